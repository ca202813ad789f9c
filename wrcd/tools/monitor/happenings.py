"""What happened to an axle, in order: falls and rises of adhesion, changes of Validity."""

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass

from wrcd.core.causes import Validity
from wrcd.tools.monitor.spells import Spell, Spells
from wrcd.tools.story.records import Fall

NEAR_US = 300_000  # a change of Validity so near to a fall is told with it


@dataclass(frozen=True, slots=True)
class Happening:
    """Something to jump to."""

    time_us: int
    text: str
    is_fall: bool


def happenings(fell: Sequence[Fall], spells: Sequence[Spell]) -> list[Happening]:
    """In order of time. The first spell is no change."""
    with_it: list[list[str]] = [[] for _ in fell]
    ends = [f.end_us + NEAR_US for f in fell]  # in order, as falls do not overlap
    out = []
    for s in spells[1:]:
        near = bisect_left(ends, s.begin_us)
        if near == len(fell) or fell[near].begin_us - NEAR_US > s.begin_us:
            out.append(Happening(s.begin_us, spell_text(s), False))
        elif s.words:
            with_it[near].append(spell_text(s))
    for f, texts in zip(fell, with_it, strict=True):
        verb = "fell" if f.after_pct < f.before_pct else "rose"
        text = f"available {verb} from {f.before_pct:.1f} to {f.after_pct:.1f} %"
        out.append(Happening((f.begin_us + f.end_us) // 2, "; ".join((text, *texts)), True))
    out.sort(key=lambda h: h.time_us)
    return out


def newest(fell: Sequence[Fall], spells: Spells, count: int, until_us: int) -> list[Happening]:
    """So many of happenings(), or more, the oldest first: of many spells few are looked at."""
    looked = count
    while True:
        part = spells.newest(looked + 1, until_us)
        if len(part) <= looked:
            return happenings(fell, part)
        known_us = part[1].begin_us  # what is older is not looked at, nor what it has to do with a fall
        whole = [f for f in fell if f.begin_us - NEAR_US >= known_us]
        after_us = max((f.end_us + NEAR_US for f in fell[: len(fell) - len(whole)]), default=0)
        found = [h for h in happenings(whole, part) if h.time_us > after_us]
        if len(found) >= count:
            return found
        looked *= 4


def spell_text(s: Spell) -> str:
    """A spell for a person: "Degraded for 2.3 s, InputStale: an input was past its time-out"."""
    text = f"{s.state} for {duration(s.duration_s)}"
    if s.cause:
        text += f", {s.cause.label}"
    return f"{text}: {s.words}" if s.words and s.cause else text


def duration(seconds: float) -> str:
    """So that it can be read at a glance."""
    if seconds < 60:
        return f"{seconds:.1f} s" if seconds >= 0.1 else f"{seconds * 1000:.0f} ms"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s"


def first_of_interest(found: Sequence[Happening], spells: Sequence[Spell]) -> int | None:
    """When a reader of a log begins: at the first fall, else where an axle first was not Valid any more."""
    fall = next((h.time_us for h in found if h.is_fall), None)
    if fall is not None:
        return fall
    valid = next((k for k, s in enumerate(spells) if s.state == Validity.VALID.value), None)
    after = [] if valid is None else spells[valid + 1 :]
    return after[0].begin_us if after else None
