"""Axles of a train on one rail share their words: against the oracle, and what a person on the bus sees of it."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from sim_ecu.play.play import LOG_START_US
from sim_ecu.play.player import Player
from sim_ecu.play.scenario import Scenario, load_scenario
from sim_ecu.play.train import placed
from tests.oracle.axles import Alone, Fused, fused
from tests.support.can_ids import ADHESION, id_of
from wrcd.bus.candump import format_line
from wrcd.bus.dbc import find_message
from wrcd.bus.frame import Frame
from wrcd.cli.main import main
from wrcd.config.config import load_config, load_packaged, packaged
from wrcd.config.describe import describe as described
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.reports import Records
from wrcd.errors import InputError

SINCE_M, VALID, SLOT_US, AXLES = 5, 1, 20_000, 4
# A film that begins and ends, and axles that use the rail to another share each; one slides on the film.
TRAIN = """
title = "a film"
duration_s = 9.0
speed_m_s = 30.0
axles = [1, 2, 3, 4]
[[rail]]
curve = "B"
[[rail]]
from_m = 120.0
curve = "D"
[[rail]]
from_m = 180.0
curve = "C"
[drive]
torque_N_m = [[0.0, 0.0], [1.0, -2500.0]]
[axle.2]
drive = { torque_N_m = [[0.0, 0.0], [1.0, -5000.0]] }
[axle.3]
drive = { creep_of_peak = [[0.0, 0.0], [1.0, -1.1]] }
[axle.4]
drive = { torque_N_m = [[0.0, 0.0], [1.0, -600.0]] }
"""


class Ride(NamedTuple):
    """Reports (slots, axles) of a core, since when each axle's word is (slots, axles), and the frames that it sent."""

    reports: Records
    since_m: np.ndarray[Any, np.dtype[np.float64]]
    speed_m_s: list[float]
    sent: list[tuple[int, int, bytes]]


def ride(config: Config, frames: Sequence[Frame]) -> Ride:
    core, reports, since_m, speeds, sent = Core(config), list[Records](), [], [], []
    for frame in frames:
        made = core.feed([frame])
        sent += [(o.frame.stamp_us, o.frame.can_id, o.frame.data) for o in made]
        if len(made.reports):
            assert len(made.reports) == AXLES
            reports.append(made.reports.copy())
            since_m.append(core.estimator._axle["memory"][:, SINCE_M].copy())
            speeds.append(float(core.estimator._train["speed_m_s"]))
    return Ride(np.array(reports), np.array(since_m), speeds, sent)


class Film(NamedTuple):
    scenario: Scenario
    place_m: list[float]  # in the direction of travel, in the core's order
    frames: list[Frame]
    together: Ride
    alone: Ride


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Film:
    file = tmp_path_factory.mktemp("film") / "film.toml"
    file.write_text(TRAIN)
    scenario = load_scenario(str(file))
    frames = [Frame(LOG_START_US + f.due_us, f.can_id, f.data) for _, part in Player(scenario) for f in part]
    config = placed(load_packaged(AXLES), scenario)
    return Film(
        scenario,
        [a.position_m for a in scenario.axles],
        frames,
        ride(config, frames),
        ride(replace(config, fuses=False), frames),
    )


def oracle(at: Film, slot: int) -> Fused:
    """What the oracle makes of the axles' words at a slot."""
    reports, of = at.alone.reports[slot], at.alone.reports[slot]["estimate"].copy()
    of[reports["has_estimate"] == 0] = 1.0
    return fused(Alone(
        of["mu_available_pct"], of["half_width_pp"], of["used_pct"], of["reaches_pct"], of["saturated"] > 0.0,
        reports["validity"] == VALID, np.array(at.place_m),
        at.alone.since_m[slot], at.alone.speed_m_s[slot],
    ))  # fmt: skip


def fuses_as_the_oracle_does(film: Film) -> tuple[set[int], int, int]:
    """How many axles stood behind words, how many words were changed, how many axles were saturated."""
    behind, changed, saturated = set[int](), 0, 0
    numbers = np.array(sorted(range(1, AXLES + 1), reverse=film.place_m[0] < film.place_m[-1]))
    for slot, got in enumerate(film.together.reports):
        want = oracle(film, slot)
        speaks = got["validity"] == VALID
        for name, values in (("mu_available_pct", want.mu_pct), ("half_width_pp", want.half_width_pp)):
            np.testing.assert_allclose(got["estimate"][name][speaks], values[speaks], rtol=1e-12)
        assert got["axles"][speaks].tolist() == want.axles[speaks].tolist()
        assert got["most_used_axle"][speaks].tolist() == numbers[want.most_used[speaks].astype(int)].tolist()
        np.testing.assert_array_equal(got["own_pct"][speaks], film.alone.reports[slot]["mu_available_pct"][speaks])
        assert (got["estimate"]["half_width_pp"][speaks] >= 0.0).all()
        of_others = speaks & (got["axles"] > 1)
        assert (got["mu_available_pct"] >= np.fmin(got["estimate"]["used_pct"], 100.0))[of_others].all()
        behind |= set(got["axles"][speaks].tolist())
        changed += int((got["mu_available_pct"] != got["own_pct"])[speaks].sum())
        saturated += int((film.alone.reports[slot]["estimate"]["saturated"] > 0.0)[speaks].sum())
    return behind, changed, saturated


def test_core_fuses_as_the_oracle_does(film: Film) -> None:
    behind, changed, saturated = fuses_as_the_oracle_does(film)
    assert behind == {1, 2, 3, 4}
    assert changed > 500
    assert saturated > 20


def test_what_does_not_speak_stays_as_it_is(film: Film) -> None:
    for together, alone in zip(film.together.reports, film.alone.reports, strict=True):
        silent = together["validity"] != VALID
        for name in ("mu_available_pct", "mu_used_pct", "validity", "cause", "confidence"):
            np.testing.assert_array_equal(together[name][silent], alone[name][silent])


def errors_pp(ride: Ride, film: Film) -> float:
    """The mean error of what is Valid, on the first rail and on the last."""
    curves = {"first": (2.0, 4.0), "last": (7.5, 9.0)}
    truth = {"first": 30.9, "last": 20.9}
    times = (ride.reports["time_us"][:, 0] - LOG_START_US) * 1e-6
    found = []
    for name, (begin, end) in curves.items():
        part = ride.reports[(times > begin) & (times < end)]
        found.append(np.abs(part["mu_available_pct"] - truth[name])[part["validity"] == VALID])
    return float(np.concatenate(found).mean())


def test_words_together_are_nearer_to_the_truth(film: Film) -> None:
    assert errors_pp(film.together, film) < 0.8 * errors_pp(film.alone, film)


def test_leading_axle_at_a_new_rail_has_its_own_word_alone(film: Film) -> None:
    """As it begins anew: beside it only its bogie's other axle, 2.5 m behind, none of the bogie 19 m behind."""
    began = np.flatnonzero((film.alone.since_m[:, 0] == 0.0) & (film.together.reports["validity"][:, 0] == VALID))
    of_film = [k for k in began if 4.0 < (film.alone.reports["time_us"][k, 0] - LOG_START_US) * 1e-6 < 5.0]
    assert of_film
    assert film.together.reports["axles"][of_film[0] - 5, 0] > 2
    assert film.together.reports["axles"][of_film[0], 0] <= 2


def test_frames_tell_an_axles_own_word(film: Film) -> None:
    database = load_packaged(AXLES).database
    reports = {int(r[0]["time_us"]): r for r in film.together.reports}
    for axle in range(1, AXLES + 1):
        message, adhesion = (find_message(database, f"{name}_A{axle}") for name in ("AdhesionOwn", "Adhesion"))
        own = {stamp: data for stamp, can_id, data in film.together.sent if can_id == id_of(f"AdhesionOwn_A{axle}")}
        fused_ones = {stamp: data for stamp, can_id, data in film.together.sent if can_id == ADHESION[axle]}
        assert len(own) == pytest.approx(90, abs=1)
        for stamp, data in own.items():
            told: Any = message.decode(data, decode_choices=False)
            r, together = reports[stamp][axle - 1], adhesion.decode(fused_ones[stamp], decode_choices=False)
            assert isinstance(together, dict)
            if not r["has_estimate"]:
                assert (told["AxlesFused"], told["MuAvailableOwn"], told["MuUsedMostAxle"]) == (0, 655.35, 0)
                continue
            assert (told["AxlesFused"], told["MuUsedMostAxle"]) == (r["axles"], r["most_used_axle"])
            if np.isnan(r["own_pct"]):  # what is in use contradicts it
                assert (told["MuAvailableOwn"], together["MuAvailable"]) == (655.35, 655.35)
                continue
            assert 0.0 <= r["own_pct"] - told["MuAvailableOwn"] < 0.01 + 1e-9
            assert told["HalfWidthOwn"] == pytest.approx(min(r["own_half_width_pp"], 100.0), abs=0.051)
            assert 0.0 <= r["most_used_pct"] - told["MuUsedMost"] < 0.01 + 1e-9
            if r["axles"] == 1 and r["most_used_axle"] == axle:
                assert together["MuAvailable"] <= told["MuAvailableOwn"]  # less: one ahead has found a worse rail
                assert together["MuAvailable"] == told["MuAvailableOwn"] or stamp - LOG_START_US > 4_000_000


REVERSE = 'speed = { signal = "VehicleSpeed.Speed", scale = -0.0025, range = [-100, 0] }'


def test_backwards_the_last_axle_leads(film: Film, tmp_path: Path) -> None:
    """The same ride in reverse, the last axle in front: accelerometers point to the other side."""
    file = tmp_path / "train.toml"
    ahead = [-a.position_m for a in film.scenario.axles]
    turned = re.sub(r'(lateral_acceleration) = (".*")', r"\1 = { signal = \2, sign = -1 }", packaged(AXLES, ahead))
    file.write_text(turned.replace('speed = "VehicleSpeed.Speed"', REVERSE))
    config = load_config(file)
    assert config.fuses
    frames = film.frames[: len(film.frames) // 2]
    both = Film(
        film.scenario, film.place_m[::-1], frames, ride(config, frames), ride(replace(config, fuses=False), frames)
    )
    assert both.alone.speed_m_s[-1] > 0.0
    behind, changed, _ = fuses_as_the_oracle_does(both)
    assert behind >= {1, 2}
    assert changed > 100


def test_why_and_report_show_the_word_alone(film: Film, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, file, page = tmp_path / "film.log", tmp_path / "train.toml", tmp_path / "film.html"
    log.write_text("".join(format_line(f, "can0") + "\n" for f in film.frames))
    file.write_text(packaged(AXLES, film.place_m))
    assert main(["why", str(log), "3", "--axle", "1", "--config", str(file)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert re.search(
        r"alone \d+ % \(± [\d.]+\); [2-4] axles on this rail stand behind the estimate; axle 1 uses most", said
    )
    assert main(["report", str(log), "--config", str(file), "-o", str(page)]) == 0
    assert all(f"axle{n}.own" in page.read_text() for n in range(1, AXLES + 1))


AT = (0.0, -2.5)
ALONE = "axle.position_m counts for nothing, each axle stands alone: "


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (packaged(2, AT), None),
        (packaged(2, (0.0, None)), "another axle's position_m is not given"),
        (packaged(1, (0.0,)), "another axle's position_m is not given"),
        (packaged(2, AT).replace("one_way = true", ""), "nothing tells which way the train runs; write one_way = true "
         "in [vehicle] if it never runs in reverse, or map vehicle.direction"),
        (packaged(2, AT).replace("one_way = true", "").replace('"VehicleSpeed.Speed"',
         '{ signal = "VehicleSpeed.Speed", range = [-60, 60] }'), None),
        (packaged(2, AT).replace('speed = "VehicleSpeed.Speed"', "") + "[limits]\nconstant_speed_m_s = 20\n",
         "no signal tells the speed"),
    ],
)  # fmt: skip
def test_words_are_fused_where_place_speed_and_way_are_known(tmp_path: Path, text: str, why: str | None) -> None:
    file = tmp_path / "train.toml"
    file.write_text(text)
    config = load_config(file)
    assert config.fuses is (why is None)
    assert config.warnings == (() if why is None else (ALONE + why,))


def test_axles_are_put_in_their_order_along_the_train(tmp_path: Path) -> None:
    """So that two by two they are bogies, whatever the order of the tables."""
    file = tmp_path / "train.toml"
    file.write_text(packaged(4, (-19.0, 0.0, -2.5, -21.5)))
    assert [a.number for a in load_config(file).axles] == [2, 3, 1, 4]


@pytest.mark.parametrize(
    ("at", "bogies"),
    [
        ((0.0, -2.5, -15.0, -17.5), ((1, 2), (3, 4))),
        ((0.0, -15.0, -17.5), ((2, 3),)),
        ((0.0, -1.8, -3.6), ((1, 2),)),
        ((0.0, -3.9), ((1, 2),)),
        ((0.0, -4.1), ()),
        ((None, None, None, None), ((1, 2), (3, 4))),
        ((0.0, -15.0, None, None), ((3, 4),)),
        ((0.0, -3.9, -6.4), ((2, 3),)),
        ((0.0, -3.9, -6.4, -10.3, -12.8), ((2, 3), (4, 5))),
        ((0.0, None, -15.0, -17.5), ((1, 2), (3, 4))),
    ],
)
def test_axles_that_stand_near_share_a_bogie(
    tmp_path: Path, at: tuple[float | None, ...], bogies: tuple[tuple[int, int], ...]
) -> None:
    """And where it is not said, two by two."""
    file = tmp_path / "train.toml"
    file.write_text(packaged(len(at), at))
    config = load_config(file)
    assert tuple((config.axles[a].number, config.axles[b].number) for a, b in config.bogies) == bogies
    assert tuple(fit.axles for fit in Core(config).design_fits) == bogies
    shared = "\n".join(described(config))
    assert shared.count("shares a bogie") == sum(at[n - 1] is not None for pair in bogies for n in pair)
    assert shared.count("no other axle in its bogie") == sum(
        x is not None and all(n not in pair for pair in bogies) for n, x in enumerate(at, 1)
    )


def test_axle_far_from_its_neighbour_is_estimated_alone(film: Film) -> None:
    """As the last one of three, whom nobody stands beside."""
    frames = film.frames[: len(film.frames) // 2]

    def says(axles: int, positions_m: Sequence[float] = ()) -> list[bytes]:
        config = load_packaged(axles, positions_m=positions_m)
        made = Core(replace(config, fuses=False)).feed(frames)
        return [o.frame.data for o in made if o.frame.can_id == ADHESION[3]]

    alone = says(3)
    assert len(alone) > 200
    assert says(4, (0.0, -2.5, -15.0, -30.0)) == alone
    assert says(4, (0.0, -2.5, -15.0, -17.5)) == says(4) != alone


def test_bogie_is_the_same_whatever_stands_before_it(film: Film, tmp_path: Path) -> None:
    """Axles 2 and 3 of three, beside two that are the train's only ones."""
    frames, file = film.frames[: len(film.frames) // 2], tmp_path / "train.toml"

    def says(text: str) -> list[tuple[int, bytes]]:
        file.write_text(text)
        config = replace(load_config(file), fuses=False)
        assert [(config.axles[a].number, config.axles[b].number) for a, b in config.bogies] == [(2, 3)]
        made = Core(config).feed(frames)
        return [(o.frame.can_id, o.frame.data) for o in made if o.frame.can_id in (ADHESION[2], ADHESION[3])]

    three = packaged(3, (0.0, -15.0, -17.5))
    head, _, rest = three.partition("[[axle]]")
    two = head + "[[axle]]" + rest.partition("[[axle]]")[2]
    assert len(says(three)) > 400
    assert says(three) == says(two)


def test_without_positions_nothing_is_sent_of_it(tmp_path: Path) -> None:
    file = tmp_path / "train.toml"
    file.write_text(packaged(2))
    config = load_config(file)
    assert (config.fuses, config.warnings, [a.own for a in config.axles]) == (False, (), [None, None])


def test_two_axles_do_not_stand_at_one_place(tmp_path: Path) -> None:
    file = tmp_path / "train.toml"
    file.write_text(packaged(2, (-2.5, -2.5)))
    with pytest.raises(InputError, match=r"-2\.5 m is another axle's already"):
        load_config(file)


def test_axles_on_rails_of_their_own_are_not_placed() -> None:
    four, config = load_scenario("four-axles"), load_packaged(4)
    assert placed(config, four) is config
    assert not placed(load_packaged(1), load_scenario("leaf-patch")).fuses
