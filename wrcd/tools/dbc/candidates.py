"""Which signals of a DBC look like an input, how much, and of which axle."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

from wrcd.bus.units import Quantity
from wrcd.tools.dbc.records import NO_NODE, DbcText, Message, Signal
from wrcd.tools.dbc.vocabulary import (
    AXLE_WORDS,
    BOGIE_WORDS,
    BRAKES,
    LOOKS,
    NOT_MEASURED,
    TRUTH,
    contains,
    converts,
    is_adhesion,
    is_enumeration,
    is_force,
    is_truth,
    letters,
    words,
)

MIN_SCORE = 3  # of a candidate; a name that says it, or a unit that only this quantity has
SURE_SCORE = 6  # both
MIN_BITS, MAX_BITS = 6, 64  # of a measurement
NAME, WEAK_NAME, AXIS, MESSAGE_NAME, UNIT, CONTRARY = 4, 2, 1, 2, 3, -6


def score(message: Message, s: Signal, quantity: Quantity) -> int:
    """How much a signal looks like a quantity; below MIN_SCORE not at all."""
    look = LOOKS[quantity]
    own, around = words(s.name), words(message.name)
    unit = s.unit.strip()
    rim = is_force(unit) and quantity in (Quantity.TORQUE, Quantity.BRAKE_TORQUE)
    if unit and not rim and not converts(unit, quantity):
        return 0
    named = NAME if contains(s.name, look.parts) else WEAK_NAME if look.words & set(own) else 0
    inside = MESSAGE_NAME if contains(message.name, look.parts) else 0
    if quantity is Quantity.BRAKE_TORQUE and unit and not named and contains(s.name + message.name, BRAKES):
        named = NAME if contains(s.name, BRAKES) or score(message, s, Quantity.TORQUE) > 0 else 0
    if quantity is Quantity.DIRECTION and _tells_direction(s):
        named += UNIT
    telling = UNIT if _plain(unit) in look.units else 0
    if telling and not look.by_unit_alone and not named and not inside:
        return 0
    axis = (
        AXIS if (quantity is Quantity.YAW_RATE and "z" in own) or (quantity is Quantity.LAT_ACCEL and "y" in own) else 0
    )
    total = named + inside + telling + axis
    brakes = quantity is Quantity.TORQUE and contains(s.name, BRAKES)
    if (NOT_MEASURED | look.contrary) & set(own) or brakes or contains(s.name, TRUTH):
        total += CONTRARY
    if NOT_MEASURED & set(around):
        total += CONTRARY // 2
    return total if named or inside or telling else 0


def _plain(unit: str) -> str:
    text = unit.lower().replace("²", "2").replace("^2", "2").replace("°", "deg").replace("degps", "deg/s")
    return "".join(c for c in text if c not in " .·*⋅[]()").replace("kmh", "km/h").replace("/sec", "/s")


def _tells_direction(s: Signal) -> bool:
    told = [letters(w) for _, w in (s.words.pairs if s.words else ())]
    return any(w.startswith(("rev", "back", "rueck")) for w in told) and any(w.startswith(("for", "vor")) for w in told)


@dataclass(frozen=True, slots=True)
class Candidate:
    """A signal that may carry a quantity. axle: the number that its names tell, or None; bogie likewise."""

    message: Message
    signal: Signal
    quantity: Quantity
    score: int
    axle: int | None
    bogie: int | None

    @property
    def name(self) -> str:
        """As a configuration names it."""
        return f"{self.message.name}.{self.signal.name}"


def candidates(dbc: DbcText) -> Iterator[Candidate]:
    """Every signal that may be an input, once for each quantity that it looks like most; the best first."""
    ours = senders_of_adhesion(dbc)
    found: list[Candidate] = []
    for m in dbc.on_the_bus:
        if m.sender in ours or is_adhesion(m) or is_truth(m):
            continue
        for s in m.signals:
            words_only = is_enumeration(s) or not MIN_BITS <= s.length <= MAX_BITS
            scores = {q: score(m, s, q) for q in LOOKS if q is Quantity.DIRECTION or not words_only}
            best = max(scores.values())
            if best >= MIN_SCORE:
                quantity = next(q for q, n in scores.items() if n == best)
                found.append(Candidate(m, s, quantity, best, *numbers(m.name, s.name)))
    yield from sorted(found, key=lambda c: -c.score)


def senders_of_adhesion(dbc: DbcText) -> set[str]:
    """Nodes that send adhesion and nothing that is surely an input: what stands in the DBC for this daemon."""
    ours = {m.sender for m in dbc.messages if is_adhesion(m)} - {NO_NODE}
    others = {
        m.sender
        for m in dbc.messages
        if m.sender in ours and not is_adhesion(m)
        for s in m.signals
        if max(score(m, s, q) for q in (Quantity.YAW_RATE, Quantity.LAT_ACCEL)) >= SURE_SCORE
    }
    return ours - others


def numbers(message: str, signal: str) -> tuple[int | None, int | None]:
    """Axle and bogie that two names tell, as far as they do. A number without a word for it counts as an axle's."""
    own, around = words(signal), words(message)
    bogie = _after(BOGIE_WORDS, own) or _after(BOGIE_WORDS, around)
    axle = _after(AXLE_WORDS, own) or _after(AXLE_WORDS, around)
    if axle is None:
        axle = _free(own) or _free(around)
    return axle, bogie


def _after(before: frozenset[str], name: list[str]) -> int | None:
    return next((int(b) for a, b in pairwise(name) if a in before and b.isdigit()), None)


def _free(name: list[str]) -> int | None:
    """A number that no word for a bogie stands before."""
    places = (i for i, w in enumerate(name) if w.isdigit() and (not i or name[i - 1] not in BOGIE_WORDS))
    return next((int(name[i]) for i in places), None)
