"""What a receiver should make of Adhesion frames, by the core's check of E2E: none of a kit's code.

Verdicts are adhesion.h's numbers.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from wrcd.bus.dbc import find_message
from wrcd.bus.frame import Frame
from wrcd.bus.reasons import Reason
from wrcd.core.configuration import AxleConfig, Config
from wrcd.core.reading import Checker


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
                if verdict <= Verdict.ANEW:
                    axle.newest_us = f.stamp_us
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
            if reason is Reason.TWO_SENDERS and axle.checker.state["last"] == counter:
                axle.counter = counter
            return REFUSED[reason]
        axle.counter = counter
        step = 0 if before is None else (counter - before) % 15
        return {1: Verdict.ACCEPTED, 2: Verdict.AFTER_GAP, 3: Verdict.AFTER_GAP}.get(step, Verdict.ANEW)


def _check(axle: _Axle, checker: Checker, f: Frame, right: bool) -> Reason | None:
    """What the checker says, but that no sender starts anew within half a cycle: it then knows of no frame before."""
    counter, state = f.data[1] & 0x0F, checker.state
    before = state.copy()
    last, payload = int(before["last"]), before["payload"][: before["payload_bytes"]].tobytes()
    if not right or last < 0 or 1 <= (counter - last) % 15 <= 3:
        return checker.check(f.data)
    soon = axle.beside_us is not None and f.stamp_us - axle.beside_us < axle.axle.adhesion.cycle_us // 2
    if soon and before["frames_since_candidate"] == 0:
        state["candidate"] = -1
    reason = checker.check(f.data)
    if (counter, f.data, before["moves"]) == (last, payload, state["moves"]):  # a copy of the newest one
        state["candidate"] = before["candidate"]
    else:
        axle.beside_us = f.stamp_us
    return reason
