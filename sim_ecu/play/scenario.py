"""Scenarios as TOML: the rail along the distance, speed, torque or creep, track, sensors, seed, duration, faults.

All axles run on one track: axle 1's irregularity and joints are those that the others meet when they get there. An
`[axle.N]` with a `seed` of its own runs on a track of its own, and so do axles whose track_seed is None.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_ecu.physics.axlebox import QUIET, AxleBox
from sim_ecu.physics.contact import CURVES, CreepCurve, curve_between
from sim_ecu.physics.rail import BLEND_M as BLEND_M
from sim_ecu.physics.rail import RailSection
from sim_ecu.physics.rail import rail_table as rail_table
from sim_ecu.physics.sensors import AXLE_BOX, SENSOR_SETS, Sampling, SensorSet, accelerometer
from sim_ecu.physics.track import SPECTRA, Spectrum
from sim_ecu.physics.wheelset import Command, Wheelset
from sim_ecu.play import scenario_keys as keys
from sim_ecu.play.encoder import SAMPLE_US
from sim_ecu.play.faults import Fault, read_fault
from sim_ecu.play.vehicles import DEFAULT_VEHICLE, load_vehicle, read_vehicle
from sim_ecu.resources import SCENARIOS, TO_DRIVE
from wrcd.config.keys import Choice, Number, names
from wrcd.config.settings import Section, read_whole, suggest
from wrcd.core.terms import MAX_AXLES
from wrcd.errors import InputError

FloatArray = NDArray[np.float64]
NYQUIST_HZ = 0.5e6 / SAMPLE_US
# Where the first axles of the bogies of axles 1 … 8 stand along the train: two vehicles, 19 m from pivot to pivot; a
# vehicle is 26.4 m long.
BOGIES_M = (0.0, -19.0, -26.4, -45.4)
WHEELBASE_M = 2.5  # where no bogie says another


def positions_m(wheelset: Wheelset) -> tuple[float, ...]:
    """Where axles 1 … 8 of a vehicle stand along its train."""
    wheelbase = WHEELBASE_M if wheelset.bogie is None else wheelset.bogie.wheelbase_m
    return tuple(at - behind for at in BOGIES_M for behind in (0.0, wheelbase))


@dataclass(frozen=True, slots=True)
class Course:
    """A quantity over time: constant, or linear between the rows of [[t, value], …]; flat outside."""

    times_s: tuple[float, ...]
    values: tuple[float, ...]

    def at(self, t: FloatArray) -> FloatArray:
        """Values at times t."""
        out: FloatArray = np.interp(t, self.times_s, self.values)
        return out


@dataclass(frozen=True, slots=True)
class DriveCourse:
    """What the driver and the traction controller want; exactly one demand. Negative values brake."""

    demand: str
    course: Course
    limit_of_peak: Course

    def command(self, t: FloatArray) -> dict[str, FloatArray]:
        """Columns of a Command at times t."""
        name = "torque" if self.demand == "torque_N_m" else self.demand
        return {name: self.course.at(t), "limit_of_peak": self.limit_of_peak.at(t)}


@dataclass(frozen=True, slots=True)
class AxleScenario:
    """One wheelset.

    seed: of its sensors' noise and its vibration. position_m: ahead of the train's own distance; followers are behind.
    track_seed: of the irregularity and the joints, shared by axles on one track; None for a track of its own.
    """

    number: int
    rail: FloatArray
    drive: DriveCourse
    track: Spectrum
    sensors: SensorSet
    seed: int
    position_m: float
    track_seed: int | None = None
    axlebox: AxleBox = QUIET

    @property
    def runs_on(self) -> int:
        """The seed of its track."""
        return self.seed if self.track_seed is None else self.track_seed


@dataclass(frozen=True, slots=True)
class Scenario:
    """A played situation. speed is the profile where it is held, else only its first value counts."""

    name: str
    title: str
    duration_s: float
    speed: Course
    hold_speed: bool
    wheelset: Wheelset
    axles: tuple[AxleScenario, ...]
    faults: tuple[Fault, ...] = ()

    def commands(self, t: FloatArray) -> Command:
        """The command of all axles for samples that end at times t."""
        columns = [a.drive.command(t) for a in self.axles]
        nothing = np.full(len(t), math.nan)
        return Command(*(np.column_stack([c.get(f, nothing) for c in columns]) for f in Command._fields))

    def held_speed(self, t: FloatArray) -> FloatArray:
        """The speed to hold at times t; NaN where the vehicle moves freely."""
        return self.speed.at(t) if self.hold_speed else np.full(len(t), math.nan)


def packaged(folder: Path = SCENARIOS) -> list[str]:
    """Names of the scenarios that come along: to play, or those of the folder TO_DRIVE."""
    return sorted(p.stem for p in folder.glob("*.toml"))


def load_scenario(name: str) -> Scenario:
    """A packaged scenario by its name, or a file by its path. Raises InputError."""
    return read_whole(path_of(name), read_scenario)


def path_of(name: str | Path, to_drive: bool = False) -> Path:
    """The file of a scenario to play or to drive. Raises InputError for a name that is none."""
    folder, other = (TO_DRIVE, SCENARIOS) if to_drive else (SCENARIOS, TO_DRIVE)
    path = folder / f"{name}.toml"
    if path.exists():
        return path
    path = Path(name)
    if path.suffix != ".toml":
        known = packaged(folder)
        every = f"packaged: {', '.join(known)}"
        hint = suggest(str(name), known) or f"{every}; or give a path to a .toml file"
        if (other / f"{name}.toml").exists():
            hint = (
                f"{name} is one to play: its torques are fixed; {every}" if to_drive
                else f"{name} is one to drive: a controller decides its torques; sim-ecu drive {name}"
            )  # fmt: skip
        raise InputError(f"there is no scenario {'to drive ' * to_drive}{str(name)!r}", hint=hint)
    return path


def read_scenario(top: Section, name: str) -> Scenario:
    """Check everything and build the scenario."""
    wheelset, axles = read_train(top)
    scenario = Scenario(
        name=name,
        title=keys.TITLE.read(top) or name,
        duration_s=keys.DURATION.of(top),
        speed=Course(*keys.SPEED.read(top)),
        hold_speed=keys.HOLD_SPEED.read(top),
        wheelset=wheelset,
        axles=axles,
        faults=read_faults(top, axles),
    )
    top.done()
    return scenario


def read_train(top: Section, drive: DriveCourse | None = None) -> tuple[Wheelset, tuple[AxleScenario, ...]]:
    """The vehicle and its axles; drive as of read_axles()."""
    for key in (keys.OF_AXLE, *keys.VEHICLE_TABLES, *keys.SHARED):
        if drive is None or key is not keys.DRIVE:
            top.raw(key.name)  # known, whatever is wrong before they are read
    read: list[Wheelset] = []
    with top.collected():
        read.append(read_vehicle(top))
    wheelset = read[0] if read else load_vehicle(DEFAULT_VEHICLE)  # to go on with
    with top.collected():
        return wheelset, read_axles(top, wheelset, drive)
    return wheelset, ()  # there is a mistake in them


def read_faults(top: Section, axles: Sequence[AxleScenario]) -> tuple[Fault, ...]:
    """[[fault]], of axles that are named. axles: those that could be read."""
    faults: list[Fault] = []
    numbers = sorted(axle_numbers(top)) if axles else []
    for f in top.sections("fault"):
        with f.collected():
            faults += [read_fault(f, numbers)] if numbers else []
    return tuple(faults)


def axle_numbers(top: Section) -> list[int]:
    """As `axles` has them; [1] without it. Raises InputError."""
    given = top.raw("axles")
    numbers = [1] if given is None else given
    if (
        not isinstance(numbers, list)
        or not 1 <= len(numbers) <= MAX_AXLES
        or not all(type(n) is int and 1 <= n <= MAX_AXLES for n in numbers)
    ):
        raise top.error(f"takes one to {MAX_AXLES} of the numbers 1 … {MAX_AXLES}, not {numbers!r}", "axles")
    if len(set(numbers)) != len(numbers):
        raise top.error(f"{numbers!r} names an axle twice", "axles")
    return numbers


def read_axles(top: Section, wheelset: Wheelset, drive: DriveCourse | None = None) -> tuple[AxleScenario, ...]:
    """The axles of a vehicle in the order of their numbers. drive: that of each, where no table may give one."""
    numbers = axle_numbers(top)
    # what an axle may have otherwise
    common = {"rail": None, "drive": None, "track": SPECTRA["good"], "sensors": SENSOR_SETS["mems"],
              "axlebox": QUIET}  # fmt: skip
    common = _settings(top, common, drive)
    seed, first, places = _seed(top, 1), min(numbers), positions_m(wheelset)
    overrides = top.section("axle")
    for key in overrides:
        if key not in {str(n) for n in numbers}:
            overrides.refuse(f"axle {key} is not among axles = {numbers}", key)
    axles = []
    for number in sorted(numbers):
        own = overrides.section(str(number))
        with own.collected():
            settings = _settings(own, common, drive)
            if wheelset.bogie is None and settings["sensors"].mounting != AXLE_BOX:
                raise own.error("needs a vehicle with bogies", "mounting", "leave it out, or name another vehicle")
            for missing in ("rail", "drive"):
                if settings[missing] is None and missing not in own and missing not in top:
                    demanded = " and [drive] utilisation = 0.3" if drive is None else ""
                    hint = f'write e.g. [[rail]] curve = "A"{demanded}'
                    raise own.error(f"axle {number} has no {missing}", missing, hint)
            axles.append(AxleScenario(
                number=number,
                seed=_seed(own, seed * 16 + number),
                position_m=keys.POSITION.of(own, places[number - 1] - places[first - 1]),
                track_seed=None if "seed" in own else seed * 16 + first,
                **settings,
            ))  # fmt: skip
            own.done()
    return tuple(axles)


def _settings(s: Section, common: Mapping[str, Any], drive: DriveCourse | None) -> dict[str, Any]:
    """Return a table's settings of an axle; common: where it has none."""
    read: dict[str, Callable[[Section], Any]] = {"rail": _rail, "track": _track, "sensors": _sensors}
    if drive is None:
        read["drive"] = _drive
    own: dict[str, Any] = {} if drive is None else {"drive": drive}
    for key, of in read.items():
        if s.raw(key) is not None:
            with s.collected():
                own[key] = of(s)
    settings = {**common, **own}
    sampling = settings["sensors"].sampling
    nyquist_hz = NYQUIST_HZ if sampling is None else 0.5 * sampling.rate_hz
    return settings | {"axlebox": _axlebox(s.section("axlebox"), common["axlebox"], nyquist_hz)}


def _seed(section: Section, default: int) -> int:
    seed = section.get("seed", int, default)
    if seed < 0:
        section.refuse(f"must not be negative, is {seed}", "seed")
        return default
    return seed


def _rail(section: Section) -> FloatArray:
    """Sections of rail, each from a distance on."""
    parts: list[RailSection] = []
    mistakes = section.mistakes
    for place, part in enumerate(section.sections("rail")):
        with part.collected():
            parts.append(_rail_section(part, place, parts))
    if not parts and section.mistakes > mistakes:
        raise section.newest_mistake
    if not parts:
        raise section.error("needs at least one section", "rail", 'write [[rail]] with curve = "A"')
    return rail_table(parts)


def _rail_section(part: Section, place: int, before: Sequence[RailSection]) -> RailSection:
    mistakes = part.mistakes
    start, curve, radius, cant = keys.FROM.of(part), _curve(part), keys.RADIUS.of(part), keys.CANT.of(part)
    if not place and "transition_m" in part:
        part.refuse("the first section has none to come from", "transition_m", "begin with a straight [[rail]]")
    transition, edge = keys.TRANSITION.of(part), keys.EDGE.of(part)
    part.done()
    if part.mistakes > mistakes:
        raise part.newest_mistake
    if before and start <= (before[-1].settled_m if len(before) > 1 else before[0].from_m):
        raise part.error(
            f"must grow from section to section, {start:g} does not",
            "from_m",
            f"the section before is settled at {before[-1].settled_m:g} m" if len(before) > 1 else "",
        )
    return RailSection(start, curve, 1 / radius if radius else 0.0, cant, transition, edge)


def _curve(part: Section) -> CreepCurve:
    """A letter of the study, or mu_0 for a curve of the family between them, or all five parameters."""
    if "curve" in part:
        return CURVES[keys.CURVE.value(part)]
    mu_0 = keys.MU_0.of(part)
    base = curve_between(mu_0)
    rest: dict[str, Any] = {key.name: key.of(part, getattr(base, key.name)) for key in keys.LAW}
    return replace(base, **rest)


def _drive(section: Section) -> DriveCourse:
    mistakes = section.mistakes
    d = section.section("drive")
    if section.mistakes > mistakes:
        raise section.newest_mistake
    given = [key for key in keys.DEMANDS if key.name in d]
    if len(given) != 1:
        named = ", ".join(key.name for key in given)
        raise d.error(f"takes exactly one of {', '.join(names(keys.DEMANDS))}; found {named or 'none'}")
    drive = DriveCourse(given[0].name, Course(*given[0].read(d)), Course(*keys.CREEP_LIMIT.read(d)))
    d.done()
    return drive


def _track(section: Section) -> Spectrum:
    """track: the name of a spectrum, or the roughness of alignment alone."""
    value = section.raw("track")
    if isinstance(value, str):
        return SPECTRA[Choice("track", "", tuple(SPECTRA), "good").value(section)]
    return Spectrum.of_roughness(Number("track", "", 0.0, 1e-4, 0.0).value(section))


def _sensors(section: Section) -> SensorSet:
    """sensors: the name of a set, or a table of its kind and biases."""
    value = section.raw("sensors")
    if isinstance(value, str):
        return SENSOR_SETS[Choice("sensors", "", tuple(SENSOR_SETS), "mems").value(section)]
    s = section.section("sensors")
    base = SENSOR_SETS[keys.KIND_OF_SENSORS.value(s)]
    sampling = _sampling(s, base.sampling)
    if sampling is not None and base.sampling is not None and sampling.range_m_s2 != base.sampling.range_m_s2:
        base = replace(base, lat_accel=accelerometer(sampling.range_m_s2))
    out = replace(
        base.biased(keys.YAW_BIAS.of(s), keys.LAT_BIAS.of(s), keys.TORQUE_BIAS.of(s)),
        speed=replace(base.speed, gain=keys.SPEED_GAIN.of(s)),
        sampling=sampling,
        mounting=keys.MOUNTING.value(s),
        g_sensitivity=keys.G_SENSITIVITY.of(s),
        misalignment_rad=keys.MISALIGNMENT.of(s),
        lateral_lead_s=keys.LATERAL_LEAD.of(s),
        jitter_s=keys.JITTER.of(s),
        friction_share=keys.FRICTION_SHARE.of(s),
        friction_gain=keys.FRICTION_GAIN.of(s),
    )
    s.done()
    return out


def _sampling(s: Section, base: Sampling | None) -> Sampling | None:
    """Return the inner sampling of a set as a table changes it."""
    rate, corner, order, limit, rectified, of_gyro = (key.read(s) for key in keys.INNER)
    if base is None:
        for key in keys.INNER:
            if key.name in s:
                raise s.error("the set does not sample inside", key.name, 'write kind = "mems-axle-box"')
        return None
    if rate is not None and rate % (2 * NYQUIST_HZ):
        raise s.error(f"takes a multiple of {2 * NYQUIST_HZ:g}, not {rate}", keys.INNER_RATE.name)
    own: dict[str, Any] = {
        "rate_hz": rate, "corner_hz": corner, "order": order, "range_m_s2": limit, "rectification": rectified,
        "gyro_rectification": of_gyro,
    }  # fmt: skip
    try:
        return replace(base, **{name: value for name, value in own.items() if value is not None})
    except ValueError as e:
        raise s.error(str(e), keys.CORNER.name) from None


def _axlebox(section: Section, base: AxleBox, nyquist_hz: float) -> AxleBox:
    """[axlebox]: what differs from base. nyquist_hz: of the sensors that feel it."""
    out = AxleBox(
        vibration_m_s2=keys.VIBRATION.of(section, base.vibration_m_s2),
        band_hz=_band(section, base.band_hz, nyquist_hz),
        vibration_power=keys.BAND_POWER.of(section, base.vibration_power),
        joint_m_s2=keys.JOINT.of(section, base.joint_m_s2),
        joint_every_m=keys.JOINT_EVERY.of(section, base.joint_every_m),
        joint_s=keys.JOINT_S.of(section, base.joint_s),
        joint_shape=Choice("joint_shape", "", keys.JOINT_SHAPE.options, base.joint_shape).value(section),
        crossing_m_s2=keys.CROSSING.of(section, base.crossing_m_s2),
        crossing_at_m=keys.CROSSING_AT.of(section, base.crossing_at_m),
        corrugation_m_s2=keys.CORRUGATION.of(section, base.corrugation_m_s2),
        corrugation_wavelength_m=keys.WAVELENGTH.of(section, base.corrugation_wavelength_m),
        corrugation_m=keys.CORRUGATED.read(section) or base.corrugation_m,
        flat_m_s2=keys.FLAT.of(section, base.flat_m_s2),
        flat_every_m=keys.FLAT_EVERY.of(section, base.flat_every_m),
        gyro_per_m_s2=keys.GYRO_FEELS.of(section, base.gyro_per_m_s2),
    )
    section.done()
    return out


def _band(section: Section, default: tuple[float, float], nyquist_hz: float) -> tuple[float, float]:
    value = section.raw("band_hz")
    if value is None:
        value = list(default)
    if not isinstance(value, list) or len(value) != 2 or not all(type(f) in (int, float) for f in value):
        raise section.error(f"takes [lowest, highest], not {value!r}", "band_hz", "e.g. [20, 100]")
    low, high = float(value[0]), float(value[1])
    # not narrower than a piece of vibration resolves
    if not 0 <= low <= min(high, nyquist_hz) - 0.1:
        raise section.error(
            f"takes a band that rises by 0.1 Hz at least, from 0 or more to {nyquist_hz:g} Hz, not {value!r}",
            "band_hz",
            "what lies above the sampling's own limit is left out",
        )
    return low, high
