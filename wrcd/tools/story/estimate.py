"""A log through the core: the frames that a daemon would have sent, and the changes of Validity behind them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
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
from wrcd.tools.story.scan import Gathering, Scan


@dataclass(frozen=True, slots=True)
class Estimated:
    """What came of a log: frames by their message, changes in their order, frames that were accepted."""

    sent: Scan
    changes: tuple[Change, ...]
    accepted: int
    resumed: bool  # it went on from the state that lies beside a recorder's log


def estimate(
    log: Path, config: Config, channel: str | None, reached: Callable[[int], None] = lambda stamp_us: None
) -> Estimated:
    """Replay a log. reached is told the stamps on the way."""
    core, gathering = Core(config), Gathering()
    changes: list[Change] = []
    told = core.events.total
    resumed = state_file(log).exists()
    before = 0
    for number, o in enumerate(_made(core, log, channel, resumed)):
        if number == 0:
            before = core.counts.accepted if resumed else 0
        gathering.put((o.frame, channel or ""))
        if core.events.total != told:
            changes += core.events.since(told)
            told = core.events.total
        if number % 1024 == 0:
            reached(o.frame.stamp_us)
    changes += core.events.since(told)
    return Estimated(gathering.done(log), tuple(changes), core.counts.accepted - before, resumed)


def _made(core: Core, log: Path, channel: str | None, resumed: bool) -> Iterator[Outgoing]:
    """What `wrcd replay` makes of the log."""
    if resumed:
        saved = load(state_file(log), core)
        made = outgoing(core, on_channel(read_log(log, Damage()), channel, log), saved)
    else:
        stretches = TimeOrder(log).put(on_channel(read_stretches(log, Damage()), channel, log))
        made = outgoing_of_stretches(core, stretches)
    for o, _ in made:
        yield o
