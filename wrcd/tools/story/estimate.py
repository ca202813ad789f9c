"""A log through the core: the frames that a daemon would have sent, the changes of Validity and the estimates behind
them."""

from array import array
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.codec import message_key
from wrcd.bus.damage import Damage
from wrcd.bus.dbc import find_message
from wrcd.bus.log import read_log, read_stretches
from wrcd.bus.log_order import TimeOrder, on_channel
from wrcd.core.causes import Cause
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.events import Change
from wrcd.core.messages import Outgoing
from wrcd.estimator.design import MODELS
from wrcd.estimator.records import Estimate
from wrcd.recorder.resume import load, state_file
from wrcd.tools.feed import outgoing, outgoing_of_stretches
from wrcd.tools.story.clock import Onward
from wrcd.tools.story.records import Adhesion, Detail
from wrcd.tools.story.scan import Gathering, Scan

LAST_TICK_US = 20_000  # before a step of the clock: what was not told of it yet


@dataclass(frozen=True, slots=True)
class Estimated:
    """What came of a log: frames by their message, changes in their order, frames that were accepted; by axle number
    what the core estimated for its Adhesion frames."""

    sent: Scan
    changes: tuple[Change, ...]
    accepted: int
    answers: Mapping[int, "Answers"]


@dataclass(frozen=True, slots=True)
class Answers:
    """What the core estimated for each Adhesion frame of an axle: more than a train's message may carry."""

    time_us: "array[int]" = field(default_factory=lambda: array("q"))
    ends_pct: "array[float]" = field(default_factory=lambda: array("f"))  # two a frame, NaN without an estimate
    residuals: "array[float]" = field(default_factory=lambda: array("f"))  # four a frame
    chosen: "array[int]" = field(default_factory=lambda: array("h"))  # model, rule and cause of a frame

    def put(self, time_us: int, why: Estimate | None, place: int, cause: Cause) -> None:
        """Take down a frame's."""
        self.time_us.append(time_us)
        if why is None:
            self.ends_pct.extend((np.nan, np.nan))
            self.residuals.extend([np.nan] * MODELS)
            self.chosen.extend((0, 0, int(cause)))
            return
        mu, half = float(why.mu_available_pct[place]), float(why.half_width_pp[place])
        self.ends_pct.extend((max(mu - half, 0.0), mu + half) if np.isfinite(half) else (np.nan, np.nan))
        self.residuals.extend(why.residuals[place].tolist())
        self.chosen.extend((int(why.winner[place]), int(why.rule[place]), int(cause)))

    def _by_time(self) -> NDArray[np.int64]:
        """The order that the frames are in once they are gathered."""
        return np.argsort(np.array(self.time_us), kind="stable")

    def bound(self, adhesion: Adhesion) -> Adhesion:
        """The frames with the interval that was estimated, for a message that states none."""
        ends = np.array(self.ends_pct, np.float32).reshape(-1, 2)[self._by_time()]
        return replace(adhesion, low_pct=ends[:, 0], high_pct=ends[:, 1])

    def detail(self) -> Detail:
        """As AdhesionDetail would tell it with each of the frames. Of stale inputs the causes' figures tell."""
        order = self._by_time()
        residuals = np.array(self.residuals, np.float32).reshape(-1, MODELS)[order]
        winner, rule, cause = np.array(self.chosen, np.int16).reshape(-1, 3)[order].T
        return Detail(
            np.array(self.time_us)[order], 20 * np.log10(residuals), winner.astype(np.int8), rule,
            cause.astype(np.int8), np.zeros((len(order), 4), bool),
        )  # fmt: skip


def estimate(
    log: Path, config: Config, channel: str | None, reached: Callable[[int], None] = lambda stamp_us: None
) -> Estimated:
    """Replay a log. reached is told the stamps on the way."""
    core, gathering, onward = Core(config), Gathering(), Onward()
    changes: list[Change] = []
    told = core.events.total
    answers = {a.number: Answers() for a in config.axles}
    of_message = {
        message_key(find_message(config.database, a.adhesion.message)): (place, answers[a.number])
        for place, a in enumerate(config.axles)
    }
    resumed = state_file(log).exists()  # it goes on from the state that lies beside a recorder's log
    before = 0
    for number, o in enumerate(made(core, log, channel, onward, Damage(), TimeOrder(log))):
        if number == 0:
            before = core.counts.accepted if resumed else 0
        stamp_us = gathering.put(onward.moved((o.frame, channel or "")))
        if (found := of_message.get(o.frame.key)) is not None:
            found[1].put(stamp_us, o.why, found[0], o.cause)
        if core.events.total != told:
            changes += [_onward(c, onward) for c in core.events.since(told)]
            told = core.events.total
        if number % 1024 == 0:
            reached(o.frame.stamp_us + onward.correction_us)
    changes += [_onward(c, onward) for c in core.events.since(told)]
    return Estimated(gathering.done(log), tuple(changes), core.counts.accepted - before, answers)


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
