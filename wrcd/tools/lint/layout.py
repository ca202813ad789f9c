"""Lint: the text, and where messages and signals lie."""

from collections.abc import Iterator
from itertools import combinations

from wrcd.tools.dbc.records import NO_MESSAGE, NO_NODE, DbcText, Message, Signal
from wrcd.tools.dbc.vocabulary import is_truth
from wrcd.tools.lint.codes import Finding

FD_LENGTHS = (*range(9), 12, 16, 20, 24, 32, 48, 64)
MAX_BITS = 8 * 64  # of any frame: no signal's places are listed beyond
MAX_STANDARD, MAX_EXTENDED = 0x7FF, 0x1FFF_FFFF
RIG_TRUTH = range(0x7A1, 0x7A9)  # standard ids of the rig's SimTruth


def check(dbc: DbcText) -> Iterator[Finding]:
    """Every finding."""
    if dbc.has_bom:
        yield Finding(1, "byte-order-mark", dbc.file.name, "EF BB BF")
    yield from _duplicates(dbc)
    yield from _references(dbc)
    yield from _nodes(dbc)
    nested = {r.number for r in dbc.references if r.keyword == "SG_MUL_VAL_"}
    for m in dbc.on_the_bus:
        yield from _message(dbc, m)
        yield from _overlaps(m, m.number in nested or sum(s.mux.endswith("M") for s in m.signals) > 1)
        for s in m.signals:
            yield from _signal(dbc, m, s)


def _duplicates(dbc: DbcText) -> Iterator[Finding]:
    ids: dict[int, Message] = {}
    names: dict[str, Message] = {}
    for m in dbc.on_the_bus:
        kind = "extended" if m.extended else "standard"
        if first := ids.get(m.number):
            what = f"{kind} id 0x{m.can_id:X} is {first.name}'s already (line {first.line})"
            yield Finding(m.line, "duplicate-id", m.name, what)
        if first := names.get(m.name):
            yield Finding(m.line, "duplicate-message", m.name, f"named like the message of line {first.line}")
        ids.setdefault(m.number, m)
        names.setdefault(m.name, m)
        signals: dict[str, Signal] = {}
        for s in m.signals:
            if other := signals.get(s.name):
                what = f"named like the signal of line {other.line}"
                yield Finding(s.line, "duplicate-signal", f"{m.name}.{s.name}", what)
            signals.setdefault(s.name, s)


def _references(dbc: DbcText) -> Iterator[Finding]:
    known: dict[int, set[str]] = {}
    for m in dbc.messages:
        known.setdefault(m.number, set()).update(s.name for s in m.signals)
    for r in dbc.references:
        if r.number not in known:
            if r.number != NO_MESSAGE:
                yield Finding(r.line, "unknown-reference", r.keyword, f"there is no message {r.number}")
        elif r.signal is not None and r.signal not in known[r.number]:
            yield Finding(r.line, "unknown-reference", r.keyword, f"message {r.number} has no signal {r.signal}")


def _nodes(dbc: DbcText) -> Iterator[Finding]:
    """Each node that is not declared once, where it first stands."""
    senders: dict[str, list[Finding]] = {}
    receivers: dict[str, list[Finding]] = {}
    for m in dbc.on_the_bus:
        found = Finding(m.line, "undeclared-sender", m.name, f"{m.sender} is not under BU_")
        senders.setdefault(m.sender, []).append(found)
        for s in m.signals:
            for node in s.receivers:
                found = Finding(s.line, "undeclared-receiver", f"{m.name}.{s.name}", f"{node} is not under BU_")
                receivers.setdefault(node, []).append(found)
    for by_node, things in ((senders, "messages"), (receivers, "signals")):
        for node, found_of_it in by_node.items():
            if node not in dbc.nodes and node != NO_NODE:
                first, count = found_of_it[0], len(found_of_it)
                more = f"; {count} {things} have it" if count > 1 else ""
                yield Finding(first.line, first.code, first.subject, first.what + more)


def _message(dbc: DbcText, m: Message) -> Iterator[Finding]:
    if m.can_id > (MAX_EXTENDED if m.extended else MAX_STANDARD):
        yield Finding(m.line, "impossible-id", m.name, f"{'extended' if m.extended else 'standard'} id 0x{m.can_id:X}")
    if m.length > 8 and not dbc.is_fd(m):
        yield Finding(m.line, "too-long", m.name, f"{m.length} bytes")
    if dbc.is_fd(m) and m.length not in FD_LENGTHS:
        yield Finding(m.line, "fd-length", m.name, f"{m.length} bytes")
    if is_truth(m):
        yield Finding(m.line, "ground-truth", m.name, "its name, or a signal's, says truth")
    elif m.can_id in RIG_TRUTH and not m.extended:
        yield Finding(m.line, "ground-truth", m.name, f"0x{m.can_id:X} is an id of the rig's SimTruth")


def _signal(dbc: DbcText, m: Message, s: Signal) -> Iterator[Finding]:
    name = f"{m.name}.{s.name}"
    if any(ord(c) > 127 for c in s.unit):
        yield Finding(s.line, "non-ascii-unit", name, f"{s.unit!r}, read as {dbc.encoding}")
    if s.length < 1:
        yield Finding(s.line, "no-bits", name, "length 0")
    elif not fits(m, s):
        yield Finding(s.line, "signal-outside-message", name, f"{_place(s)} in {m.length} bytes")


def fits(m: Message, s: Signal) -> bool:
    """Whether all of a signal's bits are the message's."""
    if s.start < 0 or s.length > MAX_BITS or s.start >= 8 * m.length:
        return False
    return max(s.bits, default=0) < 8 * m.length


def _place(s: Signal) -> str:
    return f"{s.start}|{s.length}@{0 if s.big_endian else 1}"


def _overlaps(m: Message, nested: bool) -> Iterator[Finding]:
    """Pairs that share bits and can be in one frame. nested: multiplexers within multiplexers; what takes turns with
    what is then left to loading."""
    placed = [s for s in m.signals if 0 < s.length <= MAX_BITS and s.start >= 0]
    for a, b in combinations(placed, 2):
        in_turn = _turn(a) and _turn(b) and (nested or _turn(a) != _turn(b))
        if not in_turn and a.bits & b.bits:
            what = f"{_place(b)} shares bits with {a.name}, {_place(a)} (line {a.line})"
            yield Finding(b.line, "signals-overlap", f"{m.name}.{b.name}", what)


def _turn(s: Signal) -> str:
    """The multiplexer value that a signal is there with ("m3"), or nothing."""
    return s.mux.rstrip("M") if s.mux != "M" else ""
