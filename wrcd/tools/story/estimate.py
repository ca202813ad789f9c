"""A log through the core: the frames that a daemon would have sent, and the changes of Validity behind them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from wrcd.bus.damage import Damage
from wrcd.bus.log import read_log, read_stretches
from wrcd.bus.log_order import TimeOrder, on_channel
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.events import Change
from wrcd.core.messages import Outgoing
from wrcd.recorder.resume import load, state_file
from wrcd.tools.feed import outgoing, outgoing_of_stretches
from wrcd.tools.story.clock import Onward
from wrcd.tools.story.scan import Gathering, Scan

LAST_TICK_US = 20_000  # before a step of the clock: what was not told of it yet


@dataclass(frozen=True, slots=True)
class Estimated:
    """What came of a log: frames by their message, changes in their order, frames that were accepted."""

    sent: Scan
    changes: tuple[Change, ...]
    accepted: int


def estimate(
    log: Path, config: Config, channel: str | None, reached: Callable[[int], None] = lambda stamp_us: None
) -> Estimated:
    """Replay a log. reached is told the stamps on the way."""
    core, gathering, onward = Core(config), Gathering(), Onward()
    changes: list[Change] = []
    told = core.events.total
    resumed = state_file(log).exists()  # it goes on from the state that lies beside a recorder's log
    before = 0
    for number, o in enumerate(made(core, log, channel, onward, Damage(), TimeOrder(log))):
        if number == 0:
            before = core.counts.accepted if resumed else 0
        gathering.put(onward.moved((o.frame, channel or "")))
        if core.events.total != told:
            changes += [_onward(c, onward) for c in core.events.since(told)]
            told = core.events.total
        if number % 1024 == 0:
            reached(o.frame.stamp_us + onward.correction_us)
    changes += [_onward(c, onward) for c in core.events.since(told)]
    return Estimated(gathering.done(log), tuple(changes), core.counts.accepted - before)


def _onward(change: Change, onward: Onward) -> Change:
    """A change in the time that goes on. Those of the tick in which the clock is set back are told after it."""
    if not onward.steps:
        return change
    step = onward.steps[-1]
    behind_us = step.at_us - (change.time_us + step.before_us)
    correction_us = step.before_us if 0 <= behind_us < LAST_TICK_US < step.back_us else onward.correction_us
    return replace(change, time_us=change.time_us + correction_us)


def made(
    core: Core, log: Path, channel: str | None, onward: Onward, damage: Damage, order: TimeOrder
) -> Iterator[Outgoing]:
    """What `wrcd replay` makes of the log. onward, damage and order are filled in on the way."""
    if state_file(log).exists():
        saved = load(state_file(log), core)
        frames = outgoing(core, onward.items(on_channel(read_log(log, damage), channel, log)), saved)
    else:
        stretches = order.put(on_channel(read_stretches(log, damage), channel, log))
        frames = outgoing_of_stretches(core, onward.items(stretches))
    for o, _ in frames:
        yield o
