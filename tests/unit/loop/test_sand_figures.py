"""sim-ecu sand: the arithmetic on hand-made stops, its sentences either way, and stops that are driven."""

import math
from collections.abc import Sequence

import pytest

from sim_ecu.cli.main import main
from sim_ecu.loop.control.adhesion_consumer import Facts, UsableAdhesion
from sim_ecu.loop.control.sanding_policies import SandCycle
from sim_ecu.loop.sand import sanded_stops
from sim_ecu.loop.sand.sand_figures import judge_all, sand_figures
from sim_ecu.loop.sand.sand_page import conclusions, page, text
from sim_ecu.loop.sand.sanded_stops import (
    AT_SLIDE,
    BEARING,
    BEFORE,
    DEMAND_M_S2,
    NONE,
    RAILS,
    SLIPPERY,
    SPEED_M_S,
    WHEN_LOW,
    WHO,
    BeforeBrake,
    DrivenStops,
    SandedStop,
    SandJob,
    drive_stops,
    scenario,
)
from sim_ecu.physics.contact import peak
from sim_ecu.physics.rail import rail_at
from sim_ecu.reporting.values import MET, MISSED

G = 9.80665


def made(saves_again: float, seeds: int = 6, rails: Sequence[str] = RAILS) -> list[DrivenStops]:
    """Stops in which sand at the slide saves 100 m of 300 or so, sand before it a share of that again."""
    out = []
    for rail in rails:
        for seed in range(seeds):
            bare = 300.0 + seed
            stops = dict.fromkeys(WHO, SandedStop(bare - 100.0, 1.0, 0.8))
            stops[NONE] = SandedStop(bare, 0.0, math.nan)
            stops[WHEN_LOW] = SandedStop(bare - 100.0 * (1.0 + saves_again), 1.2, 0.6)
            stops[BEFORE] = SandedStop(bare - 110.0, 1.5, -1.5 if seed % 2 else 0.6)
            if rail in BEARING:
                stops = dict.fromkeys(WHO, SandedStop(200.0, 0.0, math.nan))
                stops[WHEN_LOW] = SandedStop(200.0, 0.3 * (seed % 3 == 0), 0.6)
            out.append(DrivenStops(rail, seed, stops))
    return out


def test_metres_saved_kg_and_share_of_stops_with_sand() -> None:
    low = sand_figures(made(0.0, rails=("low",)), AT_SLIDE)
    assert (low.metres.value, low.saved_m.value, low.kg.value, low.sanded.value) == (202.5, 100.0, 1.0, 1.0)
    assert low.metres.low < 202.5 < low.metres.high
    false = judge_all(made(0.0))["rails"]["false sand"]
    assert false[WHEN_LOW].kg.value == pytest.approx(0.1)
    assert false[WHEN_LOW].sanded.value == pytest.approx(1 / 3)
    assert false[AT_SLIDE].sanded.value == 0.0
    assert false[WHEN_LOW].kg.count == 12


@pytest.mark.parametrize(("again", "verdict"), [(0.6, MET), (0.01, MISSED), (-0.05, MISSED)])
def test_share_saved_again_and_its_sentence_either_way(again: float, verdict: str) -> None:
    result = judge_all(made(again))
    assert result["again"][WHEN_LOW].value == pytest.approx(again)
    assert result["again"][BEFORE].value == pytest.approx(0.1)
    assert (result["earlier_s"], result["ahead"]) == (pytest.approx(0.2), 0.5)
    assert [g["verdict"] for g in result["goals"]] == [verdict]
    assert result["most"] == pytest.approx(0.025)  # of 100 m: from 202.5 to 200
    said, most, before, *false = conclusions(result)
    assert "save 2.5 % again" in most
    assert f"saves {100 * again:.1f}" in said
    assert "0.20 s earlier" in said
    assert ("not 50 %" in said, "until the demand comes" in said) == ((verdict == MISSED),) * 2
    assert "saves 10.0" in before
    assert "50.0 % of the stops" in before
    assert [f.partition(" of the stops")[0].partition(" (")[0] for f in false] == [
        f"On rail that bears the demand {AT_SLIDE} sands in 0.0",
        f"On rail that bears the demand {WHEN_LOW} sands in 33.3",
    ]


def test_rails_that_are_missing_leave_the_others_and_no_share() -> None:
    result = judge_all(made(0.1, rails=BEARING))
    assert list(result["rails"]) == [*BEARING, "false sand"]
    assert conclusions(result) == ["Sand at the slide saved nothing here."]


def test_slippery_rails_bear_less_than_the_demand_and_the_others_more() -> None:
    for rail in RAILS:
        for seed in range(5):
            s = scenario(SandJob(rail, seed))
            wheel = s.train.axles[0]
            bears = peak(SPEED_M_S, s.train.wheelset.contact, *rail_at(wheel.rail, 0.0)[:5])[1]
            assert (G * bears < DEMAND_M_S2) is (rail in SLIPPERY)


def test_before_brake_asks_two_seconds_before_the_demand_where_the_mean_is_too_low() -> None:
    def asks(seconds: float, *mu: float | None) -> bool:
        known = tuple(None if m is None else UsableAdhesion(m, None, False) for m in mu)
        cycle = SandCycle(round(seconds * 1e6), SPEED_M_S, 0.0, 0.0, (False,) * len(mu), known)
        return BeforeBrake(Facts.of(scenario(SandJob("low", 0)))).asks(cycle)

    assert asks(1.5, 0.05, 0.12, None)
    assert not asks(1.49, 0.05, 0.12, None)
    assert not asks(1.5, 0.07, 0.12)
    assert not asks(3.5, 0.05, 0.05)
    assert not asks(1.5, None, None)


def test_driven_stops_differ_by_policy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sanded_stops, "MOST_S", 4.4)
    monkeypatch.setattr(sanded_stops, "WHO", (NONE, AT_SLIDE, BEFORE))
    stops = drive_stops(SandJob("very low", 1_000_000)).stops
    assert stops[NONE].kg == 0.0 < stops[AT_SLIDE].kg < stops[BEFORE].kg
    assert stops[BEFORE].first_s < 0.0 < stops[AT_SLIDE].first_s
    assert stops[NONE].metres > stops[BEFORE].metres > 0.8 * 0.9 * SPEED_M_S


def test_tables_and_page_have_every_policy_and_say_that_they_are_few() -> None:
    result = {"run": {"quick": True}} | judge_all(made(0.01, seeds=2))
    lines = text(result)
    assert "QUICK" in lines[0]
    assert sum(line.startswith(f"| {BEFORE} |") for line in lines) == len(RAILS) + 1
    shown = page(result)
    assert "Metres against sand" in shown
    assert f"very low: {NONE} 300 m, 0.00 kg" in shown


@pytest.mark.parametrize("wrong", [("--seeds", "0"), ("--quick", "--seeds", "3"), ("--json", "/no/such/folder/x")])
def test_what_cannot_be_is_refused(wrong: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sand", *wrong]) == 2
    assert wrong[0] in capsys.readouterr().err
