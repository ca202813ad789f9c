"""The rig for a bench script: make one, step it, set demands, read sensors, truth and adhesion, attach a controller.

    from sim_ecu.bench import Bench

    bench = Bench("emergency-greasy", daemon=True)
    for step in bench:
        bench.demand(1, torque_N_m=-8_000.0)
    print(bench.figures())

Nothing here has a clock or a bus: a step is 5 ms of virtual time, and the same calls give the same numbers. Units stand
in the names (`_N_m`, `_m_s`, `_bar`); adhesion is a ratio (0.15, not 15 %). What is wrong in a scenario, a
configuration or a call is an `InputError` that names it.
"""

import math
import numbers
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sim_ecu.loop.control.adhesion_consumer import HALF_WIDTHS, TIMEOUT_CYCLES, Facts
from sim_ecu.loop.control.adhesion_consumer import TrainController as Controller
from sim_ecu.loop.control.slip_controller import NAMES, make_controller
from sim_ecu.loop.drive_scenario import DriveScenario, load_drive_scenario, read_drive_scenario
from sim_ecu.loop.lockstep import ON_TIME, Listener, Lockstep, Timing
from sim_ecu.loop.ride_figures import Figures, judge
from sim_ecu.loop.rig import Step
from sim_ecu.loop.rig_messages import rig_message
from sim_ecu.physics.actuators import Valve
from sim_ecu.play.encoder import SAMPLE_US, databases
from sim_ecu.play.mapped import MappedTrain, Train
from sim_ecu.play.scenario import Scenario, path_of
from sim_ecu.play.train import PACKAGED, AdhesionReader, placed
from wrcd.bus.dbc import Message, find_message
from wrcd.config.config import load_config, load_packaged
from wrcd.config.section import Section, TomlSource
from wrcd.config.settings import read_whole, suggest
from wrcd.core.configuration import Config
from wrcd.errors import InputError

__all__ = [
    "Adhesion", "Bench", "Controller", "DriveScenario", "Figures", "InputError", "Sensors", "Step", "Timing",
    "Truth", "Valve", "scenario",
]  # fmt: skip

STEP_S = SAMPLE_US * 1e-6
KEYWORDS = "keyword arguments"  # what errors call them


@dataclass(frozen=True, slots=True)
class Truth:
    """What is true of an axle after a step. Torque and adhesion in use are means of the step, signed as driven."""

    mu_available: float
    mu_used: float
    slip_m_s: float  # wheel less ground
    wheel_m_s: float
    speed_m_s: float  # of the train over ground
    torque_N_m: float  # all together: traction, electric and friction brake
    pressure_bar: float


@dataclass(frozen=True, slots=True)
class Sensors:
    """What the newest frames of an axle and its train say, with noise and faults; None: none has come yet."""

    yaw_rate_rad_s: float | None
    lateral_acceleration_m_s2: float | None
    torque_N_m: float | None
    vehicle_speed_m_s: float | None
    wheel_speed_m_s: float | None
    pressure_bar: float | None


@dataclass(frozen=True, slots=True)
class Adhesion:
    """The newest Adhesion frame of an axle. Words and numbers are None where the configuration does not send them.

    validity: "Valid", "Degraded", "NotAvailable" or "Error". half_width: of the 90 % interval around mu_available; None
    if it is wider than any that the frame can state. age_s: since the frame, not of its inputs.
    """

    validity: str | None
    mu_available: float | None
    mu_used: float | None
    half_width: float | None
    surface: str | None
    contact_state: str | None
    age_s: float
    max_age_s: float

    @property
    def valid(self) -> bool:
        """Whether it may be used: Valid, with a number, and no older than its time-out."""
        return self.validity == "Valid" and self.mu_available is not None and self.age_s <= self.max_age_s


def scenario(
    name: str | Path | None = None, *, rail: str | Sequence[Mapping[str, Any]] | None = None,
    demand: float | Sequence[Sequence[float]] | None = None, **keys: Any,
) -> DriveScenario:  # fmt: skip
    """A scenario to drive: a packaged name or a TOML file, with some keys otherwise; or made of keys alone.

    keys are those of docs/reference/scenario.md, tables are dictionaries: `axles=[1, 2], speed_m_s=20.0,
    actuators={"full_brake_N_m": 18e3}`. rail: sections, or the letter of a creep curve for one all along. demand: the
    driver's share of the full effort (-1 … 1, braking negative), or rows of [s, share]. Raises InputError.
    """
    data: dict[str, Any] = {}
    if name is not None:
        path = path_of(name, to_drive=True)
        read_whole(path, read_drive_scenario)  # what is wrong in it is reported with its line
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    data |= keys
    if rail is not None:
        data["rail"] = [{"curve": rail}] if isinstance(rail, str) else [dict(part) for part in rail]
    if demand is not None:
        data["driver"] = {"demand": demand if isinstance(demand, int | float) else [list(row) for row in demand]}
    return read_drive_scenario(
        Section(data, TomlSource(KEYWORDS, {}, None), ()), "bench" if name is None else path.stem
    )


class Bench:
    """A rig, and beside it what is requested: wrcd's core, a controller; all on one virtual bus.

    what: a packaged name, a TOML file or a `scenario()`. daemon: True for wrcd with its packaged configuration, a
    configuration of its own as a path, or none. controller: one by name ("none", "thresholds"), an object with
    the two methods of `Controller`, or None: then `demand` sets each axle's demand; an axle whose demand is
    not set has no traction and brakes as the driver demands, as without a controller on a bus. with_adhesion: the named
    controller receives the daemon's frames. on_frame: called with (us from the start, id, data) of every data frame.
    timing: when in its cycle the controller acts, and how late its demands come. Raises InputError.
    """

    def __init__(
        self, what: str | Path | DriveScenario, *, daemon: bool | str | Path = False,
        controller: str | Controller | None = None, with_adhesion: bool = False, on_frame: Listener | None = None,
        timing: Timing = ON_TIME,
    ) -> None:  # fmt: skip
        self.scenario = what if isinstance(what, DriveScenario) else load_drive_scenario(what)
        self.steps: list[Step] = []  # so far
        config = _configuration(daemon, self.scenario.train)
        if with_adhesion and config is None:
            raise InputError("with_adhesion needs a daemon", hint="daemon=True")
        if isinstance(controller, str):
            if controller not in NAMES:
                hint = suggest(controller, NAMES) or f"there are {', '.join(NAMES)}"
                raise InputError(f"there is no controller {controller!r}", hint=hint)
            controller = make_controller(controller, Facts.of(self.scenario), config if with_adhesion else None)
        elif with_adhesion:
            raise InputError("with_adhesion is of a controller by name", hint='controller="thresholds"')
        self._on_frame, self._controlled = on_frame, controller is not None
        self._newest: dict[int, tuple[int, bytes]] = {}  # by id: when, and its data
        wheelset = self.scenario.train.wheelset
        train: Train = PACKAGED if config is None or daemon is True else MappedTrain(config, wheelset)
        self._run = Lockstep(self.scenario, controller, config, self._take, sensors=True, train=train, timing=timing)
        self._readers: dict[int, tuple[Message, AdhesionReader, float]] = {}  # and the time-out, s
        if config is not None:
            for axle in config.axles:
                message = find_message(config.database, axle.adhesion.message)
                timeout_s = TIMEOUT_CYCLES * axle.adhesion.cycle_us * 1e-6
                self._readers[axle.number] = message, AdhesionReader(message, axle.adhesion), timeout_s

    @property
    def axles(self) -> list[int]:
        """The axles' numbers."""
        return self.scenario.axles

    @property
    def time_s(self) -> float:
        """Since the start."""
        return self._run.rig.time_us * 1e-6

    @property
    def over(self) -> bool:
        """Whether the scenario's time is up, or its train slower than stop_m_s."""
        return self._run.over

    @property
    def unit_adhesion_N_m(self) -> float:
        """Torque at a wheelset that takes an adhesion of 1: both wheels' load times radius. mu times this is torque."""
        w = self.scenario.train.wheelset
        return 2.0 * w.normal_N * w.r_0

    @property
    def full_brake_N_m(self) -> float:
        """Torque at a wheelset that the driver's share of -1 demands."""
        return self.scenario.actuators.full_brake_N_m

    @property
    def full_traction_N_m(self) -> float:
        """Torque at a wheelset that the driver's share of 1 demands."""
        return self.scenario.actuators.drive.max_traction_N_m

    def step(self) -> Step:
        """5 ms on, also beyond the scenario's end. Returns the train as it is then."""
        self.steps.append(self._run.step())
        return self.steps[-1]

    def __iter__(self) -> Iterator[Step]:
        """Steps until the run is over."""
        while not self.over:
            yield self.step()

    def run(self, seconds: float = math.inf) -> Figures:
        """Steps for so long, or until the run is over. Returns the figures so far. Raises InputError for no number."""
        if not _is_number(seconds) or math.isnan(seconds):
            raise InputError(f"takes seconds, not {seconds}", key="seconds")
        end_s = self.time_s + seconds - 0.5 * STEP_S
        while not self.over and self.time_s < end_s:
            self.step()
        return self.figures()

    def demand(self, axle: int, torque_N_m: float, valve: Valve = Valve.FILL) -> None:
        """Set an axle's demand, held until it is set again: drive torque (traction positive, electric brake
        negative), and what its brake valve does. A driver who brakes gets no traction. Raises InputError for an axle or
        a valve that is not there, no number, or where a controller demands."""
        if self._controlled:
            raise InputError("the attached controller demands here", hint="Bench(…) without controller=")
        if not _is_number(torque_N_m) or not math.isfinite(torque_N_m):
            raise InputError(f"takes a finite torque, not {torque_N_m}", key="torque_N_m")
        if valve not in list(Valve):
            raise InputError(f"takes {', '.join(f'Valve.{v.name}' for v in Valve)}, not {valve!r}", key="valve")
        self._place(axle)
        self._run.rig.demand(axle, float(torque_N_m), Valve(valve))

    def truth(self, axle: int) -> Truth:
        """What is true of an axle after the newest step. Raises InputError before the first."""
        k = self._place(axle)
        if not self.steps:
            raise InputError("nothing is known before the first step", hint="call step()")
        s = self.steps[-1]
        arrays = (s.mu_available, s.mu_used, s.slip_m_s, s.wheel_m_s, s.torque_N_m, s.pressure_bar)
        available, used, slip, wheel, torque, pressure = (float(a[k]) for a in arrays)
        return Truth(available, used, slip, wheel, s.speed_m_s, torque, pressure)

    def sensors(self, axle: int) -> Sensors:
        """What the newest frames say of an axle and its train. A train with a DBC of its own sends the first four under
        its own names: they are None here, on_frame has them."""
        self._place(axle)
        get = databases()[0].get_message_by_name
        return Sensors(
            self._read(get(f"YawRate_A{axle}"), "YawRate"),
            self._read(get(f"LatAccel_A{axle}"), "LatAccel"),
            self._read(get(f"Torque_A{axle}"), "Torque"),
            self._read(get("VehicleSpeed"), "Speed"),
            self._read(rig_message(f"WheelSpeed_A{axle}"), "WheelSpeed"),
            self._read(rig_message(f"BrakePressure_A{axle}"), "Pressure"),
        )

    def adhesion(self, axle: int) -> Adhesion | None:
        """The newest Adhesion frame of an axle; None before the first. Raises InputError without a daemon."""
        self._place(axle)
        if axle not in self._readers:
            without = "there is no daemon" if not self._readers else f"the daemon's configuration has no axle {axle}"
            raise InputError(without, hint="Bench(…, daemon=True)" if not self._readers else "")
        message, reader, timeout_s = self._readers[axle]
        if message.frame_id not in self._newest:
            return None
        stamp_us, data = self._newest[message.frame_id]
        values = reader.read(data)
        words = {k: v for k, v in values.items() if isinstance(v, str)}
        ratio = {k: v / 100.0 for k, v in values.items() if isinstance(v, float)}
        confidence = words.get("Confidence", "")
        return Adhesion(
            words.get("Validity"), ratio.get("MuAvailable"), ratio.get("MuUsed"), HALF_WIDTHS.get(confidence),
            words.get("Surface"), words.get("ContactState"), max(self.time_s - stamp_us * 1e-6, 0.0),
            timeout_s,
        )  # fmt: skip

    def silences(self, axle: int) -> tuple[int, float]:
        """How often an axle's demand fell silent, and for how long in all (s). A demand that is set is never silent."""
        record = self._run.rig.silences[self._place(axle)]
        return record.silences, record.silent_us * 1e-6

    def figures(self) -> Figures:
        """Time beyond the peak's creep, slides, slip energy, utilisation, stopping distance of the steps so far. Raises
        InputError before the first."""
        if not self.steps:
            raise InputError("there are no figures before the first step", hint="call step() or run()")
        return judge(self.steps, self.scenario)

    def column(self, name: str) -> np.ndarray[Any, np.dtype[np.float64]]:
        """A field of all steps so far as an array, (steps,) or (steps, axles). Raises InputError for no such field."""
        known = [f for f in Step.__dataclass_fields__ if f != "frames"]
        if name not in known:
            raise InputError(f"a step has no {name!r}", hint=suggest(name, known) or f"it has {', '.join(known)}")
        return np.array([getattr(s, name) for s in self.steps], np.float64)

    def _place(self, axle: int) -> int:
        if axle not in self.scenario.axles:
            raise InputError(f"there is no axle {axle}", hint=f"axles: {', '.join(map(str, self.scenario.axles))}")
        return self.scenario.axles.index(axle)

    def _take(self, stamp_us: int, can_id: int, data: bytes) -> None:
        self._newest[can_id] = stamp_us, data
        if self._on_frame is not None:
            self._on_frame(stamp_us, can_id, data)

    def _read(self, message: Message, signal: str) -> float | None:
        newest = self._newest.get(message.frame_id)
        if newest is None or len(newest[1]) != message.length:
            return None
        values = message.decode(newest[1], decode_choices=False)
        assert isinstance(values, dict)
        value = values[signal]
        assert isinstance(value, int | float)  # its choices are not decoded
        return float(value)


def _configuration(daemon: bool | str | Path, played: Scenario) -> Config | None:
    """The daemon's configuration; None for no daemon."""
    if isinstance(daemon, bool):
        return placed(load_packaged(len(played.axles)), played) if daemon else None
    return load_config(Path(daemon))


def _is_number(value: object) -> bool:
    return isinstance(value, numbers.Real) and not isinstance(value, bool)
