"""The rules of the contract, in the order in which they are played. Each plays one thing, and judges what the consumer
makes of it.

Last are those of how a limit follows the interval's lower end: they leave a low limit behind, which a consumer may
keep for a while.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace

from wrcd.bus.frame import Frame
from wrcd.contract.contract_player import ContractPlayer, PlayedFrame, Seen
from wrcd.contract.frames import BASE, DEGRADED, NOTHING, FrameMaker, Says
from wrcd.core.causes import Validity

PAGE = "docs/reference/what-a-controller-does.md"
ORDER, TIMEOUT, E2E, VALIDITY = "In this order", "Time-out", "E2E", "Validity"
VALUES, CONFIDENCE = "MuAvailable, MuUsed, SampleAge", "Confidence"
SURFACE, CONTACT = "Surface", "ContactState"
FIRST, AXLES = "The first rule", "One axle, or the train"
# What foul frames say: one that is above what is used, then less and less, so that one that is used can be recognised.
FOUL = (Says(60.0, "Within1pp"), Says(14.0, "Within1pp"), Says(11.0, "Within1pp"), Says(8.0, "Within1pp"))
# Foul frames come so far apart: not more than five in a second, or a consumer may fall back before it is judged.
APART_US, MIN_APART = 200_000, 4  # slots
JUMP = 7  # counts: far from what follows, before and behind
STRAY = f"{{}} frames whose counter is {JUMP} ahead"
MANY_US = 1_500_000  # of dropped frames, one after the other
MAX_DROPPED, SECOND_US = 5, 1_000_000  # with more dropped frames in a second a consumer falls back
LEVELS = ("Within1pp", "Within2pp", "Within3pp", "Within5pp", "Within8pp", "Within12pp")
DROPPED = Says(10.0, "Within1pp")
RAMP_US = 1_500_000  # of the two seconds in which no rise may be followed to its end
State = Says | tuple[str, int]  # or a raw value of Validity with its name


@dataclass(frozen=True, slots=True)
class Check:
    """A rule, the section of the page where it stands, and what the configuration must send for it: a signal or E2E."""

    name: str
    section: str
    rule: Callable[[ContractPlayer], None]
    needs: str = ""

    @property
    def source(self) -> str:
        """Where the rule stands."""
        return f"{PAGE}, “{self.section}”"

    def run(self, p: ContractPlayer) -> None:
        """Play it. Raises BrokenRule, or CannotPlay."""
        p.need(self.needs not in p.maker.lacks, p.maker.lacks.get(self.needs, ""))
        self.rule(p)


# --- what a good frame says


def _valid_is_used(p: ContractPlayer) -> None:
    p.must_reach(BASE)
    p.must_use(p.hold(BASE), f"{BASE}, frame after frame")
    p.must_reach(replace(BASE, mu_pct=40.0))


def _unknown_validity(p: ContractPlayer) -> None:
    values = p.maker.unknown_validities()
    p.need(bool(values), "knows no other Validity")
    for name, raw in values:
        _falls_back_raw(p, "Validity", raw, f"Validity {name} with {BASE.mu_pct:g} %")


def _every_transition(p: ContractPlayer) -> None:
    states: list[State] = [BASE, DEGRADED, NOTHING, *p.maker.unknown_validities()[-1:]]
    p.settle()
    for before, after in round_trip(len(states)):
        if after == 0:
            p.must_return(f"after {_name(states[before])}")
            continue
        state = states[after]
        seen = p.hold(state) if isinstance(state, Says) else _hold_raw(p, "Validity", state[1])
        p.must_fall_back(seen, f"{_name(state)} after {_name(states[before])}")


def _name(state: State) -> str:
    return state.validity.value if isinstance(state, Says) else f"Validity {state[0]}"


def round_trip(states: int) -> list[tuple[int, int]]:
    """Return the way from state 0 along every ordered pair of two states once, and back to it."""
    left = {(a, b) for a in range(states) for b in range(states) if a != b}
    path: list[int] = []

    def walk(at: int) -> None:  # Hierholzer's way to a round trip over all edges
        for to in range(states):
            if (at, to) in left:
                left.remove((at, to))
                walk(to)
        path.append(at)

    walk(0)
    return list(itertools.pairwise(reversed(path)))


def _no_number(p: ContractPlayer, kind: str) -> None:
    values = [(words, raw) for of, words, raw in p.maker.no_numbers() if of == kind]
    p.need(bool(values), "has no such value of MuAvailable")
    for words, raw in values:
        _falls_back_raw(p, "MuAvailable", raw, f"Valid with {words}")


def _high_sample_age(p: ContractPlayer) -> None:
    p.need(p.max_age_ms < 220, "says no SampleAge beyond the consumer's bound")
    _falls_back(p, replace(BASE, age_ms=min(p.max_age_ms + 40, 254)))


def _wider(p: ContractPlayer) -> None:
    before = p.settle()
    for percent in (60.0, 14.0):
        says = Says(percent, "Wider")
        p.must_ignore(p.hold(says, foul=True), before, f"{says} after {BASE}")


def _with(validity: Validity) -> Says:
    return replace(BASE, validity=validity)


def _falls_back(p: ContractPlayer, *frames: Says) -> None:
    for says in frames:
        p.settle()
        p.must_fall_back(p.hold(says), f"{says} after {BASE}")
        p.must_return(f"after {says}")


def _falls_back_raw(p: ContractPlayer, signal: str, raw: int, played: str) -> None:
    p.settle()
    p.must_fall_back(_hold_raw(p, signal, raw), f"{played} after {BASE}")
    p.must_return(f"after {played}")


def _hold_raw(p: ContractPlayer, signal: str, raw: int) -> Seen:
    return p.run(p.hold_us, lambda n, slot: [PlayedFrame(p.maker.with_raw(p.maker.frame(slot), signal, raw))])


def _unknown(p: ContractPlayer, signal: str) -> None:
    _falls_back_raw(p, signal, p.maker.word(signal, "Unknown"), f"Valid with {signal} Unknown")


# --- how frames arrive


def _damaged(frame: Frame) -> Frame:
    return replace(frame, data=bytes((frame.data[0] ^ 0x5A,)) + frame.data[1:])


def _ignores(
    p: ContractPlayer,
    played: str,
    tamper: Callable[[Frame], Frame] | None = None,
    ahead: int = 0,
    at_least: int = 1,
    of: FrameMaker | None = None,
) -> None:
    """Play good frames, and now and then a foul one in a good one's place, its counter so many ahead of its slot's.

    of: whose frames the foul ones are; then the good ones come all.
    """
    before = p.settle()
    maker = of or p.maker
    every = max(MIN_APART, -(-APART_US // p.maker.cycle_us))

    def script(n: int, slot: int) -> list[PlayedFrame]:
        good = [PlayedFrame(p.maker.frame(slot))]
        which, at = divmod(n, every)
        if at != 1 or which >= len(FOUL):
            return good
        frame = maker.frame(slot + ahead, FOUL[which])
        foul = PlayedFrame(tamper(frame) if tamper else frame, foul=True)
        return [*good, foul] if of else [foul]

    seen = p.run(every * len(FOUL) * p.maker.cycle_us, script)
    values = ", ".join(f"{f.mu_pct:g} %" for f in FOUL)
    p.must_ignore(seen, before, f"{played.format(len(seen.foul_us))} ({values}) between frames of {BASE}", at_least)


def _other_data_id(p: ContractPlayer) -> None:
    _ignores(p, "{} frames with the CRC of another data id", lambda f: p.maker.again(f, other_message=True))


def _remote(frame: Frame) -> Frame:
    return replace(frame, data=b"", remote=True, extra=len(frame.data))


def _other_id(frame: Frame) -> Frame:
    return replace(frame, can_id=frame.can_id ^ 0x40)


def _miscounted(p: ContractPlayer, counter: str, ahead: int) -> None:
    _ignores(p, f"{{}} frames with the counter {counter}", ahead=ahead, at_least=2)


def _nothing_but_wrong_crcs(p: ContractPlayer) -> None:
    p.settle()
    seen = p.run(p.maker.timeout_us + p.hold_us, lambda n, slot: [PlayedFrame(_damaged(p.maker.frame(slot)))])
    p.must_fall_back(seen, "nothing but frames with a wrong CRC", p.maker.timeout_us)


def _wrong_length(p: ContractPlayer) -> None:
    length = len(p.maker.frame(0).data)
    p.need(length > 2, "has no byte to spare")
    _ignores(p, f"{{}} frames of {length - 1} bytes", lambda f: p.maker.again(replace(f, data=f.data[:-1])))
    if length < 8:
        _ignores(p, f"{{}} frames of {length + 1} bytes", lambda f: p.maker.again(replace(f, data=f.data + b"\0")))


def _fd(p: ContractPlayer) -> None:
    p.need(p.bench.fd, "comes in classical frames alone on this bus: virtual time plays CAN FD")
    _ignores(p, "{} CAN FD frames", lambda f: replace(f, fd=True))


def _other_kind_of_id(p: ContractPlayer) -> None:
    p.need(p.maker.frame(0).can_id <= 0x7FF, "has an id that no frame with 11 bits can have")
    _ignores(p, "{} frames whose id has the other number of bits", lambda f: replace(f, extended=not f.extended))


def _other_axle(p: ContractPlayer) -> None:
    p.need(p.other is not None, "is the only axle's")
    _ignores(p, "{} frames of another axle", ahead=1, of=p.other)


def _four_or_five_on(p: ContractPlayer) -> None:
    for on in (4, 5):
        _ignores(p, f"{{}} frames whose counter is {on} on", ahead=on - 1, at_least=2)


def _more_than_five_dropped(p: ContractPlayer) -> None:
    many, apart = MAX_DROPPED + 1, 3
    judged_us = 9 * SECOND_US // 10  # before the first of them is a second old
    over_us = many * apart * p.maker.cycle_us
    p.need(over_us + p.hold_us < judged_us, f"comes too seldom for {many} dropped frames in a second")
    p.settle()

    def script(n: int, slot: int) -> list[PlayedFrame]:
        bad = n % apart == 0 and n < many * apart
        frame = p.maker.frame(slot)
        return [PlayedFrame(_damaged(frame) if bad else frame, foul=bad)]

    seen = p.run(over_us, script)
    rest = p.play(BASE, judged_us - (p.bench.now_us() - seen.begun_us))
    p.must_fall_back(rest, f"good frames ({BASE}) after {many} with a wrong CRC within {over_us / 1e6:g} s")


def _counter_stands_still(p: ContractPlayer) -> None:
    p.settle()
    newest = p.slot
    seen = p.run(MANY_US + p.hold_us, lambda n, slot: [PlayedFrame(p.maker.frame(newest))])
    p.must_fall_back(seen, f"one frame ({BASE}) again and again, its counter as it was", MANY_US)


def _second_sender(p: ContractPlayer) -> None:
    p.settle()
    other, half_us, frame = Says(40.0, "Within1pp"), p.maker.cycle_us // 2, p.maker.frame
    seen = p.run(
        MANY_US + p.hold_us, lambda n, slot: [PlayedFrame(frame(slot)), PlayedFrame(frame(slot + JUMP, other), half_us)]
    )
    p.must_fall_back(seen, f"two senders ({BASE}; {other}) with counters {JUMP} apart", MANY_US)


def _new_sequence(p: ContractPlayer) -> None:
    p.settle()
    seen = p.run(p.maker.timeout_us + p.hold_us, lambda n, slot: [PlayedFrame(p.maker.frame(slot + JUMP))])
    p.must_use(seen, f"a sequence that goes on {JUMP} counts further")


def _lost_frames(p: ContractPlayer) -> None:
    p.settle()
    seen = p.run(p.hold_us + 6 * p.maker.cycle_us, lambda n, slot: [PlayedFrame(p.maker.frame(slot))] if n % 2 else [])
    p.must_use(seen, f"{BASE}, every second frame lost")


def _three_on(p: ContractPlayer) -> None:
    late_us = p.maker.cycle_us // 4
    p.need(3 * p.maker.cycle_us - late_us <= p.maker.timeout_us, "has a time-out below three cycles")
    p.settle()

    def script(n: int, slot: int) -> list[PlayedFrame]:
        at = n % 6  # late, lost, lost, three good ones
        return [] if at in (1, 2) else [PlayedFrame(p.maker.frame(slot), late_us if at == 0 else 0)]

    seen = p.run(p.hold_us + 12 * p.maker.cycle_us, script)
    p.must_use(seen, f"{BASE}, two frames lost now and then")


def _late_frames(p: ContractPlayer) -> None:
    p.settle()
    late_us = 3 * p.maker.cycle_us // 4
    seen = p.run(
        p.hold_us + 4 * p.maker.cycle_us, lambda n, slot: [PlayedFrame(p.maker.frame(slot), late_us * (n % 2))]
    )
    p.must_use(seen, f"{BASE}, every second frame {late_us / 1000:g} ms late")


def _silence(p: ContractPlayer) -> None:
    p.settle()
    p.must_fall_back(p.silence(p.maker.timeout_us + p.hold_us), f"silence after {BASE}", p.maker.timeout_us)
    p.must_return("after silence")
    if p.bench.strict:
        p.must_hold_until_the_time_out()


def _orderly_end(p: ContractPlayer) -> None:
    p.settle()
    p.play(NOTHING, p.maker.cycle_us)
    p.must_fall_back(p.silence(p.hold_us), f"{NOTHING.validity.value} once, and then silence")


def _restart(p: ContractPlayer) -> None:
    p.settle()
    seen = p.silence(p.maker.timeout_us + p.hold_us)
    p.must_fall_back(seen, f"a daemon that is killed after {BASE}", p.maker.timeout_us)
    p.must_fall_back(p.hold(NOTHING), f"{NOTHING.validity.value} (WarmingUp) after a restart")
    p.must_return("after a restart")


# --- how a limit follows


def _half_width(p: ContractPlayer) -> None:
    p.settle(Says(30.0, LEVELS[0]))
    for level in LEVELS:
        _at_most_lower_end(p, Says(30.0, level))


def _drop(p: ContractPlayer) -> None:
    p.settle()
    p.must_be_at_most(p.hold(DROPPED), 10.0, f"{DROPPED} after {BASE}")


def _rise(p: ContractPlayer) -> None:
    high = Says(40.0, "Within1pp")
    before = p.settle(DROPPED)
    seen = p.play(high, RAMP_US)
    if not p.bench.strict:  # a late player is a silence, after which the axle counts again
        seen = Seen(seen.begun_us, list(itertools.takewhile(lambda use: use[1] is not None, seen.uses)))
    most = before + 0.85 * (p.maker.lower_end(high) - before)
    must = f"follow a rise over at least two seconds, and be at {most:.1f} % at most by then"
    p.must_be_at_most(seen, most, f"{high} for {RAMP_US / 1e6:g} s after {DROPPED}", must)


def _below_zero(p: ContractPlayer) -> None:
    p.settle(DROPPED)
    _at_most_lower_end(p, Says(5.0, "Within12pp"))


def _at_most_lower_end(p: ContractPlayer, says: Says) -> None:
    p.must_be_at_most(p.hold(says), p.maker.lower_end(says), f"{says}")


CHECKS = (
    # a consumer that falls back for ever needs no wrcd; nor does one whose limit follows nothing
    Check("valid-is-used", ORDER, _valid_is_used),
    # its number is for people; played as the daemon sends it, and with an interval, which it never has
    Check("degraded-falls-back", VALIDITY, lambda p: _falls_back(p, DEGRADED, _with(Validity.DEGRADED))),
    # there is no estimate; nor is there one where a damaged daemon sends a number with it
    Check("not-available-falls-back", VALIDITY, lambda p: _falls_back(p, NOTHING, _with(Validity.NOT_AVAILABLE))),
    Check("unknown-validity-falls-back", VALIDITY, _unknown_validity),  # a newer daemon, or a damaged one
    Check("every-transition-of-validity", VALIDITY, _every_transition),
    # frames that say Valid, and have no number, an error in its place, or what no rail has
    Check("not-available-number-falls-back", VALUES, lambda p: _no_number(p, "not-available")),
    Check("error-number-falls-back", VALUES, lambda p: _no_number(p, "error")),
    Check("number-beyond-100-percent-falls-back", VALUES, lambda p: _no_number(p, "beyond")),
    # 255 ms or older, and older than the consumer can bear, by its own bound
    Check("unknown-sample-age-falls-back", VALUES, lambda p: _falls_back(p, replace(BASE, age_ms=255)), "SampleAge"),
    Check("high-sample-age-falls-back", VALUES, _high_sample_age, "SampleAge"),
    # Valid without a class, an estimate, an interval does not occur
    Check("unknown-surface-falls-back", SURFACE, lambda p: _unknown(p, "Surface"), "Surface"),
    Check("unknown-contact-state-falls-back", CONTACT, lambda p: _unknown(p, "ContactState"), "ContactState"),
    Check("confidence-none-falls-back", CONFIDENCE, lambda p: _falls_back(p, Says(20.0, "None")), "Confidence"),
    Check("confidence-wider-changes-no-limit", CONFIDENCE, _wider, "Confidence"),  # none from it, none lifted
    Check("wrong-crc-is-dropped", E2E, lambda p: _ignores(p, "{} frames with a wrong CRC", _damaged), "E2E"),
    Check("crc-of-another-data-id-is-dropped", E2E, _other_data_id, "E2E"),  # another message under this id
    Check("nothing-but-wrong-crcs-falls-back", E2E, _nothing_but_wrong_crcs, "E2E"),  # dropped frames are none
    Check("wrong-length-is-dropped", ORDER, _wrong_length),  # a frame is used whole or not at all
    Check("remote-frame-is-dropped", ORDER, lambda p: _ignores(p, "{} remote frames", _remote)),  # it has no data
    Check("fd-frame-is-dropped", ORDER, _fd),  # a message of wrcd is a classical frame
    # the same number as an id of 29 bits, not 11, or the other way round, is another message
    Check("id-of-the-other-kind-is-dropped", ORDER, _other_kind_of_id),
    Check("other-id-is-dropped", ORDER, lambda p: _ignores(p, "{} frames under another id", _other_id)),
    Check("other-axle-is-not-used", AXLES, _other_axle),
    Check("repeated-counter-is-dropped", E2E, lambda p: _miscounted(p, "of the frame before", -1), "E2E"),
    Check("frame-out-of-order-is-dropped", E2E, lambda p: _miscounted(p, "of the frame before the last", -2), "E2E"),
    Check("stray-counter-is-dropped", E2E, lambda p: _ignores(p, STRAY, ahead=JUMP, at_least=2), "E2E"),
    # three on is the most that lost frames explain within the time-out
    Check("counter-four-or-five-on-is-dropped", E2E, _four_or_five_on, "E2E"),
    # more than five in a second, however many good ones come between: a sender that hangs, two daemons, a tester
    Check("more-than-five-dropped-frames-fall-back", E2E, _more_than_five_dropped, "E2E"),
    Check("counter-that-stands-still-falls-back", E2E, _counter_stands_still, "E2E"),
    Check("second-sender-falls-back", E2E, _second_sender, "E2E"),
    Check("new-sequence-is-accepted", E2E, _new_sequence, "E2E"),  # from the second frame on that follows
    Check("lost-frames-are-no-fault", E2E, _lost_frames),  # a counter two on
    # two frames were lost; the one before was late, so that the next comes within a time-out of three cycles
    Check("counter-three-on-is-used", E2E, _three_on),
    Check("late-frames-are-no-fault", TIMEOUT, _late_frames),  # within the time-out
    Check("silence-falls-back", TIMEOUT, _silence),  # the daemon was killed, or the line is cut
    Check("orderly-end-falls-back", TIMEOUT, _orderly_end),  # NotAvailable once more, then silence
    # a crash; then WarmingUp; then Valid, with nothing to acknowledge
    Check("restart-falls-back-until-valid", TIMEOUT, _restart),
    Check("half-width-is-taken-off", CONFIDENCE, _half_width, "Confidence"),
    Check("drop-is-followed-at-once", FIRST, _drop),  # whether the half-width is taken off is another rule
    Check("rise-is-followed-slowly", CONFIDENCE, _rise),  # so that a rise that is none does no harm
    Check("lower-end-below-zero-is-zero", CONFIDENCE, _below_zero, "Confidence"),  # a negative limit is none
)
