"""Rig, daemon's core and controller on virtual time, in one process: the same code, the same frames."""

from collections.abc import Callable, Iterator

from sim_ecu.loop.control.controller import CYCLE_US, Controller
from sim_ecu.loop.rig import LOOP, TRUTH, WRCD, Rig, Step
from sim_ecu.loop.scenario import DriveScenario
from sim_ecu.play.play import LOG_START_US
from wrcd.bus.frame import Frame
from wrcd.core.configuration import Config
from wrcd.core.core import Core


def ride(
    scenario: DriveScenario, controller: Controller, config: Config | None,
    frame: Callable[[int, int, bytes], None] | None = None, truth: bool = False,
) -> Iterator[Step]:  # fmt: skip
    """The steps of a run, until its time is over or the train is slower than the scenario's stop_m_s.

    config None: there is no daemon on the bus. frame is called with all that is on the bus: time (us from the start),
    id, data.
    """
    core = None if config is None else Core(config)
    rig = Rig(scenario, [LOOP, *([] if core is None else [WRCD]), *([TRUTH] if truth else [])])
    end_us = round(scenario.train.duration_s * 1e6)
    while rig.time_us < end_us:
        step = rig.step()
        for f in step.frames:
            controller.hear(f.can_id, f.data, f.due_us)
            if frame is not None:
                frame(f.due_us, f.can_id, f.data)
            if core is None:
                continue
            for out in core.feed(Frame(LOG_START_US + f.due_us, f.can_id, f.data)):
                stamp_us = out.frame.stamp_us - LOG_START_US
                controller.hear(out.frame.can_id, out.frame.data, stamp_us)
                if frame is not None:
                    frame(stamp_us, out.frame.can_id, out.frame.data)
        if rig.time_us % CYCLE_US == 0:
            for f in controller.tick(rig.time_us):
                rig.hear(f.can_id, f.data, rig.time_us)
                if frame is not None:
                    frame(f.due_us, f.can_id, f.data)
        yield step
        if step.speed_m_s < scenario.stop_m_s:
            return
