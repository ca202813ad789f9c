"""Lint: E2E attributes."""

from collections.abc import Collection, Iterator

from wrcd.tools.dbc.candidates import Candidate
from wrcd.tools.dbc.records import DbcText, Message
from wrcd.tools.dbc.vocabulary import is_adhesion, is_counter, is_crc
from wrcd.tools.lint.codes import Finding
from wrcd.tools.lint.layout import fits

PROFILE, DATA_ID = "E2EProfile", "E2EDataId"
KNOWN = "P11"
CRC_BITS = frozenset(range(8))
COUNTER_BITS = frozenset(range(8, 12))


def check(dbc: DbcText, inputs: Collection[Candidate]) -> Iterator[Finding]:
    """Every finding. inputs: what looks like one."""
    ids: dict[float, Message] = {}
    protected = [m for m in dbc.on_the_bus if dbc.attribute(m, PROFILE)]
    for m in protected:
        profile = dbc.attribute(m, PROFILE)
        if profile != KNOWN:
            yield Finding(dbc.attribute_line(m, PROFILE), "e2e-unknown-profile", m.name, f"{profile!r}")
            continue
        if m.length < 2:
            yield Finding(m.line, "e2e-too-short", m.name, f"{m.length} bytes")
        # the default of a file is no data id of a message's own
        data_id = dbc.number(m, DATA_ID) if DATA_ID in m.attributes else None
        line = dbc.attribute_line(m, DATA_ID)
        if data_id is None or not 0 <= data_id <= 0xFFFF:
            what = f"no {DATA_ID}" if data_id is None else f"{DATA_ID} {data_id:g}"
            yield Finding(line, "e2e-no-data-id", m.name, what)
        elif first := ids.get(data_id):
            yield Finding(line, "e2e-data-id-twice", m.name, f"{data_id:g} is {first.name}'s already")
        else:
            ids[data_id] = m
        yield from _overlaps(m)
    if protected:
        known = {m.line for m in protected}
        relevant = {c.message.line: c.message for c in inputs} | {m.line: m for m in dbc.on_the_bus if is_adhesion(m)}
        for m in relevant.values():
            if m.line not in known:
                yield Finding(m.line, "e2e-partly", m.name, f"no {PROFILE}; {len(protected)} messages have one")


def _overlaps(m: Message) -> Iterator[Finding]:
    for s in m.signals:
        if not fits(m, s):
            continue
        bits = s.bits
        if (bits == CRC_BITS and is_crc(s)) or (bits == COUNTER_BITS and is_counter(s)):
            continue
        if shared := bits & (CRC_BITS | COUNTER_BITS):
            where = " and ".join(what for what, own in (("CRC", CRC_BITS), ("counter", COUNTER_BITS)) if shared & own)
            yield Finding(s.line, "e2e-overlap", f"{m.name}.{s.name}", f"bits of the {where}")
