"""Playing in real time: what a computer that is too slow does."""

import time

import can

from sim_ecu.play.play import BUSY_US, MAX_SAMPLES, PlayTally, RealTime
from sim_ecu.play.scenario import read_scenario
from tests.support.scenarios import held
from wrcd.config.settings import parse_toml


class Late:
    """A clock that is always a minute ahead of what was played."""

    def __init__(self) -> None:
        self._reads = 0

    def monotonic_ns(self) -> int:
        self._reads += 1
        return 0 if self._reads == 1 else 60_000_000_000

    def time_ns(self) -> int:
        return time.time_ns()


def test_step_of_a_computer_that_never_catches_up_returns() -> None:
    scenario = read_scenario(parse_toml(held("A", 1.0), "test"), "test")
    with can.Bus("real-time-late", interface="virtual") as bus:
        rig = RealTime(scenario, bus, None, clock=Late())
        assert rig.step()
        assert rig.tally.overruns == MAX_SAMPLES
        assert rig.wait_s() == 0.0
        steps = 1
        while rig.step():
            steps += 1
            assert steps < 1000
        assert rig.tally.frames > 400
        assert "59.99 s late" in rig.tally.too_slow
    assert PlayTally(latest_us=BUSY_US).too_slow == ""
