"""What is wrong with single messages of a DBC: cantools' strict loading would refuse the file for it."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from cantools.database.can import Message, Signal

MAX_NAMED = 5  # messages in one warning


class Orphan(NamedTuple):
    """A statement about a signal that there is not."""

    keyword: str
    can_id: int  # as in the DBC, with bit 31 of extended ones
    signal: str


def why_unsound(message: "Message") -> str | None:
    """Return what cantools' strict loading has against a message, or None: signals of one name, that overlap or do not
    fit in."""
    (name, count), *_ = Counter(s.name for s in message.signals).most_common(1) or [("", 0)]
    if count > 1:
        return f"there are {count} signals of the name {name}"
    try:
        _used_bits(message, message.signal_tree, {})
    except ValueError as e:
        return str(e)
    return None


def _used_bits(message: "Message", tree: Any, used: dict[str, int]) -> dict[str, int]:
    """The bits of each signal of a tree as one number, beside those used already.

    Under a multiplexer the signals of one id may overlap with those of another. Raises ValueError.
    """
    for node in tree:
        name, children = next(iter(node.items())) if isinstance(node, dict) else (node, {})
        bits = _bits(message, message.get_signal_by_name(name))
        for other, taken in used.items():
            if bits & taken:
                raise ValueError(f"signals {name} and {other} overlap")
        used = {**used, name: bits}
        before, after = used, dict(used)
        for child in children.values():
            after |= _used_bits(message, child, before)
        used = after
    return used


def _bits(message: "Message", s: "Signal") -> int:
    """The bits of a signal, the first byte's highest. Raises ValueError for those that its message lacks."""
    whole = 8 * message.length
    if s.start < 0:  # cantools loads that; check_readable refuses it
        return 0
    if s.byte_order == "little_endian":
        if s.start + s.length <= whole:
            number = ((1 << s.length) - 1) << s.start
            return int.from_bytes(number.to_bytes(message.length, "little"), "big")
    else:
        first = 8 * (s.start // 8) + 7 - s.start % 8
        if first + s.length <= whole:
            return ((1 << s.length) - 1) << (whole - first - s.length)
    raise ValueError(f"signal {s.name} does not fit in")


def add_doubles(messages: Sequence["Message"], unsound: dict[str, str]) -> None:
    """Add messages of one name or one id: which of them is meant, and whose value tables are given, is open."""
    by_name: dict[str, int] = {}
    by_id: dict[tuple[int, bool], list[str]] = {}
    for m in messages:
        by_name[m.name] = by_name.get(m.name, 0) + 1
        by_id.setdefault((m.frame_id, m.is_extended_frame), []).append(m.name)
    for name, count in by_name.items():
        if count > 1:
            unsound.setdefault(name, f"there are {count} messages of this name")
    for (can_id, extended), names in by_id.items():
        if len(names) > 1 and len(set(names)) > 1:
            for name in names:
                others = ", ".join(n for n in dict.fromkeys(names) if n != name)
                kind = "extended " if extended else ""
                unsound.setdefault(name, f"{others} has the same {kind}id 0x{can_id:X}")


def add_orphans(messages: Sequence["Message"], orphans: Sequence[Orphan], unsound: dict[str, str]) -> None:
    """Add value tables and value types of signals that a message lacks; which of its signals they mean is open."""
    by_id = {m.frame_id | m.is_extended_frame << 31: m.name for m in messages}
    for keyword, can_id, signal in orphans:
        if can_id in by_id:
            unsound.setdefault(by_id[can_id], f"{keyword} names a signal {signal}, which it lacks")


def warnings_about(
    messages: Sequence["Message"], unsound: Mapping[str, str], orphans: Sequence[Orphan]
) -> tuple[str, ...]:
    """What is odd in a DBC but bearable, for a person."""
    out = []
    if unsound:
        parts = "; ".join(f"{name}: {reason}" for name, reason in list(unsound.items())[:MAX_NAMED])
        more = f"; and {len(unsound) - MAX_NAMED} more" if len(unsound) > MAX_NAMED else ""
        out.append(f"messages that cannot be mapped: {parts}{more}")
    ids = {m.frame_id | m.is_extended_frame << 31 for m in messages}
    lost = [f"{keyword} {can_id} {signal}" for keyword, can_id, signal in orphans if can_id not in ids]
    if lost:
        more = f" and {len(lost) - MAX_NAMED} more" if len(lost) > MAX_NAMED else ""
        out.append(f"statements about messages that there are not: {', '.join(lost[:MAX_NAMED])}{more}")
    return tuple(out)
