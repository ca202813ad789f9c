"""An axle that is reset again and again waits, longer each time, and comes back by itself."""

from itertools import pairwise
from typing import Any

import pytest

from tests.unit.core.test_core import Rig, validities
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.config import load_config
from wrcd.core.backoff import FIRST_WAIT_S, FREE_RESETS, LAST_WAIT_S
from wrcd.core.configuration import Config

STEP_EVERY = 10  # ticks
PER_S = 200


@pytest.fixture(scope="module")
def config() -> Config:
    return load_config(None)


def storm(rig: Rig, seconds: float) -> tuple[list[dict[str, Any]], list[float]]:
    """A yaw rate that steps to and fro without end: the adhesion frames, and when the axle was reset."""
    frames, resets = [], []
    for k in range(round(seconds * PER_S)):
        rig.spike = 5_000_000 if k // STEP_EVERY % 2 else 0
        before = rig.core.counts.restarts
        frames += rig.run(5)
        if rig.core.counts.restarts > before:
            resets.append(k / PER_S)
    rig.spike = 0
    return frames, resets


def test_the_wait_grows_and_is_bounded(config: Config) -> None:
    rig = Rig(config)
    frames, resets = storm(rig, 60.0)
    gaps = [b - a for a, b in pairwise(resets)]
    assert max(gaps[: FREE_RESETS - 1]) < 0.3
    wait = FIRST_WAIT_S
    for gap in gaps[FREE_RESETS:]:
        assert wait <= gap < wait + 0.3
        wait = min(2 * wait, LAST_WAIT_S)
    assert wait == LAST_WAIT_S
    assert rig.core.waits == len(resets) - FREE_RESETS
    assert set(validities(frames[10:])) == {"NotAvailable"}


def test_it_comes_back_by_itself_and_what_was_is_forgiven(config: Config) -> None:
    rig = Rig(config)
    storm(rig, 20.0)
    waits = rig.core.waits
    frames = rig.run(12_000)
    assert validities(frames) == ["NotAvailable", "Valid"]
    first = next(i for i, f in enumerate(frames) if f["Validity"] == "Valid")
    assert first * 0.02 <= LAST_WAIT_S + 1.2
    # a step now, and the step back, are as on the first day
    for spike in (1_000_000, 0):
        rig.spike = spike
        rig.run(500)
    assert validities(rig.run(1000)) == ["NotAvailable", "Valid"]
    assert rig.core.waits == waits


def of_axle_2(frame: Frame) -> Frame:
    can_id = frame.can_id + 1
    return Frame(frame.stamp_us, can_id, protect(frame.data, can_id, frame.data[1] & 0x0F))


def test_the_other_axles_do_not_wait(config: Config) -> None:
    rig, other = Rig(config), Rig(config)
    for k in range(20 * PER_S):
        rig.spike = 5_000_000 if k // STEP_EVERY % 2 else 0
        for frame in rig.frames():
            rig.out += rig.core.feed(frame)
        for frame in other.frames():
            if frame.can_id != 0x130:
                rig.out += rig.core.feed(of_axle_2(frame))
        rig.out += rig.core.advance(rig.t)
    assert rig.core.waits > 0
    assert validities(rig.adhesion(rig.out, 1)) == ["NotAvailable"]
    assert validities(rig.adhesion(rig.out, 2)) == ["NotAvailable", "Valid"]


def test_a_speed_that_jumps_to_and_fro_makes_all_axles_wait(config: Config) -> None:
    """Believed at its second frame each time: without a wait that is a reset every few frames."""
    rig = Rig(config)
    rig.run(2000)
    for k in range(20 * PER_S):
        rig.speed = 25.0 if k % 8 < 4 else 28.0
        rig.run(5)
    assert rig.core.counts.restarts < 40
    assert rig.core.waits == rig.core.counts.restarts - FREE_RESETS
    rig.speed = 25.0
    assert validities(rig.run(11_000)) == ["NotAvailable", "Valid"]


def test_a_step_of_time_ends_the_wait(config: Config) -> None:
    rig = Rig(config)
    storm(rig, 10.0)
    rig.t -= 3_600_000_000
    frames = rig.run(1200)
    assert validities(frames) == ["NotAvailable", "Valid"]
