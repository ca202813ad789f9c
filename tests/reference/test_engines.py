"""The engine on the train against filterpy and scikit-fuzzy, over real logs."""

import random
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from sim_ecu.design.brief import load_source
from tests.reference.filters import Filters, LiveFilters, Models, Schedule
from tests.reference.rules import FuzzyReference
from tests.support.scenarios import FOUR_AXLES, LogOf, held
from wrcd.config.config import load_config
from wrcd.core.configuration import Config
from wrcd.core.core import Core, Observer
from wrcd.estimator.paper.bank import SpeedFilter
from wrcd.estimator.records import Estimate, StepResult, Tick
from wrcd.estimator.signals.noise import Offset
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
EVERY_TICKS = 20  # of an estimate that scikit-fuzzy is asked for: it takes milliseconds


class Beside(Observer):
    """Shown the ticks of a core, filterpy's filters beside the bank. Which samples to use, and which are near a pulse,
    the engine says; the speed's filter and the offset are its own, too."""

    def __init__(self, config: Config) -> None:
        design, axles = config.design, range(len(config.axles))
        self._speed, self._offset = SpeedFilter(design.tick_s), Offset(2 * design.window_ticks, len(axles))
        self._schedule, models = Schedule(design), Models(load_source(config.design_file))
        self._filters = [Filters(design.states) for _ in axles]
        self._live = [LiveFilters(models) for _ in axles]
        self.differences: list[NDArray[np.float64]] = []  # to filters with the same gains
        self.innovations: list[NDArray[np.float64]] = []
        self.live: list[NDArray[np.float64]] = []  # of filters that carry their covariances
        self.partial = 0  # ticks of which an axle's only channel, or an absurd sample, was left out
        self.inputs: list[NDArray[np.float64]] = []
        self.fuzzy: list[float] = []
        self._asked = 0

    def was_reset(self, axle: int) -> None:
        self._offset.reset(axle)
        self._filters[axle].reset()
        self._live[axle].reset()

    def stepped(self, tick: Tick, result: StepResult) -> None:
        speed, used = self._speed.step(tick.speed_m_s), result.accepted
        z = self._offset.step(tick.z, np.broadcast_to(used & ~result.near_pulse, tick.z.shape))
        matrices = self._schedule.at(speed)
        self.partial += int((tick.present.any(axis=0) & ~used).sum())
        for a, (filters, live) in enumerate(zip(self._filters, self._live, strict=True)):
            same = filters.step(z[:, a], bool(used[a]), matrices)
            carried = live.step(z[:, a], bool(used[a]), speed)
            if used[a]:
                self.innovations.append(result.innovations[:, :, a])
                self.differences.append(self.innovations[-1] - same)
                self.live.append(carried)

    def estimated(self, tick: int, estimate: Estimate) -> None:
        if tick - self._asked >= EVERY_TICKS:
            self._asked = tick
            known = np.isfinite(estimate.fuzzy)
            self.inputs += list(estimate.inputs[known])
            self.fuzzy += estimate.fuzzy[known].tolist()


def beside(log: Path) -> Beside:
    """Both over a log; raises AssertionError where they differ by more than rounding."""
    config = load_config(None)
    found = Beside(config)
    core = Core(config, observer=found)
    for frame, _ in read_log(log, Damage()):
        core.feed(frame)
    ours, live = np.array(found.innovations), np.array(found.live)
    assert len(ours) > 700
    assert np.abs(found.differences).max() <= 1e-9 * np.abs(ours).max()
    # what steady-state gains cost against live covariances
    assert 0 < np.square(ours - live).sum() < 0.1 * np.square(live).sum()
    said = FuzzyReference(config.design).outputs(np.array(found.inputs))
    assert said == pytest.approx(np.array(found.fuzzy), abs=1e-6)
    assert np.ptp(said) > 0.5
    return found


@pytest.mark.parametrize("name", LOGS)
def test_engine_agrees_with_filterpy_and_scikit_fuzzy(log_of: LogOf, name: str) -> None:
    beside(log_of(LOGS[name]))


def test_engines_agree_where_frames_are_lost(log_of: LogOf, tmp_path: Path) -> None:
    rng = random.Random(5)
    lines = [x for x in log_of(RAMP_OVER_JOINTS).read_text().splitlines() if rng.random() > 0.05]
    lossy = tmp_path / "lossy.log"
    lossy.write_text("\n".join(lines) + "\n")
    assert beside(lossy).partial > 50
