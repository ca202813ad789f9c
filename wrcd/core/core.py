"""frame -> values -> inputs -> tick -> estimate -> Validity with its cause -> frames: the door to the core in C.

It reads no clock. Live, the loop tells it how far time has come (advance); in a replay the next frame does. What it is
and does is in wrcd/core/c/core.c.
"""

from collections.abc import Callable, Sequence
from copy import copy, deepcopy
from typing import Any

import numpy as np

from wrcd.bus.batch import FrameBatch
from wrcd.bus.frame import Frame
from wrcd.bus.mapping import Mapped
from wrcd.core.configuration import Config
from wrcd.core.counts import Counts, Health
from wrcd.core.design_fit import DesignFit, fits_of
from wrcd.core.estimator import Estimator
from wrcd.core.events import Events
from wrcd.core.layouts import as_struct, layouts
from wrcd.core.reports import Made, Report, reports
from wrcd.core.state import Buffers, Train
from wrcd.core.tables import QUANTITIES, SPEED, tables_of
from wrcd.core.vocabulary import words_of
from wrcd.native import constant, library

# Further ahead of the open tick it is a step of time; out of order by less is jitter between queues.
FORWARD_STEP_US, BACKWARD_STEP_US = int(constant("FORWARD_STEP_US")), int(constant("BACKWARD_STEP_US"))
SLOTS = 256  # that are made without coming back from C: of memory not used the kernel gives none
_STATES, _LINK_STATES = words_of("status_message", "State"), words_of("link_message", "LinkState")
Records = np.ndarray[Any, Any]
Seen = Callable[[Records], None]


class Core:
    """One bus, all its axles. samples and ticks are shown the values of accepted frames and the estimator's ticks, as
    C's records; they change nothing."""

    def __init__(self, config: Config, samples: Seen | None = None, ticks: Seen | None = None) -> None:
        self.config = config
        self.mapped = Mapped(config.database, [i.source for i in config.inputs], config.data_ids)
        self.health = Health()
        self._samples, self._ticks = samples, ticks
        self._tables = tables_of(config, self.mapped)
        self._begin()
        self.events = Events(config, self.mapped)
        self._nothing = Made(*(np.zeros(0, dtype=layouts()[name]) for name in ("made", "report")))
        self._reports = self._nothing.reports  # of the newest slot
        library().wrcd_core_begin(self._train.pointer)
        self._state.keeps_samples, self._state.keeps_ticks = samples is not None, ticks is not None

    def _begin(self) -> None:
        """Memory for the state, and who looks at it."""
        n, sent = len(self.config.axles), int(self._tables["settings"]["sent"][0])
        self.estimator = Estimator(self.config.design, n)
        self._train = Train(self._tables, self.estimator.addresses)
        self._buffers = Buffers({
            "made": SLOTS * max(sent, 1), "report": SLOTS * n, "event": 8 * SLOTS * n, "sample": 4096 + 64 * SLOTS,
            "tick": SLOTS,
        })  # fmt: skip
        self._state = as_struct(self._train.state["core"])
        self._told_health = self._train.state["core"].view(np.int64)[:9]
        self._said: tuple[int, ...] = ()
        self._feed = library().wrcd_feed
        self.counts = Counts(self.config, self.mapped, self._train.state)
        self._period_us = int(self._tables["settings"]["period_us"][0])

    def __deepcopy__(self, memo: dict[int, Any]) -> "Core":
        twin = memo[id(self)] = copy(self)
        twin.health, twin.events = deepcopy(self.health, memo), deepcopy(self.events, memo)
        twin._begin()
        twin._train.copy_from(self._train)
        twin.estimator.copy_from(self.estimator)
        return twin

    @property
    def muted(self) -> bool:
        """Whether no frames are made: nobody would send them."""
        return bool(self._state.is_muted)

    @muted.setter
    def muted(self, muted: bool) -> None:
        self._state.is_muted = muted

    @property
    def speed_m_s(self) -> float:
        """The newest speed of the train; NaN before it is known, negative backwards."""
        settings = self._tables["settings"][0]
        number = int(settings["input_of"].reshape(len(QUANTITIES), -1)[SPEED, 0])
        return float(settings["start"][SPEED] if number < 0 else self._train.state["input_state"][number]["value"])

    @property
    def below_min_speed(self) -> bool:
        """Whether the train is known to be slower than an estimate needs."""
        return abs(self.speed_m_s) < self.config.min_speed_m_s

    @property
    def time_us(self) -> int | None:
        """Begin of the open tick: every tick before it is closed. None before the first frame."""
        return int(self._state.open) * self._period_us if self._state.is_open else None

    @property
    def reports(self) -> list[Report]:
        """Of every axle at the newest slot."""
        return reports(self._reports)

    @property
    def design_fits(self) -> tuple[DesignFit, ...]:
        """Of every bogie whose constants the design has."""
        count = int(self._tables["settings"]["bogies"][0])
        return fits_of(self.config, self._train.state["bogie_state"][:count])

    def take_design_fit(self, other: "Core") -> None:
        """Know of every bogie what another core of the same design knows of its first one."""
        self._train.state["bogie_state"][:] = other._train.state["bogie_state"][0]

    @property
    def newest_us(self) -> int:
        """Newest stamp of a mapped frame; long ago before the first."""
        return int(self._state.stamp_us)

    @property
    def next_slot_us(self) -> int:
        """The first end of a tick not closed yet with which frames are due; long ago before the first frame."""
        return int(library().wrcd_next_slot_us(self._train.pointer))

    def feed(self, frames: Frame | FrameBatch | Sequence[Frame]) -> Made:
        """Take frames; return what was due before their stamps. What is not mapped changes nothing.

        A frame is accepted or refused here, whole, for what it carries or for what is plausible.
        """
        if isinstance(frames, Frame):
            frames = FrameBatch.of((frames,))
        elif not isinstance(frames, FrameBatch):
            frames = FrameBatch.of(frames)
        self._tell_health()
        taken, count, made = 0, len(frames), self._nothing
        while True:
            taken = self._feed(self._train.pointer, self._buffers.pointer, frames.records, frames.stride, taken, count)
            made = self._take(made)
            if taken >= count:
                return made

    def advance(self, now_us: int) -> Made:
        """Time has come to now_us and every frame stamped before it has been fed: close the ticks that are over.

        A time before the open tick, or more than a second after its begin, means that the clock has stepped.
        """
        self._tell_health()
        made = self._nothing
        while True:
            all_closed = library().wrcd_advance(self._train.pointer, self._buffers.pointer, now_us)
            made = self._take(made)
            if all_closed:
                return made

    def shutdown_frames(self, now_us: int) -> list[Frame]:
        """The last frames: every axle NotAvailable, the daemon stopping."""
        self.health.state = "Stopping"
        self._tell_health()
        library().wrcd_shutdown(self._train.pointer, self._buffers.pointer, now_us)
        return [o.frame for o in self._take(self._nothing)]

    def _tell_health(self) -> None:
        health, link = self.health, self.health.link
        said = (
            _STATES.index(health.state), health.overruns, link.drops, link.reopens, _LINK_STATES.index(link.state),
            link.error_frames, link.bus_offs, link.unsent, link.foreign_frames,
        )  # fmt: skip
        if said != self._said:
            self._said = self._told_health[:] = said

    def _take(self, before: Made) -> Made:
        """What has come, handed on to who looks, behind what came before."""
        out = self._buffers.take()
        if not out:
            return before
        if "event" in out:
            self.events.take(out["event"])
        if "sample" in out and self._samples is not None:
            self._samples(out["sample"])
        if "tick" in out and self._ticks is not None:
            self._ticks(out["tick"])
        if "report" in out:
            self._reports = out["report"][-len(self.config.axles) :]
        if "made" not in out:
            return before
        made = Made(out["made"], out.get("report", self._nothing.reports))
        return before.followed_by(made) if len(before) else made
