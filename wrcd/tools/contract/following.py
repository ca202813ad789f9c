"""Checks of how a limit follows the interval's lower end: less at once, more slowly.

They leave a low limit behind, which a consumer may keep for a while: so they are played last, the lowest at the end.
"""

from wrcd.tools.contract.frames import Says
from wrcd.tools.contract.player import BASE, Player, Seen
from wrcd.tools.contract.rules import CONFIDENCE, FIRST, Check, rule

CHECKS: list[Check] = []
LEVELS = ("Within1pp", "Within2pp", "Within3pp", "Within5pp", "Within8pp", "Within12pp")
DROPPED = Says(10.0, "Within1pp")
RAMP_US = 1_500_000  # of the two seconds in which no rise may be followed to its end


@rule(CHECKS, CONFIDENCE)
def half_width_is_taken_off(p: Player) -> None:
    """The interval's lower end is what there is at most."""
    p.need(p.maker.has("Confidence"), "has no Confidence")
    p.settle(Says(30.0, LEVELS[0]))
    for level in LEVELS:
        _at_most(p, Says(30.0, level))


@rule(CHECKS, FIRST)
def drop_is_followed_at_once(p: Player) -> None:
    """Take less at once. Whether the half-width is taken off is another rule."""
    p.settle()
    p.must_be_at_most(p.hold(DROPPED), 10.0, f"{DROPPED} after {BASE}")


@rule(CHECKS, CONFIDENCE)
def rise_is_followed_slowly(p: Player) -> None:
    """Take more slowly: over at least two seconds, so that a rise that is none does no harm."""
    low, high = DROPPED, Says(40.0, "Within1pp")
    before = p.settle(low)
    seen = p.play(high, RAMP_US)
    if not p.bench.strict:  # a late player is a silence, after which the axle counts again
        seen = _until_fall_back(seen)
    most = before + 0.85 * (p.maker.lower_end(high) - before)
    must = f"follow a rise over at least two seconds, and be at {most:.1f} % at most by then"
    p.must_be_at_most(seen, most, f"{high} for {RAMP_US / 1e6:g} s after {low}", must)


@rule(CHECKS, CONFIDENCE)
def lower_end_below_zero_is_zero(p: Player) -> None:
    """A negative limit is none."""
    p.need(p.maker.has("Confidence"), "has no Confidence")
    p.settle(DROPPED)
    _at_most(p, Says(5.0, "Within12pp"))


def _until_fall_back(seen: Seen) -> Seen:
    limits = [limit for _, limit in seen.uses]
    end = limits.index(None) if None in limits else len(limits)
    return Seen(seen.begun_us, seen.uses[:end])


def _at_most(p: Player, says: Says) -> None:
    p.must_be_at_most(p.hold(says), p.maker.lower_end(says), f"{says}")
