"""Which axle a signal is of, by the numbers in names."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from wrcd.bus.units import Quantity
from wrcd.config.input_mapping import MEASURED
from wrcd.core.terms import MAX_AXLES
from wrcd.dbc.recognition import SignalCandidate

PER_AXLE = (
    Quantity.YAW_RATE, Quantity.LAT_ACCEL, Quantity.TORQUE, Quantity.BRAKE_TORQUE, Quantity.AXLE_LOAD,
    Quantity.WHEEL_RADIUS,
)  # fmt: skip


@dataclass(slots=True)
class Arrangement:
    """What looks like what: by axle and quantity, best first; for all axles together; and what belongs nowhere."""

    axles: dict[int, dict[Quantity, list[SignalCandidate]]] = field(default_factory=dict)
    vehicle: dict[Quantity, list[SignalCandidate]] = field(default_factory=dict)
    by_bogie: dict[Quantity, dict[int, list[SignalCandidate]]] = field(default_factory=dict)
    unplaced: dict[Quantity, list[SignalCandidate]] = field(default_factory=dict)
    doubts: list[str] = field(default_factory=list)
    left_out: list[int] = field(default_factory=list)  # axles beyond what one daemon takes


def arrange(found: Iterable[SignalCandidate]) -> Arrangement:
    """Give every candidate its axle."""
    by_quantity: dict[Quantity, list[SignalCandidate]] = {}
    for c in found:
        by_quantity.setdefault(c.quantity, []).append(c)
    train = Arrangement()
    for q in (Quantity.SPEED, Quantity.DIRECTION):
        train.vehicle[q] = by_quantity.pop(q, [])
    measured = [c for q in MEASURED for c in by_quantity.get(q, [])]
    of_axles = any(c.axle is not None for c in measured)
    width = _axles_of_a_bogie(measured)
    if width:
        train.doubts.append(
            f"axles are numbered within their bogie: bogie 2's first is taken as axle {width + 1}, and so on"
        )
    for q in PER_AXLE:
        for c in by_quantity.get(q, []):
            number = _number(c, width, of_axles)
            if number is not None:
                train.axles.setdefault(number, {}).setdefault(q, []).append(c)
            elif c.bogie is not None:
                train.by_bogie.setdefault(q, {}).setdefault(c.bogie, []).append(c)
            else:
                train.unplaced.setdefault(q, []).append(c)
    _place_the_unnumbered(train)
    _keep_measured(train)
    _renumber(train)
    return train


def _axles_of_a_bogie(measured: Sequence[SignalCandidate]) -> int:
    """How many axles a bogie has, where names count them within the bogie; else 0."""
    both = {(c.bogie, c.axle) for c in measured if c.bogie is not None and c.axle is not None}
    locals_ = [axle for _, axle in both]
    return max(filter(None, locals_)) if len(set(locals_)) < len(locals_) else 0


def _number(c: SignalCandidate, width: int, of_axles: bool) -> int | None:
    if c.axle is not None:
        return (c.bogie - 1) * width + c.axle if width and c.bogie else c.axle
    return None if of_axles else c.bogie


def _place_the_unnumbered(train: Arrangement) -> None:
    """Names without numbers: signals of one name are of one axle each, in the order of their messages, where there are
    as many of them as axles; else the best is the only axle's, and the others are its rivals."""
    axles = sorted(train.axles) or _as_many_as_measured(train)
    for q in PER_AXLE:
        rest = train.unplaced.get(q, [])
        if not rest or any(q in quantities for quantities in train.axles.values()):
            continue
        best = _alike(rest)
        if len(best) == len(axles) > 1:
            for number, c in zip(axles, sorted(best, key=lambda c: c.message.number), strict=True):
                train.axles.setdefault(number, {})[q] = [c]
            train.doubts.append(f"{q.key}: no numbers in the names; axles are taken in the order of the messages' ids")
            train.unplaced[q] = [c for c in rest if c not in best]
        elif len(axles) == 1:
            train.axles.setdefault(axles[0], {})[q] = rest
            train.unplaced.pop(q)


def _alike(found: Sequence[SignalCandidate]) -> list[SignalCandidate]:
    """The best candidate and those of its name."""
    return [c for c in found if c.signal.name == found[0].signal.name and c.score >= found[0].score - 1]


def _as_many_as_measured(train: Arrangement) -> list[int]:
    """Axle numbers where no name has one: as many as gyros and accelerometers alike, else one."""
    counts = {len(_alike(rest)) for q in MEASURED if (rest := train.unplaced.get(q))}
    return list(range(1, 1 + (counts.pop() if len(counts) == 1 else 1)))


def _keep_measured(train: Arrangement) -> None:
    """Axles with neither gyro nor accelerometer are none of ours, unless there are no others."""
    measured = {n for n, found in train.axles.items() if found.keys() & {*MEASURED}}
    for number in sorted(train.axles.keys() - measured) if measured else ():
        for q, found in train.axles.pop(number).items():
            train.unplaced.setdefault(q, []).extend(found)


def _renumber(train: Arrangement) -> None:
    """Axles are 1 … MAX_AXLES."""
    if train.axles and not all(1 <= n <= MAX_AXLES for n in train.axles):
        old = sorted(train.axles)
        train.left_out = old[MAX_AXLES:]
        if old[:MAX_AXLES] != list(range(1, len(old[:MAX_AXLES]) + 1)):
            train.doubts.append(f"axles {', '.join(map(str, old[:MAX_AXLES]))} are numbered from 1 on")
        train.axles = {new: train.axles[n] for new, n in enumerate(old[:MAX_AXLES], 1)}


def near(train: Arrangement, q: Quantity) -> list[SignalCandidate]:
    """What looks like a quantity, and is of no axle in particular."""
    return [*train.unplaced.get(q, []), *(c for found in train.by_bogie.get(q, {}).values() for c in found)]
