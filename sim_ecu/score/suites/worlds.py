"""A train's worlds by name, each of a family: as the training draws them, wider, or of a kind that it has not.

Every axle runs in a bogie of its own on a track of its own, so that four axles are four samples of a world; but for
those on one rail, which are two bogies of a train.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from sim_ecu.design import train_worlds as drawn
from sim_ecu.design.brief import Recipe
from sim_ecu.physics.axlebox import QUIET, AxleBox, drawn_box
from sim_ecu.physics.contact import CURVES, CreepCurve, curve_between
from sim_ecu.physics.rail import RailSection, rail_table
from sim_ecu.physics.sensors import BOGIE_FRAME, RECTIFICATION, SENSOR_SETS, Sampling, SensorSet
from sim_ecu.physics.sensors import drawn as drawn_sensors
from sim_ecu.physics.track import SPECTRA, Spectrum
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.scenario import AxleScenario, Course, DriveCourse, Scenario, positions_m
from sim_ecu.play.vehicles import load_vehicle
from sim_ecu.score.suites.nominal import FRICTIONS, GOLDEN, RUN_S, STOP_M_S, spread
from sim_ecu.score.suites.run import (
    AXLES,
    SPEEDS,
    TEST,
    UTILISATIONS,
    Lot,
    Rng,
    Run,
    axle,
    drive,
    one_rail,
    scenario,
)  # fmt: skip

AS_TRAINED, WIDER, UNSEEN, TABLE = "as trained", "wider", "unseen", "for the table"  # families; the last has no goals
WORLD_RUNS = 20  # of each world: enough that more than ten of them are below half of the rail in use
TABLE_RUNS = 8
STOP_S = 18.0  # of full service: to a walking pace
CALM_M_S, CALM_S, RAMP_S = (20.0, 26.0, 32.0, 14.0), 90.0, 10.0
COASTING = 0.05  # of the full service brake, before a stop
COASTING_M_S = (16.0, 28.0)
SLIPPERY = ("C", "E", "D")
VARIED, ALIKE, ONE = "varied", "alike", "one axle's alone"  # torques of axles on one rail
FILMS, FILM_S, FILM_M = ("E", "D", "F"), 4.0, (15.0, 150.0)  # of which curves, after how long, how long
MEMS = SENSOR_SETS["mems"]


def same_curve(curve: CreepCurve, rng: Rng) -> CreepCurve:
    """Leave the curve as its friction has it."""
    return curve


def bent_otherwise(curve: CreepCurve, rng: Rng) -> CreepCurve:
    """A curve of another form: as steep at first, but bent by slip where the family's are by adhesion."""
    return replace(curve, k_A=curve.k_S, k_S=curve.k_A)


@dataclass(frozen=True, slots=True)
class World:
    """A row of the suite. tied: whether the slope of the rail's creep curves is that of their friction; None: it is,
    and neither bound of the mean error is for the row.

    vehicle: a packaged one, whose bogie is taken; load and wheel radius stay those of the design, which a configuration
    knows. off: whether its parameters are. wider: by how much the ranges are stretched. known: the world whose runs
    these are, after minutes of calm running of such a train. together: on one rail; torques
    are VARIED, ALIKE, or of ONE axle. film: there is one on it.
    """

    name: str
    family: str
    tied: bool | None = True
    wider: float = 1.0
    vehicle: str | None = None
    off: bool = True
    law: Callable[[CreepCurve, Rng], CreepCurve] = same_curve
    curved: bool = False
    spectrum: str | None = None
    sensors: Callable[[Rng, float], SensorSet] = field(default=lambda rng, wider: MEMS)
    box: Callable[[Rng, float], AxleBox] = field(default=lambda rng, wider: QUIET)
    coasting: bool = False
    stop: bool = False
    known: str = ""
    together: str = ""
    film: bool = False

    def play(self, source: Recipe, lot: Lot, number: int) -> Run:
        """One of its runs. Those of one number have the same speed, friction, torque and seeds in every world."""
        rng, own = lot.generator(12, number), lot.generator(13, number)
        low, high = SPEEDS if not self.coasting else COASTING_M_S
        v = STOP_M_S if self.stop else low + (high - low) * ((0.5 + number * GOLDEN) % 1.0)
        # a lone wheelset's design is judged in a train, too
        train = source.wheelset if source.wheelset.bogie is not None else load_vehicle("multiple-unit")
        w = self.train(train, own)
        axles, names = list[AxleScenario](), []
        for i in range(AXLES):
            letter = str(rng.choice(SLIPPERY if self.coasting or self.stop else list(CURVES)))
            between = math.exp(rng.uniform(math.log(FRICTIONS[0]), math.log(FRICTIONS[1])))
            share = float(rng.uniform(*UTILISATIONS)) * (-1.0 if rng.random() < 0.3 else 1.0)
            known = self.coasting or self.stop or (number + i) % 2 == 0
            curve = self.slope(CURVES[letter] if known else curve_between(between), own)
            sensors = self.sensing(own)
            rail, track = rail_table(self._rail(curve, v, own)), self.irregularity(source.roughness, own)
            drive_of = self._drive(w, share if self.together != ONE or i == number % AXLES else 0.0)
            if self.together and axles:
                rail, track = axles[0].rail, axles[0].track
                drive_of = axles[0].drive if self.together == ALIKE else drive_of
            one = axle(lot, i, rail, drive_of, track, rng, sensors, self.box(own, self.wider))
            if self.together:
                one = replace(one, position_m=positions_m(w)[i], track_seed=(axles or [one])[0].seed)
            axles.append(one)
            names.append(letter if known else "between")
        seconds = STOP_S if self.stop else RUN_S
        course = Course((0.0, seconds), (v, v - (drawn.BRAKES_M_S2 * seconds if self.stop else 0.0)))
        before = self._calm(train) if self.known else None
        return Run("worlds", self.name, number, scenario(w, seconds, course, axles), tuple(names), before=before)

    def _calm(self, train: Wheelset) -> Scenario:
        """Six minutes on dry, straight track at four speeds: a bogie of the vehicle as it is, on whatever it runs."""
        vehicle, rail = replace(self, off=False).train(train, np.random.default_rng(0)), one_rail(curve_between(0.35))
        assert vehicle.bogie is not None
        axles = [
            AxleScenario(
                number=k + 1, rail=rail, drive=drive("utilisation", (0.0, 0.05)), track=SPECTRA["erri-low"],
                sensors=MEMS, seed=k, position_m=-k * vehicle.bogie.wheelbase_m, track_seed=9,
            )
            for k in range(2)
        ]  # fmt: skip
        times = [t for k in range(len(CALM_M_S)) for t in (k * CALM_S + RAMP_S, (k + 1) * CALM_S)]
        course = Course(tuple(times), tuple(v for speed in CALM_M_S for v in (speed, speed)))
        return scenario(vehicle, times[-1], course, axles)

    def train(self, w: Wheelset, rng: Rng) -> Wheelset:
        """Draw the vehicle, from that of the design."""
        if self.vehicle is not None:
            other = load_vehicle(self.vehicle)
            assert other.bogie is not None
            body = 2 * (w.M_v - other.m_w) - other.bogie.frame_mass_kg
            w = replace(w, m_w=other.m_w, I_w=other.I_w, bogie=replace(other.bogie, body_mass_kg=body))
        return drawn.off_vehicle(w, rng, self.wider) if self.off else w

    def _rail(self, curve: CreepCurve, v: float, rng: Rng) -> list[RailSection]:
        if self.film:
            low, begins = CURVES[str(rng.choice(FILMS))], FILM_S * v
            edge, long = (math.exp(rng.uniform(*np.log(limits))) for limits in (drawn.EDGE_M, FILM_M))
            return [
                RailSection(0.0, curve), RailSection(begins, low, edge_m=edge),
                RailSection(begins + edge + long, curve, edge_m=edge),
            ]  # fmt: skip
        if not self.curved:
            return [RailSection(0.0, curve)]
        curvature, cant = drawn.curve_and_cant(v, rng, self.wider)
        begins, ramp = v * 3.0, v * 2.0
        return [RailSection(0.0, curve), RailSection(begins, curve, curvature, cant, transition_m=ramp)]

    def _drive(self, w: Wheelset, share: float) -> DriveCourse:
        full = -drawn.BRAKES_M_S2 * w.M_v * w.r_0
        if self.coasting:
            return drive("torque_N_m", (0.0, 0.0), (0.5, COASTING * full))
        if self.stop:
            return drive("torque_N_m", (0.0, 0.0), (1.0, full))
        return drive("utilisation", (0.0, 0.0), (0.5, share))

    def slope(self, curve: CreepCurve, rng: Rng) -> CreepCurve:
        """Draw a curve of another slope, and of the world's law; the friction stays."""
        curve = self.law(curve, rng)
        if self.tied is False:
            curve = replace(curve, k_A=curve.k_A * drawn.off(rng, drawn.OFF_K_A * self.wider))
            curve = drawn.off_slope(curve, drawn.slope_factor(rng, self.wider))
        return curve

    def sensing(self, rng: Rng) -> SensorSet:
        """Draw the sensors."""
        sensors = self.sensors(rng, self.wider)
        return drawn.off_sensors(sensors, rng, self.wider) if self.off else sensors

    def irregularity(self, roughness: tuple[float, float], rng: Rng) -> Spectrum:
        """Draw the track, from the range of the design's."""
        drawn_track = drawn.track(rng, roughness, wider=self.wider)
        return drawn_track if self.spectrum is None else SPECTRA[self.spectrum]


def _flats(rng: Rng, wider: float) -> AxleBox:
    """An axle box as the training draws them, and a wheel flat, which it never has."""
    return replace(drawn_box(rng, wider), flat_m_s2=math.exp(rng.uniform(math.log(20.0), math.log(200.0))))


def _inside(corner_hz: float, order: int, rectified: float = 1.0) -> Callable[[Rng, float], SensorSet]:
    sampling = Sampling(4000.0, corner_hz, order, rectification=rectified * RECTIFICATION)
    return lambda rng, wider: replace(SENSOR_SETS["mems-axle-box"], sampling=sampling)


def _shaken(rms: float) -> Callable[[Rng, float], AxleBox]:
    box = AxleBox(vibration_m_s2=rms, band_hz=(20.0, 1000.0), vibration_power=2.0, gyro_per_m_s2=2e-4)
    return lambda rng, wider: box


def _friction(gain: float) -> Callable[[Rng, float], SensorSet]:
    return lambda rng, wider: replace(MEMS, friction_share=0.5, friction_gain=gain)


# Cases in which one thing is swept: their figures are for a table, whatever they are.
SWEPT = (
    World("track: fra-5", TABLE, spectrum="fra-5"),
    World("mounted on the bogie's frame", TABLE, sensors=lambda rng, wider: replace(MEMS, mounting=BOGIE_FRAME)),
    *(
        World(f"half of the torque by friction, {word}", TABLE, stop=True, sensors=_friction(gain))
        for gain, word in ((1.1, "read 10 % high"), (0.6, "read 40 % low"), (1.4, "read 40 % high"), (0.0, "missing"))
    ),
    *(
        World(f"vibration of {rms:g} m/s², low-pass of {corner_hz:g} Hz, order {order}", TABLE,
              sensors=_inside(corner_hz, order), box=_shaken(rms))
        for rms in (2.0, 10.0, 30.0)
        for corner_hz, order in ((40.0, 4), (80.0, 2))
    ),
    *(
        World(f"vibration of 10 m/s², rectified {k:g} times as much", TABLE, sensors=_inside(40.0, 4, k),
              box=_shaken(10.0))
        for k in (0.0, 3.0)
    ),
)  # fmt: skip
WORLDS = (
    World("its own vehicle", AS_TRAINED, off=False),
    World("vehicle and sensors off", AS_TRAINED),
    World("slopes untied", AS_TRAINED, tied=False),
    World("curves with cant", AS_TRAINED, tied=None, curved=True),
    World("sampled inside, shaken", AS_TRAINED, tied=None, sensors=drawn_sensors, box=drawn_box),
    World("coasting before a stop", AS_TRAINED, tied=None, coasting=True),
    World("stops by full service", AS_TRAINED, tied=None, stop=True),
    World("all off × 1.5", WIDER, wider=1.5, curved=True),
    World("slopes untied × 1.5", WIDER, tied=False, wider=1.5),
    World("vehicle: another one's bogie", UNSEEN, vehicle="high-speed-coach"),
    World("… after minutes of calm running", UNSEEN, vehicle="high-speed-coach", known="vehicle: another one's bogie"),
    World("track: china-hs", UNSEEN, spectrum="china-hs"),
    World("vibration: wheel flats", UNSEEN, sensors=drawn_sensors, box=_flats),
    World("slopes: curves bent otherwise", UNSEEN, law=bent_otherwise),
)
# Of these each axle alone stands beside.
ON_ONE_RAIL = (
    *(World(f"on one rail, torques {t}", TABLE, together=t) for t in (VARIED, ALIKE, ONE)),
    World("on one rail, slopes untied", TABLE, tied=False, together=VARIED),
    World("on one rail, shaken", TABLE, sensors=drawn_sensors, box=drawn_box, together=VARIED),
    World("on one rail with a film", TABLE, together=VARIED, film=True),
)
EVERY = (*WORLDS, *SWEPT, *ON_ONE_RAIL)


def worlds(source: Recipe, scale: float, lot: Lot = TEST) -> Iterator[Run]:
    """So many runs of each world."""
    places = [w.name for w in EVERY if not w.known]
    for world in EVERY:
        place = places.index(world.known or world.name)
        for number in spread(scale, TABLE_RUNS if world in SWEPT else WORLD_RUNS, place):
            yield world.play(source, lot, number)
