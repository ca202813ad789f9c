"""What cannot hold at once: one signal for two things, one message for two jobs, one identity for two messages."""

from collections.abc import Iterable, Sequence

from wrcd import declared
from wrcd.bus.codec import message_key
from wrcd.bus.dbc import Database, find_message
from wrcd.bus.frame import EXTENDED
from wrcd.bus.signals import Output
from wrcd.bus.units import Quantity
from wrcd.core.configuration import Input
from wrcd.mapping.statements import TORQUES, Statement
from wrcd.section import Section

OWN = (Quantity.YAW_RATE, Quantity.LAT_ACCEL)  # of one axle each: two that share it are one sensor


def shared_signals(statements: Sequence[Statement]) -> None:
    """A gyro or accelerometer of two axles, and a torque that would be counted twice. Mistakes are collected."""
    before: dict[tuple[str, str], list[Statement]] = {}
    for s in statements:
        others = before.setdefault((s.message, s.signal), [])
        reason = next(filter(None, (_why_not_both(s, other) for other in others)), None)
        if reason is not None:
            s.table.mistake(s.table.error(reason, declared.SIGNAL.name))
        others.append(s)


def _why_not_both(s: Statement, other: Statement) -> str | None:
    """Why a signal that is one thing already cannot be another, too; None: it can."""
    named = f"{s.message}.{s.signal}"
    if s.quantity is not other.quantity and not {s.quantity, other.quantity} <= set(TORQUES):
        return f"{named} is {other.table.name} already; one signal measures one thing"
    if s.axles == other.axles:
        return f"{named} is counted in {other.table.name} already"
    if s.quantity in OWN:
        return f"{named} is {other.table.name} already; each wheelset has its own {s.quantity.key}"
    return None


def messages(
    inputs: Iterable[tuple[Statement, Input]], outputs: Iterable[tuple[Section, Output]], database: Database
) -> None:
    """A message for two jobs, and two messages with one identity. Mistakes are collected."""
    jobs: dict[str, tuple[str, bool]] = {}  # by message: what for, whether it is sent
    keys: dict[int, str] = {}

    def take(table: Section, key: str, name: str, sent: bool) -> None:
        job = jobs.setdefault(name, (table.name, sent))
        if job[0] != table.name and (sent or job[1]):
            table.mistake(
                table.error(f"{name} is {'sent' if job[1] else 'read'} for {job[0]} already", key, "one job a message")
            )
            return
        identity = message_key(find_message(database, name))
        other = keys.setdefault(identity, name)
        if other != name:
            kind = "extended" if identity & EXTENDED else "standard"
            table.mistake(table.error(f"{name} has the {kind} id 0x{identity & ~EXTENDED:X}, and so has {other}", key))

    for s, i in inputs:
        take(s.table, declared.SIGNAL.name, s.message, False)
        for rule in i.source.statuses or ():
            if rule.message != s.message:
                take(s.table, declared.STATUS.name, rule.message, False)
    for table, output in outputs:
        take(table, declared.MESSAGE.name, output.message, True)
