"""Passages of trains over places with low rail, for the map of low rail: two bogies of a train on one rail.

A place has its rail and its track; each train that comes over it has its own vehicle, sensors, speed and effort. In
ordinary running nobody uses more than there is, so no wheel slides; as driven, the effort is drawn whatever the rail
bears.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sim_ecu.design.brief import Recipe
from sim_ecu.physics.contact import CreepCurve, curve_between, peak
from sim_ecu.physics.rail import RailSection, rail_table
from sim_ecu.physics.wheelset import GRAVITY, Wheelset
from sim_ecu.play.scenario import AxleScenario, Course, DriveCourse, positions_m
from sim_ecu.play.vehicles import load_vehicle
from sim_ecu.score import MAP
from sim_ecu.score.suites.nominal import GOLDEN
from sim_ecu.score.suites.run import AXLES, CREEP_LIMIT, TEST, Lot, Rng, Run, scenario
from sim_ecu.score.suites.worlds import WORLDS, World

IN_WORLDS = (
    "its own vehicle", "vehicle and sensors off", "slopes untied", "sampled inside, shaken", "track: china-hs",
    "vibration: wheel flats", "slopes: curves bent otherwise",
)  # fmt: skip
DRY_PCT, WET_PCT = (25.0, 45.0), (15.0, 25.0)  # good rail
AT_M_S = 20.0  # at which speed a rail's adhesion is stated
MAX_SPEED_M_S, MIN_SPEED_M_S = 35.0, 12.0
EFFORTS = {"coasting": (2.0, 5.0), "light": (5.0, 8.0), "service": (9.0, 12.0)}  # % of the axle load in use
DRIVEN = {"coasting": 0.45, "light": 0.30, "service": 0.25}  # share of each as driven
MOST_OF_LOW = 0.85  # of the low rail that ordinary running uses
HELD_S, TURN_S = (5.0, 15.0), (1.0, 4.0)  # how long an effort stays, and how long it takes to change
SHARP_M, LONG_EDGE_M = 0.5, (10.0, 30.0)  # edges of a film
CLEANED = (0.05, 0.25)  # more adhesion for each axle that has run over the film before, as a share


@dataclass(frozen=True, slots=True)
class PlaceKind:
    """A kind of place. places: of each world. low_pct: adhesion of the film; None: it is wet rail amid a dry line.
    film_m, around_m: how long the film is, and the good rail on either side. driven: passages as driven beside the
    ordinary ones. cleaned: each axle leaves a better rail to the next one."""

    name: str
    places: int
    low_pct: tuple[float, float] | None
    film_m: tuple[float, float]
    around_m: float
    ordinary: int = 3
    driven: int = 0
    cleaned: bool = False


FILM = PlaceKind("film of 100 to 400 m", 16, (3.0, 8.0), (100.0, 400.0), 650.0, driven=1)
LONG_FILM = PlaceKind("film of 0.8 to 1.5 km", 4, (3.0, 8.0), (800.0, 1500.0), 1500.0)
CLEANED_FILM = PlaceKind("film that the first axles clean", 5, (3.0, 8.0), (100.0, 400.0), 650.0, cleaned=True)
FAIR = PlaceKind("rail of 8 to 15 %", 5, (8.0, 15.0), (100.0, 400.0), 650.0)
WET_STRETCH = PlaceKind("wet stretch amid dry line", 5, None, (200.0, 600.0), 1000.0)
PLACE_KINDS = (FILM, LONG_FILM, CLEANED_FILM, FAIR, WET_STRETCH)


@dataclass(frozen=True, slots=True)
class MapPlace:
    """A place: its kind, its world and the world's family, its number among all places, the film's adhesion under the
    first axle (NaN: there is none), where the film begins and ends, and how long its edges are."""

    kind: str
    world: str
    family: str
    number: int
    low_pct: float
    film_m: tuple[float, float]
    edge_m: float

    @property
    def has_film(self) -> bool:
        """Whether some of its rail is low."""
        return math.isfinite(self.low_pct)


@dataclass(frozen=True, slots=True, kw_only=True)
class PassageRun(Run):
    """A passage over a place, at a held speed. film: the film's curve under each axle."""

    place: MapPlace
    effort: str
    driven: bool
    speed_m_s: float
    film: tuple[CreepCurve, ...]


def map_passages(source: Recipe, scale: float, lot: Lot = TEST) -> Iterator[PassageRun]:
    """Yield every passage of every place: so many places of each kind in each world, one at least."""
    train = source.wheelset if source.wheelset.bogie is not None else load_vehicle("multiple-unit")
    number = 0
    for name in IN_WORLDS:
        world = next(w for w in WORLDS if w.name == name)
        for kind in PLACE_KINDS:
            for at in range(max(round(kind.places * scale), 1)):
                yield from _passages(source, train, world, kind, at, number, lot)
                number += 1


def _passages(
    source: Recipe, train: Wheelset, world: World, kind: PlaceKind, at: int, number: int, lot: Lot
) -> Iterator[PassageRun]:
    """The passages over one place."""
    key = (14, IN_WORLDS.index(world.name), PLACE_KINDS.index(kind), at)
    rng = lot.generator(*key)
    wet, share = at % 2 == 0 and kind is not WET_STRETCH, (0.5 + number * GOLDEN) % 1.0
    low, high = WET_PCT if kind.low_pct is None else kind.low_pct
    target = low + (high - low) * share
    begin, length = kind.around_m + float(rng.uniform(0.0, 100.0)), float(rng.uniform(*kind.film_m))
    edge = SHARP_M if rng.random() < 0.5 else float(rng.uniform(*LONG_EDGE_M))
    better = float(rng.uniform(*CLEANED)) if kind.cleaned else 0.0
    before, after = (_rail(world, train, float(rng.uniform(*(WET_PCT if wet else DRY_PCT))), rng) for _ in range(2))
    films = [_rail(world, train, target * (1.0 + better) ** k, lot.generator(*key, 1)) for k in range(AXLES)]
    rails = [
        rail_table([RailSection(0.0, before), RailSection(begin, film, edge_m=edge),
                    RailSection(begin + length, after, edge_m=edge)])
        for film in films
    ]  # fmt: skip
    spectrum, track_seed = world.irregularity(source.roughness, rng), lot.seed(rng)
    end = begin + length + edge + kind.around_m
    low_pct = math.nan if kind.low_pct is None else target
    place = MapPlace(kind.name, world.name, world.family, number, low_pct, (begin, begin + length), edge)
    for passage in range(kind.ordinary + kind.driven):
        rng, driven = lot.generator(*key, 2, passage), passage >= kind.ordinary
        share = (0.5 + (5 * number + passage) * GOLDEN) % 1.0
        v = MIN_SPEED_M_S + (MAX_SPEED_M_S - MIN_SPEED_M_S) * share
        most = math.inf if driven else MOST_OF_LOW * target
        effort = _effort(passage, driven, most, rng)
        sign = -1.0 if effort == "service" or rng.random() < 0.5 else 1.0
        w, seconds = world.train(train, rng), round(end / v + 1.0, 2)
        times, used = _used(effort, most, seconds, rng)
        torque = tuple(sign * u / 100.0 * w.M_v * GRAVITY * w.r_0 for u in used)
        drive = DriveCourse("torque_N_m", Course(times, torque), Course((0.0,), (CREEP_LIMIT,)))
        axles = [
            AxleScenario(
                number=k + 1, rail=rails[k], drive=drive, track=spectrum, sensors=world.sensing(rng),
                seed=lot.seed(rng), position_m=positions_m(w)[k], track_seed=track_seed,
                axlebox=world.box(rng, world.wider),
            )
            for k in range(AXLES)
        ]  # fmt: skip
        played = scenario(w, seconds, v, axles)
        yield PassageRun(MAP, f"{kind.name}, {world.name}", number, played, ("",) * AXLES, place=place,
                         effort=effort, driven=driven, speed_m_s=v, film=tuple(films))  # fmt: skip


def _rail(world: World, w: Wheelset, available_pct: float, rng: Rng) -> CreepCurve:
    """A curve as the world draws them, with so much adhesion at its peak at AT_M_S."""
    seed = int(rng.integers(2**62))
    low, high = 0.01, 1.2  # friction at zero slip

    def curve(friction: float) -> CreepCurve:
        return world.slope(curve_between(friction), np.random.default_rng(seed))  # the same draw at every friction

    for _ in range(40):
        middle = math.sqrt(low * high)
        is_less = 100.0 * peak(AT_M_S, w.contact, *curve(middle).row())[1] < available_pct
        low, high = (middle, high) if is_less else (low, middle)
    return curve(math.sqrt(low * high))


def _effort(passage: int, driven: bool, most_pct: float, rng: Rng) -> str:
    if driven:
        return str(rng.choice(list(DRIVEN), p=list(DRIVEN.values())))
    borne = [name for name, (least, _) in EFFORTS.items() if least < most_pct]
    return borne[passage % len(borne)]


def _used(effort: str, most_pct: float, seconds: float, rng: Rng) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Times (s) and what is in use (% of the axle load): within the effort's ends, held and changed in turn."""
    low, high = EFFORTS[effort]
    high = min(high, most_pct)
    at, used = 1.0, float(rng.uniform(low, high))
    points = [(0.0, 0.0), (at, used)]
    while at < seconds:
        hold, turn = float(rng.uniform(*HELD_S)), float(rng.uniform(*TURN_S))
        points.append((at + hold, used))
        at, used = at + hold + turn, float(rng.uniform(low, high))
        points.append((at, used))
    times, values = zip(*points, strict=True)
    return times, values
