"""The careful receiver of an axle's adhesion message: what docs/reference/what-a-controller-does.md demands of one.

It reads any configuration's output, by its own names, with cantools and autosar-e2e alone.
"""

from collections import deque
from dataclasses import dataclass

import e2e.p11
from cantools.database.can import Message

from sim_ecu.loop.messages import Rejected
from sim_ecu.play.adhesion import AdhesionReader
from sim_ecu.play.encoder import COUNTERS, frame_length
from wrcd.bus.dbc import find_message
from wrcd.bus.signals import Output
from wrcd.core.configuration import AxleConfig, Config
from wrcd.core.vocabulary import CONFIDENCES

MAX_STEP = 3  # of the counter from frame to frame within the time-out: two slots may be missing
TIMEOUT_CYCLES = 3
MAX_AGE_MS = 60.0  # SampleAge that is borne
MAX_DROPPED, DROPS_WITHIN_US = 5, 1_000_000  # more dropped frames than this in so long: two senders, or a bad line
NEEDED = ("Validity", "MuAvailable", "Confidence")
HALF_WIDTHS = {name: width / 100.0 for width, name in CONFIDENCES[:-1]}
WIDER = CONFIDENCES[-1][1]


@dataclass(frozen=True, slots=True)
class Adhesion:
    """What a frame tells that may be used. Ratios; half_width None: wider than any stated."""

    mu: float
    half_width: float | None
    saturated: bool


class AdhesionReceiver:
    """Follows the adhesion message of one axle. Times are microseconds of any one clock.

    unusable says what the message lacks for a controller to act on it (None: nothing): such a message is never used.
    """

    def __init__(self, message: Message, output: Output) -> None:
        missing = [name for name in NEEDED if name not in output.signals]
        if output.data_id is None:
            missing.insert(0, "E2E")
        self.unusable = f"{message.name} carries no {', no '.join(missing)}" if missing else None
        self.dropped = Rejected()  # a dropped frame is as if it had not come
        self._reader = AdhesionReader(message, output)
        self._can_id, self._length, self._data_id = message.frame_id, frame_length(message), output.data_id
        self._timeout_us = TIMEOUT_CYCLES * output.cycle_us
        self._counter: int | None = None
        self._jumped_us: int | None = None  # when the counter jumped, if none has continued it since
        self._half_cycle_us = output.cycle_us // 2
        self._stamp_us: int | None = None
        self._adhesion: Adhesion | None = None
        self._drops_us: deque[int] = deque(maxlen=MAX_DROPPED + 1)

    def hear(self, can_id: int, data: bytes, stamp_us: int) -> bool:
        """Take a frame from the bus; True if it is a good one of this message. A bad one changes only the counts."""
        if can_id != self._can_id or self._data_id is None:
            return False
        if len(data) != self._length:
            return self._drop("length", stamp_us)
        if not e2e.p11.e2e_p11_check(bytearray(data), self._data_id):
            return self._drop("crc", stamp_us)
        counter = data[1] & 0x0F
        if self._fresh(stamp_us) and self._counter is not None:
            step = (counter - self._counter) % COUNTERS
            if step == 0:
                return self._drop("repeated", stamp_us)
            at_once = self._jumped_us is not None and stamp_us - self._jumped_us < self._half_cycle_us
            if step > MAX_STEP or at_once:
                # a frame that continues this one is taken again; one that comes at once is an old one, out of a queue
                self._counter, self._jumped_us = counter, stamp_us
                return self._drop("counter", stamp_us)
        self._counter, self._stamp_us, self._jumped_us = counter, stamp_us, None
        self._adhesion = self._read(data)
        return True

    def adhesion(self, now_us: int) -> Adhesion | None:
        """What may be used now; None: fall back."""
        if self.unusable is not None or not self._fresh(now_us) or self._is_disturbed(now_us):
            return None
        return self._adhesion

    def _fresh(self, now_us: int) -> bool:
        return self._stamp_us is not None and now_us - self._stamp_us <= self._timeout_us

    def _is_disturbed(self, now_us: int) -> bool:
        """Whether more frames were dropped than a good line drops."""
        return len(self._drops_us) > MAX_DROPPED and now_us - self._drops_us[0] <= DROPS_WITHIN_US

    def _drop(self, why: str, stamp_us: int) -> bool:
        setattr(self.dropped, why, getattr(self.dropped, why) + 1)
        self._drops_us.append(stamp_us)
        return False

    def _read(self, data: bytes) -> Adhesion | None:
        """What a good frame tells; None: fall back."""
        said = self._reader.read(data)
        mu, level, age_ms = said.get("MuAvailable"), said.get("Confidence"), said.get("SampleAge", 0.0)
        if said.get("Validity") != "Valid" or not isinstance(mu, float) or not 0.0 <= mu <= 100.0:
            return None
        if "Unknown" in (said.get("Surface"), said.get("ContactState")):
            return None
        if not isinstance(age_ms, float) or age_ms > MAX_AGE_MS:
            return None
        if level != WIDER and level not in HALF_WIDTHS:
            return None
        width = None if level == WIDER else HALF_WIDTHS[str(level)]
        return Adhesion(mu / 100.0, width, said.get("ContactState") == "Saturated")


def receiver(config: Config, axle: AxleConfig) -> AdhesionReceiver:
    """The receiver of an axle's adhesion message of a configuration."""
    return AdhesionReceiver(find_message(config.database, axle.adhesion.message), axle.adhesion)
