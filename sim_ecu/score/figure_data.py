"""What the paper's figures are drawn from: held conditions on several tracks, estimated over time by the design."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from sim_ecu.design.brief import Recipe
from sim_ecu.design.cases import Condition, Progress, held_at, simulate
from sim_ecu.design.linear import Point
from sim_ecu.design.side_by_side import SideBySide
from sim_ecu.physics.contact import CURVES, CreepCurve, curve_between
from sim_ecu.physics.wheelset import LAT_ACCEL, MU_AVAILABLE, MU_USED, SLIP, TORQUE, YAW_RATE, Wheelset
from wrcd.core.design import Sets
from wrcd.core.estimator import step_through
from wrcd.core.records import Ticks
from wrcd.core.terms import MODELS

FloatArray = NDArray[np.float64]

SPEED = 25.0  # m/s, of all figures
SETTLED_S = 2.0  # the paper's "after 2 seconds"
SATURATED, LINEAR = 1.0, 0.05  # creep as a share of the one at the peak; on curve A 0.05 is still a straight line
OVER_TIME = ("A", "C", "F")  # curves at whose peaks runs are drawn: Figs. 3 and 11, 4 and 12 show the same
EVERY_S = 0.02  # an estimate so often, as on the bus
FRICTION_ENDS = (0.022, 0.65)  # mu_0 of the family's slipperiest and driest rail in Fig. 6


@dataclass(frozen=True, slots=True)
class HeldTrace:
    """n runs over k moments: t_s (k,), residuals, seen and own_range (k, n, 4), the others (k, n); NaN if unknown.

    seen is what the rules are given of the residuals: log10 of 1 to 3 over residual 4, and of residual 4, the sensors'
    noise taken off; in the paper's form log10 of the residuals. own_range is its place between the centres of the
    lowest (0) and the highest (1) set of its own.
    """

    t_s: FloatArray
    residuals: FloatArray
    seen: FloatArray
    own_range: FloatArray
    fuzzy: FloatArray
    unbounded_pct: FloatArray  # adhesion from the fuzzy output alone, without the bound that the torque sets
    mu_pct: FloatArray
    half_width_pp: FloatArray
    truth_pct: FloatArray
    used_pct: FloatArray
    creep: FloatArray

    def runs(self, which: slice) -> "HeldTrace":
        """Some of the runs."""
        rest = (getattr(self, name)[:, which] for name in list(self.__dataclass_fields__)[1:])
        return HeldTrace(self.t_s, *rest)

    def since(self, start_s: float) -> "HeldTrace":
        """What was estimated from a time on."""
        late = self.t_s >= start_s - 1e-9
        return HeldTrace(*(getattr(self, name)[late] for name in self.__dataclass_fields__))


def own_range(sets: Sequence[Sets], seen: FloatArray) -> FloatArray:
    """Place of what the rules see (…, 4) between the centres of its own lowest (0) and highest (1) set."""
    low, high = (np.array([s.centres[i] for s in sets]) for i in (0, -1))
    return np.asarray((seen - low) / (high - low))


def held(w: Wheelset, curve: CreepCurve, creep_of_peak: float, tracks: int) -> list[Condition]:
    """A wheelset held at a share of its curve's peak creep, on a number of good tracks."""
    return [held_at(w, curve, creep_of_peak, SPEED, 1000 + k) for k in range(tracks)]


Measured: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]
Known: TypeAlias = dict[tuple[Any, ...], Measured]  # what was simulated: each condition once, for all designs


def measured(s: Recipe, conditions: Sequence[Condition], seconds: float, progress: Progress, known: Known) -> Measured:
    """Return the simulation's outputs (ticks, outputs, n), z (ticks, 2, n) and the torque ratio (ticks, n)."""
    d = s.design
    key = (s.wheelset, s.sensors, d.tick_s, seconds, tuple(conditions))
    if key not in known:
        runs = []
        for i, c in enumerate(conditions):
            runs.append(simulate(s.wheelset, c, seconds, d.tick_s).outputs[:, 0])
            progress("simulating", (i + 1) / len(conditions))
        y, rng = np.stack(runs, axis=-1), np.random.default_rng(1)
        felt = ((s.sensors.yaw_rate, YAW_RATE), (s.sensors.lat_accel, LAT_ACCEL), (s.sensors.torque, TORQUE))
        yaw, lat, torque = (sensor.measure(y[:, column], rng) for sensor, column in felt)
        known[key] = y, np.stack((yaw, lat), axis=1), np.abs(torque) / (2 * d.normal_N * d.r_0)
    return known[key]


def observe(
    s: Recipe,
    conditions: list[Condition],
    seconds: float,
    progress: Progress,
    known: Known,
    every_s: float = EVERY_S,
) -> HeldTrace:
    """Simulate the conditions, measure, and estimate from the filters' standstill on."""
    d = s.design
    y, z, ratio = measured(s, conditions, seconds, progress, known)
    n = len(conditions)
    estimator = SideBySide(d, n)
    every = max(1, round(every_s / d.tick_s))
    ticks = list(range(every - 1, len(z), every))
    played = Ticks(0, z, np.ones(z.shape, dtype=bool), ratio, [SPEED] * len(z))
    estimates = [estimator.estimate() for _, _ in zip(step_through(estimator, played, ticks), ticks, strict=False)]
    seen = np.array([e.inputs[:, :MODELS] for e in estimates])
    fuzzy = np.array([e.fuzzy for e in estimates])
    return HeldTrace(
        t_s=(np.array(ticks) + 1) * d.tick_s,
        residuals=np.array([e.residuals for e in estimates]),
        seen=seen,
        own_range=own_range(d.residual_sets, seen),
        fuzzy=fuzzy,
        unbounded_pct=np.clip(np.polyval(d.polynomial, fuzzy), *d.adhesion_range_pct),
        mu_pct=np.array([e.mu_available_pct for e in estimates]),
        half_width_pp=np.array([e.half_width_pp for e in estimates]),
        truth_pct=100 * y[ticks, MU_AVAILABLE],
        used_pct=100 * np.abs(y[ticks, MU_USED]),
        creep=y[ticks, SLIP],
    )


@dataclass(frozen=True, slots=True)
class Levels:
    """Fig. 6: residuals over adhesion at one share of the peak's creep, from slippery to dry.

    windows (w, levels, 4) are the single windows' residuals, seen (w, levels, 4) what the rules see of them.
    """

    creep_of_peak: float
    adhesion_pct: FloatArray  # (levels,)
    windows: FloatArray
    seen: FloatArray


def nearest(point: Point, *regions: Levels) -> Levels:
    """The region whose creep is the most like a design point's."""
    return min(regions, key=lambda levels: abs(levels.creep_of_peak - point.creep_of_peak))


def level_curves(between: int) -> list[CreepCurve]:
    """The six curves, two ends, and so many curves between neighbours, from slippery to dry."""
    known = sorted((FRICTION_ENDS[0], *(c.mu_0 for c in CURVES.values()), FRICTION_ENDS[1]))
    every = np.interp(np.arange((len(known) - 1) * (between + 1) + 1) / (between + 1), range(len(known)), np.log(known))
    return [curve_between(float(np.exp(x))) for x in every]


def survey(s: Recipe, creep_of_peak: float, between: int, tracks: int, progress: Progress, known: Known) -> Levels:
    """The residuals of whole windows, taken half a window apart once the wheelset has settled."""
    curves = level_curves(between)
    conditions = [c for curve in curves for c in held(s.wheelset, curve, creep_of_peak, tracks)]
    seconds = SETTLED_S + 1.5 * s.design.window_s
    trace = observe(s, conditions, seconds, progress, known, s.design.window_s / 2)
    trace = trace.since(SETTLED_S + s.design.window_s - s.design.tick_s)
    shape = (len(trace.t_s), len(curves), tracks, MODELS)
    windows, seen = (
        np.moveaxis(values.reshape(shape), 2, 1).reshape(-1, len(curves), MODELS)
        for values in (trace.residuals, trace.seen)
    )
    return Levels(creep_of_peak, trace.truth_pct[-1].reshape(len(curves), tracks)[:, 0], windows, seen)


@dataclass(frozen=True, slots=True)
class Data:
    """All that is drawn. below is what is held at the share of the peak's creep that model 4 is designed at."""

    subject: Recipe
    at_peak: dict[str, HeldTrace]  # by curve
    linear: HeldTrace  # curve A
    below: HeldTrace  # curve A
    regions: tuple[Levels, Levels]  # at the peak, and where model 4 is designed


def gather(s: Recipe, tracks: int, seconds: float, between: int, at: Progress, known: Known) -> Data:
    """Simulate and estimate: most of the time goes here."""
    below = s.points[-1].creep_of_peak
    wanted = [*((c, SATURATED) for c in OVER_TIME), ("A", LINEAR), ("A", below)]
    conditions = [c for curve, share in wanted for c in held(s.wheelset, CURVES[curve], share, tracks)]
    trace = observe(s, conditions, seconds, lambda _, share: at("runs over time", share), known)
    runs = [trace.runs(slice(i * tracks, (i + 1) * tracks)) for i in range(len(wanted))]
    peak, least = (
        survey(s, share, between, tracks, lambda _, done: at("residuals over adhesion", done), known)
        for share in (SATURATED, below)
    )
    return Data(s, dict(zip(OVER_TIME, runs, strict=False)), runs[-2], runs[-1], (peak, least))
