"""How often a multiplexed signal comes: in some frames of its message only."""

import math

from wrcd.bus.dbc import Database, Message, cycle_ms, find_message
from wrcd.bus.positions import Branch, branch
from wrcd.estimator.design import Design
from wrcd.mapping.inputs import MEASURED
from wrcd.mapping.statements import Statement


def check_pace(s: Statement, database: Database, design: Design, warnings: list[str]) -> None:
    """A gyro or accelerometer is needed in every tick. Of a multiplexed one that is said, with what the DBC's cycle
    makes of it: whether its branches take turns or all come in each cycle, no DBC says."""
    message = find_message(database, s.message)
    of = branch(message, s.signal)
    if s.quantity not in MEASURED or not of.conditions:
        return
    tick_ms = 1000 * design.tick_s
    cycle, frames = cycle_ms(message), frames_for_one(message, of)
    name = f"{s.message}.{s.signal}"
    turns = f" ({cycle * frames:g} ms where they take turns)" if cycle is not None and cycle * frames > tick_ms else ""
    warnings.append(
        f"{name} is multiplexed: it comes only in frames with {of}{turns}, and is needed every {tick_ms:g} ms"
    )


def frames_for_one(message: Message, of: Branch) -> float:
    """Of how many frames one is of a branch, where the multiplexers' values take turns."""
    return math.prod(len(_values(message, name)) / max(1, len(ids)) for name, _, ids in of.conditions)


def _values(message: Message, multiplexer: str) -> set[int]:
    """The values of a multiplexer that have signals."""
    return {k for x in message.signals if x.multiplexer_signal == multiplexer for k in x.multiplexer_ids or ()}
