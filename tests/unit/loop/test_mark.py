"""Stops at the mark: how they are drawn and driven, and the figures that are made of them."""

import math
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest

from sim_ecu.loop.control.braking_rate import RATES
from sim_ecu.loop.driver import MarkDriver, Rule
from sim_ecu.loop.mark import stops as at_mark
from sim_ecu.loop.mark.approach import approach
from sim_ecu.loop.mark.lines import AXLES, MARK_WORLDS, MIX, STATIONS, Stop, braking_m, stops
from sim_ecu.loop.mark.mark_figures import ALL, GROUPS, LATE, TIED, judge_all, policy_figures
from sim_ecu.loop.mark.mark_page import page, text
from sim_ecu.loop.mark.policies import DRY, KNOWS, LAST, POLICIES, SLIPPERY, TESTS, TOLD, WRCD, DrivenStop, SlideMemory
from sim_ecu.loop.mark.policies import told_rate as rate_of
from sim_ecu.loop.mark.stops import StopOutcome, known_rate, least_adhesion, stands
from sim_ecu.play.play import LOG_START_US
from sim_ecu.play.player import LARGE_CHUNK, Player
from sim_ecu.reporting.values import CHANCE, MET, MET_CHANCE, MISSED
from tests.support.can_ids import ADVICE
from wrcd.bus.frame import Frame
from wrcd.config.config import load_packaged
from wrcd.core.core import Core

TRAINING = 0
FULL = 1.2


def line(number: int, world: int = 0) -> list[Stop]:
    return stops(MARK_WORLDS[world], number, TRAINING)


def first(rail: str, late: bool = False) -> Stop:
    """The first stop of the training lines on a rail."""
    return next(s for n in range(60) for s in line(n) if s.rail == rail and s.late is late)


# --- how stops are drawn


def test_a_line_is_the_same_every_time_and_its_rails_are_alike() -> None:
    one, again = line(3), line(3)
    assert [s.rail for s in one] == [s.rail for s in again]
    assert (one[4].scenario.train.axles[0].rail == again[4].scenario.train.axles[0].rail).all()
    rails = [[s.rail for s in line(n)] for n in range(60)]
    same = sum(a == b for of in rails for a, b in pairwise(of)) / (60 * (STATIONS - 1))
    alone = sum(share**2 for share in MIX.values())
    assert same == pytest.approx(0.7 + 0.3 * alone, abs=0.06)
    for rail, share in MIX.items():
        assert sum(of.count(rail) for of in rails) / 600 == pytest.approx(share, abs=0.09), rail


def test_lines_of_a_number_have_the_same_rails_in_every_world() -> None:
    for world in range(1, len(MARK_WORLDS)):
        assert [(s.rail, s.late, s.speed_m_s) for s in line(5)] == [
            (s.rail, s.late, s.speed_m_s) for s in line(5, world)
        ]


def test_a_late_film_begins_within_400_m_and_lies_up_to_the_mark() -> None:
    stop = next(s for n in range(60) for s in line(n) if s.late)
    assert 150.0 <= stop.mark_m - stop.film_m <= 400.0
    table = stop.scenario.train.axles[0].rail
    before, behind = table[table[:, 0] < stop.film_m, 1], table[table[:, 0] > stop.film_m + 1.0, 1]
    assert before.min() > 0.2
    assert behind.max() < 0.1


def test_untied_slopes_leave_the_friction_as_it_is() -> None:
    tied, untied = (s.scenario.train.axles[0].rail for s in (line(5)[0], line(5, 1)[0]))
    assert untied[:, 1] == pytest.approx(tied[:, 1], rel=0.02)
    assert untied[:, 5] != pytest.approx(tied[:, 5], rel=0.05)


# --- how they are driven


def driven(stop: Stop, rate: float) -> StopOutcome:
    return stands(MarkDriver(Rule(rate), FULL), stop)


@pytest.mark.parametrize(("rail", "rate"), [("wet", 0.9), ("wet", 0.35), ("low", None)])
def test_what_is_rolled_is_what_the_rig_makes_of_it(
    rail: str, rate: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    stop = first(rail)
    planned = known_rate(stop) if rate is None else rate  # of who knows the rail: the most that is rolled
    rolled = driven(stop, planned)
    monkeypatch.setattr(at_mark, "ROLLS", 0.0)
    simulated = driven(stop, planned)
    assert simulated.slip_energy_kJ != rolled.slip_energy_kJ, "neither was simulated, or both were"
    assert rolled.past_m == pytest.approx(simulated.past_m, abs=0.3)
    assert rolled.seconds == pytest.approx(simulated.seconds, abs=0.6)
    assert rolled.slip_energy_kJ == pytest.approx(simulated.slip_energy_kJ, rel=0.15)
    assert not simulated.slid


def test_dry_rate_overruns_on_low_rail_and_the_rate_of_who_knows_it_does_not() -> None:
    stop = first("low")
    dry, known = driven(stop, RATES.dry), driven(stop, known_rate(stop))
    assert dry.slid
    assert dry.past_m > 20.0
    assert not known.slid
    assert abs(known.past_m) < 0.5
    assert known_rate(stop) == pytest.approx(RATES.kept * 9.80665 * least_adhesion(stop, known_rate(stop)), rel=0.01)


def test_each_train_is_advised_as_by_a_daemon_of_its_own() -> None:
    four = [replace(s, mark_m=s.speed_m_s * 6.0 + braking_m(s.speed_m_s, RATES.dry)) for s in line(2)[:4]]
    shared = approach(four)
    seconds = (four[0].mark_m - braking_m(four[0].speed_m_s, RATES.dry)) / four[0].speed_m_s
    train = replace(four[0].scenario.train, duration_s=seconds, hold_speed=True)
    core = Core(load_packaged(AXLES, advice=True))
    out = [
        o.frame for _, frames in Player(train, truth=False, chunk=LARGE_CHUNK) for f in frames
        for o in core.feed(Frame(LOG_START_US + f.due_us, f.can_id, f.data))
    ]  # fmt: skip
    alone = [(f.stamp_us - LOG_START_US, f.can_id, f.data) for f in out if f.can_id == ADVICE]
    assert alone == shared[0]
    assert len(alone) > 20
    assert len({tuple(of) for of in shared}) == 4, "each its own"


def test_a_slide_is_remembered_for_so_many_stops() -> None:
    slid, not_slid = StopOutcome(0.9, 50.0, 60.0, True, 9.0, False), StopOutcome(0.9, 0.0, 60.0, False, 0.0, False)
    slow = StopOutcome(0.35, 0.0, 80.0, False, 0.0, False)
    memory = SlideMemory(2)
    found = [memory.stop({DRY: dry, SLIPPERY: slow}) for dry in (not_slid, slid, slid, slid, not_slid)]
    assert found == [not_slid, slid, slow, slow, not_slid]
    assert LAST in POLICIES


def test_a_liar_plans_with_what_he_says() -> None:
    assert rate_of(8) == pytest.approx(RATES.kept * 9.80665 * 0.08, abs=1e-9)
    assert rate_of(1) == RATES.least
    assert rate_of(40) == RATES.dry


# --- figures


def outcome(past_m: float = 0.0, seconds: float = 50.0, rate: float = 0.9) -> StopOutcome:
    return StopOutcome(rate, past_m, seconds, past_m > 2.0, 1.0 + past_m, False)


def made(number: int, policies: Mapping[str, StopOutcome], station: int = 0, late: bool = False) -> DrivenStop:
    """A stop of which most policies make the same as who knows the rail."""
    usual = dict.fromkeys(POLICIES, outcome())
    return DrivenStop(MARK_WORLDS[0].name, number, station, "low", late, {**usual, **policies})


def many(policies: Mapping[str, StopOutcome] | None = None) -> list[DrivenStop]:
    return [made(n, policies or {}, s) for n in range(8) for s in range(STATIONS)]


def test_seconds_are_of_stops_that_neither_overran() -> None:
    stops = [made(n, {WRCD: outcome(seconds=54.0)}) for n in range(6)]
    stops += [made(n, {WRCD: outcome(past_m=30.0, seconds=90.0)}, 1) for n in range(6)]
    p = policy_figures(stops, WRCD)
    assert p.lost_s.value == pytest.approx(4.0)
    assert p.overruns.value == 0.5
    assert p.past_m.value == pytest.approx(15.0)
    assert p.median_m == p.worst_m == 30.0
    assert p.false.value == 0.0
    assert policy_figures([made(0, {WRCD: outcome(seconds=56.0)})], WRCD).false.value == 1.0


def test_nothing_past_two_metres_is_an_overrun() -> None:
    assert policy_figures(many({WRCD: outcome(past_m=1.9)}), WRCD).overruns.value == 0.0
    assert policy_figures(many({WRCD: outcome(past_m=2.1)}), WRCD).overruns.value == 1.0


def goals(stops: list[DrivenStop]) -> dict[str, dict[str, Any]]:
    return {g["what"]: g for g in judge_all(stops)["goals"]}


def test_goals_are_met_by_who_knows_and_missed_by_who_does_not() -> None:
    good = goals(
        many(
            {
                DRY: outcome(past_m=40.0),
                SLIPPERY: outcome(seconds=70.0),
                "told 15 %": outcome(past_m=40.0),
                TESTS: outcome(seconds=52.0),
            }
        )
    )
    assert {good[w]["verdict"] for w in good if TIED in w or "over those" in w} <= {MET, MET_CHANCE}
    bad = goals(many({WRCD: outcome(past_m=40.0), DRY: outcome(past_m=40.0)}))
    assert bad[f"{TIED}: share of overruns, wrcd"]["verdict"] == MISSED
    assert bad[f"{ALL}: overruns of wrcd over those of {DRY}"]["verdict"] == MISSED
    slow = goals(many({WRCD: outcome(seconds=60.0), SLIPPERY: outcome(seconds=62.0)}))
    assert slow[f"{TIED}: seconds lost a stop, wrcd"]["verdict"] == MISSED
    assert slow[f"{ALL}: liars that are better in overruns and seconds"]["figure"].value == len(TOLD)


def test_one_overrun_in_eighty_stops_is_within_chance() -> None:
    stops = many()[:-1] + [made(7, {WRCD: outcome(past_m=40.0)}, STATIONS - 1)]
    assert goals(stops)[f"{TIED}: share of overruns, wrcd"]["verdict"] == CHANCE


def test_late_films_are_a_group_of_their_own() -> None:
    stops = [*many(), made(0, {WRCD: outcome(past_m=100.0)}, late=True)]
    groups = judge_all(stops)["groups"]
    assert groups[TIED][WRCD].overruns.value == 0.0
    assert groups[LATE][WRCD].overruns.value == 1.0
    assert groups[ALL][WRCD].stops == groups[TIED][WRCD].stops + 1
    assert set(groups) <= set(GROUPS)


def test_page_begins_with_two_pictures_and_the_text_has_every_policy() -> None:
    result = {"run": {"quick": True, "left_out": {}}} | judge_all(many({DRY: outcome(past_m=40.0)}))
    html = page(result)
    planes, lines, tables = (
        html.index(w) for w in ("Metres past the mark against", "A line of ten stations", "<table")
    )
    assert planes < lines < tables
    assert html.count("<figure>") == 2
    said = "\n".join(text(result))
    assert "QUICK" in said
    assert all(name in said for name in POLICIES if name != KNOWS)
    assert not math.isnan(result["groups"][ALL][WRCD].lost_s.value)
