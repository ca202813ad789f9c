"""A controller's cycles follow its wheel speeds."""

import numpy as np
import pytest

from sim_ecu.loop.control.controller import CYCLE_US
from sim_ecu.loop.control.pacer import SETTLE_US, STEP_US, WINDOW, Pacer


def follow(offset_us: int, frames: int, late_us: list[int] | None = None, drift_us: float = 0.0) -> list[int]:
    """How long after each frame's proper time the next cycle comes; frames come every cycle, some of them late."""
    pacer, moved, out = Pacer(), 0, []
    for k in range(frames):
        proper_us = k * CYCLE_US + offset_us + round(k * drift_us)
        stamp_us = proper_us + (late_us[k % len(late_us)] if late_us else 0)
        moved += pacer.hear(stamp_us - moved)
        out.append((moved - proper_us) % CYCLE_US)
    return out


@pytest.mark.parametrize("offset_us", [0, 1_000, 4_999, 8_500, 9_999])
def test_cycle_comes_right_after_the_first_frame(offset_us: int) -> None:
    assert set(follow(offset_us, 3 * WINDOW)) == {SETTLE_US}


def test_late_frames_do_not_move_the_cycles() -> None:
    late = np.random.default_rng(5).integers(0, 7_000, 97).tolist()
    late[::5] = [0] * len(late[::5])
    assert set(follow(3_000, 10 * WINDOW, late)) == {SETTLE_US}


def test_cycles_follow_a_clock_that_drifts() -> None:
    after = follow(3_000, 100 * WINDOW, drift_us=2.0)  # 200 ppm
    assert max(abs(a - SETTLE_US) for a in after) <= STEP_US


def test_cycles_follow_a_sender_that_begins_anew() -> None:
    pacer, moved = Pacer(), 0
    for k in range(4 * WINDOW):
        phase = 2_000 if k < WINDOW else 7_000
        moved += pacer.hear(k * CYCLE_US + phase - moved)
    assert (moved - 7_000) % CYCLE_US == SETTLE_US
