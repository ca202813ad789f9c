"""What the demo came to: how far the estimate was off, how fast it followed the rail, when it was not Valid."""

import itertools
import math
from collections.abc import Iterable, Sequence

from sim_ecu.play.observer import Trace
from wrcd.core.causes import Validity
from wrcd.core.events import Change

RAIL_PP, RAIL_RATIO = 3.0, 1.25  # from frame to frame: more than that is another rail
MAX_SPANS = 6  # in which it was not Valid, one by one
HOLDS = 3  # frames that the estimate must stay on the new rail's side


def lines(number: int, trace: Trace, changes: Sequence[Change], first_s: float, end_s: float) -> list[str]:
    """Of one axle."""
    pairs = valid_pairs(trace)
    if not pairs:
        return [f"axle {number}: not one of {len(trace.adhesion)} frames is Valid"]
    errors = sorted(abs(e - true) for _, e, true in pairs)
    out = [
        f"axle {number}: {len(pairs)} valid frames of {len(trace.adhesion)}, error of the estimate: median "
        f"{errors[len(errors) // 2]:.1f}, mean {sum(errors) / len(errors):.1f} percentage points "
        "(changes of rail included)"
    ]
    out += [f"  {text}" for text in _rails(trace)]
    spans = [f"  {text}" for text in _not_valid([c for c in changes if c.axle == number], first_s, end_s)]
    more = [f"  and {len(spans) - MAX_SPANS} times more"] if len(spans) > MAX_SPANS else []
    return [*out, *spans[:MAX_SPANS], *more]


def valid_pairs(trace: Trace) -> list[tuple[float, float, float]]:
    """(time, estimate, truth) of every Valid frame."""
    out, k = [], 0
    for t, a in trace.adhesion:
        while k + 1 < len(trace.truth) and trace.truth[k + 1][0] <= t:
            k += 1
        if a["Validity"] == "Valid" and isinstance(mu := a["MuAvailable"], float) and trace.truth:
            out.append((t, mu, float(trace.truth[k][1]["MuAvailable"])))
    return out


def _rails(trace: Trace) -> Iterable[str]:
    """Each change of rail, and how long until the estimate had crossed the geometric mean of both."""
    levels = [(t, float(true["MuAvailable"])) for t, true in trace.truth]
    for (_, before), (t, after) in itertools.pairwise(levels):
        if abs(after - before) < RAIL_PP or max(after, before) < RAIL_RATIO * min(after, before):
            continue
        delay_s = _crossed(trace, t, before, after)
        followed = (
            "wrcd has not followed"
            if delay_s is None
            else f"wrcd crossed the middle between them after {delay_s:.2f} s"
        )
        yield f"at {t:.1f} s the rail went from {before:.1f} to {after:.1f} %: {followed}"


def _crossed(trace: Trace, at_s: float, before: float, after: float) -> float | None:
    middle, held = math.sqrt(before * after), 0
    for t, a in trace.adhesion:
        if t < at_s:
            continue
        mu = a["MuAvailable"]
        across = isinstance(mu, float) and (mu < middle if after < before else mu > middle)
        held = held + 1 if across else 0
        if held == 1:
            since_s = t
        if held == HOLDS:
            return since_s - at_s
    return None


def _not_valid(changes: Sequence[Change], first_s: float, end_s: float) -> Iterable[str]:
    """Each time that it was not Valid: from when to when, and for what causes."""
    k = 0
    while k < len(changes):
        if changes[k].after is Validity.VALID:
            k += 1
            continue
        first = k
        while k < len(changes) and changes[k].after is not Validity.VALID:
            k += 1
        until_s = changes[k].time_us * 1e-6 - first_s if k < len(changes) else end_s
        from_s = max(changes[first].time_us * 1e-6 - first_s, 0.0)
        why = dict.fromkeys(f"{c.after}, {c.cause.label}" for c in changes[first:k])
        yield f"not Valid from {from_s:.1f} to {until_s:.1f} s: {'; '.join(why)}"
