"""Conditions like the training's; the same in worlds that differ from the design's in one thing each; what a real axle
box feels and the track's spectrum lacks; and slow or coasting wheelsets."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sim_ecu.design.train_worlds import BRAKES_M_S2
from sim_ecu.physics.axlebox import QUIET, AxleBox
from sim_ecu.physics.contact import CURVES, CreepCurve, curve_between
from sim_ecu.physics.sensors import SENSOR_SETS, SensorSet
from sim_ecu.physics.track import QUALITY, Spectrum
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.faults import Fault
from sim_ecu.play.scenario import Course, positions_m
from sim_ecu.score.suites.run import (
    AXLES,
    SPEEDS,
    TEST,
    UTILISATIONS,
    Lot,
    Rng,
    Run,
    any_track,
    axle,
    drive,
    one_rail,
    scenario,
)  # fmt: skip

RUN_S = 10.0
GRID = 120  # conditions of the grid
FRICTIONS = (CURVES["F"].mu_0, CURVES["A"].mu_0)
GOLDEN = 0.6180339887498949
MEMS = SENSOR_SETS["mems"]


@dataclass(frozen=True, slots=True)
class Variant:
    """One way in which the world is not as the design thinks. Without any it is the grid's."""

    name: str = ""
    wheelset: Callable[[Wheelset, Rng], Wheelset] = lambda w, _: w
    curve: Callable[[CreepCurve, Rng], CreepCurve] = lambda c, _: c
    sensors: SensorSet = MEMS
    curvature: float = 0.0  # 1/m
    ramp_m_s2: float = 0.0
    track: Spectrum | None = None  # of all axles
    corner: float = 1.0  # times the track's
    box: AxleBox = QUIET
    speeds: tuple[float, float] = SPEEDS
    utilisations: tuple[float, float] = UTILISATIONS
    faults: tuple[Fault, ...] = ()
    one_track: bool = False  # and one rail for all axles, as under a train


def condition(
    suite: str, w: Wheelset, number: int, variant: Variant, seconds: float = RUN_S, lot: Lot = TEST
) -> Run:  # fmt: skip
    """One of the grid's: half of the curves are A to F, half lie between; held torque, three tenths of it braking.

    Everything but the variant follows from the number. Speeds of successive numbers cover their range evenly.
    """
    rng, own = lot.generator(2, number), lot.generator(3, number)
    letters = list(CURVES)
    low, high = variant.speeds
    v = low + (high - low) * ((0.5 + number * GOLDEN) % 1.0)
    axles, names = [], []
    for i in range(AXLES):
        known = (number + i) % 2 == 0
        letter, between = str(rng.choice(letters)), curve_between(math.exp(rng.uniform(*np.log(FRICTIONS))))
        curve = variant.curve(CURVES[letter] if known else between, own)
        share = float(rng.uniform(*variant.utilisations)) * (-1.0 if rng.random() < 0.3 else 1.0)
        drawn = any_track(rng)
        axles.append(
            axle(
                lot, i, one_rail(curve, variant.curvature), drive("utilisation", (0.0, 0.0), (0.5, share)),
                (variant.track or drawn).with_corner(variant.corner), rng, variant.sensors, variant.box,
            )
        )  # fmt: skip
        names.append(letter if known else "between")
    if variant.one_track:
        first = axles[0]
        axles = [
            replace(a, rail=first.rail, track=first.track, position_m=position, track_seed=first.seed)
            for a, position in zip(axles, positions_m(w)[:AXLES], strict=True)
        ]
        names = names[:1] * AXLES
    speed = Course((0.0, seconds), (v, v + variant.ramp_m_s2 * seconds))
    played = scenario(variant.wheelset(w, own), seconds, speed, axles, variant.faults)
    return Run(suite, variant.name, number, played, tuple(names))


def size(scale: float) -> int:
    """Conditions of the grid."""
    return max(2, round(GRID * scale))


def spread(scale: float, count: int, first: int) -> list[int]:
    """Numbers of some of the grid's conditions: successive ones, whose speeds are spread evenly. The next first goes
    on where this one ends, so that variants together reach all of the grid."""
    total = size(scale)
    count = min(max(1, round(count * scale)), total)
    return [(first * count + j) % total for j in range(count)]


def varied(
    suite: str, variants: Sequence[Variant], runs: int, first: int, seconds: float = RUN_S
) -> Callable[..., Iterator[Run]]:  # fmt: skip
    """Return a suite: so many of the grid's conditions with each of the variants. first: see spread."""

    def make(w: Wheelset, scale: float, lot: Lot = TEST) -> Iterator[Run]:
        for k, variant in enumerate(variants):
            yield from (condition(suite, w, n, variant, seconds, lot) for n in spread(scale, runs, first + k))

    return make


def grid(w: Wheelset, scale: float, lot: Lot = TEST) -> Iterator[Run]:
    """Curves A to F and between x utilisation x speed x track; some of it with the better sensors, too."""
    yield from (condition("grid", w, k, Variant("mems"), lot=lot) for k in range(size(scale)))
    tactical = Variant("tactical", sensors=SENSOR_SETS["tactical"])
    yield from (condition("grid", w, k, tactical, lot=lot) for k in spread(scale, GRID // 3, 0))


def either(rng: Rng, share: float) -> float:
    """Return 1 more or less a share."""
    return 1.0 + share if rng.random() < 0.5 else 1.0 - share


def scattered(w: Wheelset, rng: Rng) -> Wheelset:
    """Masses, stiffnesses, dampings and inertias each off by up to 10 %."""
    names = ("m_w", "I_w", "k_w", "I_R", "I_L", "k_s", "C_s", "a", "b")
    return replace(w, **{n: getattr(w, n) * rng.uniform(0.9, 1.1) for n in names})


def noisier(factor: float) -> SensorSet:
    """Both inertial sensors with so many times their noise."""
    yaw, lat = MEMS.yaw_rate, MEMS.lat_accel
    return replace(
        MEMS,
        yaw_rate=replace(yaw, noise_rms=yaw.noise_rms * factor),
        lat_accel=replace(lat, noise_rms=lat.noise_rms * factor),
    )


NOISE = {0.67: "sensor noise × 0.67", 1.5: "sensor noise × 1.5", 2.0: "sensor noise × 2"}
# Constant errors of cheap sensors: 0.5 degrees per second, 5 mg, a torque that reads 3 % high.
ROBUST = (
    Variant("wheelset parameters off by up to 10 %", wheelset=scattered),
    Variant("conicity off by 30 %", wheelset=lambda w, r: replace(w, gamma=w.gamma * either(r, 0.3))),
    Variant("load off by 15 %", wheelset=lambda w, r: replace(w, M_v=w.M_v * either(r, 0.15))),
    Variant("k_A off by 30 %", curve=lambda c, r: replace(c, k_A=c.k_A * either(r, 0.3))),
    Variant("torque reads 3 % high", sensors=replace(MEMS, torque=replace(MEMS.torque, gain=1.03))),
    Variant("gyro bias 0.5 °/s", sensors=MEMS.biased(math.radians(0.5), 0.0, 0.0)),
    Variant("accelerometer bias 5 mg", sensors=MEMS.biased(0.0, 0.049, 0.0)),
    Variant("curve of 1500 m, no cant", curvature=1 / 1500),
    Variant("speed ramp of 0.8 m/s²", ramp_m_s2=0.8),
    *(Variant(name, sensors=noisier(factor)) for factor, name in NOISE.items()),
    *(Variant(f"corner of the track's spectrum × {f:g}", corner=f) for f in (0.5, 2.0)),
)


robust = varied("robust", ROBUST, 12, 0)


# Roughness is the spectral density A_a of the irregularity; the amplitude goes with its root. The first two are judged.
ROUGH = (
    ("half as rough as any trained", 0, 0.5),
    ("twice as rough as any trained", 1, 2.0),
    ("half the amplitude of any trained", 0, 0.25),
    ("twice the amplitude of any trained", 1, 4.0),
)
ROUGH_JUDGED = tuple(name for name, _, _ in ROUGH[:2])


def rough(w: Wheelset, scale: float, trained: tuple[float, float], lot: Lot = TEST) -> Iterator[Run]:
    """Tracks smoother and rougher than any in the training (whose ends are given times the good track's A_a)."""
    variants = [
        Variant(name, track=Spectrum.of_roughness(QUALITY["good"] * trained[end] * factor))
        for name, end, factor in ROUGH
    ]
    return varied("rough", variants, 12, 20)(w, scale, lot)


WHITE_HZ = (0.0, 100.0)
# What is judged: against the nominal error (within the bound that the band and the pulses leave), or by points.
VIBRATION = tuple(
    Variant(f"vibration of {a:g} m/s², 20 to 100 Hz", box=AxleBox(vibration_m_s2=a)) for a in (0.03, 0.1, 0.3, 1.0)
)
JOINTS = tuple(
    Variant(f"joints of {a:g} m/s², {shape}", box=AxleBox(joint_m_s2=a, joint_shape=shape))
    for a in (0.3, 2.0)
    for shape in ("bipolar", "unipolar")
)
WHITE = {
    a: Variant(f"white vibration of {a:g} m/s²", box=AxleBox(vibration_m_s2=a, band_hz=WHITE_HZ))
    for a in (0.03, 0.1)
}  # fmt: skip
# Beyond what an estimate has to cover: there it must not be Valid and wrong.
BEYOND = (
    Variant("white vibration of 0.3 m/s²", box=AxleBox(vibration_m_s2=0.3, band_hz=WHITE_HZ)),
    Variant("joints of 5 m/s², bipolar", box=AxleBox(joint_m_s2=5.0)),
    Variant(
        "joints of 2 m/s² every 8 m, unipolar", box=AxleBox(joint_m_s2=2.0, joint_every_m=8.0, joint_shape="unipolar")
    ),
)
CROSSING = Variant("a crossing of 2 m/s²", box=AxleBox(crossing_m_s2=2.0, crossing_at_m=100.0))
HARSH = (*VIBRATION, *JOINTS, *WHITE.values(), CROSSING, *BEYOND)
SLOW = (
    Variant("coasting, 10 to 50 m/s", utilisations=(0.0, 0.0)),
    Variant("3 to 10 m/s", speeds=(3.2, 10.0)),
)
harsh = varied("harsh", HARSH, 10, 30)
SLOW_RUNS, SLOW_FIRST = 14, 50
# Stops by full service, of which each plays a band of speed at its end: what is quiet there was loud just before.
STOP_M_S, STOP_BANDS_M_S = 25.0, ((12.0, 8.0), (8.0, 5.0), (5.0, 3.2))


def slow(w: Wheelset, scale: float, lot: Lot = TEST) -> Iterator[Run]:
    """Coasting, below the grid's speeds, and down to a walking pace."""
    yield from varied("slow", SLOW, SLOW_RUNS, SLOW_FIRST)(w, scale, lot)
    braked = drive("torque_N_m", (0.0, 0.0), (1.0, -BRAKES_M_S2 * w.M_v * w.r_0))
    for high, low in STOP_BANDS_M_S:
        variant = Variant(f"stops, {high:g} to {low:g} m/s", speeds=(STOP_M_S, STOP_M_S), ramp_m_s2=-BRAKES_M_S2)
        for n in spread(scale, SLOW_RUNS, SLOW_FIRST + len(SLOW)):
            run = condition("slow", w, n, variant, (STOP_M_S - low) / BRAKES_M_S2, lot)
            axles = tuple(replace(a, drive=braked) for a in run.scenario.axles)
            yield replace(
                run, scenario=replace(run.scenario, axles=axles), judged_from_s=(STOP_M_S - high) / BRAKES_M_S2
            )
