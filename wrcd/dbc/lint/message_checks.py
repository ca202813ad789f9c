"""Lint of every message and signal: the text and the layout of frames, numbers and words, times, E2E.

inputs: what looks like one.
"""

from collections.abc import Collection, Iterator
from itertools import combinations

from wrcd.bus.dbc import DATA_ID, KNOWN_PROFILE, LONGEST_MS, PROFILE, TIMEOUT
from wrcd.bus.words import unusable
from wrcd.config.input_mapping import FLOAT_BITS
from wrcd.dbc.dbc_lines import NO_MESSAGE, NO_NODE, DbcText, Message, Signal
from wrcd.dbc.lint.codes import Flaw
from wrcd.dbc.recognition import (
    MIN_BITS,
    SignalCandidate,
    is_adhesion,
    is_counter,
    is_crc,
    is_enumeration,
    is_percent,
    is_status,
    is_truth,
    says_adhesion,
)

FD_LENGTHS = (*range(9), 12, 16, 20, 24, 32, 48, 64)
MAX_BITS = 8 * 64  # of any frame: no signal's places are listed beyond
MAX_STANDARD, MAX_EXTENDED = 0x7FF, 0x1FFF_FFFF
RIG_TRUTH = range(0x7A1, 0x7A9)  # standard ids of the rig's SimTruth
SEND_TYPE = "GenMsgSendType"
CRC_BITS = frozenset(range(8))
COUNTER_BITS = frozenset(range(8, 12))


def check_layout(dbc: DbcText) -> Iterator[Flaw]:
    """Yield what is wrong with the text, and with where messages and signals lie."""
    if dbc.has_bom:
        yield Flaw(1, "byte-order-mark", dbc.file.name, "EF BB BF")
    yield from _duplicates(dbc)
    yield from _references(dbc)
    yield from _nodes(dbc)
    nested = {r.number for r in dbc.references if r.keyword == "SG_MUL_VAL_"}
    for m in dbc.on_the_bus:
        yield from _message(dbc, m)
        yield from _overlaps(m, m.number in nested or sum(s.mux.endswith("M") for s in m.signals) > 1)
        for s in m.signals:
            yield from _signal(dbc, m, s)


def _duplicates(dbc: DbcText) -> Iterator[Flaw]:
    ids: dict[int, Message] = {}
    names: dict[str, Message] = {}
    for m in dbc.on_the_bus:
        kind = "extended" if m.extended else "standard"
        if first := ids.get(m.number):
            what = f"{kind} id 0x{m.can_id:X} is {first.name}'s already (line {first.line})"
            yield Flaw(m.line, "duplicate-id", m.name, what)
        if first := names.get(m.name):
            yield Flaw(m.line, "duplicate-message", m.name, f"named like the message of line {first.line}")
        ids.setdefault(m.number, m)
        names.setdefault(m.name, m)
        signals: dict[str, Signal] = {}
        for s in m.signals:
            if other := signals.get(s.name):
                what = f"named like the signal of line {other.line}"
                yield Flaw(s.line, "duplicate-signal", s.path, what)
            signals.setdefault(s.name, s)


def _references(dbc: DbcText) -> Iterator[Flaw]:
    known: dict[int, set[str]] = {}
    for m in dbc.messages:
        known.setdefault(m.number, set()).update(s.name for s in m.signals)
    for r in dbc.references:
        if r.number not in known:
            if r.number != NO_MESSAGE:
                yield Flaw(r.line, "unknown-reference", r.keyword, f"there is no message {r.number}")
        elif r.signal is not None and r.signal not in known[r.number]:
            yield Flaw(r.line, "unknown-reference", r.keyword, f"message {r.number} has no signal {r.signal}")


def _nodes(dbc: DbcText) -> Iterator[Flaw]:
    """Each node that is not declared once, where it first stands."""
    senders: dict[str, list[Flaw]] = {}
    receivers: dict[str, list[Flaw]] = {}
    for m in dbc.on_the_bus:
        found = Flaw(m.line, "undeclared-sender", m.name, f"{m.sender} is not under BU_")
        senders.setdefault(m.sender, []).append(found)
        for s in m.signals:
            for node in s.receivers:
                found = Flaw(s.line, "undeclared-receiver", s.path, f"{node} is not under BU_")
                receivers.setdefault(node, []).append(found)
    for by_node, things in ((senders, "messages"), (receivers, "signals")):
        for node, found_of_it in by_node.items():
            if node not in dbc.nodes and node != NO_NODE:
                first, count = found_of_it[0], len(found_of_it)
                more = f"; {count} {things} have it" if count > 1 else ""
                yield Flaw(first.line, first.code, first.subject, first.what + more)


def _message(dbc: DbcText, m: Message) -> Iterator[Flaw]:
    if m.can_id > (MAX_EXTENDED if m.extended else MAX_STANDARD):
        yield Flaw(m.line, "impossible-id", m.name, f"{'extended' if m.extended else 'standard'} id 0x{m.can_id:X}")
    if m.length > 8 and not dbc.is_fd(m):
        yield Flaw(m.line, "too-long", m.name, f"{m.length} bytes")
    if dbc.is_fd(m) and m.length not in FD_LENGTHS:
        yield Flaw(m.line, "fd-length", m.name, f"{m.length} bytes")
    if is_truth(m):
        yield Flaw(m.line, "ground-truth", m.name, "its name, or a signal's, says truth")
    elif m.can_id in RIG_TRUTH and not m.extended:
        yield Flaw(m.line, "ground-truth", m.name, f"0x{m.can_id:X} is an id of the rig's SimTruth")


def _signal(dbc: DbcText, m: Message, s: Signal) -> Iterator[Flaw]:
    name = s.path
    if any(ord(c) > 127 for c in s.unit):
        yield Flaw(s.line, "non-ascii-unit", name, f"{s.unit!r}, read as {dbc.encoding}")
    if s.length < 1:
        yield Flaw(s.line, "no-bits", name, "length 0")
    elif not fits(m, s):
        yield Flaw(s.line, "signal-outside-message", name, f"{_place(s)} in {m.length} bytes")


def fits(m: Message, s: Signal) -> bool:
    """Whether all of a signal's bits are the message's."""
    if s.start < 0 or s.length > MAX_BITS or s.start >= 8 * m.length:
        return False
    return max(s.bits, default=0) < 8 * m.length


def _place(s: Signal) -> str:
    return f"{s.start}|{s.length}@{0 if s.big_endian else 1}"


def _overlaps(m: Message, nested: bool) -> Iterator[Flaw]:
    """Pairs that share bits and can be in one frame. nested: multiplexers within multiplexers; what takes turns with
    what is then left to loading."""
    placed = [s for s in m.signals if 0 < s.length <= MAX_BITS and s.start >= 0]
    for a, b in combinations(placed, 2):
        in_turn = _turn(a) and _turn(b) and (nested or _turn(a) != _turn(b))
        if not in_turn and a.bits & b.bits:
            what = f"{_place(b)} shares bits with {a.name}, {_place(a)} (line {a.line})"
            yield Flaw(b.line, "signals-overlap", b.path, what)


def _turn(s: Signal) -> str:
    """The multiplexer value that a signal is there with ("m3"), or nothing."""
    return s.mux.rstrip("M") if s.mux != "M" else ""


def check_values(dbc: DbcText) -> Iterator[Flaw]:
    """Yield what is wrong with numbers of signals, and with the words of their value tables."""
    for m in dbc.on_the_bus:
        for s in m.signals:
            if 0 < s.length <= MAX_BITS:
                yield from _range(s)
                yield from _start_value(dbc, s)
                yield from _words(s)
        if is_adhesion(m):
            yield from _room(m)


def limits(s: Signal) -> tuple[float, float]:
    """The lowest and the highest physical value of the bits."""
    ends = [raw * s.scale + s.offset for raw in (s.lowest_raw, s.highest_raw)]
    return min(ends), max(ends)


def _range(s: Signal) -> Iterator[Flaw]:
    if s.scale == 0:
        yield Flaw(s.line, "factor-zero", s.path, f"({s.scale:g},{s.offset:g})")
    if s.is_float and s.length not in FLOAT_BITS:
        yield Flaw(s.line, "float-width", s.path, f"{s.length} bits")
    if s.low is None or s.high is None:
        return
    stated = f"[{s.low:g}|{s.high:g}]"
    if s.low > s.high:
        yield Flaw(s.line, "range-reversed", s.path, stated)
    elif s.scale and not s.is_float:
        low, high = limits(s)
        slack = 0.5 * abs(s.scale) + 1e-9 * max(abs(low), abs(high))
        if s.low < low - slack or s.high > high + slack:
            yield Flaw(s.line, "range-beyond-field", s.path, f"{stated}, {s.length} bits hold {low:g} … {high:g}")


def in_range(s: Signal, raw: float) -> bool:
    """Whether a raw value is a measurement by [min|max]; without a range every one is."""
    if s.low is None or s.high is None:
        return True
    slack = 1e-6 * abs(s.scale)
    return s.low - slack <= raw * s.scale + s.offset <= s.high + slack


def _start_value(dbc: DbcText, s: Signal) -> Iterator[Flaw]:
    if "GenSigStartValue" not in s.attributes or s.is_float:
        return  # a default for the whole file is nobody's statement about this signal
    raw = dbc.number(s, "GenSigStartValue")
    if raw is None:
        return
    holds = s.lowest_raw <= raw <= s.highest_raw
    if not holds or not (raw in dict(s.words) or in_range(s, raw)):
        what = f"raw {raw:g}" if not holds else f"raw {raw:g}, which is {raw * s.scale + s.offset:g}{_unit(s)}"
        line = dbc.attribute_line(s, "GenSigStartValue")
        yield Flaw(line, "start-value-out-of-range", s.path, what)


def _unit(s: Signal) -> str:
    return f" {s.unit}" if s.unit else ""


def _words(s: Signal) -> Iterator[Flaw]:
    seen: dict[int, str] = {}
    for raw, word in s.words:
        if raw in seen:
            yield Flaw(s.words_line, "value-named-twice", s.path, f"{raw} is {seen[raw]!r} and {word!r}")
        seen[raw] = word
        if not s.is_float and not s.lowest_raw <= raw <= s.highest_raw:
            what = f"{raw} {word!r}, {s.length} bits hold {s.lowest_raw} … {s.highest_raw}"
            yield Flaw(s.words_line, "value-beyond-width", s.path, what)
        elif unusable(word) and _measures(s) and s.low is not None and in_range(s, raw):
            what = f"{raw} {word!r} is {raw * s.scale + s.offset:g}{_unit(s)}, within [{s.low:g}|{s.high:g}]"
            yield Flaw(s.words_line, "sentinel-in-range", s.path, what)


def _measures(s: Signal) -> bool:
    """Whether its values are numbers. One whose words are states has "not available" among them, rightly in range."""
    return bool(s.unit.strip()) or s.scale != 1 or not (is_enumeration(s) or is_status(s) or s.length < MIN_BITS)


def _room(m: Message) -> Iterator[Flaw]:
    for s in m.signals:
        if is_percent(s) and (says_adhesion(s) or s.high is not None) and not s.is_float and 0 < s.length <= 32:
            ends = in_range(s, s.lowest_raw) and in_range(s, s.highest_raw)
            if ends and s.scale:
                low, high = limits(s)
                what = f"{s.length} bits are {low:g} … {high:g} {s.unit}, all in its range"
                yield Flaw(s.line, "no-room-for-not-available", s.path, what)


def check_times(dbc: DbcText, inputs: Collection[SignalCandidate]) -> Iterator[Flaw]:
    """Yield what is wrong with cycles and time-outs."""
    relevant = {c.message.line for c in inputs}
    for m in dbc.on_the_bus:
        cycle = dbc.number(m, "GenMsgCycleTime")
        line = dbc.attribute_line(m, "GenMsgCycleTime")
        if _no_time(cycle):
            yield Flaw(line, "cycle-no-time", m.name, f"a cycle of {cycle:g} ms")
        elif not cycle:
            matters = m.line in relevant or is_adhesion(m)
            kind = dbc.attribute(m, SEND_TYPE) or ""
            if "cycl" in kind.lower() and (matters or SEND_TYPE in m.attributes):
                at = dbc.attribute_line(m, SEND_TYPE)
                yield Flaw(at, "cyclic-without-cycle", m.name, f"{SEND_TYPE} {kind}, cycle 0")
            elif matters:
                yield Flaw(m.line, "no-cycle", m.name, "no GenMsgCycleTime")
        for s in m.signals:
            yield from _timeout(dbc, s, cycle or 0.0)


def _no_time(ms: float | None) -> bool:
    return ms is not None and ms != 0 and not 1 <= ms <= LONGEST_MS


def _timeout(dbc: DbcText, s: Signal, cycle: float) -> Iterator[Flaw]:
    timeout = dbc.number(s, TIMEOUT)
    line = dbc.attribute_line(s, TIMEOUT)
    if _no_time(timeout):
        yield Flaw(line, "cycle-no-time", s.path, f"a time-out of {timeout:g} ms")
    elif timeout and timeout < cycle:
        yield Flaw(line, "timeout-below-cycle", s.path, f"{timeout:g} ms, cycle {cycle:g} ms")


def check_protection(dbc: DbcText, inputs: Collection[SignalCandidate]) -> Iterator[Flaw]:
    """Yield what is wrong with E2E attributes."""
    ids: dict[float, Message] = {}
    protected = [m for m in dbc.on_the_bus if dbc.e2e_profile(m)]
    for m in protected:
        profile = dbc.attribute(m, PROFILE)
        if profile != KNOWN_PROFILE:
            yield Flaw(dbc.attribute_line(m, PROFILE), "e2e-unknown-profile", m.name, f"{profile!r}")
            continue
        if m.length < 2:
            yield Flaw(m.line, "e2e-too-short", m.name, f"{m.length} bytes")
        # the default of a file is no data id of a message's own
        data_id = dbc.number(m, DATA_ID) if DATA_ID in m.attributes else None
        line = dbc.attribute_line(m, DATA_ID)
        if data_id is None or not 0 <= data_id <= 0xFFFF:
            what = f"no {DATA_ID}" if data_id is None else f"{DATA_ID} {data_id:g}"
            yield Flaw(line, "e2e-no-data-id", m.name, what)
        elif first := ids.get(data_id):
            yield Flaw(line, "e2e-data-id-twice", m.name, f"{data_id:g} is {first.name}'s already")
        else:
            ids[data_id] = m
        yield from _e2e_overlaps(m)
    if protected:
        known = {m.line for m in protected}
        relevant = {c.message.line: c.message for c in inputs} | {m.line: m for m in dbc.on_the_bus if is_adhesion(m)}
        for m in relevant.values():
            if m.line not in known:
                yield Flaw(m.line, "e2e-partly", m.name, f"no {PROFILE}; {len(protected)} messages have one")


def _e2e_overlaps(m: Message) -> Iterator[Flaw]:
    for s in m.signals:
        if not fits(m, s):
            continue
        bits = s.bits
        if (bits == CRC_BITS and is_crc(s)) or (bits == COUNTER_BITS and is_counter(s)):
            continue
        if shared := bits & (CRC_BITS | COUNTER_BITS):
            where = " and ".join(what for what, own in (("CRC", CRC_BITS), ("counter", COUNTER_BITS)) if shared & own)
            yield Flaw(s.line, "e2e-overlap", s.path, f"bits of the {where}")
