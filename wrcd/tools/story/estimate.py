"""A log through the core: the frames that a daemon would have sent, and the changes of Validity behind them."""

from collections.abc import Callable, Iterable, Iterator
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
    before = newest_us = 0
    for number, o in enumerate(_made(core, log, channel, resumed, onward)):
        if number == 0:
            before = core.counts.accepted if resumed else 0
        newest_us = o.frame.stamp_us
        gathering.put(onward.moved((o.frame, channel or "")))
        if core.events.total != told:
            changes += _onward(core.events.since(told), newest_us, onward)
            told = core.events.total
        if number % 1024 == 0:
            reached(newest_us + onward.correction_us)
    changes += _onward(core.events.since(told), newest_us, onward)
    return Estimated(gathering.done(log), tuple(changes), core.counts.accepted - before)


def _onward(changes: Iterable[Change], newest_us: int, onward: Onward) -> Iterator[Change]:
    """Changes in the time that goes on. One that lies behind the newest frame is of before the clock was set back."""
    for c in changes:
        correction_us = onward.before_us if onward.steps and c.time_us > newest_us else onward.correction_us
        yield replace(c, time_us=c.time_us + correction_us) if correction_us else c


def _made(core: Core, log: Path, channel: str | None, resumed: bool, onward: Onward) -> Iterator[Outgoing]:
    """What `wrcd replay` makes of the log."""
    if resumed:
        saved = load(state_file(log), core)
        made = outgoing(core, onward.items(on_channel(read_log(log, Damage()), channel, log)), saved)
    else:
        stretches = TimeOrder(log).put(on_channel(read_stretches(log, Damage()), channel, log))
        made = outgoing_of_stretches(core, onward.items(stretches))
    for o, _ in made:
        yield o
