"""The estimator against its oracle over real logs, and against filters that carry their covariances."""

import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from sim_ecu.design.brief import load_source
from tests.oracle.comparison import Comparison
from tests.oracle.live_filters import LiveFilters, Models
from tests.support.scenarios import FOUR_AXLES, LogOf, held
from tests.support.stepped import SteppedEstimator, StepResult, Tick
from wrcd.config.config import load_config
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.terms import CHANNELS, MAX_AXLES
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

# Half a minute of live covariances at every tenth of a metre per second would be too much: the speed ramps by little.
RAMP_OVER_JOINTS = """
duration_s = 6
speed_m_s = [[0, 20], [6, 22.5]]
rail = [{ curve = "A" }, { from_m = 70, curve = "E" }]
drive = { torque_N_m = [[0, 0], [1, 5000], [4.5, 5000], [4.52, 3000]] }
[axlebox]
joint_m_s2 = 1.0
"""
LOGS = {"held": held("C", 4.0), "ramp, joints, another rail": RAMP_OVER_JOINTS, "four axles": FOUR_AXLES}


EVERY_TICKS = 4  # of an estimate


class Beside:
    """Shown the ticks of a core: an estimator with its oracle beside it, and live filters of the same measurements."""

    def __init__(self, config: Config) -> None:
        self._axles = len(config.axles)
        models = Models(load_source(config.design_file))
        self._estimator = SteppedEstimator(config.design, self._axles)
        self.both = Comparison(self._estimator)
        self._live = [LiveFilters(models) for _ in range(self._axles)]
        self.innovations: list[NDArray[np.float64]] = []
        self.live: list[NDArray[np.float64]] = []  # of filters that carry their covariances
        self.fuzzy: list[float] = []
        self.partial = 0  # ticks of which an axle's only channel, or an absurd sample, was left out

    def take(self, ticks: NDArray[Any]) -> None:
        """Ticks of the core, as it has them."""
        for t in ticks:
            for axle in range(self._axles):
                if t["were_reset"] >> axle & 1:
                    self._reset(axle)
            z, present = (t[name].reshape(CHANNELS, MAX_AXLES)[:, : self._axles] for name in ("z", "present"))
            ratio = t["torque_ratio"][: self._axles]
            self._step(Tick(int(t["number"]), z, present > 0, ratio, float(t["speed_m_s"])), t["result"])

    def _reset(self, axle: int) -> None:
        self._estimator.reset(axle)
        self.both.reset(axle)
        self._live[axle].reset()

    def _step(self, tick: Tick, of_core: Any) -> None:
        result = self._estimator.step(tick)
        assert np.array_equal(result.whitened, StepResult(of_core, self._axles).whitened)
        expected, oracle = self.both.stepped(tick, result), self.both.oracle
        used = expected.accepted
        self.partial += int((tick.present.any(axis=0) & ~used).sum())
        for axle, live in enumerate(self._live):
            carried = live.step(oracle.deviation[:, axle], bool(used[axle]), oracle.speed_m_s)
            if used[axle]:
                self.innovations.append(result.innovations[:, :, axle])
                self.live.append(carried)
        if tick.number % EVERY_TICKS == 0:
            estimate = self._estimator.estimate()
            self.both.estimated(estimate)
            self.fuzzy += estimate.fuzzy[np.isfinite(estimate.fuzzy)].tolist()


def beside(log: Path) -> Beside:
    """All of them over a log; raises AssertionError where they differ."""
    config = load_config(None)
    found = Beside(config)
    core = Core(config, ticks=found.take)
    for frame, _ in read_log(log, Damage()):
        core.feed(frame)
    ours, live = np.array(found.innovations), np.array(found.live)
    assert len(ours) > 700
    # what steady-state gains cost against live covariances
    assert 0 < np.square(ours - live).sum() < 0.1 * np.square(live).sum()
    assert np.ptp(found.fuzzy) > 0.5
    return found


@pytest.mark.parametrize("name", LOGS)
def test_estimator_agrees_with_its_oracle_over_a_log(log_of: LogOf, name: str) -> None:
    beside(log_of(LOGS[name]))


def test_estimator_agrees_with_its_oracle_where_frames_are_lost(log_of: LogOf, tmp_path: Path) -> None:
    rng = random.Random(5)
    lines = [x for x in log_of(RAMP_OVER_JOINTS).read_text().splitlines() if rng.random() > 0.05]
    lossy = tmp_path / "lossy.log"
    lossy.write_text("\n".join(lines) + "\n")
    assert beside(lossy).partial > 50
