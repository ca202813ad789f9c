"""Drivers who stop at a mark: when they begin to brake, what they go by, and how it ends."""

from pathlib import Path
from typing import Any

import pytest

from sim_ecu import bench
from sim_ecu.bench import Bench, InputError
from sim_ecu.cli import driver as cli_driver
from sim_ecu.loop.control.adhesion_consumer import Facts
from sim_ecu.loop.control.braking_rate import RATES, needed_m_s2
from sim_ecu.loop.driver import LEVER_US, POLICIES, REACTION_S, Advised, BrakeTesting, MarkDriver, Rule, make_driver
from sim_ecu.loop.driver_on_bus import DriverOnBus, LeverOnBus
from sim_ecu.loop.rig_messages import rig_message
from sim_ecu.play.encoder import Channel, Sent, databases
from tests.support.advice import advice_frame
from wrcd.config.config import load_packaged

FULL, SPEED, MARK_M = 1.2, 16.0, 600.0
NEAR_M = 2.0


def coast(driver: MarkDriver, until_m: float = MARK_M, frames: dict[int, Sent] | None = None) -> float:
    """Let a train come at SPEED; what is heard at which time. Returns where a decision was taken."""
    now_us = 0
    while (at := SPEED * now_us * 1e-6) < until_m:
        if frames and (f := frames.get(now_us)) is not None:
            driver.hear(f.can_id, f.data, now_us)
        driver.demand(now_us, at, SPEED, MARK_M)
        if driver.begun_us is not None or driver.tested_us is not None:
            return at
        now_us += LEVER_US
    raise AssertionError("nothing was decided")


@pytest.mark.parametrize("rate", [0.9, 0.35])
def test_brake_is_decided_on_where_the_mark_needs_the_rate(rate: float) -> None:
    driver = MarkDriver(Rule(rate), FULL)
    at = coast(driver)
    assert needed_m_s2(SPEED, MARK_M - at - REACTION_S * SPEED) == pytest.approx(rate, rel=0.02)
    assert driver.rate_m_s2 == rate


def test_nothing_is_demanded_without_a_mark_and_before_the_reaction() -> None:
    driver = MarkDriver(Rule(0.9), FULL)
    assert driver.demand(0, 0.0, SPEED, None) == 0.0
    coast(driver)
    assert driver.begun_us is not None
    assert driver.demand(driver.begun_us + LEVER_US, MARK_M - 150.0, SPEED, MARK_M) == 0.0
    after_us = driver.begun_us + round(1e6 * REACTION_S)
    assert driver.demand(after_us, MARK_M - 150.0, SPEED, MARK_M) == pytest.approx(-(SPEED**2) / 300.0 / FULL)
    assert driver.demand(after_us, MARK_M - 50.0, SPEED, MARK_M) == -1.0, "more than full service there is not"
    assert driver.demand(after_us, MARK_M + 1.0, 5.0, MARK_M) == -1.0, "it is past the mark"


def heard(low: float, middle: float, validity: str = "Valid", until_s: float = 60.0) -> dict[int, Sent]:
    """An advice every 200 ms."""
    return {us: advice_frame(us, low, middle, validity) for us in range(200_000, round(1e6 * until_s), 200_000)}


def advised(tests: bool = True) -> MarkDriver:
    return MarkDriver(Advised(load_packaged(2, advice=True), tests=tests), FULL)


@pytest.mark.parametrize(
    ("low", "planned"), [(0.6, 0.85 * 0.6), (0.1, RATES.least), (5.0, RATES.dry)], ids=["advised", "least", "dry"]
)
def test_advised_rate_is_kept_within_its_limits(low: float, planned: float) -> None:
    driver = advised(tests=False)
    at = coast(driver, frames=heard(min(low, 2.5), min(low, 2.5)))
    assert driver.rate_m_s2 == pytest.approx(planned, abs=0.01)
    assert needed_m_s2(SPEED, MARK_M - at - REACTION_S * SPEED) == pytest.approx(planned, rel=0.03)


@pytest.mark.parametrize("frames", [{}, heard(2.0, 2.2, "Degraded"), heard(2.0, 2.2, "NotAvailable")])
def test_without_valid_advice_the_cautious_rate_is_planned_with(frames: dict[int, Sent]) -> None:
    driver = advised()
    coast(driver, frames=frames)
    assert driver.rate_m_s2 == RATES.cautious
    assert driver.tested_us is None, "a test without a daemon finds nothing"


def test_valid_advice_holds_for_two_seconds_of_silence() -> None:
    driver = advised()
    until_s = 22.0  # the cautious rate would begin after some 14 s
    at = coast(driver, frames=heard(2.0, 2.2, until_s=until_s))
    assert at == pytest.approx(SPEED * (until_s - 0.2 + RATES.holds_s), abs=SPEED * 0.2)
    assert driver.rate_m_s2 == RATES.cautious


def test_frame_with_a_wrong_crc_is_no_advice() -> None:
    driver = advised()
    broken = {us: Sent(us, f.can_id, bytes([f.data[0] ^ 1]) + f.data[1:]) for us, f in heard(2.0, 2.2).items()}
    coast(driver, frames=broken)
    assert driver.rate_m_s2 == RATES.cautious


def test_coasting_advice_that_is_not_enough_is_tested_first() -> None:
    driver = advised()
    at = coast(driver, frames=heard(0.5, 1.5))
    assert driver.tested_us is not None
    assert driver.begun_us is None
    now_us, v = driver.tested_us, SPEED
    shares = []
    while now_us < driver.tested_us + round(1e6 * (REACTION_S + RATES.test_s)) - LEVER_US:
        now_us += LEVER_US
        at += v * LEVER_US * 1e-6
        shares.append(driver.demand(now_us, at, v, MARK_M))
    assert set(shares) == {0.0, -RATES.tests / FULL}
    f = advice_frame(now_us // 200_000 * 200_000, 1.5, 1.6, "Valid")
    driver.hear(f.can_id, f.data, now_us)
    assert driver.demand(now_us + LEVER_US, at, v, MARK_M) == 0.0, "the rail bears the dry rate: it coasts on"
    assert driver.begun_us is None
    # the coasting advice is as vague as before; what the test has found holds
    assert driver.rule.rate_m_s2(now_us + LEVER_US, at) == RATES.dry
    f = advice_frame((now_us // 200_000 + 1) * 200_000, 0.3, 0.6, "Valid")
    driver.hear(f.can_id, f.data, now_us + 200_000)
    assert driver.rule.rate_m_s2(now_us + 200_000, at) == pytest.approx(0.85 * 0.3, abs=0.01), "another rail"


@pytest.mark.parametrize(("slip", "planned"), [(0.0, RATES.dry), (2.0, RATES.cautious)])
def test_a_driver_without_wrcd_sees_whether_a_wheel_slides(slip: float, planned: float) -> None:
    driver = MarkDriver(BrakeTesting((1,)), FULL)
    at = coast(driver)
    assert driver.tested_us is not None
    wheel = Channel(rig_message("WheelSpeed_A1"))
    now_us = driver.tested_us
    for _ in range(round((REACTION_S + RATES.test_s) * 1e6) // LEVER_US):
        now_us += LEVER_US
        f = wheel.encode(now_us, {"WheelSpeed": SPEED - slip})
        driver.hear(f.can_id, f.data, now_us)
        driver.demand(now_us, at, SPEED, MARK_M)
    assert driver.rule.rate_m_s2(now_us, at) == planned


def test_lever_on_the_bus_is_passed_on_and_its_silence_brakes() -> None:
    rig_end, lever = LeverOnBus(FULL), Channel(rig_message("DriverLever"))
    assert rig_end.demand(0, 0.0, SPEED, MARK_M) == 0.0
    f = lever.encode(300_000, {"Share": -0.5})
    rig_end.hear(f.can_id, f.data, 300_000)
    assert rig_end.demand(300_000, 0.0, SPEED, MARK_M) == -0.5
    assert rig_end.demand(500_000, 0.0, SPEED, MARK_M) == -0.5
    assert rig_end.demand(550_000, 0.0, SPEED, MARK_M) == -RATES.cautious / FULL


def share_of(lever: Sent) -> float:
    values: Any = rig_message("DriverLever").decode(lever.data)
    return float(values["Share"])


def test_driver_on_the_bus_moves_the_lever_by_position_and_speed() -> None:
    end = DriverOnBus(MarkDriver(Rule(0.9), FULL), FULL)
    train, speed = Channel(rig_message("TrainPosition")), Channel(databases()[0].get_message_by_name("VehicleSpeed"))
    assert end.tick(0) == []
    shares = []
    for now_us in range(LEVER_US, 4_000_000, 10_000):
        at = 400.0 + SPEED * now_us * 1e-6
        if now_us % LEVER_US == 0:
            f = train.encode(now_us, {"Position": at, "ToMark": MARK_M - at})
            end.hear(f.can_id, f.data, now_us)
        if now_us % 20_000 == 0:
            f = speed.encode(now_us, {"Speed": SPEED})
            end.hear(f.can_id, f.data, now_us)
        shares += [share_of(f) for f in end.tick(now_us)]
    assert shares[0] == 0.0
    assert shares[-1] < -0.7
    late = end.tick(5_000_000)
    assert share_of(late[0]) == pytest.approx(-RATES.cautious / FULL, abs=1e-3)
    assert end.look(5_000_000) == ["train silent: brakes with 0.35 m/s²"]


def test_who_listens_to_wrcd_stands_at_the_mark_in_lockstep() -> None:
    wet = bench.scenario("mark-wet", mark_m=400.0, speed_m_s=14.0)
    run = Bench(wet, daemon=True, controller="thresholds", driver="wrcd")
    run.run()
    assert abs(run.steps[-1].distance_m - 400.0) <= NEAR_M
    assert run.steps[-1].speed_m_s < 0.02


def test_commands_know_the_drivers_that_there_are() -> None:
    assert cli_driver.POLICIES == POLICIES


def test_driver_needs_a_mark_and_a_configuration_with_advice(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no mark_m"):
        Bench("emergency-wet", driver="dry")
    with pytest.raises(InputError, match="no driver 'wet'"):
        Bench("mark-wet", driver="wet")
    with pytest.raises(InputError, match=r"no \[advice\]"):
        make_driver("wrcd", Facts.of(Bench("mark-wet").scenario), load_packaged(2))
