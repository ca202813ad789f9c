"""What happened to an axle, in order: falls and rises of adhesion, changes of Validity."""

from collections.abc import Sequence
from dataclasses import dataclass

from wrcd.core.causes import Validity
from wrcd.tools.monitor.axle import AxleModel
from wrcd.tools.monitor.falls import falls
from wrcd.tools.monitor.spells import Spell
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
    out = []
    for f in fell:
        verb = "fell" if f.after_pct < f.before_pct else "rose"
        text = f"available {verb} from {f.before_pct:.1f} to {f.after_pct:.1f} %"
        out.append(Happening(f.end_us, text, True))
    for s in spells[1:]:
        near = [k for k, h in enumerate(out) if h.is_fall and abs(h.time_us - s.begin_us) <= NEAR_US]
        text = spell_text(s)
        if near:
            h = out[near[0]]
            out[near[0]] = Happening(h.time_us, f"{h.text}; {text}", True)
        else:
            out.append(Happening(s.begin_us, text, False))
    out.sort(key=lambda h: h.time_us)
    return out


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


def of_axle(axle: AxleModel) -> list[Happening]:
    """Of what is held."""
    return happenings(falls(axle.number, axle.adhesion), axle.spells.all())
