"""What the inputs of one message say of it: its E2E protection.

A frame is accepted whole or not at all, so what one input says of its message holds for all of them, and two that
contradict each other are refused.
"""

from collections.abc import Iterable, Sequence

from wrcd import declared
from wrcd.bus.dbc import Database, Message, Signal, attribute, data_id, find_message
from wrcd.mapping.statements import Statement
from wrcd.section import TO_FILL_IN, Section


def by_message(statements: Iterable[Statement]) -> dict[str, list[Statement]]:
    """The statements about each message."""
    found: dict[str, list[Statement]] = {}
    for s in statements:
        found.setdefault(s.message, []).append(s)
    return found


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
            raise table.error(str(e), None, f'{table.line(e2e="none")}, or e2e = "P11" and its data_id') from None
        if stated is not None and known is None:
            raise table.error(
                f"message {message.name} is not protected", declared.DATA_ID.name, f"if it is, {table.line(e2e='P11')}"
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
            raise table.error(
                "is missing",
                declared.DATA_ID.name,
                f"the DBC states none for {message.name}: {table.line(data_id=TO_FILL_IN)}",
            )
        return known
    return stated


def check_header(table: Section, key: str, message: Message, names: Iterable[str]) -> None:
    """Raises InputError for a signal within what E2E writes: byte 0 and the low nibble of byte 1."""
    for signal in message.signals:
        if signal.name in names and bits(signal) & set(range(12)):
            raise table.error(
                f"{message.name}.{signal.name} lies where the E2E CRC and counter of {message.name} are",
                key,
                f"if it is not protected, {table.line(e2e='none', data_id=None)}",
            )


def bits(signal: Signal) -> set[int]:
    """The bits of a frame that a signal takes, as the DBC counts them."""
    if signal.byte_order == "little_endian":
        return set(range(signal.start, signal.start + signal.length))
    first = 8 * (signal.start // 8) + 7 - signal.start % 8
    return {8 * (k // 8) + 7 - k % 8 for k in range(first, first + signal.length)}
