"""What can go wrong between a sensor and the daemon, as data: kinds of fault, and how one is requested."""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum, auto

from wrcd.config.keys import Choice, Number
from wrcd.config.settings import Section, parse_toml, suggest
from wrcd.errors import InputError

# Signals that a fault can be of; all stands for the axle's own three. The second word is the message, without the axle.
SIGNALS = {
    "yaw_rate": "YawRate", "lateral_acceleration": "LatAccel", "torque": "Torque", "speed": "VehicleSpeed",
}  # fmt: skip
ALL = "all"
OF_AXLE = tuple(s for s in SIGNALS if s != "speed")
DURATION_S = 0.5


def message_of(signal: str, axle: int) -> str:
    """The message of a signal in the packaged DBC."""
    return SIGNALS[signal] if signal == "speed" else f"{SIGNALS[signal]}_A{axle}"


class Stage(Enum):
    """Where a fault acts."""

    SIGNAL = auto()  # on what the sensor says, before it is a frame
    FRAME = auto()  # on frames, or beside them
    BUS = auto()  # on the whole bus or the interface: it takes neither signal nor axle


@dataclass(frozen=True, slots=True)
class FaultKind:
    """One kind. amounts are the defaults: one for all, or one for each of SIGNALS; none if it takes no amount."""

    stage: Stage
    what: str
    unit: str = ""
    amounts: tuple[float, ...] = ()
    low: float = 0.0
    high: float = 0.0


_ANY = 1e6
KINDS = {
    "loss": FaultKind(Stage.FRAME, "every frame is lost with a probability", "probability", (0.02,), 0.0, 1.0),
    "burst": FaultKind(Stage.FRAME, "all frames are lost"),
    "crc": FaultKind(Stage.FRAME, "a bit is flipped on the way; the CRC tells"),
    "counter": FaultKind(Stage.FRAME, "the E2E counter stands still; the CRC is right"),
    "dlc": FaultKind(Stage.FRAME, "frames are too short or too long", "bytes", (-1.0,), -4.0, 3.0),
    "bias": FaultKind(Stage.SIGNAL, "the value is off", "rad/s, m/s², N·m, m/s", (0.1, 0.5, 3000.0, 2.0), -_ANY, _ANY),
    "drift": FaultKind(
        Stage.SIGNAL, "the value goes off more and more", "… per s", (0.02, 0.2, 1000.0, 1.0), -_ANY, _ANY
    ),
    "freeze": FaultKind(Stage.SIGNAL, "the value stands still in fresh frames"),
    "spike": FaultKind(
        Stage.SIGNAL, "one sample is off every 0.1 s", "rad/s, m/s², N·m, m/s", (0.5, 10.0, 30000.0, 20.0), -_ANY, _ANY
    ),
    "nan": FaultKind(Stage.FRAME, "the value's code for not available, in a good frame"),
    "status": FaultKind(Stage.FRAME, "the sender says Error", "code", (14.0,), 0.0, 255.0),
    "swap": FaultKind(Stage.FRAME, "a gateway swaps the ids of two axles' frames"),
    "reverse": FaultKind(Stage.SIGNAL, "the sensor is mounted the other way round"),
    "dead": FaultKind(
        Stage.SIGNAL, "the sensor gives its own noise alone (a torque or a speed has none, and stays)",
        "rad/s, m/s², N·m, m/s rms", (3e-4, 0.01, 0.0, 0.0), 0.0, _ANY,
    ),
    "swap-wiring": FaultKind(Stage.SIGNAL, "the sensors of two axles are swapped, their frames are right"),
    "delay": FaultKind(Stage.FRAME, "frames are held back", "ms", (8.0,), 0.0, 10_000.0),
    "sender": FaultKind(
        Stage.FRAME, "a second sender of the same ids, its own counter, right CRCs, a factor on the values",
        "factor", (0.5,), -100.0, 100.0,
    ),
    "babble": FaultKind(
        Stage.FRAME, "an unmapped id of the highest priority, and copies of a mapped frame, in turn", "frames/s",
        (2000.0,), 1.0, 20_000.0,
    ),
    "error-flood": FaultKind(Stage.BUS, "CAN error frames", "frames/s", (1000.0,), 1.0, 20_000.0),
    "link-down": FaultKind(Stage.BUS, "the interface goes down and up again (on a bus: vcan and root)"),
    "device-gone": FaultKind(Stage.BUS, "the interface is deleted and made again (on a bus: vcan and root)"),
    "bus-off": FaultKind(Stage.BUS, "the controller goes bus-off (with --fast)"),
}  # fmt: skip
SILENT = ("link-down", "device-gone", "bus-off")  # no frame gets through


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault: what from when for how long. amount is in the unit of the kind and the signal."""

    kind: str
    at_s: float
    duration_s: float = DURATION_S
    of: str = "yaw_rate"
    axle: int = 1
    amount: float | None = None  # the kind's default

    @property
    def begin_us(self) -> int:
        """From the first sample at or after this."""
        return round(self.at_s * 1e6)

    @property
    def end_us(self) -> int:
        """The first moment at which all is well again."""
        return round((self.at_s + self.duration_s) * 1e6)

    def on(self, due_us: int) -> bool:
        """Return whether it acts at a time after the scenario's start."""
        return self.begin_us <= due_us < self.end_us

    @property
    def signals(self) -> tuple[str, ...]:
        """The signals it is of."""
        return OF_AXLE if self.of == ALL else (self.of,)

    def size(self, signal: str) -> float:
        """The amount for a signal."""
        if self.amount is not None:
            return self.amount
        amounts = KINDS[self.kind].amounts
        return amounts[list(SIGNALS).index(signal)] if len(amounts) > 1 else amounts[0] if amounts else 0.0


def read_fault(s: Section, numbers: Sequence[int], at: str = "at_s", duration: str = "duration_s") -> Fault:
    """A [[fault]] table of a scenario with these axles. Raises InputError that names the key."""
    for key, kind_of_value in (("kind", str), (at, float)):
        s.take(key, kind_of_value)
    name = Choice("kind", "", tuple(KINDS)).value(s)
    kind = KINDS[name]
    of, axle, amount = "yaw_rate", numbers[0], None
    if kind.stage is not Stage.BUS:
        of = Choice("of", "", (*SIGNALS, ALL), of).value(s)
        axle = s.get("axle", int, axle)
        if axle not in numbers:
            raise s.error(f"axle {axle} is not among the scenario's: {', '.join(map(str, numbers))}", "axle")
        if name.startswith("swap"):
            if len(numbers) == 1:
                raise s.error(f"{name} needs a scenario with two axles", "kind", "e.g. four-axles")
            if of == "speed":
                raise s.error("the speed belongs to no axle and cannot be swapped", "of")
    if kind.amounts and "amount" in s:
        if len(kind.amounts) > 1 and of == ALL:
            raise s.error("is in the unit of one signal", "amount", f"name one: of = {', '.join(SIGNALS)}")
        amount = Number("amount", "", kind.low, kind.high).value(s)
    at_s, duration_s = Number(at, "", 0.0, 1e6).value(s), Number(duration, "", 0.001, 1e6, DURATION_S).value(s)
    fault = Fault(name, at_s, duration_s, of, axle, amount)
    s.done()
    return fault


def parse_fault(spec: str, numbers: Sequence[int], end_s: float = math.inf) -> Fault:
    """A fault as on the command line, e.g. crc:at=3,for=0.5,of=yaw_rate,axle=1. Raises InputError, also for one that
    would begin at or behind the scenario's end."""
    name, _, rest = spec.partition(":")
    if name not in KINDS:
        hint = suggest(name, KINDS) or f"kinds: {', '.join(KINDS)}"
        raise InputError(f"there is no fault {name!r}", key=f"--fault {spec}", hint=hint)
    lines = [f'kind = "{name}"']
    for part in filter(None, rest.split(",")):
        key, equals, value = part.partition("=")
        if not equals or not re.fullmatch(r"[a-z_]+", key) or not re.fullmatch(r"[\w.+-]+", value):
            raise InputError(f"{part!r} is not KEY=VALUE", key=f"--fault {spec}", hint="e.g. crc:at=3,for=0.5,axle=1")
        lines.append(f"{key} = {value if _is_number(value) else repr(value)}")
    try:
        fault = read_fault(parse_toml("\n".join(lines), "--fault"), numbers, "at", "for")
    except InputError as e:
        raise InputError(e.reason, key=f"--fault {spec}: {e.key}".removesuffix(": "), hint=e.hint) from None
    if fault.at_s >= end_s:
        raise InputError(
            f"{fault.at_s:g} s is not before the scenario's end", key=f"--fault {spec}: at",
            hint=f"it lasts {end_s:g} s",
        )  # fmt: skip
    return fault


def _is_number(text: str) -> bool:
    return re.fullmatch(r"[+-]?(0|[1-9][0-9]*)(\.[0-9]+)?(e[+-]?[0-9]+)?", text) is not None


def described() -> Iterator[tuple[str, str]]:
    """The kinds: name, and what each is with its default amounts."""
    for name, k in KINDS.items():
        default = ", ".join(f"{a:g}" for a in k.amounts)
        yield name, k.what + (f" (amount: {default} {k.unit})" if k.amounts else "")
