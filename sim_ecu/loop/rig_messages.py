"""The loop's frames: laid out as cantools reads the DBC, checked as a careful receiver does; and their silences."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import e2e.p11

from sim_ecu.play.encoder import COUNTERS, data_id, databases

if TYPE_CHECKING:
    from cantools.database.can import Message

COAST, TRACTION, BRAKE = MODES = range(3)  # DriverDemand's Mode; another one is none
EVERY_US = 1_000_000  # between two silences of a message that are reported, if they are short
LONG_US = 200_000  # a silence that lasts so long is always reported
NONE_YET, SILENT, CAME, AGAIN = "none yet", "silent", "heard", "again"  # what there is to report of a message


def rig_message(name: str) -> "Message":
    """Return a message of the rig's own DBC."""
    return databases()[1].get_message_by_name(name)


MAX_STEP = 3  # of the counter from frame to frame within the time-out: two slots may be missing


class ProtectedFrames:
    """Checks the frames of a message: length, CRC and counter of E2E. Times are microseconds of any one clock.

    stamp_us: of the newest good frame, None before the first; kept by who takes them. rejected: counts by reason.
    at_once_us: what follows a jump of the counter sooner than this is old, out of a queue.
    """

    def __init__(self, length: int, data_id: int, timeout_us: int, at_once_us: int = 0) -> None:
        self.timeout_us = timeout_us
        self.stamp_us: int | None = None
        self.rejected = {"length": 0, "CRC": 0, "repeated": 0, "counter": 0}
        self._length, self._data_id, self._at_once_us = length, data_id, at_once_us
        self._counter = -1
        self._jumped_us: int | None = None  # when the counter jumped, if none has continued it since

    def check(self, data: bytes, stamp_us: int) -> bool:
        """Return whether a frame is good. A bad one changes counts and, if its E2E passes, the expected counter."""
        if len(data) != self._length:
            return self.reject("length", stamp_us)
        if not e2e.p11.e2e_p11_check(bytearray(data), self._data_id):
            return self.reject("CRC", stamp_us)
        counter = data[1] & 0x0F
        fresh, step = self.fresh(stamp_us), (counter - self._counter) % COUNTERS
        if fresh and step == 0:
            return self.reject("repeated", stamp_us)
        self._counter = counter
        at_once = self._jumped_us is not None and stamp_us - self._jumped_us < self._at_once_us
        if fresh and (step > MAX_STEP or at_once):
            self._jumped_us = stamp_us  # the sequence is taken again from the next that follows
            return self.reject("counter", stamp_us)
        self._jumped_us = None
        return True

    def fresh(self, now_us: int) -> bool:
        """Return whether the newest good frame is within its time-out."""
        return self.stamp_us is not None and now_us - self.stamp_us <= self.timeout_us

    def reject(self, why: str, stamp_us: int) -> bool:
        """Count a frame that is not taken; returns False."""
        self.rejected[why] = self.rejected.get(why, 0) + 1
        return False


class NewestFrame(ProtectedFrames):
    """The newest good frame of a message of the DBC, with its time-out. Raw values are physical; enumerations stay
    numbers.

    known: the values that signals may have; a frame with another one is not taken, and counted as "unknown value".
    """

    def __init__(self, message: "Message", known: Mapping[str, Collection[float]] | None = None) -> None:
        signal = message.signals[0]
        assert signal.dbc is not None
        timeout_ms = int(signal.dbc.attributes["GenSigTimeoutTime"].value)
        super().__init__(message.length, data_id(message), 1000 * timeout_ms)
        self.message, self.values = message, dict[str, Any]()
        self._known = known or {}

    def take(self, data: bytes, stamp_us: int) -> bool:
        """Return whether a frame is good, and keep its values if it is."""
        if not self.check(data, stamp_us):
            return False
        values: Any = self.message.decode(data, decode_choices=False)
        if any(values[name] not in known for name, known in self._known.items()):
            return self.reject("unknown value", stamp_us)
        self.values, self.stamp_us = values, stamp_us
        return True


def driver_demand() -> NewestFrame:
    """Return the receiver of DriverDemand; a frame of an unknown Mode is not taken."""
    return NewestFrame(rig_message("DriverDemand"), known={"Mode": MODES})


@dataclass(slots=True)
class SilenceRecord:
    """Silences of one message, looked at in every cycle. That it has not come yet is no silence.

    silent_us: all of them; lasted_us: the newest one.
    """

    cycle_us: int
    silences: int = 0
    silent_us: int = 0
    longest_us: int = 0
    came: bool = False
    lasted_us: int = 0
    _since_us: int | None = None
    _reported: bool = False
    _reported_us: int = -EVERY_US

    @property
    def now(self) -> bool:
        """Whether it is silent."""
        return self._since_us is not None

    def look(self, now_us: int, silent: bool) -> str | None:
        """Return what there is to report at the end of a cycle in which it was silent or not."""
        if not silent:
            ended = self.now and self._reported
            news = (AGAIN if self.came else CAME) if ended else None
            self._since_us, self.came = None, True
            return news
        if self._since_us is None:
            self._since_us, self._reported = now_us - self.cycle_us, False
            self.silences += self.came
        self.lasted_us = now_us - self._since_us
        if self.came:
            self.silent_us += self.cycle_us
            self.longest_us = max(self.longest_us, self.lasted_us)
        if self._reported or (now_us - self._reported_us < EVERY_US and self.lasted_us < LONG_US):
            return None
        self._reported, self._reported_us = True, now_us
        return SILENT if self.came else NONE_YET

    def counts(self) -> dict[str, Any]:
        """Return whether it ever came, how often it fell silent, how long in all and at most (s)."""
        return {
            "heard": self.came, "silences": self.silences, "silent_s": round(self.silent_us * 1e-6, 3),
            "longest_s": round(self.longest_us * 1e-6, 3),
        }  # fmt: skip


class Silences:
    """Of several messages by name. words: what is reported while none came yet, and when one falls silent."""

    def __init__(self, names: Sequence[str], cycle_us: int, words: Mapping[str, str], what: str = "") -> None:
        self.by_name = {name: SilenceRecord(cycle_us) for name in names}
        self._words, self._what = words, what

    def look(self, now_us: int, silent: Sequence[bool | None]) -> dict[str, list[str]]:
        """Return the names of which there is something to report, by what that is. silent: of each; None: too early."""
        out: dict[str, list[str]] = {}
        for (name, s), is_silent in zip(self.by_name.items(), silent, strict=True):
            news = None if is_silent is None else s.look(now_us, is_silent)
            if news is not None:
                after = f"{self._what}{news} after {s.lasted_us * 1e-6:.2f} s"
                out.setdefault(self._words.get(news, after), []).append(name)
        return out


def times(n: int) -> str:
    """Return "once", or so many times."""
    return "once" if n == 1 else f"{n} times"


def counted(rejected: Mapping[str, int]) -> str:
    """Return frames that were not taken, by reason; nothing if all were."""
    text = ", ".join(f"{n} {why}" for why, n in rejected.items() if n)
    return f"; frames not taken: {text}" if text else ""
