"""How often a multiplexed signal comes: in some frames of its message only."""

import math

from wrcd import declared
from wrcd.bus.dbc import Database, Message, cycle_ms, find_message
from wrcd.bus.positions import Branch, branch
from wrcd.estimator.design import Design
from wrcd.mapping.inputs import MEASURED
from wrcd.mapping.statements import Statement


def check_pace(s: Statement, database: Database, design: Design, warnings: list[str]) -> None:
    """A gyro or accelerometer is needed in every tick. A multiplexed one that cannot come so often by the DBC's cycle
    is an InputError, any other one is said."""
    message = find_message(database, s.message)
    of = branch(message, s.signal)
    if s.quantity not in MEASURED or not of.conditions:
        return
    tick_ms = 1000 * design.tick_s
    cycle, frames = cycle_ms(message), frames_for_one(message, of)
    name = f"{s.message}.{s.signal}"
    if cycle is not None and cycle * frames > tick_ms:
        raise s.table.error(
            f"message {s.message} comes every {cycle} ms, and {s.signal} in one of {frames:g} of its frames: every "
            f"{cycle * frames:g} ms, slower than the design's tick of {tick_ms:g} ms",
            declared.SIGNAL.name,
            "a faster sensor, or a design of that tick by `sim-ecu design`",
        )
    warnings.append(f"{name} is multiplexed: it comes only in frames with {of}, and is needed every {tick_ms:g} ms")


def frames_for_one(message: Message, of: Branch) -> float:
    """Of how many frames one is of a branch, where the multiplexers' values take turns."""
    return math.prod(len(_values(message, name)) / max(1, len(ids)) for name, _, ids in of.conditions)


def _values(message: Message, multiplexer: str) -> set[int]:
    """The values of a multiplexer that have signals."""
    return {k for x in message.signals if x.multiplexer_signal == multiplexer for k in x.multiplexer_ids or ()}
