"""Measurements that come early or late for their tick, and the register of what was reached."""

import math
import random
from collections import Counter
from dataclasses import replace

import pytest

from tests.support.can_ids import LAT_ACCEL, YAW_RATE
from tests.support.lone_wheelset import PLAYED, lone_config
from tests.support.scenarios import FOUR_AXLES, LogOf
from wrcd.bus.frame import Frame
from wrcd.bus.reasons import Reason
from wrcd.core.core import Core
from wrcd.core.input_buffers import NEVER, JitterBuffer, Reach
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

MEASUREMENTS = {*YAW_RATE.values(), *LAT_ACCEL.values()}


def played(*ticks: list[int], patience: int = 100) -> list[int | None]:
    """What each tick uses, of measurements named by their stamps."""
    a = JitterBuffer(1, patience)
    out: list[int | None] = []
    for tick in ticks:
        for stamp in tick:
            a.put(0, stamp / 10, stamp)
        (value,), present = a.take()
        there = present is None or present[0]
        out.append(a.used_us[0] if there else None)
        assert value == (a.used_us[0] / 10 if there else 0.0)
    return out


@pytest.mark.parametrize(
    ("ticks", "used", "patience"),
    [
        ([[1], [2], [3]], [1, 2, 3], 100),
        ([[1, 2], [], [3]], [1, 2, 3], 100),  # what is too many waits for the next tick
        ([[1], [], [2, 3], [], [4, 5], []], [1, None, 2, 3, 4, 5], 100),
        ([[1, 2, 3], [], []], [2, 3, None], 100),  # a third drops the oldest
        ([[1, 2], [3, 4], [5, 6], [7, 8]], [1, 3, 5, 7], 100),  # twice as fast as the tick: in even steps
        ([[1, 2], [3, 4], [5, 6], [7, 8]], [1, 3, 5, 7], 2),
        ([[1, 2], [3], [4], [5], [6], [7]], [1, 2, 3, 4, 6, 7], 4),  # waits beyond patience: dropped
        ([[1, 2], [3], [], [4, 5], [6], [7], [8]], [1, 2, 3, 4, 5, 6, 7], 4),  # needed now and then: stays
    ],
)
def test_tick_uses_one_measurement_in_their_order(
    ticks: list[list[int]], used: list[int | None], patience: int
) -> None:
    assert played(*ticks, patience=patience) == used


def test_measurement_that_is_not_to_be_used_has_its_tick() -> None:
    a, used = JitterBuffer(1, 100), []
    for stamps in ([1, 2], [3], [4], []):
        for stamp in stamps:
            a.put(0, math.nan if stamp == 2 else stamp / 10, stamp)
        used.append((a.take(), a.used_us[0]))
    assert used == [(([0.1], None), 1), (([0.0], [False]), 1), (([0.3], None), 3), (([0.4], None), 4)]


def test_reset_drops_waiting_measurements() -> None:
    a = JitterBuffer(6, 100)
    a.put(5, 5.0, 7)
    a.put(5, 6.0, 8)
    a.take()
    a.reset()
    assert a.take() == ([0.0] * 6, [False] * 6)
    assert a.used_us == [NEVER] * 6


def test_reach_register_shifts_each_timeout_and_keeps_the_reason() -> None:
    reach = Reach([15_000, 0])
    assert reach.read(0, 0) == (0, "None")
    for k in range(8):
        reach.accept(0, 15_000 * (100 + k))
    assert reach.read(0, 15_000 * 107) == (0b01111111, "None")
    assert reach.read(0, 15_000 * 108) == (0b11111111, "None")
    reach.reject(0, 15_000 * 108, Reason.DATA_ID)
    reach.accept(0, 15_000 * 110)
    assert reach.read(0, 15_000 * 111) == (0b11111001, "DataId")
    assert reach.read(0, 15_000 * 116) == (0b00100000, "DataId")
    assert reach.read(0, 15_000 * 117) == (0b01000000, "None")
    assert reach.read(0, 15_000 * 1000) == (0, "None")
    reach.accept(0, 15_000 * 1000)
    reach.reset()
    assert reach.read(0, 15_000 * 1001) == (0, "None")


def means(frames: list[Frame]) -> list[float]:
    """MuAvailable of every axle, over the last two seconds."""
    core = Core(lone_config())
    reports = [core.reports for f in frames if core.feed(f)][-100:]
    assert all(r.validity == "Valid" for slot in reports for r in slot)
    return [sum(r[axle].mu_available_pct or 0.0 for r in reports) / len(reports) for axle in range(4)]


@pytest.mark.parametrize(("fixed_us", "random_us"), [(2500, 1000), (2500, 2500), (4900, 300)])
def test_estimate_does_not_depend_on_bus_delays(log_of: LogOf, fixed_us: int, random_us: int) -> None:
    """Frames late by a fixed and a random time, many ticks with two and many with none: the estimate is the same."""
    punctual = [f for f, _ in read_log(log_of(PLAYED + FOUR_AXLES), Damage())]
    rng = random.Random(4)
    late: list[Frame] = []
    newest: dict[int, int] = {}  # frames of one id keep their order
    for f in punctual:
        stamp = f.stamp_us + fixed_us + min(int(abs(rng.gauss(0, random_us))), 9000)
        newest[f.can_id] = stamp = max(stamp, newest.get(f.can_id, 0) + 1)
        late.append(replace(f, stamp_us=stamp))
    late.sort(key=lambda f: f.stamp_us)
    ticks = Counter((f.can_id, f.stamp_us // 5000) for f in late if f.can_id in MEASUREMENTS)
    assert sum(n > 1 for n in ticks.values()) > 100
    assert means(late) == pytest.approx(means(punctual), abs=0.25)
