"""The careful receiver of an axle's adhesion message: what docs/reference/what-a-controller-does.md demands of one.

It reads any configuration's output, by its own names, with cantools and autosar-e2e alone.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

from sim_ecu.loop.drive_scenario import DriveScenario
from sim_ecu.loop.rig_messages import BRAKE, TRACTION, ProtectedFrames, driver_demand, rig_message
from sim_ecu.physics.actuators import Actuators, Valve
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.encoder import Channel, Sent, frame_length
from sim_ecu.play.train import AdhesionReader
from wrcd.bus.dbc import Message, find_message
from wrcd.bus.signals import Output
from wrcd.core.configuration import AxleConfig, Config
from wrcd.core.vocabulary import CONFIDENCES
from wrcd.errors import InputError


@dataclass(frozen=True, slots=True)
class Facts:
    """A train of like wheelsets, as its controller has it; the mass per wheelset is M_v."""

    axles: tuple[int, ...]
    wheelset: Wheelset = field(default_factory=Wheelset)
    actuators: Actuators = field(default_factory=Actuators)

    @classmethod
    def of(cls, scenario: DriveScenario) -> "Facts":
        """The facts of a scenario's train."""
        train = scenario.train
        return cls(tuple(scenario.axles), train.wheelset, scenario.actuators)

    @property
    def inertia_kg_m2(self) -> float:
        """Of a wheelset with its drive."""
        return self.wheelset.I_R + self.wheelset.I_L

    @property
    def unit_adhesion_N_m(self) -> float:
        """Torque at a wheelset that takes an adhesion of 1: 2 N r_0."""
        return 2.0 * self.wheelset.normal_N * self.wheelset.r_0

    @property
    def carried_N_m(self) -> float:
        """The same with what turns the wheelset itself: that takes torque beside what the rail carries."""
        return self.unit_adhesion_N_m * (1.0 + self.inertia_kg_m2 / self.wheelset.r_0**2 / self.wheelset.M_v)

    @property
    def full_brake_N_m(self) -> float:
        """What the driver demands of a wheelset at a brake share of 1, both brakes together."""
        return self.actuators.full_brake_N_m

    def demand_N_m(self, share: float, braking: bool) -> float:
        """|torque| that a share (0 ... 1) of the full effort demands of a wheelset."""
        return share * (self.full_brake_N_m if braking else self.actuators.drive.max_traction_N_m)


CYCLE_US = 10_000


class TrainController(Protocol):
    """Pure: no clock, no bus."""

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take a frame from the bus."""

    def tick(self, now_us: int) -> list[Sent]:
        """The Demand frames of a cycle; now_us is a multiple of CYCLE_US."""


class Unprotected:
    """Gives the driver all that is demanded: no wheel-slide protection at all.

    Sends nothing before the first frame of the driver, so that the rig brakes by itself. When the driver falls silent,
    traction ends and a brake stays.
    """

    def __init__(self, axles: Sequence[int], actuators: Actuators) -> None:
        self._a = actuators
        self._driver = driver_demand()
        self._channels = [Channel(rig_message(f"Demand_A{n}")) for n in axles]

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> None:
        """Take the driver's demand."""
        if can_id == self._driver.message.frame_id:
            self._driver.take(data, stamp_us)

    def tick(self, now_us: int) -> list[Sent]:
        """Return the same Demand for every axle."""
        if self._driver.stamp_us is None:
            return []
        share, mode, torque = self._driver.values["Share"], self._driver.values["Mode"], 0.0
        if mode == BRAKE:
            torque = -share * self._a.full_brake_N_m
        elif mode == TRACTION and self._driver.fresh(now_us):
            torque = share * self._a.drive.max_traction_N_m
        return [c.encode(now_us, {"Torque": torque, "Valve": Valve.FILL}) for c in self._channels]


TIMEOUT_CYCLES = 3
MAX_AGE_MS = 60.0  # SampleAge that is borne
MAX_DROPPED, DROPS_WITHIN_US = 5, 1_000_000  # more dropped frames than this in so long: two senders, or a bad line
NEEDED = ("Validity", "MuAvailable", "Confidence")
HALF_WIDTHS = {name: width / 100.0 for width, name in CONFIDENCES[:-1]}
WIDER = CONFIDENCES[-1][1]
NOTHING_YET = "nothing has come yet"


@dataclass(frozen=True, slots=True)
class UsableAdhesion:
    """What a frame reports that may be used. Ratios; half_width None: wider than any stated."""

    mu: float
    half_width: float | None
    saturated: bool


class AdhesionReceiver(ProtectedFrames):
    """Follows the adhesion message of one axle. A frame that is rejected is as if it had not come.

    unusable says what the message lacks for a controller to act on it (None: nothing): such a message is never used.
    """

    def __init__(self, message: Message, output: Output) -> None:
        missing = [name for name in NEEDED if name not in output.signals]
        if output.data_id is None:
            missing.insert(0, "E2E")
        self.unusable = f"{message.name} carries no {', no '.join(missing)}" if missing else None
        timeout_us = TIMEOUT_CYCLES * output.cycle_us
        super().__init__(frame_length(message), output.data_id or 0, timeout_us, at_once_us=output.cycle_us // 2)
        self._reader = AdhesionReader(message, output)
        self.can_id, self._is_protected = message.frame_id, output.data_id is not None
        self._adhesion: UsableAdhesion | None = None
        self._validity = ""  # of the newest good frame
        self._drops_us: deque[int] = deque(maxlen=MAX_DROPPED + 1)

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> bool:
        """Take a frame from the bus; True if it is a good one of this message. A bad one changes only the counts."""
        if can_id != self.can_id or not self._is_protected or not self.check(data, stamp_us):
            return False
        self.stamp_us, self._adhesion = stamp_us, self._read(data)
        return True

    def adhesion(self, now_us: int) -> UsableAdhesion | None:
        """Return what may be used now; None: fall back."""
        if self.unusable is not None or not self.fresh(now_us) or self._is_disturbed(now_us):
            return None
        return self._adhesion

    def why_unused(self, now_us: int) -> str:
        """Return why there is nothing to use now; "" where there is."""
        if self.unusable is not None:
            return self.unusable
        if self.adhesion(now_us) is not None:
            return ""
        if self.stamp_us is None:
            return NOTHING_YET
        if not self.fresh(now_us):
            return f"silent for {self.timeout_us // 1000} ms"
        return self._validity if self._validity != "Valid" else "frames were dropped, or its values are not for use"

    def _is_disturbed(self, now_us: int) -> bool:
        """Whether more frames were dropped than a good line drops."""
        return len(self._drops_us) > MAX_DROPPED and now_us - self._drops_us[0] <= DROPS_WITHIN_US

    def reject(self, why: str, stamp_us: int) -> bool:
        """Count a frame that is not taken, and keep when it came."""
        self._drops_us.append(stamp_us)
        return super().reject(why, stamp_us)

    def _read(self, data: bytes) -> UsableAdhesion | None:
        """Return what a good frame reports; None: fall back."""
        values = self._reader.read(data)
        self._validity = str(values.get("Validity"))
        mu, level, age_ms = values.get("MuAvailable"), values.get("Confidence"), values.get("SampleAge", 0.0)
        if values.get("Validity") != "Valid" or not isinstance(mu, float) or not 0.0 <= mu <= 100.0:
            return None
        if "Unknown" in (values.get("Surface"), values.get("ContactState")):
            return None
        if not isinstance(age_ms, float) or age_ms > MAX_AGE_MS:
            return None
        if level != WIDER and level not in HALF_WIDTHS:
            return None
        width = None if level == WIDER else HALF_WIDTHS[str(level)]
        return UsableAdhesion(mu / 100.0, width, values.get("ContactState") == "Saturated")


def receiver(config: Config, axle: AxleConfig) -> AdhesionReceiver:
    """The receiver of an axle's adhesion message of a configuration."""
    return AdhesionReceiver(find_message(config.database, axle.adhesion.message), axle.adhesion)


def usable_receiver(config: Config, axle: AxleConfig) -> AdhesionReceiver:
    """The same. InputError where the message lacks what a controller needs of it."""
    adhesion = receiver(config, axle)
    if adhesion.unusable is not None:
        raise InputError(
            f"{adhesion.unusable}: no base for a controller",
            hint="map them in the configuration, or run the controller without adhesion",
        )
    return adhesion
