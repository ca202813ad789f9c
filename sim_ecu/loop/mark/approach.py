"""Four trains on their way to four stations, and what a daemon advises each: one core, as on a train of eight axles.

The trains of a line run at one speed, so that one core serves four of them. Each train's advice is made of its own two
axles, by the daemon's own Adviser: the frames are those of a daemon of its own (a test compares them).
"""

from collections.abc import Sequence
from dataclasses import fields, replace
from functools import cache

from sim_ecu.loop.control.braking_rate import RATES
from sim_ecu.loop.mark.lines import AXLES, Stop, braking_m
from sim_ecu.play.play import LOG_START_US
from sim_ecu.play.player import LARGE_CHUNK, Player
from wrcd.bus.batch import FrameBatch
from wrcd.bus.codec import Writer
from wrcd.bus.dbc import find_message
from wrcd.bus.frame import Frame
from wrcd.config.config import load_packaged
from wrcd.core.advice import Adviser
from wrcd.core.configuration import MAX_AXLES, Config
from wrcd.core.core import Core
from wrcd.core.messages import Outgoing
from wrcd.estimator.records import Estimate

TRAINS = MAX_AXLES // AXLES
Advices = Sequence[tuple[int, int, bytes]]  # stamp (us from the start), id, data


def approach(stops: Sequence[Stop]) -> Sequence[Advices]:
    """Return what each train hears until the last place where it may begin to brake. Up to TRAINS stops of one line."""
    first = stops[0]
    seconds = (first.mark_m - braking_m(first.speed_m_s, RATES.dry)) / first.speed_m_s
    axles = [a for stop in stops for a in stop.scenario.train.axles]
    numbered = tuple(replace(a, number=k) for k, a in enumerate(axles, 1))
    train = replace(first.scenario.train, axles=numbered, duration_s=seconds, hold_speed=True)
    core, shared = Core(_packaged(len(axles))), _Shared(len(stops), advised_configuration())
    for _, frames in Player(train, truth=False, chunk=LARGE_CHUNK):
        for f in frames:
            shared.take(core, core.feed_batch(FrameBatch.of([Frame(LOG_START_US + f.due_us, f.can_id, f.data)])))
    return shared.heard


@cache
def advised_configuration() -> Config:
    """The packaged configuration of a train of AXLES with its advice."""
    return load_packaged(AXLES, advice=True)


_packaged = cache(load_packaged)


class _Shared:
    """Advises each train from its own part of a core's slots."""

    def __init__(self, trains: int, config: Config) -> None:
        assert config.advice is not None
        output = config.advice.output
        self.heard: list[list[tuple[int, int, bytes]]] = [[] for _ in range(trains)]
        self._advisers = [Adviser(AXLES, config.advice) for _ in range(trains)]
        self._writer, self._cycle_us = Writer(find_message(config.database, output.message), output), output.cycle_us
        self._slot_us = -1

    def take(self, core: Core, out: Sequence[Outgoing]) -> None:
        """Take what a core has made; where a slot with advice is in it, advise."""
        slot = [m for m in out if m.frame.stamp_us % self._cycle_us == 0]
        if not slot or slot[0].frame.stamp_us == self._slot_us:
            return
        self._slot_us = stamp_us = slot[0].frame.stamp_us
        estimate = next((m.why for m in slot if m.why is not None), None)
        for k, (adviser, heard) in enumerate(zip(self._advisers, self.heard, strict=True)):
            own = slice(AXLES * k, AXLES * (k + 1))
            advice = adviser.update(
                stamp_us, core.speed_m_s, core.below_min_speed, core.reports[own], _part(estimate, own), None
            )
            frame = self._writer.frame(stamp_us, stamp_us // self._cycle_us, advice.values())
            heard.append((stamp_us - LOG_START_US, frame.can_id, frame.data))


def _part(estimate: Estimate | None, own: slice) -> Estimate | None:
    """The estimate of some of its axles."""
    if estimate is None:
        return None
    return Estimate(**{f.name: getattr(estimate, f.name)[own] for f in fields(Estimate)})
