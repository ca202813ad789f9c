"""Numbers and times of a story in words."""

from collections.abc import Iterable

from wrcd.core.causes import Validity
from wrcd.tools.story.records import Event, Story


def percent(value: float) -> str:
    """38 or 4.6: two digits are enough."""
    return f"{value:.0f}" if abs(value) >= 9.95 else f"{value:.1f}"


def seconds(value_s: float) -> str:
    """A duration: 0.02 s, 8.0 s, 95 s."""
    digits = 2 if abs(value_s) < 0.995 else 1 if abs(value_s) < 99.95 else 0
    return f"{value_s:.{digits}f} s"


def at(story: Story, time_us: int) -> str:
    """A time since the log's first frame."""
    return f"{(time_us - story.begin_us) * 1e-6:.1f} s"


def causes(events: Iterable[Event]) -> str:
    """For how long each cause lasted, longest first: "TooLittleData 0.48 s, Harsh 0.04 s"."""
    lasted: dict[str, float] = {}
    for e in events:
        lasted[name(e)] = lasted.get(name(e), 0.0) + e.duration_s
    ordered = sorted(lasted.items(), key=lambda item: -item[1])
    more = f", {len(ordered) - 4} more" if len(ordered) > 4 else ""
    return ", ".join(f"{cause} {seconds(s)}" for cause, s in ordered[:4]) + more


def name(e: Event) -> str:
    """The cause of an event, as the DBC spells it."""
    return e.cause.label if e.cause else e.detail or "cause not told"


def because(e: Event) -> str:
    """The cause in words, with its figures where they are known."""
    if not e.cause:
        return e.detail or "no cause was told"
    return e.cause.words + (f" ({e.detail})" if e.detail else "")


def lasting(events: Iterable[Event], validity: Validity, begin_us: int, end_us: int) -> list[Event]:
    """What of the events of one Validity lies within a time."""
    return [
        Event(e.axle, max(e.begin_us, begin_us), min(e.end_us, end_us), e.validity, e.cause, e.detail)
        for e in events
        if e.validity is validity and e.begin_us < end_us and e.end_us > begin_us
    ]


def total_s(events: Iterable[Event]) -> float:
    """How long they last together."""
    return sum(e.duration_s for e in events)
