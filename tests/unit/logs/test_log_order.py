"""The order of a log's stamps, and its channels."""

import random
from pathlib import Path

import numpy as np
import pytest

from wrcd.bus.frame import Frame
from wrcd.errors import InputError
from wrcd.logs.columns import Item, Stretch, stretches
from wrcd.logs.time_order import TimeOrder, frames_of, on_channel

LOG = Path("a.log")
START_US = 1_700_000_000_000_000
FRAMES = [(Frame(START_US + 1_000 * k, 0x100 + k % 7, bytes([k % 256])), "can0") for k in range(20_000)]
Frames = list[tuple[Frame, str]]


def put(frames: Frames, by_columns: bool = True) -> tuple[Frames, TimeOrder]:
    order = TimeOrder(LOG)
    items: list[Item] = list(stretches(frames)) if by_columns else list(frames)
    return [f for item in order.put(items) for f in frames_of(item)], order


def shuffled(seed: int, within_us: int) -> Frames:
    rng = np.random.default_rng(seed)
    delays = rng.integers(0, within_us, len(FRAMES))
    return [FRAMES[k] for k in np.argsort([f.stamp_us for f, _ in FRAMES] + delays, kind="stable")]


@pytest.mark.parametrize("by_columns", [True, False])
@pytest.mark.parametrize("frames", [FRAMES, shuffled(1, 9_000)], ids=["in order", "jitter between queues"])
def test_log_in_order_or_nearly_so_passes_untouched(frames: Frames, by_columns: bool) -> None:
    found, order = put(frames, by_columns)
    assert found == frames
    assert order.warnings() == []


@pytest.mark.parametrize("by_columns", [True, False])
@pytest.mark.parametrize("within_us", [30_000, 990_000])
def test_log_out_of_order_within_a_second_is_sorted_and_told(within_us: int, by_columns: bool) -> None:
    found, order = put(shuffled(2, within_us), by_columns)
    assert found == FRAMES
    (warning,) = order.warnings()
    assert warning.startswith("a.log: out of time order from frame ")
    assert f"by up to {order.largest_move_us * 1e-6:.3g} s; sorted" in warning
    assert within_us // 2 < order.largest_move_us <= within_us


@pytest.mark.parametrize("seed", range(5))
def test_log_that_gets_out_of_order_later_is_sorted_from_there(seed: int) -> None:
    rng = random.Random(seed)
    frames, at = list(FRAMES), 15_000
    for k in range(at, len(frames) - 600, 600):
        part = frames[k : k + 600]
        rng.shuffle(part)
        frames[k : k + 600] = part
    found, order = put(frames)
    assert found == FRAMES
    assert at < order.sorted_from < at + 100


def test_log_out_of_order_by_more_is_refused() -> None:
    with pytest.raises(InputError, match="out of time order"):
        put(shuffled(3, 10_000_000))


@pytest.mark.parametrize("step_us", [-50_000, -700_000, -5_000_000])
@pytest.mark.parametrize("by_columns", [True, False])
def test_step_of_the_clock_is_told_and_stays(step_us: int, by_columns: bool) -> None:
    frames = FRAMES[:8000] + [
        (Frame(f.stamp_us + step_us, f.can_id, f.data), channel) for f, channel in FRAMES[8000:]
    ]  # fmt: skip
    found, order = put(frames, by_columns)
    assert found == frames
    seconds = f"{(-step_us - 1000) * 1e-6:.3g}"
    assert order.warnings() == [
        f"a.log: its stamps step back 1 time, first at frame 8001, by up to {seconds} s: taken for steps of the clock"
    ]


def two_channels() -> list[Item]:
    return list(stretches([(f, "can1" if k % 3 == 0 else "can0") for k, (f, _) in enumerate(FRAMES[:3000])]))


def test_wanted_channel_is_read_alone() -> None:
    found = list(on_channel(two_channels(), "can1", LOG))
    assert sum(len(item) if isinstance(item, Stretch) else 1 for item in found) == 1000
