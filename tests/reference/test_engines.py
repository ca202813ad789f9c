"""The engine on the train against filterpy and scikit-fuzzy, over real logs."""

import random
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from tests.reference.engines import Findings, compare
from tests.support.scenarios import FOUR_AXLES, LogOf, held
from wrcd.config.config import load_config
from wrcd.core import core
from wrcd.core.core import Core, Observer
from wrcd.estimator.estimator import Estimator
from wrcd.estimator.paper import bank
from wrcd.estimator.records import Estimate, StepResult, Tick
from wrcd.estimator.signals import noise
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


def agree(log: Path) -> Findings:
    found = compare(log, load_config(None), fuzzy_every_s=0.3)
    assert found.ticks > 700
    assert found.agree
    assert found.largest > 0
    assert len(found.fast) >= 9
    assert np.ptp(found.fast) > 0.5
    assert 0 < found.live_square < 0.1 * found.square  # what steady-state gains cost against live covariances
    return found


@pytest.mark.parametrize("name", LOGS)
def test_fast_and_reference_engine_agree(log_of: LogOf, name: str) -> None:
    agree(log_of(LOGS[name]))


def test_engines_agree_where_frames_are_lost(log_of: LogOf, tmp_path: Path) -> None:
    rng = random.Random(5)
    lines = [x for x in log_of(RAMP_OVER_JOINTS).read_text().splitlines() if rng.random() > 0.05]
    lossy = tmp_path / "lossy.log"
    lossy.write_text("\n".join(lines) + "\n")
    assert agree(lossy).partial > 50


class Lengths(Observer):
    """Keeps the windows' lengths and the pulses: an observer of the core."""

    def __init__(self) -> None:
        self.windows_s: list[float] = []
        self.pulses = 0
        self._near_pulse = False

    def stepped(self, tick: Tick, result: StepResult) -> None:
        """Keep the newest tick's."""
        self._near_pulse = bool(result.near_pulse[0])

    def estimated(self, tick: int, estimate: Estimate) -> None:
        """Of a slot."""
        self.windows_s.append(float(estimate.window_s[0]))
        self.pulses += self._near_pulse


def test_the_log_has_what_the_engines_are_compared_on(log_of: LogOf) -> None:
    """Whole windows, dropped at the change of torque or rail, and pulses."""
    seen = Lengths()
    played = Core(load_config(None), observer=seen)
    for frame, _ in read_log(log_of(RAMP_OVER_JOINTS), Damage()):
        played.feed(frame)
    windows = np.array(seen.windows_s)
    assert windows.max() == 1.0
    assert windows[windows.argmax() :].min() < 0.5
    assert seen.pulses > 5


@pytest.mark.parametrize(
    ("room", "name", "value", "log"),
    [(bank, "MEMORY_S", 0.5, "ramp, joints, another rail"), (noise, "MEMORY_TICKS", 10.0, "held")],
)
def test_difference_between_engines_is_found(
    room: ModuleType, name: str, value: float, log: str, log_of: LogOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(core, "make_estimator", Estimator)  # C has constants of its own
    monkeypatch.setattr(room, name, value)
    assert not compare(log_of(LOGS[log]), load_config(None), 0.3).agree
