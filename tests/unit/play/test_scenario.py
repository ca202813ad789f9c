"""Scenarios as TOML, and the frames of many axles."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from sim_ecu.loop.drive_scenario import load_drive_scenario
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.encoder import SAMPLE_US
from sim_ecu.play.player import Player
from sim_ecu.play.scenario import Scenario, load_scenario, read_scenario
from sim_ecu.play.scenario_keys import TABLES, Measure
from wrcd.config.settings import parse_toml
from wrcd.core.terms import MAX_AXLES
from wrcd.errors import InputError, InputErrors


def scenario(axles: object) -> Scenario:
    text = f'duration_s = 0.2\naxles = {axles}\nrail = [{{ curve = "A" }}]\ndrive = {{ utilisation = 0.3 }}\n'
    return read_scenario(parse_toml(text, "test"), "test")


@pytest.mark.parametrize("axles", [[], [0], [9], list(range(1, 10)), [1.0], "one", [6, 6]])
def test_other_axles_than_one_to_eight_and_an_axle_named_twice_are_refused(axles: object) -> None:
    with pytest.raises(InputError, match="axles:"):
        scenario(f"'{axles}'" if isinstance(axles, str) else axles)


def test_a_second_vehicle_follows_the_first() -> None:
    places = [a.position_m for a in scenario(list(range(1, MAX_AXLES + 1))).axles]
    assert places[:4] == [0.0, -2.5, -19.0, -21.5]
    assert [b - a for a, b in zip(places[:4], places[4:], strict=True)] == [pytest.approx(-26.4)] * 4
    assert [a.position_m for a in scenario([5, 8]).axles] == pytest.approx([0.0, -21.5])


def test_the_locomotives_bogies_have_three_axles() -> None:
    places = [a.position_m for a in load_scenario("six-axles").axles]
    assert [round(a - b, 1) for a, b in pairwise(places)] == [2.1, 2.1, 7.8, 2.1, 2.1]


@pytest.mark.parametrize(("axles", "spacing_us"), [(4, 200), (5, 100), (8, 100)])
def test_the_frames_of_a_sample_are_sent_before_the_next(axles: int, spacing_us: int) -> None:
    samples = list(Player(scenario(list(range(1, axles + 1)))))
    assert max(len(frames) for _, frames in samples) == 4 * axles + 1
    for due_us, frames in samples:
        stamps = [f.due_us for f in frames]
        assert stamps[0] == due_us
        assert {b - a for a, b in pairwise(stamps)} == {spacing_us}
        assert stamps[-1] < due_us + SAMPLE_US


RAIL, DRIVE = 'rail = [{ curve = "A" }]\n', "drive = { utilisation = 0.3 }\n"
FAULT = '[[fault]]\nkind = "bias"\nat_s = 1\n'
# by declared table: a scenario with one more line in it
WITH = {
    "": "@\n" + RAIL + DRIVE,
    "rail": DRIVE + '[[rail]]\ncurve = "A"\n[[rail]]\n@\n',
    "drive": RAIL + "[drive]\ntorque_N_m = 0\n@\n",
    "axle.N": RAIL + DRIVE + "[axle.1]\n@\n",
    "fault": RAIL + DRIVE + '[[fault]]\nkind = "bias"\n@\n',
    "wheelset": 'vehicle = "lone-wheelset"\n' + RAIL + DRIVE + "[wheelset]\n@\n",
    **{name: RAIL + DRIVE + f"[{name}]\n@\n" for name in ("vehicle", "suspension", "sensors", "axlebox")},
}
# which the parser asks for only where they are there, or beside no other
ONLY_IF_THERE = {
    "rail": {"curve"}, "drive": {"utilisation", "creep", "creep_of_peak"}, "fault": {"amount"},
    "wheelset": {"name"},
}  # fmt: skip


def mistake(table: str, line: str) -> str:
    """What is said of a line too much in a table."""
    at = "at_s = 1\n" if table == "fault" and not line.startswith("at_s") else ""
    with pytest.raises(InputError) as e:
        read_scenario(parse_toml(WITH[table].replace("@", line) + at, "test"), "test")
    return str(e.value)


@pytest.mark.parametrize("table", TABLES)
def test_parser_knows_the_declared_keys_and_no_other(table: str) -> None:
    said = mistake(table, "qqqqqq = 1")
    assert "qqqqqq: " in said
    not_asked = ONLY_IF_THERE.get(table, set())
    assert set(said.partition("known here: ")[2].split(", ")) == {key.name for key in TABLES[table]} - not_asked
    for name in not_asked:
        assert "unknown key" not in mistake(table, f"{name} = []")


@pytest.mark.parametrize(
    ("table", "key"), [(table, key) for table, keys in TABLES.items() for key in keys if isinstance(key, Measure)]
)
def test_declared_range_is_the_parsers(table: str, key: Measure) -> None:
    for value in (key.low - 1.0, key.high * 10 + 1.0):
        expected = f"{key.name}: takes a number from {key.low:g} to {key.high:g}, not"
        assert expected in mistake(table, f"{key.name} = {value!r}")


def test_wheelset_of_a_scenario_is_the_one_that_runs() -> None:
    text = 'vehicle = "lone-wheelset"\nduration_s = 2\nrail = [{ curve = "A" }]\ndrive = { utilisation = 0.3 }\n'
    own, foreign = (
        read_scenario(parse_toml(text + more, "test"), "test")
        for more in ("", '[wheelset]\nname = "metro"\nr_0 = 0.42\nM_v = 10500.0\n')
    )
    assert own.wheelset == Wheelset()
    assert foreign.wheelset == replace(Wheelset(), name="metro", r_0=0.42, M_v=10500.0)
    torques = [list(Player(s).measured())[-1].readings[0].torque for s in (own, foreign)]
    # as much of the adhesion: by load and radius less torque, but for the sensor's noise
    assert torques[1] / torques[0] == pytest.approx(10500 * 0.42 / (15000 * 0.5), rel=0.06)


@pytest.mark.parametrize("held", [True, False])
def test_held_speed_follows_its_course_and_a_free_train_its_torque(held: bool) -> None:
    text = (
        f"duration_s = 4\nspeed_m_s = [[0, 20], [4, 22]]\nhold_speed = {str(held).lower()}\n"
        'rail = [{ curve = "A" }]\ndrive = { torque_N_m = -7000 }\n'
    )
    samples = list(Player(read_scenario(parse_toml(text, "test"), "test")).measured())
    speeds = [s.speed_m_s for s in samples]
    if held:
        assert speeds[-1] == pytest.approx(22.0, abs=0.1)
    else:  # 7 kN m at 0.5 m brake 15 t with 0.93 m/s2, and resistance a little more
        assert speeds[-1] == pytest.approx(20.0 - 4 * (14000 + 220 + 400) / 15_000, abs=0.25)


def test_scenario_to_drive_is_said_to_be_one() -> None:
    with pytest.raises(InputError, match="sim-ecu drive brake-wet"):
        load_scenario("brake-wet")


MISTAKEN = """\
duration_s = -5
speed_m_s = "x"
tarck = "good"
axles = [1, 2]
sensors = "memz"
[[rail]]
curve = "Z"
[[rail]]
from_m = 10
curve = "A"
cant_rad = 7
[drive]
utilisation = 4
nonsense = 1
[axle.2]
seed = -4
position_m = "a"
[[fault]]
kind = "crx"
at_s = 1
[[fault]]
kind = "crc"
[vehicle]
body_mass_kg = -1
nope = 2
"""


@pytest.mark.parametrize("to_drive", [False, True])
def test_all_mistakes_of_a_scenario_are_said_at_once(tmp_path: Path, to_drive: bool) -> None:
    """Each at its line, and none that only follows from another."""
    file = tmp_path / "mistaken.toml"
    text = MISTAKEN.replace("[drive]", "[driver]").replace("utilisation", "demand") if to_drive else MISTAKEN
    file.write_text(text)
    with pytest.raises(InputErrors) as said:
        (load_drive_scenario if to_drive else load_scenario)(str(file))
    begins = ("duration", "speed", "tarck", "sensors", "curve", "cant", "demand" if to_drive else "util", "nonsense",
              "seed", "position", 'kind = "crx"', 'kind = "crc"', "body", "nope")  # fmt: skip
    lines = [next(n for n, line in enumerate(text.splitlines(), 1) if line.startswith(b)) for b in begins]
    lines[-3] -= 1  # what is missing is said at its table
    assert [e.line for e in said.value.errors] == lines
    assert "tarck: unknown key — did you mean 'track'?" in str(said.value)


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        # beside each, what would only follow from it
        ('vehicle = "lone-wheelst"\nsensors = { mounting = "bogie frame" }\nwheelset = { m_w = 1e3 }\n', ["vehicle"]),
        ("axles = [1, 2]\naxle.2.axlebox.band_hz = [5, 1]\n@" + FAULT + "axle = 2\n", ["axle.2.axlebox.band_hz"]),
        ('rail = [{ curve = "Z" }, { from_m = 9, curve = "A", transition_m = 2 }]\n' + DRIVE, ["rail[1].curve"]),
        ('vehicle = "x"\nrail = []\n' + DRIVE, ["vehicle", "rail"]),
        ("seed = -3\n", ["seed"]),
        ("drive = 3\n" + RAIL, ["drive"]),
        ("speed_m_s = [[0, 500]]\nfoo = 1\n@[[fault]]\nat_s = 1\n", ["speed_m_s", "foo", "fault[1].kind"]),
    ],
)
def test_no_mistake_of_a_scenario_follows_from_another_or_hides_one(text: str, keys: list[str], tmp_path: Path) -> None:
    file = tmp_path / "mistaken.toml"
    file.write_text(text.replace("@", RAIL + DRIVE) if "@" in text or "rail" in text else text + RAIL + DRIVE)
    with pytest.raises(InputError) as said:
        load_scenario(str(file))
    errors = said.value.errors if isinstance(said.value, InputErrors) else (said.value,)
    assert [e.key for e in errors] == keys
