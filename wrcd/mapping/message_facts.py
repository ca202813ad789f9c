"""What the inputs of one message say of it: which signals tell whether its sender is well, and its E2E protection.

A frame is accepted whole or not at all, so what one input says of its message holds for all of them, and two that
contradict each other are refused.
"""

import re
from collections.abc import Iterable, Sequence

from wrcd import declared
from wrcd.bus.dbc import Database, Message, Signal, attribute, data_id, find_message, timeout_ms
from wrcd.bus.signals import StatusRule
from wrcd.bus.statuses import STATUS
from wrcd.bus.words import degraded, unusable, usable
from wrcd.mapping.inputs import DEFAULT_TIMEOUT_MS, check_readable, find
from wrcd.mapping.statements import Statement, StatusStatement
from wrcd.mapping.values import raw_values, words
from wrcd.section import Section

STATUS_NAMES = re.compile(r"status|state|valid|quality|health", re.IGNORECASE)


def by_message(statements: Iterable[Statement]) -> dict[str, list[Statement]]:
    """The statements about each message."""
    found: dict[str, list[Statement]] = {}
    for s in statements:
        found.setdefault(s.message, []).append(s)
    return found


# --- status


def status_rules(said: Sequence[Statement], database: Database, warnings: list[str]) -> tuple[StatusRule, ...]:
    """The rules of one message, by what its inputs say of it, else by the DBC's words. Mistakes are collected."""
    if any(s.status_wrong for s in said):
        return ()
    stated = [s for s in said if s.status is not None]
    off = [s for s in said if s.status_off]
    if stated and off:
        s = off[0]
        raise s.table.error(
            f"is false, but {stated[0].table.name} names the status of {s.message}", declared.STATUS.name
        )
    if off:
        return ()
    rules: dict[tuple[str, str], tuple[StatusRule, Statement]] = {}
    for s in stated:
        assert s.status is not None
        rule = _stated_rule(s, s.status, database)
        known = rules.setdefault((rule.message, rule.signal), (rule, s))
        if known[0] != rule:
            raise s.table.error(
                f"takes other values of {rule.message}.{rule.signal} for good than {known[1].table.name}",
                declared.STATUS.name,
            )
    if rules:
        return tuple(rule for rule, _ in rules.values())
    return tuple(_usual_rules(said, find_message(database, said[0].message), warnings))


def _stated_rule(s: Statement, stated: StatusStatement, database: Database) -> StatusRule:
    key = declared.STATUS.name
    message, signal = find(s.table, key, database, stated.message, stated.signal)
    timeout_us = 0
    try:
        check_readable(message, signal)
        if message.name != s.message:
            timeout_us = 1000 * (timeout_ms(message, signal) or DEFAULT_TIMEOUT_MS)
    except ValueError as e:
        raise s.table.error(str(e), key) from None
    usual_ok, usual_degraded = usual_values(signal)
    ok = usual_ok if stated.ok is None else raw_values(s.table, declared.OK.name, signal, stated.ok)
    degraded = (
        usual_degraded - ok
        if stated.degraded is None
        else raw_values(s.table, declared.DEGRADED.name, signal, stated.degraded)
    )
    if not ok:
        known = ", ".join(words(signal).values())
        raise s.table.error(
            f"{message.name}.{signal.name} has no word that is known to be good",
            key,
            f"say which: ok = [{'one of ' + known if known else 'raw values'}]",
        )
    if both := ok & degraded:
        raise s.table.error(f"{min(both)} is good already", declared.DEGRADED.name)
    return StatusRule(message.name, signal.name, ok, degraded, timeout_us)


def usual_values(signal: Signal) -> tuple[frozenset[int], frozenset[int]]:
    """Raw values that are good and degraded by the words of the value table."""
    table = words(signal)
    return (
        frozenset(raw for raw, word in table.items() if usable(word)),
        frozenset(raw for raw, word in table.items() if degraded(word)),
    )


def _usual_rules(said: Sequence[Statement], message: Message, warnings: list[str]) -> list[StatusRule]:
    """A signal called Status; else every one whose name or words say that it is one."""
    measured = {s.signal for s in said}
    signals = [s for s in message.signals if s.name not in measured and not s.is_multiplexer]
    rules = []
    for signal in [s for s in signals if s.name == STATUS] or [s for s in signals if _is_status(s)]:
        table = said[0].table
        ok, degraded = usual_values(signal)
        if not ok and signal.name == STATUS and not words(signal):
            ok = frozenset({0})  # without a value table only 0 is taken for good
        if ok:
            rules.append(StatusRule(message.name, signal.name, ok, degraded))
        elif signal.name == STATUS or any(unusable(word) for word in words(signal).values()):
            table.mistake(
                table.error(
                    f"{message.name}.{signal.name} tells of failures, and none of its words is known to be good "
                    f"({', '.join(words(signal).values())})",
                    declared.SIGNAL.name,
                    f'add status = "{message.name}.{signal.name}" and ok = […], or status = false',
                )
            )
        else:
            warnings.append(
                f"{message.name}.{signal.name} may say whether its sender is well, and does not count: "
                "if it does, name it as the status of an input of that message, else say status = false"
            )
    return rules


def _is_status(signal: Signal) -> bool:
    """Whether a signal's name says that it is a status, or its words: a good one and one of failure."""
    table = words(signal).values()
    return bool(STATUS_NAMES.search(signal.name)) or (any(map(usable, table)) and any(map(unusable, table)))


# --- E2E


def protection(said: Sequence[Statement], database: Database) -> int | None:
    """The data id of one message that carries inputs, by what they say of it, else by the DBC. Raises InputError."""
    if any(s.protection_wrong for s in said):
        return None
    message = find_message(database, said[0].message)
    identities = {}
    for s in said:
        if s.e2e is not None or s.data_id is not None:
            identities[e2e_identity(s.table, message, s.e2e, s.data_id)] = s
    if len(identities) > 1:
        (_, first), (_, second) = list(identities.items())[:2]
        raise second.table.error(
            f"says another E2E protection of {message.name} than {first.table.name}",
            declared.E2E.name if second.e2e is not None else declared.DATA_ID.name,
        )
    if identities:
        return next(iter(identities))
    s = said[0]
    return e2e_identity(s.table, message, None, None)


def e2e_identity(table: Section, message: Message, e2e: str | None, stated: int | None) -> int | None:
    """The data id of a message, by what a table says of it, else by the DBC; None: not protected. Raises InputError."""
    if e2e == declared.UNPROTECTED:
        if stated is not None:
            raise table.error('says nothing beside e2e = "none"', declared.DATA_ID.name)
        return None
    if e2e is None:
        try:
            known = data_id(message)
        except ValueError as e:
            raise table.error(str(e), None, 'say e2e = "none", or e2e = "P11" and its data_id') from None
        if stated is not None and known is None:
            raise table.error(
                f"message {message.name} is not protected", declared.DATA_ID.name, 'add e2e = "P11" if it is'
            )
        return known if stated is None else stated
    if message.length < 2:
        raise table.error(f"message {message.name} has no room for CRC and counter", declared.E2E.name)
    if stated is None:
        known = attribute(message, "E2EDataId")
        if (
            not isinstance(known, int)
            or not 0 <= known <= declared.DATA_ID.high
            or not attribute(message, "E2EProfile")
        ):
            raise table.error("is missing", declared.DATA_ID.name, f"the DBC states none for {message.name}")
        return known
    return stated


def check_header(table: Section, key: str, message: Message, names: Iterable[str]) -> None:
    """Raises InputError for a signal within what E2E writes: byte 0 and the low nibble of byte 1."""
    for signal in message.signals:
        if signal.name in names and bits(signal) & set(range(12)):
            raise table.error(
                f"{message.name}.{signal.name} lies where the E2E CRC and counter of {message.name} are",
                key,
                'e2e = "none" if it is not protected',
            )


def bits(signal: Signal) -> set[int]:
    """The bits of a frame that a signal takes, as the DBC counts them."""
    if signal.byte_order == "little_endian":
        return set(range(signal.start, signal.start + signal.length))
    first = 8 * (signal.start // 8) + 7 - signal.start % 8
    return {8 * (k // 8) + 7 - k % 8 for k in range(first, first + signal.length)}
