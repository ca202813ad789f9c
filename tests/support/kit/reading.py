"""What a receiver should make of Adhesion frames, by wrcd.bus.e2e.Checker and cantools: none of a kit's code.

Verdicts, states, reasons and limits are adhesion.h's numbers.
"""

import math
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

from wrcd.bus.dbc import find_message, find_signal
from wrcd.bus.e2e import Checker
from wrcd.bus.frame import Frame
from wrcd.bus.reasons import Reason
from wrcd.core.configuration import AxleConfig, Config

NO_VALUE = 65535
MAX_DROPS, SECOND_US, MAX_AGE_MS = 5, 1_000_000, 60
EPSILON = 1e-7
WIDTHS = {"Within12pp": 12, "Within8pp": 8, "Within5pp": 5, "Within3pp": 3, "Within2pp": 2, "Within1pp": 1}
SURFACES = ("Unknown", "Dry", "Wet", "Reduced", "Low", "VeryLow")
CONTACTS = ("Unknown", "Adhering", "Saturated")
# the most cautious first, where two share a raw value
CAUTION = ("Error", "NotAvailable", "Degraded", "None", "Wider", *WIDTHS)


class Verdict(IntEnum):
    ACCEPTED = 0
    AFTER_GAP = 1
    ANEW = 2
    NOT_MINE = 3
    KIND = 4
    LENGTH = 5
    CRC = 6
    DATA_ID = 7
    REPEAT = 8
    COUNTER = 9
    TWO_SENDERS = 10


class Why(IntEnum):
    NO_REASON = 0
    NOTHING_YET = 3
    SENDERS = 4
    TIMED_OUT = 5
    MANY_DROPS = 6
    DEGRADED = 7
    NOT_AVAILABLE = 8
    VALIDITY = 9
    MU = 10
    SAMPLE_AGE = 11
    CONFIDENCE = 12
    NO_CLASS = 13


REFUSED = {
    Reason.CRC: Verdict.CRC, Reason.DATA_ID: Verdict.DATA_ID, Reason.REPEAT: Verdict.REPEAT,
    Reason.COUNTER: Verdict.COUNTER, Reason.TWO_SENDERS: Verdict.TWO_SENDERS,
}  # fmt: skip


@dataclass
class _Axle:
    axle: AxleConfig
    message: Any
    timeout_us: int
    checker: Checker | None
    newest_us: int | None = None
    heard_us: int | None = None
    counter: int | None = None
    beside_us: int | None = None  # when the newest frame beside the sequence came
    doubted: bool = False
    drops: list[int] = field(default_factory=list)
    says: dict[str, Any] = field(default_factory=dict)


class Reading:
    """The frames of a configuration. timeouts_us: by axle's number."""

    def __init__(self, config: Config, timeouts_us: dict[int, int]) -> None:
        ids = tuple(a.adhesion.data_id for a in config.axles if a.adhesion.data_id is not None)
        self._axles = {}
        for a in config.axles:
            identity = a.adhesion.data_id
            checker = None if identity is None else Checker(identity, ids)
            message = find_message(config.database, a.adhesion.message)
            self._axles[a.number] = _Axle(a, message, timeouts_us[a.number], checker)

    def feed(self, f: Frame) -> Verdict:
        """A frame, at its stamp."""
        for axle in self._axles.values():
            if (axle.message.frame_id, axle.message.is_extended_frame) == (f.can_id, f.extended) and not f.error:
                verdict = self._of(axle, f)
                if verdict > Verdict.ANEW:
                    axle.drops.append(f.stamp_us)
                else:
                    axle.newest_us, axle.says, axle.doubted = f.stamp_us, _says(axle, f.data), False
                axle.doubted |= verdict == Verdict.TWO_SENDERS
                return verdict
        return Verdict.NOT_MINE

    def _of(self, axle: _Axle, f: Frame) -> Verdict:
        if f.fd or f.remote:
            return Verdict.KIND
        if len(f.data) != axle.message.length:
            return Verdict.LENGTH
        if axle.checker is None:
            late = axle.newest_us is None or f.stamp_us - axle.newest_us > axle.timeout_us
            return Verdict.ANEW if late else Verdict.ACCEPTED
        # which frames it calls right is asked of a checker that knows nothing of before
        right = Checker(axle.axle.adhesion.data_id or 0).check(f.data) is None
        if right:
            if axle.heard_us is not None and f.stamp_us - axle.heard_us > axle.timeout_us:
                axle.checker.reset()
                axle.counter = None
            axle.heard_us = f.stamp_us
        reason = _check(axle, axle.checker, f, right)
        counter, before = f.data[1] & 0x0F, axle.counter
        if reason is not None:
            if reason is Reason.TWO_SENDERS and axle.checker._last == counter:
                axle.counter = counter
            return REFUSED[reason]
        axle.counter = counter
        step = 0 if before is None else (counter - before) % 15
        return {1: Verdict.ACCEPTED, 2: Verdict.AFTER_GAP, 3: Verdict.AFTER_GAP}.get(step, Verdict.ANEW)

    def poll(self, number: int, now_us: int) -> list[int]:
        """State, reason, limit, MuAvailable, half-width, lower end, MuUsed, shown, age, surface, contact."""
        axle = self._axles[number]
        out = [0, 0, 0, *[NO_VALUE] * 6, 0, 0]
        if axle.doubted and axle.heard_us is not None and now_us - axle.heard_us <= axle.timeout_us:
            out[1] = Why.SENDERS
            return out
        if axle.newest_us is None or now_us - axle.newest_us > axle.timeout_us:
            out[1] = Why.NOTHING_YET if axle.newest_us is None else Why.TIMED_OUT
            return out
        says = axle.says
        out[6:9] = [NO_VALUE if says.get(k) is None else says[k] for k in ("MuUsed", "MuAvailable", "SampleAge")]
        recent = sum(now_us - at < SECOND_US for at in axle.drops)
        if recent > MAX_DROPS:
            out[1] = Why.MANY_DROPS
        else:
            out[1] = _why(says)
        if out[1] != Why.NO_REASON:
            return out
        out[0], out[3] = 1, says["MuAvailable"]
        width = WIDTHS.get(says.get("Confidence", ""))
        if width is not None:
            out[2], out[4], out[5] = 2 if width <= 5 else 1, 100 * width, max(says["MuAvailable"] - 100 * width, 0)
        out[9], out[10] = (
            SURFACES.index(says.get("Surface", "Unknown")),
            CONTACTS.index(says.get("ContactState", "Unknown")),
        )
        return out


def _check(axle: _Axle, checker: Checker, f: Frame, right: bool) -> Reason | None:
    """What the checker says, but that no sender starts anew within half a cycle: it then knows of no frame before."""
    counter, last, payload, kept, moves = (
        f.data[1] & 0x0F,
        checker._last,
        checker._payload,
        checker._candidate,
        checker._moves,
    )
    if not right or last is None or 1 <= (counter - last) % 15 <= 3:
        return checker.check(f.data)
    soon = axle.beside_us is not None and f.stamp_us - axle.beside_us < axle.axle.adhesion.cycle_us // 2
    if soon and checker._frames_since_candidate == 0:
        checker._candidate = None
    reason = checker.check(f.data)
    if (counter, f.data, moves) == (last, payload, checker._moves):  # a copy of the newest one
        checker._candidate = kept
    else:
        axle.beside_us = f.stamp_us
    return reason


def _says(axle: _Axle, data: bytes) -> dict[str, Any]:
    """By our names: 0.01 % or ms, a word, or None."""
    raws: Any = axle.message.decode(data, decode_choices=False, scaling=False)
    values: Any = axle.message.decode(data, decode_choices=False)
    out: dict[str, Any] = {}
    for ours, sent in axle.axle.adhesion.signals.items():
        s, raw = find_signal(axle.message, sent.name), raws[sent.name]
        if sent.words is not None:
            found = [word for word, value in sent.words.items() if value == raw]
            out[ours] = min(found, key=lambda w: CAUTION.index(w) if w in CAUTION else -1, default=None)
            continue
        value = float(values[sent.name]) / sent.factor
        most = 100.0 if ours.startswith("Mu") else 60_000.0
        low, high = s.minimum if sent.low is None else sent.low, s.maximum if sent.high is None else sent.high
        good = raw != sent.not_available and raw not in (s.choices or {}) and -EPSILON < value < most + EPSILON
        good &= low is None or float(values[sent.name]) > float(low) - EPSILON
        good &= high is None or float(values[sent.name]) < float(high) + EPSILON
        rounded = {
            "MuAvailable": math.floor(100 * value + EPSILON), "MuUsed": math.floor(100 * value + 0.5 + EPSILON),
            "SampleAge": min(math.ceil(value - EPSILON), 255),
        }  # fmt: skip
        out[ours] = rounded[ours] if good else None
    return out


def _why(says: dict[str, Any]) -> Why:
    if says["Validity"] != "Valid":
        return {"Degraded": Why.DEGRADED, "NotAvailable": Why.NOT_AVAILABLE}.get(says["Validity"], Why.VALIDITY)
    if says["MuAvailable"] is None:
        return Why.MU
    if "SampleAge" in says and (says["SampleAge"] is None or says["SampleAge"] > MAX_AGE_MS):
        return Why.SAMPLE_AGE
    if says.get("Confidence", "Wider") in ("None", None):
        return Why.CONFIDENCE
    return (
        Why.NO_CLASS
        if any(says.get(k, "Dry") in ("Unknown", None) for k in ("Surface", "ContactState"))
        else Why.NO_REASON
    )
