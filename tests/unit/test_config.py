"""Bad input gets one clear message: file, line, key, reason, what to do."""

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.support.config_texts import AXLE, VEHICLE
from tests.support.lone_wheelset import LONE_DESIGN
from wrcd import resources
from wrcd.bus.units import Quantity
from wrcd.checksum import checksum
from wrcd.config.config import load_config, load_config_to_run, load_packaged, packaged
from wrcd.config.describe import describe
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.design import load_design
from wrcd.core.estimator import evidence
from wrcd.core.terms import MAX_FEATURE, PAIR_FEATURES
from wrcd.errors import InputError

ROOT = Path(__file__).parents[2]


def config(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "wrcd.toml"
    path.write_text(text)
    return path


def test_the_default_maps_four_axles() -> None:
    c = load_config(None)
    assert [a.number for a in c.axles] == [1, 2, 3, 4]
    assert len(c.inputs) == 13
    assert {i.source.quantity: i.timeout_us for i in c.inputs} == {
        Quantity.YAW_RATE: 15_000,
        Quantity.LAT_ACCEL: 15_000,
        Quantity.TORQUE: 30_000,
        Quantity.SPEED: 60_000,
    }
    assert {a.adhesion.cycle_us for a in c.axles} == {20_000}
    assert {o.cycle_us for a in c.axles for o in (a.detail, a.inputs) if o} == {100_000}
    assert {o.cycle_us for o in (c.status, c.rejects, c.link) if o} == {1_000_000}


@pytest.mark.parametrize("axles", [1, 4, 6, 8])
def test_packaged_dbc_has_the_messages_of_eight_axles(tmp_path: Path, axles: int) -> None:
    c = load_config(config(tmp_path, packaged(axles)))
    assert [a.number for a in c.axles] == list(range(1, axles + 1))
    assert all(None not in (a.detail, a.inputs) for a in c.axles)
    assert len(c.inputs) == 3 * axles + 1
    assert len(Core(c).mapped.keys) == 3 * axles + 1
    lines = describe(c)
    assert lines[-1] == "ok"
    assert f"axle {axles}" in lines
    assert c.axles == load_packaged(axles).axles


def test_example_of_six_axles_maps_the_packaged_dbc() -> None:
    c = load_config(ROOT / "examples" / "six-axles.toml")
    assert (c.axles, c.inputs) == (load_packaged(6).axles, load_packaged(6).inputs)


def test_small_configuration_is_read_and_described(tmp_path: Path) -> None:
    text = f'[bus]\nchannel = "vcan7"\n{VEHICLE}{AXLE}[limits]\nmin_speed_m_s = 4\n'
    c = load_config(config(tmp_path, text))
    assert (c.channel, c.min_speed_m_s, len(c.axles)) == ("vcan7", 4.0, 1)
    lines = describe(c)
    assert lines[-1] == "ok"
    assert any("Torque_A1.Torque (N*m), stale after 30 ms" in line for line in lines)


BAD = {
    "not TOML": (f"{VEHICLE}{AXLE}= 3\n", 9, ""),
    "no axle": (VEHICLE, None, "axle"),
    "nine axles": (VEHICLE + AXLE * 9, 4, "axle"),
    "out of range": (f"{VEHICLE}{AXLE}[limits]\nmin_speed_m_s = -1\n", 10, "limits.min_speed_m_s"),
    "absurd speed": (f"{AXLE}[limits]\nconstant_speed_m_s = 1e308\n", 8, "limits.constant_speed_m_s"),
    "more than 64 bits": (f"{VEHICLE}{AXLE}[limits]\nmin_speed_m_s = {10**400}\n", 10, "limits.min_speed_m_s"),
    "a number of a page": (f"{VEHICLE}{AXLE}[limits]\nmin_speed_m_s = {'9' * 5000}\n", None, ""),
    "no such design": (f'{VEHICLE}{AXLE}[estimator]\ndesign = "none.json"\n', 10, "estimator.design"),
    "another wheelset": (f"{VEHICLE}{AXLE}[wheelset]\nm_w = 1600.0\n", 10, "wheelset.m_w"),
    "a train's wheelset": (f'{VEHICLE}{AXLE}[wheelset]\nname = "metro"\n', 10, "wheelset.name"),
}  # fmt: skip


@pytest.mark.parametrize("read", [load_config, load_config_to_run])
@pytest.mark.parametrize("case", BAD)
def test_bad_configuration_is_an_error_with_file_line_and_key(
    tmp_path: Path, case: str, read: Callable[[Path], Config]
) -> None:
    text, line, key = BAD[case]
    path = config(tmp_path, text)
    with pytest.raises(InputError) as error:
        read(path)
    assert (error.value.file, error.value.line, error.value.key) == (path, line, key)


OWN_DBC = '[dbc]\nfile = "own.dbc"\n'


@pytest.mark.parametrize("more", ["", "[wheelset]\n"])
def test_own_dbc_without_a_named_wheelset_is_an_error(tmp_path: Path, more: str) -> None:
    (tmp_path / "own.dbc").write_bytes(resources.DBC.read_bytes())
    path = config(tmp_path, f"{VEHICLE}{AXLE}{OWN_DBC}{more}")
    with pytest.raises(InputError, match=r"wrcd\.toml:10: dbc\.file: "):
        load_config(path)


@pytest.mark.parametrize(
    "more", ['[wheelset]\nname = "multiple-unit"\n', "[wheelset]\nr_0 = 0.5\n", '[estimator]\ndesign = "my.json"\n']
)
def test_a_wheelset_that_is_named_is_shown(tmp_path: Path, more: str) -> None:
    (tmp_path / "own.dbc").write_bytes(resources.DBC.read_bytes())
    (tmp_path / "my.json").write_bytes(resources.DESIGN.read_bytes())
    lines = describe(load_config(config(tmp_path, f"{VEHICLE}{AXLE}{OWN_DBC}{more}")))
    (line,) = (x for x in lines if x.startswith("wheelset "))
    assert "multiple-unit: axle load 147.1 kN, wheel radius 0.5 m, conicity 0.15" in line


def test_measurements_are_stale_after_three_ticks_whatever_the_dbc_says(tmp_path: Path) -> None:
    text = resources.DBC.read_text("cp1252")
    for can_id, name in ((257, "YawRate"), (273, "LatAccel"), (289, "Torque")):
        good = f'"GenSigTimeoutTime" SG_ {can_id} {name} '
        assert good in text
        text = text.replace(good + ("15" if can_id < 289 else "30"), good + "90")
    (tmp_path / "own.dbc").write_text(text, "cp1252")
    c = load_config(config(tmp_path, f'{VEHICLE}{AXLE}{OWN_DBC}[wheelset]\nname = "multiple-unit"\n'))
    assert [i.timeout_us for i in c.inputs] == [15_000, 15_000, 90_000, 60_000]


DAMAGE = {
    "bank.Phi": lambda d: d["bank"].pop("Phi"),
    "bank.K": lambda d: d["bank"]["K"].pop(),
    "bank.H": lambda d: d["bank"]["H"][0][0][0].append(1.0),
    "bank.speeds_m_s": lambda d: d["bank"]["speeds_m_s"].reverse(),
    "bank.tick_s": lambda d: d["bank"].update(tick_s=0),
    "fuzzy.rules": lambda d: d["fuzzy"]["rules"][0].__setitem__(0, 9),
    "fuzzy.bases": lambda d: d["fuzzy"]["bases"].pop(),
    "fuzzy.slopes": lambda d: d["fuzzy"]["slopes"][0].pop(),
    "fuzzy.spreads": lambda d: d["fuzzy"]["spreads"].__setitem__(0, 0.0),
    "fuzzy.speed": lambda d: d["fuzzy"].pop("speed"),
    "fuzzy.spread_slopes": lambda d: d["fuzzy"]["spread_slopes"].pop(),
    "fuzzy.columns.middle": lambda d: d["fuzzy"]["columns"]["middle"].pop(),
    "fuzzy.columns.low": lambda d: d["fuzzy"]["columns"]["low"].__setitem__(0, 99.0),
    "fuzzy.consequents": lambda d: d["fuzzy"].update(consequents=["one"]),
    "fuzzy.beyond": lambda d: d["fuzzy"].update(beyond=-0.1),
    "changes": lambda d: d.pop("changes"),
    "changes.limits": lambda d: d["changes"]["limits"].pop(),
    "changes.speeds_m_s": lambda d: d["changes"]["speeds_m_s"].reverse(),
    "bank.lowpass": lambda d: d["bank"]["lowpass"][0].__setitem__(5, 1.1),
    "bank.highpass": lambda d: d["bank"]["highpass"][0].pop(),
    "bank.noise_power": lambda d: d["bank"]["noise_power"][0][0].__setitem__(0, 0.0),
    "bank.noise_rms": lambda d: d["bank"].update(noise_rms=[1e-3]),
    "form": lambda d: d.update(form="another"),
    "recent_s": lambda d: d.update(recent_s=0.6),
    "longest_s": lambda d: d.update(longest_s=0.5),
    "longest_s: must be 48 ticks": lambda d: d.update(longest_s=0.6, window_s=0.5, bank={**d["bank"], "tick_s": 0.02}),
    "fuzzy.columns.low: must be finite numbers of shape (27,)": lambda d: d.update(format="wrcd-design/4"),
    "fuzzy.residual_4": lambda d: d["fuzzy"]["residual_4"]["centres"].reverse(),
    "fuzzy.torque": lambda d: d["fuzzy"]["torque"]["names"].pop(),
    "polynomial": lambda d: d.update(polynomial=["x"]),
    "fuzzy.bases[0]": lambda d: d["fuzzy"]["bases"].__setitem__(0, 10**400),
    "format": lambda d: d.update(format="other"),
    "interval.factors": lambda d: d["interval"]["factors"].pop(),
    "interval.speeds_m_s": lambda d: d["interval"]["speeds_m_s"].reverse(),
    "health.middle": lambda d: d["health"]["middle"].pop(),
    "health.scale": lambda d: d["health"]["scale"].__setitem__(0, 0.0),
    "health.middle: must be finite numbers of shape (170,)": lambda d: d["health"].update(scale=[1.0] * 170),
    "health.prior": lambda d: d["health"]["prior"].__setitem__(1, 1e-8),
    "health.out_bias": lambda d: d["health"]["out_bias"].pop(),
    "health.states": lambda d: d["health"]["states"].reverse(),
    "interval.regimes": lambda d: d["interval"]["regimes"].pop(),
    "inputs.wheelset.bogie.semi_wheelbase_m": lambda d: d["inputs"]["wheelset"]["bogie"].update(
        semi_wheelbase_m=math.nan
    ),
    "health.temper": lambda d: d["health"]["temper"].__setitem__(1, -0.1),
    "health.hidden": lambda d: d["health"]["hidden"].pop(),
    "health.out": lambda d: d["health"]["out"][0].pop(),
    "health.kept": lambda d: d["health"].update(kept=1.5),
}


@pytest.mark.parametrize("key", DAMAGE)
def test_wrong_design_with_a_right_checksum_is_rejected(tmp_path: Path, key: str) -> None:
    document = json.loads(resources.DESIGN.read_text())
    DAMAGE[key](document)
    document["checksum"] = checksum(document)
    path = tmp_path / "design.json"
    path.write_text(json.dumps(document))
    with pytest.raises(InputError) as error:
        load_design(path)
    assert str(path) in str(error.value)
    assert key.removesuffix("[0]") in str(error.value)


def test_design_of_the_format_before_says_what_it_said_and_moves_with_no_column_beyond(tmp_path: Path) -> None:
    document, now = json.loads(resources.DESIGN.read_text()), load_design(resources.DESIGN)
    for part in (document["fuzzy"], document["fuzzy"]["columns"]):
        for key, value in part.items():
            if key in ("slopes", "spread_slopes"):
                part[key] = [row[:27] for row in value]
            elif key in ("low", "high", "middle"):
                part[key] = value[:27]
    document["format"] = "wrcd-design/4"
    document["checksum"] = checksum(document)
    (tmp_path / "design.json").write_text(json.dumps(document))
    before = load_design(tmp_path / "design.json")
    for name in ("low", "high", "middle", "slopes", "spread_slopes"):
        np.testing.assert_array_equal(getattr(before, name)[..., :27], getattr(now, name)[..., :27])
        assert not getattr(before, name)[..., 27:].any()
        assert getattr(now, name)[..., 27:].any()


def test_design_whose_pairs_are_judged_by_the_features_of_before_judges_them_as_before(tmp_path: Path) -> None:
    document, now = json.loads(LONE_DESIGN.read_text()), load_design(LONE_DESIGN)
    for key in ("middle", "scale", "hidden"):
        assert len(document["health"][key]) == PAIR_FEATURES
        document["health"][key] = document["health"][key][:170]
    document["checksum"] = checksum(document)
    (tmp_path / "design.json").write_text(json.dumps(document))
    before = load_design(tmp_path / "design.json").health
    assert before is not None
    assert now.health is not None
    x = np.random.default_rng(1).standard_normal((5, PAIR_FEATURES))
    h = {
        k: np.array(v, dtype=float) for k, v in document["health"].items() if k in ("middle", "scale", "hidden", "out")
    }
    z = np.clip((x[:, :170] - h["middle"]) / h["scale"], -MAX_FEATURE, MAX_FEATURE)
    out = np.tanh(z @ h["hidden"] + before.hidden_bias) @ h["out"] + before.out_bias
    np.testing.assert_allclose(evidence(before, x), out - out[:, :1], atol=1e-9)
    assert not np.allclose(evidence(now.health, x), evidence(before, x))


@pytest.mark.parametrize("content", ["", "[]", "3", "{", '{"format": "wrcd-design/2"}', "\x00"])
def test_damaged_design_file_is_an_error(tmp_path: Path, content: str) -> None:
    path = tmp_path / "design.json"
    path.write_text(content)
    with pytest.raises(InputError):
        load_design(path)


MULTIPLEXED = """
BO_ 800 Motion: 8 TCU
 SG_ Page M : 0|8@1+ (1,0) [0|3] "" WRCD
 SG_ V m0 : 8|16@1+ (0.01,0) [0|300] "km/h" WRCD

CM_ """


def test_a_multiplexed_signal_can_be_mapped_and_the_multiplexer_cannot(tmp_path: Path) -> None:
    text = resources.DBC.read_text("cp1252").replace("\nCM_ ", MULTIPLEXED, 1)
    (tmp_path / "own.dbc").write_text(text, "cp1252")
    rest = f'{AXLE}[dbc]\nfile = "own.dbc"\n[wheelset]\nname = "multiple-unit"\n'
    found = load_config(config(tmp_path, f'[vehicle]\nspeed = "Motion.V"\n{rest}'))
    assert [i.source.signal for i in found.inputs if i.source.quantity is Quantity.SPEED] == ["V"]
    path = config(tmp_path, f'[vehicle]\nspeed = {{ signal = "Motion.Page", unit = "m/s" }}\n{rest}')
    with pytest.raises(InputError, match=r"wrcd.toml:2: vehicle.speed.signal: "):
        load_config(path)


MOTION = '\nBO_ 800 Motion: 8 TCU\n SG_ V : {} [0|300] "km/h" WRCD\n\nCM_ '
NOT_THAT_LARGE = "not a usable DBC: no message, signal or number is that large"
BEYOND = r"wrcd.toml:2: vehicle.speed: Motion\.V has bits that no frame has"
OF_BITS = r"adhesion: Adhesion_A1\..* beyond its (4|16) bits"
OF_TIME = r": the {} .* must lie within 1 … 65535 ms"
TIMEOUT = '"GenSigTimeoutTime" SG_ 304 Speed {};'


@pytest.mark.parametrize(
    ("good", "bad", "reason"),
    [
        ("Torque_A1: 5 ", "Torque_A1: 1000000000 ", NOT_THAT_LARGE),
        ("Torque : 16|24@", "Torque : 16|2400000000@", NOT_THAT_LARGE),
        ('"E2EDataId" INT 0', '"E2EDataId" INT 1e99999999', NOT_THAT_LARGE),
        (TIMEOUT.format(60), TIMEOUT.format(-1e300), "vehicle.speed" + OF_TIME),
        ('"GenMsgCycleTime" BO_ 145 20;', '"GenMsgCycleTime" BO_ 145 -20;', r"axle\[1\].adhesion" + OF_TIME),
        ("\nCM_ ", MOTION.format("-1|16@1+ (0.01,0)"), BEYOND),
        ("\nCM_ ", MOTION.format("8|16@1+ (0,0)"), BEYOND),
        ("\nCM_ ", MOTION.format("8|16@1+ (1e400,0)"), BEYOND),
        ('VAL_ 145 Validity 0 "NotAvailable"', 'VAL_ 145 Validity 16 "NotAvailable"', OF_BITS),
        ('"GenSigStartValue" SG_ 145 MuAvailable 65535;', '"GenSigStartValue" SG_ 145 MuAvailable 1e6;', OF_BITS),
    ],
)  # fmt: skip
def test_size_time_or_value_in_a_dbc_beyond_its_range_is_an_error(
    tmp_path: Path, good: str, bad: str, reason: str
) -> None:
    text = resources.DBC.read_text("cp1252")
    assert good in text
    (tmp_path / "own.dbc").write_text(text.replace(good, bad, 1), "cp1252")
    vehicle = VEHICLE.replace("VehicleSpeed.Speed", "Motion.V") if "Motion" in bad else VEHICLE
    if reason == NOT_THAT_LARGE:
        reason = f"own.dbc:{text[: text.index(good)].count(chr(10)) + 1}: {reason}"
    with pytest.raises(InputError, match=reason.format("(time-out|cycle)")):
        load_config(config(tmp_path, f"{vehicle}{AXLE}{OWN_DBC}"))
