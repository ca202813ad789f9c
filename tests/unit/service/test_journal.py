"""The daemon's log lines: one per thing that happens, and of each kind at most one a second."""

import re
from itertools import pairwise

import pytest

from tests.support.can_ids import ADHESION, ADHESION_A1, LAT_ACCEL_A1, WRCD_STATUS, YAW_RATE_A1
from tests.support.scripted_link import ScriptedLink
from tests.support.sensor_simulator import MS, SensorSimulator
from tests.support.snapshots import assert_kept
from wrcd.bus.reasons import Reason
from wrcd.bus.units import Quantity
from wrcd.config.config import load_config
from wrcd.core.counts import REASONS
from wrcd.core.vocabulary import FITS
from wrcd.service.journal import CounterLog


class Log:
    """A core, a link, and what is written about them."""

    def __init__(self) -> None:
        self.sim, self.link = SensorSimulator(load_config(None)), ScriptedLink()
        self.lines: list[str] = []
        self.watch = CounterLog(self.sim.core, self.link, self.lines.append)

    def look(self, ms: int = 0) -> list[str]:
        """What is written within so many milliseconds, looking every five."""
        self.lines.clear()
        for _ in range(max(1, ms // 5)):
            self.sim.t += 5 * MS
            self.watch.look(self.sim.t)
        return list(self.lines)

    def damage(self, can_id: int, n: int) -> None:
        for _ in range(n):
            for frame in self.sim.frames():
                if frame.can_id == can_id:
                    self.sim.core.feed(type(frame)(frame.stamp_us, can_id, bytes(len(frame.data))))


@pytest.fixture
def log() -> Log:
    return Log()


def test_undisturbed_core_logs_nothing(log: Log) -> None:
    log.sim.run(1500)
    log.look()
    log.sim.run(3000)
    assert log.look(5000) == []


def test_rejected_frames_are_logged_once_a_second(log: Log) -> None:
    log.look()
    log.damage(YAW_RATE_A1, 30)
    lines = [line for line in log.look(1000) if not line.startswith("axle ")]
    assert lines == ["rejected 30 frames in the last second: crc YawRate_A1 30"]
    assert log.look(3000) == []
    lines, begin = [], log.sim.t
    for _ in range(30):
        log.damage(LAT_ACCEL_A1, 10)
        lines += [line for line in log.look(100) if line.startswith("rejected ")]
    seconds = (log.sim.t - begin) * 1e-6
    assert seconds - 1 <= len(lines) <= seconds + 1


def test_flapping_validity_is_logged_at_most_once_a_second_per_cause_with_a_count(log: Log) -> None:
    """Five late frames in a row, three times a second."""
    sim = log.sim
    sim.run(1500)
    log.look()
    degraded: list[tuple[int, str]] = []
    begin_us = sim.t
    for _ in range(12):
        for ms, silent in ((25, {YAW_RATE_A1}), (300, set())):
            sim.silent = silent
            for _ in range(ms // 5):
                sim.run(5)
                log.lines.clear()
                log.watch.look(sim.t)
                degraded += [(sim.t, line) for line in log.lines if "InputStale" in line]
    assert len(degraded) == 4
    assert all(later - earlier >= 1_000_000 for (earlier, _), (later, _) in pairwise(degraded))
    assert sim.t - begin_us < 4_000_000
    line = "axle 1: Valid -> Degraded, InputStale: yaw rate YawRate_A1.YawRate 20.0 ms old, limit 15"
    assert re.sub(r"\d+\.\d", "20.0", degraded[0][1]) == line
    assert all("more in the last second" in text for _, text in degraded[1:])
    rest = log.look(3000)
    told = [
        int(n) for text in [t for _, t in degraded] + rest for n in re.findall(r"(\d+) more", text) if "Stale" in text
    ]
    assert 1 + sum(told) == 12


def test_last_change_of_a_flapping_axle_is_what_it_is_now(log: Log) -> None:
    """However the lines are spaced, the newest of an axle says its Validity."""
    sim = log.sim
    sim.run(1500)
    log.look()
    lines: list[str] = []
    for _ in range(3):
        sim.silent = {YAW_RATE_A1}
        sim.run(30)
        sim.silent = set()
        sim.run(40)
        log.lines.clear()
        log.watch.look(sim.t)
        lines += log.lines
    lines += log.look(2000)
    whole = [line for line in lines if "in the last second:" not in line]
    assert whole[-1].startswith("axle 1: Degraded -> Valid (")
    assert log.look(5000) == []


def test_flapping_link_is_logged_at_most_once_a_second_per_state(log: Log) -> None:
    assert log.look() == []
    log.link.health.state = "Down"
    assert log.look() == ["the CAN link is down: nothing comes, nothing goes"]
    log.link.health.state = "Up"
    assert log.look() == ["the CAN link is up"]
    lines = []
    for _ in range(100):
        log.link.health.state = "Down" if log.link.health.up else "Up"
        lines += log.look(50)
    assert 8 <= len(lines) <= 12
    assert log.look(2000)[-1:] in ([], ["the CAN link is up"])
    assert log.link.health.up


def test_design_of_another_bogie_is_said_once_and_once_that_it_is_not(log: Log) -> None:
    bogies = log.sim.core._train.state["bogie_state"]
    bogies["ratio"], bogies["weight"], bogies["bias_pp"], bogies["bias_sigma_pp"] = 250.0, 30.0, -1.5, 0.5

    def said(*words: str) -> list[str]:
        bogies["verdict"] = [FITS.index(word) for word in words]
        return [line for line in log.look(3000) if "design" in line]

    assert said("Unknown", "Like") == []
    assert said("Unsure", "Unsure") == []
    unlike = [
        f"axles {of}: the design is another bogie's (likelihood ratio 250 of 30 calm stretches): conicity x 1, primary "
        "yaw stiffness x 1, secondary yaw damping x 1; adhesion is about 1.5 points too low here"
        for of in ("1 and 2", "3 and 4")
    ]
    assert said("Unlike", "Unsure") == unlike[:1]
    bogies["ratio"] = 300.0
    assert said("Unlike", "Unsure") == []
    bogies["ratio"] = 250.0
    assert said("Unlike", "Unlike") == unlike[1:]
    assert said("Like", "Unlike") == ["axles 1 and 2: the design no longer seems another bogie's"]
    assert said("Unsure", "Unlike") == []


def test_slides_that_contradict_the_estimates_are_said_once_and_once_that_they_do_not(log: Log) -> None:
    train = log.sim.core.estimator._train

    def said(bias: float) -> list[str]:
        train["slides"][0], train["slides"][3] = 8.6, bias
        return [line for line in log.look(3000) if "slides" in line]

    assert said(0.0) == []
    low = "9 slides show that the estimates before them were 37 % too low: intervals are wider by that"
    assert said(-0.462) == [low]
    assert said(-0.5) == []
    assert said(0.0) == ["slides no longer show that estimates are too high or low"]
    assert said(0.2) == [low.replace("37 % too low", "22 % too high")]


def test_lines_of_counts_and_of_validity_are_those_of_the_snapshot(log: Log) -> None:
    """Each step and what is written of it: a count at most once a second, and nothing where nothing grew."""
    sim, health = log.sim, log.link.health
    told: list[str] = []

    def step(what: str, ms: int = 0) -> None:
        told.extend((f"- {what}", *log.look(ms)))

    sim.run(1500)
    step("a window")
    sim.yaw_status = 1
    sim.run(1500)
    step("the gyro says Degraded")
    sim.yaw_status = 0
    sim.run(2000)
    step("and is well")
    while sim.speed > 1.0:
        sim.speed -= 0.2
        sim.run(20)
    step("the train stops", 2000)
    for can_ids, what in (([ADHESION_A1] * 50, "of one id"), ([*ADHESION.values(), *[WRCD_STATUS] * 2], "of many")):
        for can_id in can_ids:
            health.foreign(can_id)
        step(f"somebody else's frames {what}")
        step("nothing", 3000)
    for drops, ms in ((5, 0), (6, 100), (9, 1000), (0, 2000), (1, 2000)):  # 0: set back at the end of the start
        health.drops = drops
        step(f"{drops} drops, {ms} ms", ms)
    health.state = "BusOff"
    step("bus-off", 3000)
    health.unsent = 500
    step("500 unsent", 3000)
    health.state, health.unsent = "Up", 503
    step("link up, 503 unsent", 3000)
    state = log.sim.core._train.state
    for n in range(8):
        state["message_state"]["refused"][n, REASONS.index(Reason.RANGE)] += 9 - n
    step("many reasons", 1000)
    of = [(s.source.quantity, s.source.axles) for s in log.sim.core.mapped.signals]
    lateral_1, yaw_2 = of.index((Quantity.LAT_ACCEL, (0,))), of.index((Quantity.YAW_RATE, (1,)))
    state["input_state"]["clipped"][[lateral_1, yaw_2]] += (12, 3)
    step("clipped samples of two axles", 1000)
    state["input_state"]["clipped"][yaw_2] += 1
    step("of one", 1000)
    step("nothing", 1000)
    sim.t -= 3_600_000 * MS
    health.unsent += 1
    step("an hour back, and one unsent")
    assert_kept("journal", "steps", told)
