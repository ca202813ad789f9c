"""The fault matrix as data: for every kind of fault, what Adhesion of the axle must do, and what the daemon's journal
must say of it: axle, input, figure and limit.

In a line's template # is a number, and [what is in brackets] may be missing, as may a line after "perhaps": slots and
limits meet a fault at different points.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from sim_ecu.play.faults import ALL, OF_AXLE, SIGNALS, SILENT, Fault, message_of

SLOT_MS = 20  # an adhesion frame covers the time up to its slot's beginning
TIMEOUT_MS = {"yaw_rate": 15, "lateral_acceleration": 15, "torque": 30, "speed": 60, ALL: 15}
CYCLE_MS = {"yaw_rate": 5, "lateral_acceleration": 5, "torque": 10, "speed": 20, ALL: 10}
WINDOW_MS = 1000
LONG_S = 3.0
BROKEN_S = 12.0
# So long after any fault, seen or not, the estimate must be what it would have been, but for so much: the window of 1 s
# and 1.5 times the memory of 1.3 s, to which a fault that cannot be seen has spoken.
SETTLED_AFTER_MS, SETTLED_PP = 2950, 1.0


@dataclass(frozen=True, slots=True)
class Leaves:
    """Not Valid from within_ms after the fault's begin on until its end; Valid again back_ms after the end."""

    within_ms: float
    back_ms: float

    def __str__(self) -> str:
        return f"leave Valid in {self.within_ms:g} ms, be back in {self.back_ms:g} ms"


@dataclass(frozen=True, slots=True)
class Stays:
    """Valid throughout, MuAvailable at most so far from that without the fault."""

    within_pp: float

    def __str__(self) -> str:
        return f"stay Valid within {self.within_pp:g} pp"


@dataclass(frozen=True, slots=True)
class Found:
    """Not Valid from within_ms after the fault's begin on until its end, and for as long again: that is not judged."""

    within_ms: float

    def __str__(self) -> str:
        return f"be found out in {self.within_ms / 1000:g} s"


@dataclass(frozen=True, slots=True)
class Unseen:
    """Nothing on the bus shows it. How far the estimate goes astray is measured, not judged."""

    def __str__(self) -> str:
        return "cannot be seen"


Must = Leaves | Stays | Found | Unseen


@dataclass(frozen=True, slots=True)
class MatrixRow:
    """A fault (its at_s is the player's) and what must come of it."""

    fault: Fault
    must: Must


def _row(kind: str, of: str, must: Must, duration_s: float = 0.5, amount: float | None = None) -> MatrixRow:
    return MatrixRow(Fault(kind, 0.0, duration_s, of, 1, amount), must)


def _leaves(of: str, noticed_ms: float = 0.0, forgotten_ms: float = 0.0) -> Leaves:
    """A time-out and a slot after the last good frame; a window after the second good one (of the first after a fault
    the counter may be refused), the next slot. And what it takes to notice the fault, and that it is over."""
    return Leaves(TIMEOUT_MS[of] + noticed_ms + SLOT_MS, WINDOW_MS + 2 * CYCLE_MS[of] + forgotten_ms + SLOT_MS)


def _two_senders(of: str) -> Leaves:
    """A second sender is suspected at its second frame, and forgotten after one turn of the counter."""
    return _leaves(of, forgotten_ms=15 * CYCLE_MS[of])


_ONE_AND_ALL = ("yaw_rate", ALL)
_REFUSED = ("burst", "crc", "counter", "dlc", "nan", "status", "swap")
ROWS = (
    *(_row(kind, of, _leaves(of)) for kind in _REFUSED for of in _ONE_AND_ALL),
    *(_row(kind, of, _leaves(of)) for kind in ("burst", "status") for of in ("torque", "speed")),
    # a sender that says Degraded, and then Ok: the estimate is a window old
    *(_row("status", of, _leaves(of), amount=1.0) for of in (*_ONE_AND_ALL, "speed")),
    # the first frame of a freeze is still true, and six more are alike
    *(_row("freeze", of, _leaves(of, noticed_ms=7 * CYCLE_MS["yaw_rate"] - TIMEOUT_MS[of])) for of in _ONE_AND_ALL),
    *(_row("sender", of, _two_senders(of)) for of in _ONE_AND_ALL),
    *(_row(kind, ALL, _leaves(ALL)) for kind in SILENT),
    *(_row("loss", of, Stays(1.0)) for of in _ONE_AND_ALL),
    *(_row("burst", of, Stays(1.0), 0.01) for of in _ONE_AND_ALL),  # two frames, the most that may be missing
    *(_row("spike", of, Stays(1.0)) for of in _ONE_AND_ALL),
    *(_row("babble", of, Stays(0.1)) for of in _ONE_AND_ALL),
    _row("error-flood", ALL, Stays(0.0)),
    # a step far beyond what the track does: nothing that was known before holds; and the step back is noticed likewise
    *(_row("bias", of, _leaves(of, forgotten_ms=3 * CYCLE_MS["yaw_rate"])) for of in _ONE_AND_ALL),
    _row("bias", "speed", _leaves("speed", forgotten_ms=CYCLE_MS["speed"])),
    _row("bias", "yaw_rate", Unseen(), amount=0.01),
    _row("drift", "yaw_rate", Stays(1.0), LONG_S, 0.0002),
    *(_row("drift", of, Unseen()) for of in _ONE_AND_ALL),
    *(_row("delay", of, Unseen()) for of in _ONE_AND_ALL),
    *(_row("dead", of, Unseen()) for of in _ONE_AND_ALL),
    # of the gyros for 3 s it is sometimes found, after 4 s
    _row("swap-wiring", "yaw_rate", Unseen(), 1.0),
    _row("swap-wiring", ALL, Unseen(), LONG_S),
    _row("bias", "torque", Unseen()),
    _row("freeze", "torque", Unseen()),
)
# What shows in the sensors' signals only after seconds, and is doubted for as long afterwards: on the virtual
# clock alone.
_DEAD, _PAIR = Found(6_000.0 + SLOT_MS), Found(10_000.0 + SLOT_MS)
LONG_ROWS = (
    *(_row("dead", of, _DEAD, BROKEN_S) for of in (ALL, "yaw_rate", "lateral_acceleration")),
    *(_row("reverse", of, _PAIR, BROKEN_S) for of in ("yaw_rate", "lateral_acceleration")),
    _row("swap-wiring", "yaw_rate", _PAIR, BROKEN_S),
)


SILENT_MS = 100
PERHAPS = "perhaps "  # before a line that comes only if a slot falls within it
NUMBER = r"-?\d+(?:\.\d+)?"
REFUSED_AS = {"crc": "crc", "counter": "repeat", "dlc": "length", "nan": "range", "status": "status", "swap": "data id"}
# what may be said of a pair of sensors, and in which words
PAIR_CAUSES = {
    "SensorsSilent": "both dead", "GyroReversed": "one the other way round", "GyroDead": "the gyro dead",
    "AccelSmall": "the accelerometer dead",
}  # fmt: skip
PAIR = ("yaw_rate", "lateral_acceleration")  # first past their time-outs, and named first


@dataclass(frozen=True, slots=True)
class ExpectedLines:
    """Templates: of each axle its lines in their order; reason and message of the frames that are rejected, in
    brackets where there may be none."""

    axles: tuple[tuple[str, ...], ...] = ()
    rejected: tuple[str, ...] = ()

    def __str__(self) -> str:
        out = [
            f"{PERHAPS * line.startswith(PERHAPS)}axle {axle}: {line.removeprefix(PERHAPS)}"
            for axle, lines in enumerate(self.axles, 1)
            for line in lines
        ]
        if self.rejected:
            out.append(f"rejected # frames in the last second: {', '.join(f'{r} #' for r in self.rejected)}")
        return "<br>".join(f"`{line}`" for line in out) or "nothing"


def expected_lines(row: MatrixRow) -> ExpectedLines:
    """Of a row."""
    f = row.fault
    kind, signals = f.kind, f.signals
    axles = (1, 2) if kind in ("swap", *SILENT) or f.of == "speed" else (1,)
    if kind in SILENT:
        counters = [f"counter {message_of(s, a)}" for a in axles for s in OF_AXLE]
        return ExpectedLines(
            tuple(_silent(a, (*OF_AXLE, "speed"), "") for a in axles), (*counters, "counter VehicleSpeed")
        )
    if isinstance(row.must, Stays):
        return _unmoved(kind, signals)
    if isinstance(row.must, Unseen | Found):
        return _of_signals(row)
    if kind == "status" and f.amount == 1.0:
        return ExpectedLines(tuple(_degraded(a, signals) for a in axles))
    if kind == "bias":
        return _jumped(f.of, axles)
    if kind == "freeze":
        return ExpectedLines(
            tuple(_frozen(a, signals) for a in axles), tuple(f"stuck {message_of(s, 1)}" for s in _pair(signals))
        )
    if kind == "sender":
        rejected = tuple(f"{why} {message_of(s, 1)}" for why in ("two senders", "counter") for s in signals)
        return ExpectedLines((_two_senders_lines(signals),), rejected)
    refused = REFUSED_AS.get(kind, "")
    rejected = tuple(f"{refused} {message_of(s, a)}" for a in axles for s in signals) if refused else ()
    if kind == "crc":  # of one frame in 256 the flipped CRC is another message's
        rejected += tuple(f"[data id {message_of(s, 1)}]" for s in signals)
    if kind not in ("nan", "status"):  # the counter is not what it was before
        rejected += tuple(f"counter {message_of(s, a)}" for a in axles for s in signals)
    refused = "# crc[, # data id]" if kind == "crc" else f"# {refused}" if refused else ""
    return ExpectedLines(tuple(_silent(a, signals, refused) for a in axles), rejected)


def wrong_lines(row: MatrixRow, journal: Sequence[str]) -> str:
    """What is wrong with the lines of a journal from a fault's begin on; nothing: they are those that are expected."""
    must = expected_lines(row)
    for axle in (1, 2, 3, 4):
        lines = [line for line in journal if line.startswith(f"axle {axle}: ")]
        expected = list(must.axles[axle - 1]) if axle <= len(must.axles) else []
        while expected:
            template, *expected = expected
            if lines and _is(lines[0], axle, template.removeprefix(PERHAPS)):
                lines = lines[1:]
            elif not template.startswith(PERHAPS):
                return f"the journal does not say of axle {axle}: {template}; but: {'; '.join(lines) or 'nothing'}"
        if lines:
            return f"the journal also says: {'; '.join(lines)}"
    return _wrong_rejections(must.rejected, [line for line in journal if not line.startswith("axle ")])


def _wrong_rejections(expected: Sequence[str], lines: Sequence[str]) -> str:
    if strange := [line for line in lines if not line.startswith("rejected ")]:
        return f"the journal says {strange[0]!r}"
    reported = {re.sub(r" \d+$", "", part) for line in lines for part in line.partition(": ")[2].split(", ")}
    needed = {r for r in expected if not r.startswith("[")}
    if strange := sorted(reported - {r.strip("[]") for r in expected} - {"others"}):
        return f"the journal says that frames were rejected: {strange[0]}"
    if "others" not in reported and (missing := sorted(needed - reported)):
        return f"the journal does not say that frames were rejected: {missing[0]}"
    return ""


def _is(line: str, axle: int, template: str) -> bool:
    pattern = re.escape(template).replace(r"\[", "(?:").replace(r"\]", ")?").replace(r"\#", NUMBER)
    more = r"\d+ more in the last second"
    return re.fullmatch(rf"axle {axle}: (?:{more}: )?{pattern}(?: \({more}\))?", line) is not None


def named(signal: str, axle: int) -> str:
    """The input as the daemon names it."""
    name = "Speed" if signal == "speed" else SIGNALS[signal]
    return f"{signal.replace('_', ' ')} {message_of(signal, axle)}.{name}"


def _pair(signals: Sequence[str]) -> list[str]:
    return [s for s in signals if s in PAIR]


def _old(axle: int, signals: Sequence[str], limits_ms: Sequence[int], refused: str) -> str:
    since = f" (refused since: {refused})" if refused else ""
    return "; ".join(
        f"{named(s, axle)} # ms old, limit {limit}{since}" for s, limit in zip(signals, limits_ms, strict=True)
    )


def _silent(axle: int, signals: Sequence[str], refused: str) -> tuple[str, ...]:
    """An input does not come, or is refused, for half a second."""
    first = _pair(signals) or list(signals)
    more = "[; and # more]" if len(signals) > len(first) else ""
    return (
        f"Valid -> Degraded, InputStale: {_old(axle, first, [TIMEOUT_MS[s] for s in first], refused)}",
        f"Degraded -> NotAvailable, InputSilent: {_old(axle, first, [SILENT_MS] * len(first), refused)}{more}",
        *_back(),
    )


def _back() -> tuple[str, str]:
    return "NotAvailable, WarmingUp: # s of the window's 1 s", "NotAvailable -> Valid"


def _degraded(axle: int, signals: Sequence[str]) -> tuple[str, ...]:
    first = _pair(signals) or list(signals)
    more = "[; and # more]" if len(signals) > len(first) else ""
    inputs = "; ".join(named(s, axle) for s in first)
    return f"Valid -> Degraded, SensorDegraded: {inputs}{more}: the status says Degraded", "Degraded -> Valid"


def _frozen(axle: int, signals: Sequence[str]) -> tuple[str, ...]:
    """The sensor that repeats itself least is refused first, or both at once."""
    first = _pair(signals)
    units = {"yaw_rate": "rad/s", "lateral_acceleration": "m/s2"}
    same = "; ".join(f"{named(s, axle)} repeated # {units[s]} in # consecutive frames" for s in first)
    stale, silent = (_old(axle, first[-1:], [limit], "# stuck") for limit in (TIMEOUT_MS[first[-1]], SILENT_MS))
    others, is_one = first[:-1], len(first) == 1
    other = "" if is_one else f"[{_old(axle, others, [SILENT_MS] * len(others), '# stuck')}; ]"
    also = "" if is_one else f"[{_old(axle, others, [TIMEOUT_MS[s] for s in others], '# stuck')}; ]"
    return (
        f"Valid -> Degraded, Unchanged: {same}",
        f"Degraded, InputStale: {also}{stale}",
        f"Degraded -> NotAvailable, InputSilent: {other}{silent}",
        *_back(),
    )


def _two_senders_lines(signals: Sequence[str]) -> tuple[str, ...]:
    first = _pair(signals)
    counters = "; ".join(f"{named(s, 1)}: two sequences of counters[ (refused since: # two senders)]" for s in first)
    more = "[; and # more]" if len(signals) > len(first) else ""
    stale, silent = (_old(1, first, [limit] * len(first), "# two senders") for limit in (15, SILENT_MS))
    return (
        f"{PERHAPS}Valid -> Degraded, TwoSenders: {counters}",
        f"[Valid -> ]Degraded, InputStale: {stale}",
        f"Degraded -> NotAvailable, InputSilent: {silent}{more}",
        *_back(),
    )


def _jumped(of: str, axles: Sequence[int]) -> ExpectedLines:
    if of == "speed":
        why = "speed VehicleSpeed.Speed jumped to # m/s"
        return ExpectedLines(
            ((f"Valid -> NotAvailable, Restarted: {why}", "NotAvailable -> Valid"),) * 2, ("jump VehicleSpeed",)
        )
    why = f"{named('yaw_rate', 1)} jumped by # rad/s, limit 0.08"
    return ExpectedLines(((f"Valid -> NotAvailable, Restarted: {why}", "NotAvailable -> Valid"),) * len(axles))


def _unmoved(kind: str, signals: Sequence[str]) -> ExpectedLines:
    """The axle stays Valid."""
    if kind == "spike" and "torque" in signals:
        return ExpectedLines(rejected=("jump Torque_A1",))
    if kind == "babble":
        copied = signals if len(signals) == 1 else ("lateral_acceleration", "torque")
        return ExpectedLines(rejected=tuple(f"repeat {message_of(s, 1)}" for s in copied))
    return ExpectedLines()


def _of_signals(row: MatrixRow) -> ExpectedLines:
    """What only the sensors' signals show, if anything does."""
    f = row.fault
    rejected = ("jump Torque_A1", "jump Torque_A2") if f.kind == "swap-wiring" and f.of == ALL else ()
    if f.kind not in ("dead", "reverse", "swap-wiring"):
        return ExpectedLines()
    if row not in LONG_ROWS:
        return ExpectedLines(rejected=rejected)

    def pair(cause: str, words: str, axle: int = 1) -> str:
        yaw, lat = named("yaw_rate", axle), named("lateral_acceleration", axle)
        levels = f"{yaw} #, {lat} # times the sensor's noise; correlation # below 1.5 Hz, # in 3 to 10 Hz"
        return f"Degraded, {cause}: {words} #, sound #; {levels}"

    def found(cause: str, words: str, axle: int = 1) -> tuple[str, ...]:
        """A wrong sign looks like a delay first."""
        late = f"perhaps Valid -> {pair('SensorsUnrelated', 'one later than it says')}"
        return (*(late,) * (f.kind == "reverse"), f"[Valid -> ]{pair(cause, words, axle)}")

    if f.kind == "swap-wiring":  # one cause, for two states
        words = "[of different axles][one later than it says]"
        return ExpectedLines(tuple(found("SensorsUnrelated", words, axle) for axle in (1, 2)))
    if f.kind == "reverse":
        cause = "GyroReversed"
    else:
        cause = {ALL: "SensorsSilent", "yaw_rate": "GyroDead"}.get(f.of, "AccelSmall")
    return ExpectedLines((found(cause, PAIR_CAUSES[cause]),))
