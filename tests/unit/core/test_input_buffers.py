"""Measurements that come early or late for their tick, and the register of what was reached."""

import math
import random
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from tests.support.can_ids import LAT_ACCEL, YAW_RATE
from tests.support.lone_wheelset import PLAYED, lone_config
from tests.support.scenarios import FOUR_AXLES, LogOf
from tests.support.stages import NEVER, OwnInputs
from wrcd.bus.frame import Frame
from wrcd.bus.reasons import Reason
from wrcd.core.core import Core
from wrcd.core.counts import REASONS
from wrcd.core.tables import BRAKE, DIRECTION, LAT, LOAD, QUANTITIES, RADIUS, SPEED, TORQUE, YAW
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

MEASUREMENTS = {*YAW_RATE.values(), *LAT_ACCEL.values()}


def played(*ticks: list[int], patience: int = 100) -> list[int | None]:
    """What each tick uses, of measurements named by their stamps."""
    a = OwnInputs((YAW, 0), patience=patience)
    out: list[int | None] = []
    for tick in ticks:
        for stamp in tick:
            a.accept(0, stamp / 10, stamp)
        (value, _), (there, _) = a.close(0)
        used_us = int(a.state["used_us"][0])
        out.append(used_us if there else None)
        assert value == (used_us / 10 if there else 0.0)
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
    a, used = OwnInputs((YAW, 0)), []
    for stamps in ([1, 2], [3], [4], []):
        for stamp in stamps:
            assert a.accept(0, math.nan if stamp == 2 else stamp / 10, stamp) == (stamp == 2)
        (value, _), (there, _) = a.close(0)
        used.append((value, there, a.state["used_us"][0]))
    assert used == [(0.1, True, 1), (0.0, False, 1), (0.3, True, 3), (0.4, True, 4)]


def test_reset_drops_waiting_measurements() -> None:
    a = OwnInputs(*((channel, axle) for channel in (YAW, LAT) for axle in range(3)))
    a.accept(5, 5.0, 7)
    a.accept(5, 6.0, 8)
    assert a.close(0) == ([0.0] * 5 + [5.0], [False] * 5 + [True])
    a.reset()
    assert a.close(0) == ([0.0] * 6, [False] * 6)
    assert a.state["used_us"].tolist() == [NEVER] * 6


def test_reach_register_shifts_each_timeout_and_keeps_the_reason() -> None:
    a = OwnInputs((TORQUE, 0), (TORQUE, 1))
    a.of["timeout_us"] = [15_000, 0]

    def read(at: int) -> tuple[int, str]:
        return a.reached(TORQUE, 0, at)

    assert read(0) == (0, "None")
    for k in range(8):
        a.accept(0, 1.0, 15_000 * (100 + k))
    assert read(15_000 * 107) == (0b01111111, "None")
    assert read(15_000 * 108) == (0b11111111, "None")
    a.reject(0, 15_000 * 108, Reason.DATA_ID)
    a.accept(0, 1.0, 15_000 * 110)
    assert read(15_000 * 111) == (0b11111001, "DataId")
    assert read(15_000 * 116) == (0b00100000, "DataId")
    assert read(15_000 * 117) == (0b01000000, "None")
    assert read(15_000 * 1000) == (0, "None")
    a.accept(0, 1.0, 15_000 * 1000)
    a.reset()
    assert read(15_000 * 1001) == (0, "None")
    assert a.reached(TORQUE, 1, 15_000) == (0, "None")


def test_reach_register_that_is_read_after_a_while_is_that_of_one_read_always() -> None:
    for passed, register in ((1, 1), (2, 2), (8, 128), (9, 0), (100, 0)):
        a = OwnInputs((TORQUE, 0))
        a.of["timeout_us"] = 10
        a.accept(0, 1.0, 0)
        assert a.reached(TORQUE, 0, 10 * passed) == (register, "None")
        assert a.reached(TORQUE, 0, 10 * passed + 10) == (2 * register % 256, "None")


@pytest.mark.parametrize("begin", [-1000, -104, -3, 100])
def test_reach_register_is_the_same_before_1970(begin: int) -> None:
    """Time-outs are numbered from 1970 on, below zero before."""
    a = OwnInputs((TORQUE, 0))
    a.of["timeout_us"] = 15_000
    read = []
    for k in range(20):
        if k not in (5, 6, 11):
            a.accept(0, 1.0, 15_000 * (begin + k) + 700)
        read.append(a.reached(TORQUE, 0, 15_000 * (begin + k + 1))[0])
    assert read[7] == 0b11111001
    assert read == [
        sum(1 << k - j for j in range(max(0, k - 7), k + 1) if j not in (5, 6, 11)) for k in range(20)
    ]  # fmt: skip


def test_reach_of_a_sum_is_that_of_the_part_that_is_reached_least() -> None:
    """And of equal ones that which says why."""
    a = OwnInputs((TORQUE, 0), (TORQUE, 0), (TORQUE, 0))
    a.of["timeout_us"], a.of["next"] = 10, [-1, 0, 1]
    assert a.reached(LOAD, 0, 100) == (0, "None")
    for at in range(0, 80, 10):
        for part in range(3):
            a.accept(part, 1.0, at)
    assert a.reached(TORQUE, 0, 80) == (0b11111111, "None")
    a.reject(1, 75, Reason.CRC)
    assert a.reached(TORQUE, 0, 80) == (0b11111111, "Crc")
    a.reject(0, 75, Reason.COUNTER)
    assert a.reached(TORQUE, 0, 80) == (0b11111111, "Crc")  # the first of them
    for part in (0, 2):
        a.accept(part, 1.0, 80)
    assert a.reached(TORQUE, 0, 90) == (0b11111110, "Crc")
    for part in (1, 2):
        a.accept(part, 1.0, 90)
    a.accept(2, 1.0, 100)
    assert a.reached(TORQUE, 0, 110) == (0b11111010, "Crc")
    a.accept(1, 1.0, 110)
    assert a.reached(TORQUE, 0, 120) == (0b11111000, "Counter")


@pytest.mark.parametrize("axle", [0, 1])
@pytest.mark.parametrize("quantity", range(len(QUANTITIES)))
def test_input_is_stale_past_its_timeout_and_unknown_past_its_silence(quantity: int, axle: int) -> None:
    """MuUsed has no value without torque, load or radius."""
    a = OwnInputs((quantity, axle), (TORQUE, 1 - axle))
    a.of["timeout_us"], a.of["silent_us"] = [20, 500], [100, 1000]
    a.accept(0, 1.0, 0)
    a.accept(1, 1.0, 0)
    axles = a.train.state["axle"]
    for end_us, is_stale, is_silent in ((20, 0, 0), (21, 1, 0), (100, 1, 0), (101, 1, 1), (120, 0, 0)):
        if end_us == 120:
            a.accept(0, 1.0, 101)
        a.close(end_us)
        assert (axles["stale"][axle], axles["stale"][1 - axle]) == (is_stale << quantity, 0)
        unknown = bool(is_silent) and quantity in (TORQUE, BRAKE, LOAD, RADIUS)
        assert (np.isnan(axles["torque_ratio"]) == [unknown and k == axle for k in range(2)]).all()


def test_speed_below_zero_turns_the_train_beyond_half_a_metre_per_second() -> None:
    a = OwnInputs((LAT, 0), (SPEED, 0))
    a.settings["speed_tells_direction"] = 1
    turned = []
    for speed in (0.4, -0.4, -0.5, -0.51, -0.4, 0.5, 0.51, -0.5):
        a.accept(0, 1.0, 0)
        a.accept(1, speed, 0)
        turned.append(a.close(0)[0][LAT] < 0)
    assert turned == [False, False, False, True, True, True, False, False]


def test_direction_of_an_axle_turns_its_acceleration() -> None:
    a = OwnInputs((LAT, 0), (LAT, 1), (DIRECTION, 0), (DIRECTION, 1))
    for ways in ((1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0), (1.0, 1.0)):
        for number, value in enumerate((0.5, 0.25, *ways)):
            a.accept(number, value, 0)
        assert a.close(0)[0][2:] == [0.5 * ways[0], 0.25 * ways[1]]


def test_refusals_are_counted_anew_after_a_good_frame_and_a_step_of_time() -> None:
    a, told = OwnInputs((YAW, 0)), []
    for then in (lambda: a.accept(0, 1.0, 7), a.reset, list):
        for reason in (Reason.CRC, Reason.COUNTER, Reason.CRC):
            a.reject(0, 9, reason)
        told.append((a.state["refusals"][0], a.state["refused"][0].sum(), a.state["order"][0][:2].tolist()))
        then()
    assert told == 3 * [(2, 3, [REASONS.index(Reason.CRC), REASONS.index(Reason.COUNTER)])]


@pytest.mark.parametrize("channel", [YAW, LAT])
def test_measurement_at_an_end_of_its_range_is_clipped_and_unchanged_after_four_repeats(channel: int) -> None:
    a = OwnInputs((channel, 0))
    a.of["first_end"], a.of["last_end"] = -5.0, 5.0
    assert [a.accept(0, value, 0) for value in (-5.0, -4.99, 4.99, 5.0)] == [True, False, False, True]
    a.settings["start"][SPEED] = 1.0
    assert [(a.plausible(0, 5.0, 0), a.unchanged(0, 1)) for _ in range(5)] == [*4 * [(None, False)], (None, True)]


@pytest.mark.parametrize("second", [TORQUE, BRAKE])
def test_torques_against_each_other_by_more_than_a_fiftieth_contradict_each_other(second: int) -> None:
    """The larger side counts then, else their sum. Parts of one torque, and the brake's beside it."""
    a = OwnInputs((second, 0), (TORQUE, 0))
    a.of["next"] = [-1, 0 if second == TORQUE else -1]
    a.settings["load_N"], a.settings["radius_m"], a.settings["torque_sign_counts"] = 100.0, 0.5, 1
    for less, used in ((1.0, 4.0), (1.05, 5.0)):  # of 2 N r_0
        for torques in ((-less, 5.0), (less, -5.0), (5.0, -less), (-5.0, less)):
            for number, torque in enumerate(torques):
                a.accept(number, torque, 0)
            a.close(0)
            assert a.train.state["axle"]["torque_ratio"].tolist() == [used]


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
