"""What the daemon itself named of a log's sensors, when first and for how long; and frames that it refused."""

from collections import Counter
from dataclasses import asdict, dataclass
from typing import Any

from wrcd.bus.reasons import Reason
from wrcd.core.causes import Cause

# Causes that name a sensor, its wiring or its sender; the rest are of the ride or of the estimate.
SENSORS = (
    Cause.SENSORS_SILENT, Cause.GYRO_REVERSED, Cause.GYRO_DEAD, Cause.SENSORS_UNRELATED, Cause.ACCEL_SMALL,
    Cause.TORQUES_CONTRADICT, Cause.SENSOR_DEGRADED, Cause.TWO_SENDERS, Cause.UNCHANGED,
)  # fmt: skip
INPUTS = (Cause.INPUT_SILENT, Cause.INPUT_STALE)
MIN_SILENT_S = 1.0  # in all: a frame that came late once makes no sensor suspicious
MIN_REFUSED_SHARE = 0.01  # of a message's frames


@dataclass(frozen=True, slots=True)
class Suspect:
    """A suspicious sensor. axle 0: of several or of the vehicle. first_s: of the log. seconds: in all; of refused
    frames their share of the message's, of the log's time. times: how often it began."""

    what: str
    axle: int
    text: str
    first_s: float
    seconds: float
    times: int

    def document(self) -> dict[str, Any]:
        """As the row's detail says it."""
        return asdict(self)


class SuspectSpells:
    """An axle's causes of not being Valid, as the core reports their changes."""

    def __init__(self) -> None:
        self.first_us: dict[Cause, int] = {}
        self.times: Counter[Cause] = Counter()
        self._spent_us: Counter[Cause] = Counter()
        self._texts: dict[Cause, tuple[int, str]] = {}  # of the longest spell, and how long (us)
        self._now: tuple[int, Cause, str] = (0, Cause.NONE, "")  # what the core reported last, and when

    def change(self, stamp_us: int, cause: Cause, text: str) -> None:
        """Take a change, or (NONE) the log's end."""
        since_us, before, words = self._now
        if cause is before:
            return
        if before:
            length_us = stamp_us - since_us
            self._spent_us[before] += length_us
            if length_us > self._texts.get(before, (-1, ""))[0]:
                self._texts[before] = length_us, words
        if cause:
            self.first_us.setdefault(cause, stamp_us)
            self.times[cause] += 1
        self._now = stamp_us, cause, text

    def suspects(self, axle: int, begin_us: int) -> list[Suspect]:
        """Return those that name a sensor, the longest first."""
        out = []
        for cause in (*SENSORS, *INPUTS):
            seconds = self._spent_us[cause] * 1e-6
            if not seconds or (cause in INPUTS and seconds < MIN_SILENT_S):
                continue
            first_s = (self.first_us[cause] - begin_us) * 1e-6
            _, text = self._texts[cause]
            out.append(Suspect(cause.label, axle, text or cause.words, first_s, seconds, self.times[cause]))
        return sorted(out, key=lambda s: -s.seconds)


@dataclass(slots=True)
class _Refused:
    """Frames of a message that were refused for one reason."""

    first_us: int
    last_us: int
    frames: int = 0


class RefusalTally:
    """Frames that were refused, by message and reason, and those that were accepted, by message."""

    def __init__(self) -> None:
        self.accepted: Counter[str] = Counter()
        self._before: Counter[tuple[str, Reason]] = Counter()
        self._total = 0
        self._of: dict[tuple[str, Reason], _Refused] = {}

    @property
    def messages(self) -> set[str]:
        """Of which a frame came, good or not."""
        return {*self.accepted, *(message for message, _ in self._of)}

    @property
    def total(self) -> int:
        """Refused frames."""
        return self._total

    def look(self, counted: Counter[tuple[str, Reason]], stamp_us: int) -> None:
        """Note what was refused since the look before. counted: by message and reason, so far."""
        total = counted.total()
        if total == self._total:
            return
        for key, frames in (counted - self._before).items():
            found = self._of.setdefault(key, _Refused(stamp_us, stamp_us))
            found.frames, found.last_us = found.frames + frames, stamp_us
        self._before, self._total = counted.copy(), total

    def document(self, begin_us: int) -> list[dict[str, Any]]:
        """All of them, the most first."""
        rows = [
            {
                "message": message,
                "reason": reason.value,
                "frames": r.frames,
                "first_s": round((r.first_us - begin_us) * 1e-6, 3),
                "last_s": round((r.last_us - begin_us) * 1e-6, 3),
            }
            for (message, reason), r in self._of.items()
        ]
        return sorted(rows, key=lambda row: (-int(str(row["frames"])), str(row["message"]), str(row["reason"])))

    def suspects(self, axles: dict[str, int], begin_us: int, end_us: int) -> list[Suspect]:
        """Messages of which many frames were refused. axles: by message. begin_us, end_us: of the log."""
        out = []
        for (message, reason), r in self._of.items():
            every = self.accepted[message] + sum(o.frames for (m, _), o in self._of.items() if m == message)
            if r.frames < MIN_REFUSED_SHARE * every:
                continue
            text = f"{message}: {r.frames} of {every} frames refused for {reason.value}"
            first_s, seconds = (r.first_us - begin_us) * 1e-6, r.frames / every * (end_us - begin_us) * 1e-6
            out.append(Suspect(f"Refused{reason.label}", axles.get(message, 0), text, first_s, seconds, r.frames))
        return sorted(out, key=lambda s: (-s.times, s.text))
