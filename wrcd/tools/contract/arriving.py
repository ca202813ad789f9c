"""Checks of how frames arrive: damaged, repeated, lost, late, under another id, not at all."""

from collections.abc import Callable
from dataclasses import replace

from wrcd.bus.frame import Frame
from wrcd.tools.contract.frames import NOTHING, FrameMaker, Says
from wrcd.tools.contract.player import BASE, Player, Sent
from wrcd.tools.contract.rules import AXLES, E2E, ORDER, TIMEOUT, Check, rule

CHECKS: list[Check] = []
# What foul frames say: one that is above what is used, then less and less, so that one that is used can be told.
FOUL = (Says(60.0, "Within1pp"), Says(14.0, "Within1pp"), Says(11.0, "Within1pp"), Says(8.0, "Within1pp"))
# Foul frames come so far apart: not more than five in a second, or a consumer may fall back before it is judged.
APART_US, MIN_APART = 200_000, 4  # slots
JUMP = 7  # counts: far from what follows, before and behind
MANY_US = 1_500_000  # of dropped frames, one after the other
MAX_DROPPED, SECOND_US = 5, 1_000_000  # with more dropped frames in a second a consumer falls back
Tamper = Callable[[Frame], Frame]  # of a frame that says something foul


@rule(CHECKS, E2E)
def wrong_crc_is_dropped(p: Player) -> None:
    """Bits flipped on the way."""
    _protected(p)
    _ignores(p, _damaged, "{} frames with a wrong CRC")


@rule(CHECKS, E2E)
def crc_of_another_data_id_is_dropped(p: Player) -> None:
    """Another message under this id."""
    _protected(p)
    _ignores(p, lambda f: p.maker.again(f, other_message=True), "{} frames with the CRC of another data id")


@rule(CHECKS, E2E)
def nothing_but_wrong_crcs_falls_back(p: Player) -> None:
    """Dropped frames are none."""
    _protected(p)
    p.settle()
    seen = p.run(p.maker.timeout_us + p.hold_us, lambda n, slot: [Sent(_damaged(p.frame(slot)))])
    p.must_fall_back(seen, "nothing but frames with a wrong CRC", p.maker.timeout_us)


@rule(CHECKS, ORDER)
def wrong_length_is_dropped(p: Player) -> None:
    """A frame is used whole or not at all."""
    length = len(p.frame(0).data)
    p.need(length > 2, "has no byte to spare")
    _ignores(p, lambda f: p.maker.again(replace(f, data=f.data[:-1])), f"{{}} frames of {length - 1} bytes")
    if length < 8:
        longer = f"{{}} frames of {length + 1} bytes"
        _ignores(p, lambda f: p.maker.again(replace(f, data=f.data + b"\0")), longer)


@rule(CHECKS, ORDER)
def remote_frame_is_dropped(p: Player) -> None:
    """It has no data."""
    _ignores(p, lambda f: replace(f, data=b"", remote=True, extra=len(f.data)), "{} remote frames")


@rule(CHECKS, ORDER)
def fd_frame_is_dropped(p: Player) -> None:
    """A message of wrcd is a classical frame: the same bytes in CAN FD are another sender's."""
    p.need(p.bench.fd, "comes in classical frames alone on this bus: virtual time plays CAN FD")
    _ignores(p, lambda f: replace(f, fd=True), "{} CAN FD frames")


@rule(CHECKS, ORDER)
def id_of_the_other_kind_is_dropped(p: Player) -> None:
    """The same number as an id of 29 bits, not 11, or the other way round, is another message."""
    p.need(p.frame(0).can_id <= 0x7FF, "has an id that no frame with 11 bits can have")
    _ignores(p, lambda f: replace(f, extended=not f.extended), "{} frames whose id has the other number of bits")


@rule(CHECKS, ORDER)
def other_id_is_dropped(p: Player) -> None:
    """Another message, of the same bytes."""
    _ignores(p, lambda f: replace(f, can_id=f.can_id ^ 0x40), "{} frames under another id")


@rule(CHECKS, AXLES)
def other_axle_is_not_used(p: Player) -> None:
    """Take no axle's adhesion for another's."""
    p.need(p.other is not None, "is the only axle's")
    _ignores(p, _whole, "{} frames of another axle", ahead=1, of=p.other)


@rule(CHECKS, E2E)
def repeated_counter_is_dropped(p: Player) -> None:
    """A gateway that plays a frame again."""
    _protected(p)
    _ignores(p, _whole, "{} frames with the counter of the frame before", ahead=-1, at_least=2)


@rule(CHECKS, E2E)
def frame_out_of_order_is_dropped(p: Player) -> None:
    """An older frame after a newer one."""
    _protected(p)
    _ignores(p, _whole, "{} frames with the counter of the frame before the last", ahead=-2, at_least=2)


@rule(CHECKS, E2E)
def stray_counter_is_dropped(p: Player) -> None:
    """A frame that belongs to another sequence."""
    _protected(p)
    _ignores(p, _whole, f"{{}} frames whose counter is {JUMP} ahead", ahead=JUMP, at_least=2)


@rule(CHECKS, E2E)
def counter_four_or_five_on_is_dropped(p: Player) -> None:
    """Three on is the most that lost frames explain within the time-out."""
    _protected(p)
    for on in (4, 5):
        _ignores(p, _whole, f"{{}} frames whose counter is {on} on", ahead=on - 1, at_least=2)


@rule(CHECKS, E2E)
def more_than_five_dropped_frames_fall_back(p: Player) -> None:
    """In a second, however many good ones come between."""
    _protected(p)
    many, apart = MAX_DROPPED + 1, 3
    judged_us = 9 * SECOND_US // 10  # before the first of them is a second old
    over_us = many * apart * p.maker.cycle_us
    p.need(over_us + p.hold_us < judged_us, f"comes too seldom for {many} dropped frames in a second")
    p.settle()

    def script(n: int, slot: int) -> list[Sent]:
        bad = n % apart == 0 and n < many * apart
        return [Sent(_damaged(p.frame(slot)) if bad else p.frame(slot), foul=bad)]

    seen = p.run(over_us, script)
    rest = p.play(BASE, judged_us - (p.bench.now_us() - seen.begun_us))
    p.must_fall_back(rest, f"good frames ({BASE}) after {many} with a wrong CRC within {over_us / 1e6:g} s")


@rule(CHECKS, E2E)
def counter_that_stands_still_falls_back(p: Player) -> None:
    """A sender that hangs: more than five dropped frames in a second."""
    _protected(p)
    p.settle()
    newest = p.slot
    seen = p.run(MANY_US + p.hold_us, lambda n, slot: [Sent(p.frame(newest))])
    p.must_fall_back(seen, f"one frame ({BASE}) again and again, its counter as it was", MANY_US)


@rule(CHECKS, E2E)
def second_sender_falls_back(p: Player) -> None:
    """Two daemons, or a tester: more than five dropped frames in a second."""
    _protected(p)
    p.settle()
    other, half_us = Says(40.0, "Within1pp"), p.maker.cycle_us // 2
    seen = p.run(MANY_US + p.hold_us, lambda n, slot: [Sent(p.frame(slot)), Sent(p.frame(slot + JUMP, other), half_us)])
    p.must_fall_back(seen, f"two senders ({BASE}; {other}) with counters {JUMP} apart", MANY_US)


@rule(CHECKS, E2E)
def new_sequence_is_accepted(p: Player) -> None:
    """From the second frame on that follows."""
    _protected(p)
    p.settle()
    seen = p.run(p.maker.timeout_us + p.hold_us, lambda n, slot: [Sent(p.frame(slot + JUMP))])
    p.must_use(seen, f"a sequence that goes on {JUMP} counts further")


@rule(CHECKS, E2E)
def lost_frames_are_no_fault(p: Player) -> None:
    """A counter two on."""
    p.settle()
    seen = p.run(p.hold_us + 6 * p.maker.cycle_us, lambda n, slot: [Sent(p.frame(slot))] if n % 2 else [])
    p.must_use(seen, f"{BASE}, every second frame lost")


@rule(CHECKS, E2E)
def counter_three_on_is_used(p: Player) -> None:
    """Two frames were lost. The one before was late, so that the next comes within a time-out of three cycles."""
    late_us = p.maker.cycle_us // 4
    p.need(3 * p.maker.cycle_us - late_us <= p.maker.timeout_us, "has a time-out below three cycles")
    p.settle()

    def script(n: int, slot: int) -> list[Sent]:
        at = n % 6  # late, lost, lost, three good ones
        return [] if at in (1, 2) else [Sent(p.frame(slot), late_us if at == 0 else 0)]

    seen = p.run(p.hold_us + 12 * p.maker.cycle_us, script)
    p.must_use(seen, f"{BASE}, two frames lost now and then")


@rule(CHECKS, TIMEOUT)
def late_frames_are_no_fault(p: Player) -> None:
    """Within the time-out."""
    p.settle()
    late_us = 3 * p.maker.cycle_us // 4
    seen = p.run(p.hold_us + 4 * p.maker.cycle_us, lambda n, slot: [Sent(p.frame(slot), late_us * (n % 2))])
    p.must_use(seen, f"{BASE}, every second frame {late_us / 1000:g} ms late")


@rule(CHECKS, TIMEOUT)
def silence_falls_back(p: Player) -> None:
    """The daemon was killed, or the line is cut."""
    p.settle()
    seen = p.silence(p.maker.timeout_us + p.hold_us)
    p.must_fall_back(seen, f"silence after {BASE}", p.maker.timeout_us)
    p.must_return("after silence")
    if p.bench.strict:
        p.must_hold_until_the_time_out()


@rule(CHECKS, TIMEOUT)
def orderly_end_falls_back(p: Player) -> None:
    """NotAvailable once more, then silence."""
    p.settle()
    p.play(NOTHING, p.maker.cycle_us)
    seen = p.silence(p.hold_us)
    p.must_fall_back(seen, f"{NOTHING.validity.value} once, and then silence")


@rule(CHECKS, TIMEOUT)
def restart_falls_back_until_valid(p: Player) -> None:
    """A crash; then WarmingUp; then Valid, with nothing to acknowledge."""
    p.settle()
    seen = p.silence(p.maker.timeout_us + p.hold_us)
    p.must_fall_back(seen, f"a daemon that is killed after {BASE}", p.maker.timeout_us)
    seen = p.hold(NOTHING)
    p.must_fall_back(seen, f"{NOTHING.validity.value} (WarmingUp) after a restart")
    p.must_return("after a restart")


def _protected(p: Player) -> None:
    p.need(p.maker.protected, "has no E2E: no base for a controller")


def _whole(frame: Frame) -> Frame:
    return frame


def _damaged(frame: Frame) -> Frame:
    return replace(frame, data=bytes((frame.data[0] ^ 0x5A,)) + frame.data[1:])


def _ignores(
    p: Player,
    tamper: Tamper,
    played: str,
    *,
    ahead: int = 0,
    at_least: int = 1,
    of: FrameMaker | None = None,
) -> None:
    """Good frames, and now and then a foul one in a good one's place, its counter so many ahead of its slot's.

    of: whose frames the foul ones are; then the good ones come all.
    """
    before = p.settle()
    maker = of or p.maker
    every = max(MIN_APART, -(-APART_US // p.maker.cycle_us))

    def script(n: int, slot: int) -> list[Sent]:
        good = [Sent(p.frame(slot))]
        which, at = divmod(n, every)
        if at != 1 or which >= len(FOUL):
            return good
        foul = Sent(tamper(maker.frame(slot + ahead, FOUL[which])), foul=True)
        return [*good, foul] if of else [foul]

    seen = p.run(every * len(FOUL) * p.maker.cycle_us, script)
    said = ", ".join(f"{f.mu_pct:g} %" for f in FOUL)
    p.must_ignore(seen, before, f"{played.format(len(seen.foul_us))} ({said}) between frames of {BASE}", at_least)
