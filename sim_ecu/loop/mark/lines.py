"""The stops that are driven: lines of ten stations in a world, their rails alike from stop to stop.

Shares and lengths without a source are this project's own choice: no line's own were published with them.
"""

import math
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sim_ecu.loop.control.braking_rate import RATES
from sim_ecu.loop.drive_scenario import NO_DRIVE, DriveScenario
from sim_ecu.loop.driver import REACTION_S, STANDS_M_S
from sim_ecu.loop.suites.rides import DRY, FIRST_TEST_SEED, GREASY, LOW, WET, Rng
from sim_ecu.physics.actuators import Actuators
from sim_ecu.physics.cleaning import Cleaning
from sim_ecu.physics.contact import CreepCurve, curve_between
from sim_ecu.physics.rail import RailSection, rail_table
from sim_ecu.physics.sensors import SensorSet
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.scenario import AxleScenario, Course, Scenario, positions_m
from sim_ecu.play.vehicles import DEFAULT_VEHICLE, load_vehicle
from sim_ecu.score.suites.worlds import WORLDS, World

STATIONS = 10
AXLES = 2  # one bogie: both its wheelsets are weighed
# Friction mu_0 by class of rail.
VERY_LOW = (0.027, 0.035)
CLASSES: dict[str, tuple[float, float]] = {
    "dry": DRY, "wet": WET, "greasy": GREASY, "low": LOW, "very low": VERY_LOW,
}  # fmt: skip
MIX = {"dry": 0.45, "wet": 0.25, "greasy": 0.14, "low": 0.11, "very low": 0.05}  # of the approaches
STAYS = 0.7  # of the stations: the approach is of the class of the one before; else it is drawn from the mix
LATE = 0.3  # of the approaches on low and very low rail: the film is first met within the braking distance,
LATE_M = (150.0, 400.0)  # so far before the mark, after a wet rail
PATCH_M, SCATTER, ALIKE = (
    25.0,
    0.08,
    0.8,
)  # friction varies along the rail: patch, scatter of its logarithm, correlation
LINE_M_S = (14.0, 19.0)  # of a line: its trains coast at this speed
FULL_SERVICE = 1.2  # m/s2
COASTS_S = 4.0  # before the first place where anybody may begin to brake: the estimate needs some seconds
MOST_S = 400.0
ROUGHNESS = (0.9, 4.0)  # range of the default design's training


@dataclass(frozen=True, slots=True)
class MarkWorld:
    """What differs from the train that the design thinks of. of: a world of the score, whose train, slopes, track and
    sensors are taken. lines: so many of ten stations. family: "as trained" or "unseen". tied: whether the creep slope
    follows from the friction."""

    name: str
    of: World
    lines: int
    family: str
    tied: bool = True
    cleaning: bool = False
    sensors: Callable[[SensorSet, Rng], SensorSet] = field(default=lambda s, rng: s)


def _friction_unknown(s: SensorSet, rng: Rng) -> SensorSet:
    """Half of the braking torque is made by friction, and read some tens of per cent wrong."""
    return replace(s, friction_share=0.5, friction_gain=float(rng.uniform(0.6, 1.4)))


AS_TRAINED, UNSEEN = "as trained", "unseen"
_OF = {w.name: w for w in WORLDS}
_OFF = _OF["vehicle and sensors off"]
MARK_WORLDS = (
    MarkWorld("tied slopes", _OFF, 20, AS_TRAINED),
    MarkWorld("untied slopes", _OF["slopes untied"], 12, AS_TRAINED, tied=False),
    MarkWorld("slip cleans the rail", _OFF, 4, AS_TRAINED, cleaning=True),
    MarkWorld("friction torque unknown", _OFF, 4, AS_TRAINED, sensors=_friction_unknown),
    MarkWorld("another one's bogie", _OF["vehicle: another one's bogie"], 6, UNSEEN),
    MarkWorld("track: china-hs", _OF["track: china-hs"], 6, UNSEEN),
    MarkWorld("curves bent otherwise", _OF["slopes: curves bent otherwise"], 4, UNSEEN, tied=False),
    MarkWorld("slopes untied × 1.5", _OF["slopes untied × 1.5"], 4, UNSEEN, tied=False),
)


@dataclass(frozen=True, slots=True)
class Stop:
    """One station's approach. mark_m: where the train is to stand, from its own start. film_m: from where on the class
    holds; late: that is within the braking distance. scenario: with nobody braking."""

    world: str
    line: int
    station: int
    rail: str
    late: bool
    speed_m_s: float
    mark_m: float
    film_m: float
    scenario: DriveScenario


def braking_m(speed_m_s: float, rate_m_s2: float) -> float:
    """Way from the decision to brake at a rate to standstill."""
    return REACTION_S * speed_m_s + speed_m_s**2 / (2.0 * rate_m_s2)


def actuators(w: Wheelset) -> Actuators:
    """Brakes whose full service gives FULL_SERVICE."""
    per_m_s2 = (w.M_v + (w.I_R + w.I_L) / w.r_0**2) * w.r_0
    return Actuators(full_brake_N_m=FULL_SERVICE * per_m_s2)


def stops(world: MarkWorld, line: int, first_seed: int = FIRST_TEST_SEED) -> list[Stop]:
    """The stops of a line of a number, always the same."""
    seed, key = first_seed + line, zlib.crc32(world.name.encode())
    of_line, own = np.random.default_rng([seed, 26]), np.random.default_rng([seed, 26, key])
    train = world.of.train(load_vehicle(DEFAULT_VEHICLE), own)
    track = world.of.irregularity(ROUGHNESS, own)
    sensors = world.sensors(world.of.sensing(own), own)
    speed = float(of_line.uniform(*LINE_M_S))
    mark = speed * COASTS_S + braking_m(speed, RATES.least)
    out, rail = [], ""
    for station in range(STATIONS):
        if not rail or of_line.random() > STAYS:
            rail = str(of_line.choice(list(MIX), p=list(MIX.values())))
        late = bool(of_line.random() < LATE) and rail in ("low", "very low")
        film = mark - float(of_line.uniform(*LATE_M)) if late else 0.0
        curve, before = (world.of.slope(curve_between(float(of_line.uniform(*CLASSES[r]))), own) for r in (rail, "wet"))
        sections = _sections(curve, film, mark + 400.0, of_line)
        if late:
            sections = [RailSection(0.0, before), *sections]
        table, box = rail_table(sections), world.of.box(own, world.of.wider)
        axles = tuple(
            AxleScenario(k + 1, table, NO_DRIVE, track, sensors, 16 * (STATIONS * seed + station) + k, at,
                         16 * (STATIONS * seed + station), axlebox=box)
            for k, at in enumerate(positions_m(train)[:AXLES])
        )  # fmt: skip
        played = Scenario("mark", "", MOST_S, Course((0.0,), (speed,)), False, train, axles)
        scenario = DriveScenario(
            played, Course((0.0,), (0.0,)), actuators(train), stop_m_s=STANDS_M_S, mark_m=mark,
            cleaning=Cleaning() if world.cleaning else None,
        )  # fmt: skip
        out.append(Stop(world.name, line, station, rail, late, speed, mark, film, scenario))
    return out


def _sections(curve: CreepCurve, from_m: float, to_m: float, rng: Rng) -> Sequence[RailSection]:
    """A rail whose friction varies along its way about that of a curve; its slope goes with it."""
    out, off = [], float(rng.normal())
    for at in np.arange(from_m, to_m, PATCH_M):
        mu_0 = curve.mu_0 * math.exp(SCATTER * off)
        own, base = curve_between(mu_0), curve_between(curve.mu_0)
        scaled = {f: getattr(curve, f) * getattr(own, f) / getattr(base, f) for f in ("A", "B", "k_A", "k_S")}
        out.append(RailSection(float(at), replace(curve, mu_0=mu_0, **scaled)))
        off = ALIKE * off + math.sqrt(1.0 - ALIKE**2) * float(rng.normal())
    return out
