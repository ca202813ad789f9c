"""Stops become figures: overruns, metres, seconds, energy of every policy, and goals. Pure."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_ecu.loop.control.braking_rate import RATES
from sim_ecu.loop.mark.lines import AS_TRAINED, MARK_WORLDS, UNSEEN
from sim_ecu.loop.mark.policies import DRY, KNOWS, POLICIES, SLIPPERY, TESTS, TOLD, WRCD, DrivenStop
from sim_ecu.loop.mark.stops import StopOutcome
from sim_ecu.reporting.values import Figure
from sim_ecu.reporting.verdicts import Goal
from sim_ecu.score.metrics import bootstrap

FloatArray = NDArray[np.float64]
OVERRUN_M = 2.0  # past the mark
LATE_S = 5.0  # after who knows the rail: a stop that is late for nothing, on a rail that bears the dry rate
MIN_STOPS = 50  # of a group: fewer judge nothing
_WORLD = {w.name: w for w in MARK_WORLDS}

Stops = Sequence[DrivenStop]


@dataclass(frozen=True, slots=True)
class PolicyFigures:
    """Of a policy in a group of stops. Intervals are of whole lines.

    overruns: share of the stops more than OVERRUN_M past the mark; past_m: mean of metres past, 0 where it is not; of
    the overruns median_m, worst_m. lost_s: mean seconds after who knows the rail, of stops that neither overran.
    energy_kJ: slip energy of a wheel. tested: share of the stops with a brake test. false: share of those on rails that
    bear the dry rate that end more than LATE_S after it.
    """

    stops: int
    overruns: Figure
    past_m: Figure
    median_m: float
    worst_m: float
    lost_s: Figure
    energy_kJ: Figure
    tested: float
    false: Figure


# Groups of stops by name: what a table is of, and which stops they are.
TIED, UNTIED, ALL, LATE, OTHER = "tied slopes", "untied slopes", "all stops", "late films", "unseen worlds"
ABOUT = {
    TIED: "of that world, the film met before braking", UNTIED: "of that world, the film met before braking",
    ALL: "of the worlds as trained, late films included",
    LATE: "of the worlds as trained, the film first met within the braking distance of who knows the rail",
    OTHER: "of worlds that the training has not, late films included",
}  # fmt: skip
GROUPS: Mapping[str, Callable[[DrivenStop], bool]] = {
    TIED: lambda d: d.world == MARK_WORLDS[0].name and not d.late,
    UNTIED: lambda d: d.world == MARK_WORLDS[1].name and not d.late,
    ALL: lambda d: _WORLD[d.world].family == AS_TRAINED,
    LATE: lambda d: _WORLD[d.world].family == AS_TRAINED and d.late,
    OTHER: lambda d: _WORLD[d.world].family == UNSEEN,
}


def policy_figures(every: Stops, policy: str) -> PolicyFigures:
    """The figures of one policy in some stops."""
    of = [d.outcomes[policy] for d in every]
    runs = np.array([_run(d) for d in every], np.int64)
    past = np.array([max(o.past_m, 0.0) for o in of])
    over = past > OVERRUN_M
    both = ~over & np.array([d.outcomes[KNOWS].past_m <= OVERRUN_M for d in every], bool)
    lost = np.array([o.seconds - d.outcomes[KNOWS].seconds for o, d in zip(of, every, strict=True)])
    bears = both & np.array([d.outcomes[KNOWS].rate_m_s2 >= RATES.dry for d in every], bool)
    return PolicyFigures(
        stops=len(every),
        overruns=bootstrap.share(over, runs) if len(every) else bootstrap.NOTHING,
        past_m=bootstrap.mean(past, runs),
        median_m=float(np.median(past[over])) if over.any() else math.nan,
        worst_m=float(past.max()) if over.any() else 0.0,
        lost_s=bootstrap.mean(lost[both], runs[both]),
        energy_kJ=bootstrap.mean(np.array([o.slip_energy_kJ for o in of]), runs),
        tested=float(np.mean([o.tested for o in of])) if of else math.nan,
        false=bootstrap.share(lost[bears] > LATE_S, runs[bears]) if bears.any() else bootstrap.NOTHING,
    )  # fmt: skip


def _run(d: DrivenStop) -> int:
    """A number for the line, the same in every world: lines of a number have the same rails."""
    return d.line


def judge_all(every: Stops) -> dict[str, Any]:
    """All figures: leaves are PolicyFigures, Figures, numbers and words."""
    groups = {}
    for name, belongs in GROUPS.items():
        part = [d for d in every if belongs(d)]
        if part:
            groups[name] = {p: policy_figures(part, p) for p in POLICIES}
    rails = {}
    for rail in dict.fromkeys(d.rail for d in every):
        part = [d for d in every if d.rail == rail and _WORLD[d.world].family == AS_TRAINED and not d.late]
        if part:
            rails[rail] = {p: policy_figures(part, p) for p in POLICIES}
    return {
        "groups": groups, "rails": rails, "goals": goals(every, groups),
        "stops": [_record(d) for d in every],
    }  # fmt: skip


def goals(every: Stops, groups: Mapping[str, Mapping[str, PolicyFigures]]) -> list[dict[str, Any]]:
    """What wrcd is held to, with verdicts; beside each what the policy that knows no rail and no wrcd reaches."""
    out: list[dict[str, Any]] = []

    def add(what: str, figure: Figure, bound: float, beside: Figure | None = None, never: bool = False) -> None:
        least = 1 if never else bootstrap.FEWEST  # lines
        out.append(Goal(what, figure, bound, min_runs=least, never=never).record() | {"beside": beside})

    for name, most, seconds in ((TIED, 0.005, 3.0), (UNTIED, 0.01, 6.0)):
        if name in groups and groups[name][WRCD].stops >= MIN_STOPS:
            ours, dry, slippery = (groups[name][p] for p in (WRCD, DRY, SLIPPERY))
            add(f"{name}: share of overruns, wrcd", ours.overruns, most, dry.overruns)
            add(f"{name}: seconds lost a stop, wrcd", ours.lost_s, seconds, slippery.lost_s)
    if ALL in groups and groups[ALL][WRCD].stops >= MIN_STOPS:
        part = [d for d in every if GROUPS[ALL](d)]
        ours = groups[ALL][WRCD]
        add(f"{ALL}: overruns of wrcd over those of {DRY}", _ratio(part, _overran, DRY), 0.25)
        add(f"{ALL}: seconds lost of wrcd over those of {SLIPPERY}", _ratio(part, _lost, SLIPPERY), 1.0 / 3.0)
        add(f"{ALL}: slip energy of wrcd over that of {DRY}", _ratio(part, _energy, DRY), 0.5)
        add(f"{ALL}: stops late for nothing, wrcd", ours.false, 0.1, groups[ALL][SLIPPERY].false)
        better = [p for p in TOLD if _is_better(groups[ALL][p], ours)]
        add(f"{ALL}: liars that are better in overruns and seconds", bootstrap.exact(len(better), 1, len(TOLD)), 0.0,
            never=True)  # fmt: skip
        met = [d for d in part if not d.late]
        worst = max((d.outcomes[WRCD].past_m for d in met), default=0.0)
        dry_worst = max((d.outcomes[DRY].past_m for d in met), default=0.0)
        add(
            "as trained, film met before braking: metres past, the worst stop of wrcd",
            bootstrap.exact(max(worst, 0.0), 1, len(met)),
            20.0,
            bootstrap.exact(dry_worst, 1, len(met)),
            never=True,
        )
        add(f"{ALL}: seconds lost of wrcd over those of {TESTS}", _ratio(part, _lost, TESTS), 1.5)
    return out


def _is_better(p: PolicyFigures, ours: PolicyFigures) -> bool:
    return p.overruns.value <= ours.overruns.value and p.lost_s.value <= ours.lost_s.value


def _overran(d: DrivenStop, policy: str) -> float:
    return float(d.outcomes[policy].past_m > OVERRUN_M)


def _energy(d: DrivenStop, policy: str) -> float:
    return d.outcomes[policy].slip_energy_kJ


def _lost(d: DrivenStop, policy: str) -> float:
    """Seconds after who knows the rail."""
    return d.outcomes[policy].seconds - d.outcomes[KNOWS].seconds


def _ratio(part: Stops, of: Callable[[DrivenStop, str], float], other: str) -> Figure:
    """wrcd's over another policy's, of whole lines; seconds of stops that neither of them nor who knows overran."""
    if of is _lost:
        part = [d for d in part if not any(_overran(d, p) for p in (WRCD, other, KNOWS))]
    runs = np.array([_run(d) for d in part], np.int64)
    ours, theirs = (np.array([of(d, p) for d in part], np.float64) for p in (WRCD, other))
    return bootstrap.ratio(ours, runs, theirs, runs) if theirs.sum() > 0.0 else bootstrap.NOTHING


def _record(d: DrivenStop) -> dict[str, Any]:
    return {
        "world": d.world, "line": d.line, "station": d.station, "rail": d.rail, "late": d.late,
        "policies": {name: _outcome(o) for name, o in d.outcomes.items()},
    }  # fmt: skip


def _outcome(o: StopOutcome) -> dict[str, float | bool]:
    return {
        "rate_m_s2": round(o.rate_m_s2, 3), "past_m": round(o.past_m, 2), "seconds": round(o.seconds, 2),
        "slid": o.slid, "slip_energy_kJ": round(o.slip_energy_kJ, 2), "tested": o.tested,
    }  # fmt: skip
