"""The fast lane: from frames to ticks in C (wrcd/core/c/lane.c) while nothing happens.

It borrows the state of a core's inputs, and gives it back before anything is done that it leaves to Python: a frame
that anything speaks against, a tick that is not sound.
"""

import ctypes
import math
from typing import Any, Protocol

import numpy as np

from wrcd.bus.batch import FrameBatch
from wrcd.bus.codec import Receiver
from wrcd.bus.e2e import CRC_TABLE, Checker
from wrcd.bus.frame import EXTENDED
from wrcd.bus.readers import MessageReader
from wrcd.bus.writers import SignalWriter
from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import Config
from wrcd.core.counts import Counts
from wrcd.core.design import FloatArray
from wrcd.core.estimator import Estimator
from wrcd.core.events import Events
from wrcd.core.input_buffers import NEVER
from wrcd.core.inputs import LAT, QUANTITIES, SPEED, TORQUE, TRACTION_HELD_US, Inputs, TickInputs
from wrcd.core.lane_records import (
    FIELD,
    FRAME_RECORD,
    LANE,
    MAX_CYCLES,
    MAX_WORDS,
    MESSAGE,
    PLACE,
    SENT,
    SIGNAL,
    SLOT,
    TOLD,
)
from wrcd.core.messages import ROOM, Outbox, Outgoing, Report, nan_to_none
from wrcd.core.plausibility import MIN_RUN, JumpCheck, StuckCheck
from wrcd.core.records import StepResult
from wrcd.core.terms import EstimateDoubt, PairState
from wrcd.core.validity import LOAD_SHARES, OF_ESTIMATE, OF_PAIR, RADIUS_SHARES, Backoff, ValidityMonitor
from wrcd.core.vocabulary import CONFIDENCES, SURFACES, words_of

_, FRAME, TICK, DUE, NOTE = range(5)  # why it stopped: enum wrcd_lane_stop
FIRST_WAIT, LAST_WAIT = 8, 128  # frames; the lane is tried again with the last: Python takes at least one
MAX_RAW = (1 << 63) - 1  # of a number that is sent
LONG = 64  # ticks in the lane that make the next wait the first again
_UNCHECKED, _STUCK, _JUMP = range(3)
_NONE_CAME = -1  # since the lane began, in the place of a run of equal values

_MAX_SLOTS = 64  # that are made without coming back


class Lender(Protocol):
    """What of a core is borrowed, and given back."""

    config: Config
    counts: Counts
    estimator: Estimator
    receiver: Receiver
    events: Events
    explains: bool
    muted: bool
    _open: int | None
    _begin_us: int
    _end_us: int
    _period_us: int
    _stamp_us: int
    _tick: TickInputs
    _inputs: Inputs
    _validity: ValidityMonitor
    _is_reset: list[bool]
    _outlier_us: list[int]
    _backoff: Backoff
    _outbox: Outbox

    def take_told(self) -> None:
        """Take what slots have told in the lane."""


def fits(core: Lender) -> bool:
    """Whether a core can have a lane: torques of one signal, few cycles."""
    inputs = core._inputs
    return (
        all(len(parts) == 1 for parts in inputs._parts)
        and min((t for _, t in inputs._deadlines), default=0) > 0
        and len(core._outbox.cycles_us) <= MAX_CYCLES
    )


class _Tables(ctypes.Structure):
    """wrcd_lane_tables."""

    _fields_ = [("tables", ctypes.c_void_p * 10), ("max_made", ctypes.c_int64), ("max_slots", ctypes.c_int64)]


class FastLane:
    """Of one core that it fits. limits_us: of a silence, and of steps of time forward and backward."""

    def __init__(self, core: Lender, limits_us: tuple[int, int, int]) -> None:
        self._core, self._inputs, self._n = core, core._inputs, len(core.config.axles)
        self._estimator = core.estimator
        self._run = core.estimator.library.wrcd_lane_run
        self.is_lent, self._limits_us, self.total_ticks, self._unseen_ticks = False, limits_us, 0, 0
        self._wait, self._left = FIRST_WAIT, FIRST_WAIT
        self._signals: list[Any] = []
        self._readers = [r for _, r in sorted(core.receiver.readers.items())]
        self._lane = np.zeros(1, dtype=LANE)
        self._k = self._lane[0]
        self._head = self._lane.view(np.int64)[:8]  # open … out_slots
        self._message = np.zeros(len(self._readers), dtype=MESSAGE)
        self._signal = np.zeros(max(1, sum(len(r.signals) for r in self._readers)), dtype=SIGNAL)
        self._place = np.zeros(len(QUANTITIES) * self._n, dtype=PLACE)
        self._speed = self._place[SPEED * self._n]
        places: list[int] = []
        oks: list[int] = []
        for m, (key, reader) in zip(self._message, sorted(core.receiver.readers.items()), strict=True):
            self._describe(m, key, reader, places, oks)
        self._places, self._oks = np.array([*places, 0], dtype=np.int32), np.array([*oks, 0], dtype=np.uint64)
        self._crc_table = np.frombuffer(CRC_TABLE, dtype=np.uint8)
        self._sent, self._fields, self._quiet = _sent_by(core._outbox)
        self._cycles = {int(s["word"]): int(s["cycle_us"]) for s in self._sent}
        self._adhesions = sum(w is not None for w in core._outbox.of_axles["adhesion"])
        self._made = np.zeros(_MAX_SLOTS * max(1, len(self._sent)), dtype=FRAME_RECORD)
        self._slots = np.zeros(_MAX_SLOTS, dtype=SLOT)
        sizes = [core.estimator.library.wrcd_lane_bytes(of) for of in range(8)]
        ours = FRAME_RECORD, MESSAGE, SIGNAL, PLACE, LANE, SENT, FIELD, SLOT
        assert sizes == [x.itemsize for x in ours], f"{sizes} are not {[x.itemsize for x in ours]}"
        tables = (
            self._message, self._signal, self._place, self._places, self._oks, self._crc_table, self._sent,
            self._fields, self._made, self._slots,
        )  # fmt: skip
        self._tables = _Tables(tuple(t.ctypes.data for t in tables), len(self._made), len(self._slots))
        lane = ctypes.c_void_p(self._lane.ctypes.data)
        self._arguments = lane, ctypes.byref(self._tables), *core.estimator.arguments
        self._taken = ctypes.c_int64(0)
        self._taken_at = ctypes.byref(self._taken)
        self._describe_words()
        self._describe_limits()

    def _describe(self, m: Any, key: int, reader: MessageReader, places: list[int], oks: list[int]) -> None:
        inputs, checker = self._inputs, reader.checker
        m["word"], m["length"], m["is_big_endian"] = key, reader.length, reader.order == "big"
        m["is_plain"] = (
            reader.order is not None and not reader.fd and reader.length <= 8
            and all(s.is_simple and max(s.mask, s.sign) < 1 << 52 for s in reader.signals)
            and (not reader.statuses or bool(reader.good_statuses[1]))
        )  # fmt: skip
        m["is_protected"] = checker is not None
        m["crc_start"] = 0 if checker is None else checker.start
        if not m["is_plain"]:  # Python takes its frames
            return
        m["first_signal"], m["signals"] = len(self._signals), len(reader.signals)
        bits, good = reader.good_statuses
        m["status_bits"], m["first_ok"], m["oks"] = bits, len(oks), len(good)
        oks += sorted(good)
        for signal in reader.signals:
            s, number = self._signal[len(self._signals)], signal.number
            check = inputs._checks[number]
            s["mask"], s["sign"], s["shift"] = signal.mask, signal.sign, signal.shift
            s["scale"], s["offset"], s["factor"] = float(signal.scale), float(signal.offset), float(signal.factor)
            s["low"], s["high"] = signal.low, signal.high
            s["first_end"], s["last_end"] = inputs._ends[number]
            s["quantity"], s["first_place"], s["places"] = (
                inputs._quantities[number], len(places), len(inputs._places[number])
            )  # fmt: skip
            places += inputs._places[number]
            if isinstance(check, StuckCheck):
                s["check"] = _STUCK
            elif isinstance(check, JumpCheck):
                s["check"], s["max_step"], s["timeout_us"] = _JUMP, check._max_step, check._timeout_us
            self._signals.append(check)

    def _describe_words(self) -> None:
        k, outbox = self._k, self._core._outbox
        k["surfaces"], k["confidences"], k["room"] = len(SURFACES), len(CONFIDENCES), ROOM
        k["surface_pct"][: len(SURFACES)] = [low for low, _ in SURFACES]
        k["confidence_pp"][: len(CONFIDENCES)] = [most for most, _ in CONFIDENCES]
        k["sent"], k["adhesions"], k["window_ticks"] = len(self._sent), self._adhesions, self._core._validity._window
        k["of_pair"] = [OF_PAIR.get(state, Cause.NONE) for state in PairState]
        k["of_doubt"] = [OF_ESTIMATE.get(doubt, Cause.NONE) for doubt in EstimateDoubt]
        k["contradiction"], k["too_little_data"] = Cause.CONTRADICTION, Cause.TOO_LITTLE_DATA
        k["inputs_cycle_us"][: self._n] = [outbox.inputs_cycle_us(axle) for axle in range(self._n)]

    def _describe_limits(self) -> None:
        core, inputs, k, design = self._core, self._inputs, self._k, self._core.config.design
        k["period_us"], k["axles"], k["messages"] = core._period_us, self._n, len(self._message)
        k["silence_us"], k["forward_us"], k["backward_us"] = self._limits_us
        cycles = core._outbox.cycles_us
        k["cycles"], k["cycle_us"][: len(cycles)] = len(cycles), cycles
        k["min_speed_m_s"], (k["speed_low"], k["speed_high"]) = core.config.min_speed_m_s, inputs._speeds
        k["load_N"], k["radius_m"] = 2.0 * design.normal_N, design.r_0
        k["dead_Nm"], k["against_Nm"] = inputs._dead_Nm, inputs._against_Nm
        k["shares"] = *LOAD_SHARES, *RADIUS_SHARES
        k["traction_held_us"], k["patience"] = TRACTION_HELD_US, design.recent_ticks
        k["speed_tells_direction"] = inputs._speed_tells_direction
        k["torque_sign_counts"], k["torque_is_total"] = inputs._torque_sign_counts, inputs._torque_is_total
        self._place["is_mapped"] = 0
        for place, timeout_us in inputs._deadlines:
            self._place[place]["is_mapped"], self._place[place]["timeout_us"] = 1, timeout_us

    def is_open(self) -> bool:
        """Whether the lane may take the next frame: nothing is going on that it would have to know."""
        if self.is_lent:
            return True
        self._left -= 1
        if self._left > 0:
            return False
        self._left = self._wait
        core, inputs, validity = self._core, self._inputs, self._core._validity
        return not (
            core._open is None or core._open < 0 or core._stamp_us == NEVER or core._begin_us == NEVER
            or True in core._is_reset
            or any(core.events.tick_causes) or any(validity._newest) or any(validity._stale_ticks)
            or not {Cause.STANDSTILL, Cause.INPUT_SILENT}.isdisjoint(validity._begun)
            or inputs._speed_jumped or not inputs.all_trusted
            or any(core._backoff.waiting(axle, core._open) for axle in range(self._n))
            or any(check.run >= MIN_RUN for check in inputs._stuck_checks.values())
        )  # fmt: skip

    def take(self, batch: FrameBatch, first: int) -> tuple[int, int]:
        """Take frames from `first` on until something happens. Returns what, and the first that was not taken."""
        if not self.is_lent:
            self._lend()
        self._taken.value = first
        stop = self._run(*self._arguments, batch.records, len(batch), self._taken_at)
        if stop in (FRAME, TICK):
            self.give_back()
            long = self.total_ticks - self._lent_at >= LONG
            self._left = self._wait = FIRST_WAIT if long else min(2 * self._wait, LAST_WAIT)
        return stop, self._taken.value

    def _lend(self) -> None:
        core, inputs, k, p, n = self._core, self._inputs, self._k, self._place, self._n
        self.is_lent, self._lent_at = True, self.total_ticks
        k["open"], k["begin_us"], k["end_us"], k["stamp_us"] = core._open, core._begin_us, core._end_us, core._stamp_us
        k["accepted"] = k["ticks"] = k["out_frames"] = k["out_slots"] = 0
        k["ratio_known"], k["torque_ratio"][:n] = inputs._torque_ratio_known, inputs._torque_ratio
        k["sound_ticks"][:n], k["outlier_us"][:n] = core._validity._sound_ticks, core._outlier_us
        k["rejected_until_us"] = inputs.reach.rejected_until_us
        k["shares_known"], k["is_reverse"] = inputs._shares_known and inputs._shares_ok, inputs._reverse
        p["stamp_us"], p["value"] = inputs._stamp_us, inputs._value
        p["traction_us"][TORQUE * n : (TORQUE + 1) * n] = inputs._traction_us
        buffer, measured = inputs._jitter_buffer, p[: (LAT + 1) * n]
        measured["used_us"], measured["surplus_ticks"] = buffer.used_us, buffer._surplus_ticks
        for place, waiting in zip(measured, buffer._waiting, strict=True):
            place["waits"] = len(waiting)
            for i, (value, stamp_us) in enumerate(waiting):
                place["waiting"][i], place["waiting_us"][i] = value, stamp_us
        for s, check in zip(self._signal, self._signals, strict=False):
            if isinstance(check, StuckCheck):
                s["value"], s["run"], s["share"], s["frames"] = check.value, check.run, check._share, check._frames
                s["changed_us"] = NEVER if check._changed_us is None else check._changed_us
            elif isinstance(check, JumpCheck):
                s["value"], s["changed_us"], s["run"] = check._value, check._stamp_us, _NONE_CAME
        self._message["frames"] = 0
        for m, reader in zip(self._message, self._readers, strict=True):
            if (checker := reader.checker) is not None:
                m["is_suspicious"], m["last"] = checker.is_suspicious, -1 if checker._last is None else checker._last
        self.was_told()

    def was_told(self) -> None:
        """A slot has been told by Python."""
        k, events, reach = self._k, self._core.events, self._inputs.reach
        self._place["reach"], self._place["reach_until_us"] = reach._register, reach._until_us
        k["confidence"][: self._n] = [_LEVELS.index(level) for level in events.confidences]
        k["cause"][: self._n], k["standing"][: self._n] = events.causes, events.standing_causes
        quiet = events.all_estimated and not (self._core.explains or self._core.muted)
        k["quiet"] = self._quiet if quiet else 0

    def tells_nothing(self) -> None:
        """Leave every slot to Python, until one has been told there."""
        self._k["quiet"] = 0

    def made(self) -> list[Outgoing]:
        """The frames that were made since the last time."""
        count = int(self._head[6])
        if not count:
            return []
        k, self._head[6] = self._k, 0
        self._core.events.confidences = [_LEVELS[level] for level in k["confidence"][: self._n].tolist()]
        cycles = self._cycles
        made = self._made[:count]
        return [
            Outgoing(frame, cycles[frame.key], None, _CAUSES[cause])
            for frame, cause in zip(FrameBatch(made.tobytes()), made["cause"].tolist(), strict=True)
        ]

    def reports(self) -> list[Report]:
        """Of every axle at the newest slot that was told since the last time; empty: there was none."""
        count = int(self._k["out_slots"])
        self._k["out_slots"] = 0
        return [
            _report(of_axle)
            for slot in self._slots[max(count - 1, 0) : count]
            for of_axle in slot["told"][: self._n].tolist()
        ]

    @property
    def newest(self) -> int:
        """The newest tick's number."""
        return int(self._k["open"]) - 1

    @property
    def result(self) -> StepResult:
        """What that tick brought."""
        return self._estimator.newest

    @property
    def yaw_rate(self) -> FloatArray:
        """(n,): of the newest tick."""
        return np.array(self._k["z"][: self._n])

    @property
    def due(self) -> tuple[int, ...]:
        """The cycles whose slots begin with the newest tick's end."""
        due = int(self._k["due"])
        return tuple([cycle_us for k, cycle_us in enumerate(self._core._outbox.cycles_us) if due >> k & 1])

    def count(self) -> None:
        """Show the core how far it has come, and the speed."""
        core = self._core
        core._open, core._begin_us, core._end_us, core._stamp_us, ticks, accepted, _, _ = self._head.tolist()
        core.counts.ticks += ticks
        core.counts.accepted += accepted
        self.total_ticks += ticks
        self._unseen_ticks += ticks
        self._head[4:6] = 0
        self._inputs.speed_m_s = float(self._speed["value"])

    def report(self) -> None:
        """Show the core all that it tells of its inputs."""
        self.count()
        core, inputs, k, p, n = self._core, self._inputs, self._k, self._place, self._n
        core._validity.went_on(self._unseen_ticks)
        self._unseen_ticks = 0
        for axle in range(n):
            if core._validity.window_full[axle]:
                core._backoff.recovered(axle)
        inputs._stamp_us, inputs._value = p["stamp_us"].tolist(), p["value"].tolist()
        inputs._jitter_buffer.used_us = p["used_us"][: (LAT + 1) * n].tolist()
        core._tick = TickInputs(inputs.speed_m_s, False, [], None, k["torque_ratio"][:n].tolist(), (), ())
        inputs.reach._register, inputs.reach._until_us = p["reach"].tolist(), p["reach_until_us"].tolist()

    def give_back(self) -> None:
        """Let Python go on from here."""
        if not self.is_lent:
            return
        self._core.take_told()
        self.is_lent = False
        self.report()
        inputs, k, p, n = self._inputs, self._k, self._place, self._n
        inputs._torque_ratio_known = bool(k["ratio_known"])
        inputs._torque_ratio = k["torque_ratio"][:n].tolist()
        inputs._shares_known, inputs._shares_ok = bool(k["shares_known"]), True
        inputs._traction_us = p["traction_us"][TORQUE * n : (TORQUE + 1) * n].tolist()
        buffer, measured = inputs._jitter_buffer, p[: (LAT + 1) * n]
        buffer._surplus_ticks = measured["surplus_ticks"].tolist()
        for place, waiting in zip(measured, buffer._waiting, strict=True):
            waits = int(place["waits"])
            waiting.clear()
            waiting.extend(zip(place["waiting"][:waits].tolist(), place["waiting_us"][:waits].tolist(), strict=True))
        for s, check in zip(self._signal, self._signals, strict=False):
            changed_us = int(s["changed_us"])
            if isinstance(check, StuckCheck):
                check.value, check.run = float(s["value"]), int(s["run"])
                check._share, check._frames = float(s["share"]), float(s["frames"])
                check._changed_us = None if changed_us == NEVER else changed_us
            elif isinstance(check, JumpCheck) and s["run"] != _NONE_CAME:
                check._value, check._stamp_us = float(s["value"]), changed_us
                check._doubted, check.jumped = math.nan, False
        for m, reader in zip(self._message, self._readers, strict=True):
            if m["frames"] and reader.checker is not None:
                payload = m["payload"].tobytes()[: reader.length]
                reader.checker.follow(int(m["last"]), payload, int(m["last_us"]), int(m["frames"]))


_CAUSES = tuple(Cause)
_SURFACES, _CONTACTS, _LEVELS = (words_of("adhesion", name) for name in ("Surface", "ContactState", "Confidence"))


def _report(told: list[float]) -> Report:
    _, mu, used, age, surface, contact, level, cause, short = told
    return Report(
        Validity.DEGRADED if cause else Validity.VALID, nan_to_none(mu), used, int(age), _SURFACES[int(surface)],
        _CONTACTS[int(contact)], _LEVELS[int(level)], _CAUSES[int(cause)], bool(short),
    )  # fmt: skip


def _sent_by(outbox: Outbox) -> tuple[Any, Any, int]:
    """What is sent of the axles: messages, their fields, and a bit for each cycle at which nothing else is due. No
    messages and no cycles where any is not plain."""
    groups = outbox.of_axles
    written = [(group, axle, w) for group, of in groups.items() for axle, w in enumerate(of) if w is not None]
    fields_of = [f for _, _, w in written for f in w.writers.values()]
    if any(w.order is None or w.fd or w.length > 8 for _, _, w in written) or any(
        max(map(abs, f.raws)) > MAX_RAW for f in fields_of
    ):
        return np.zeros(0, dtype=SENT), np.zeros(0, dtype=FIELD), 0
    sent, fields = (
        np.zeros(len(written), dtype=SENT),
        np.zeros(sum(len(w.writers) for _, _, w in written), dtype=FIELD),
    )
    first = 0
    for s, (group, axle, w) in zip(sent, written, strict=True):
        s["start"], s["cycle_us"], s["axle"], s["length"] = w.start, w.cycle_us, axle, w.length
        s["word"] = w.can_id | EXTENDED * w.extended
        s["is_big_endian"], s["is_protected"] = w.order == "big", w.data_id is not None
        s["crc_start"] = 0 if w.data_id is None else Checker(w.data_id).start
        s["first_field"], s["fields"] = first, len(w.writers)
        for f, (name, signal) in zip(fields[first:], w.writers.items(), strict=False):
            _describe_field(f, group, name, signal)
        first += len(w.writers)
    others = {w.cycle_us for w in outbox.others}
    quiet = sum(1 << k for k, cycle_us in enumerate(outbox.cycles_us) if cycle_us not in others)
    return sent, fields, quiet


def _describe_field(f: Any, group: str, name: str, signal: SignalWriter) -> None:
    f["told"], f["mask"], f["shift"] = TOLD.index(name), signal.mask, signal.shift
    words = words_of(group, name)
    f["is_word"] = bool(words)
    for k, word in enumerate(words[:MAX_WORDS]):
        f["word_bits"][k] = (signal.raw(word) & signal.mask) << signal.shift
    f["factor"], f["low"], f["high"], f["scale"], f["offset"] = signal.numbers
    f["lowest"], f["highest"], f["not_available"] = signal.raws
    f["is_rounded_down"], f["rounds"] = signal.rounds_down, signal.rounds
