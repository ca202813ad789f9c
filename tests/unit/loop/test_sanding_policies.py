"""Sanders on the loop's bus: commands and their silence, policies one by one, and a controller's stop."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from sim_ecu.bench import Bench, scenario
from sim_ecu.cli.control import SANDING
from sim_ecu.loop.control.adhesion_consumer import Facts, UsableAdhesion, usable_receiver
from sim_ecu.loop.control.sanding_policies import (
    HOLD_S,
    MIN_SPEED_M_S,
    POLICIES,
    SEEN_S,
    AtPlace,
    AtSlide,
    BelowSpeed,
    Policy,
    SandControl,
    SandCycle,
    WhenLow,
    make_sanding,
)
from sim_ecu.loop.control.slip_controller import make_controller
from sim_ecu.loop.drive_scenario import Sanders
from sim_ecu.loop.lockstep import Lockstep
from sim_ecu.loop.rig import LOOP, Rig
from sim_ecu.loop.rig_messages import rig_message
from sim_ecu.physics.sanding import AHEAD_M, Sander
from sim_ecu.play.encoder import Channel
from tests.support.daemon_frames import GOOD, DaemonFrames
from wrcd.config.config import load_packaged
from wrcd.errors import InputError

SANDED = scenario(
    rail="F", demand=-0.4, speed_m_s=20.0, duration_s=5.0, axles=[1, 2, 3, 4], sanders={"axles": [1, 3]}
)  # fmt: skip
FACTS = Facts.of(SANDED)
PER_STEP_KG = 2.0 / 60.0 * 0.005


def commanded(rig: Rig, axle: int, kg_min: float, seconds: float, every_ms: int = 50) -> np.ndarray:
    """Sand by step and axle while one sander's command is sent."""
    channel = Channel(rig_message(f"Sand_A{axle}"))
    out = []
    for _ in range(round(seconds / 0.005)):
        if every_ms and rig.time_us % (1000 * every_ms) == 0:
            f = channel.encode(rig.time_us, {"Rate": kg_min})
            rig.hear(f.can_id, f.data, rig.time_us)
        out.append(rig.step().sand_kg)
    return np.array(out)


def test_command_in_frames_lays_sand_at_its_axle_after_the_delay() -> None:
    sand = commanded(Rig(SANDED, [LOOP]), 3, 1.0, 1.0)
    assert not sand[:100].any()
    assert sand[100:, 2] == pytest.approx(np.full(100, PER_STEP_KG / 2))
    assert not sand[:, [0, 1, 3]].any()


def test_silent_command_is_no_sand_past_its_time_out() -> None:
    rig = Rig(SANDED, [LOOP])
    commanded(rig, 1, 2.0, 1.0)
    sand = commanded(rig, 1, 2.0, 1.5, every_ms=0)[:, 0]
    last_us = 950_000 + 150_000  # the last frame and its time-out
    assert np.flatnonzero(sand)[-1] * 5000 == pytest.approx(last_us + 500_000 - 1_000_000, abs=10_000)


def test_damaged_command_and_one_for_an_axle_without_a_sander_lay_none() -> None:
    rig = Rig(SANDED, [LOOP])
    good = Channel(rig_message("Sand_A1")).encode(50_000, {"Rate": 2.0})
    rig.hear(good.can_id, bytes([good.data[0] ^ 1, *good.data[1:]]), 0)
    assert not commanded(rig, 2, 2.0, 1.0).any()


def test_direct_command_holds_stands_before_frames_and_ends_with_the_stock() -> None:
    few = replace(SANDED, sanders=Sanders((1, 3), Sander(delay_s=0.1, stock_kg=0.01)))
    bench = Bench(few)
    bench.sand(1, 2.0)
    bench.run(1.0)
    sand = bench.column("sand_kg")
    assert sand[20:70, 0] == pytest.approx(np.full(50, PER_STEP_KG))
    assert sand[:, 0].sum() == pytest.approx(0.01)
    assert not sand[100:].any()
    assert not sand[:, 1:].any()


@pytest.mark.parametrize(("axle", "kg_min"), [(2, 1.0), (9, 1.0), (1, -1.0), (1, np.nan)])
def test_sand_from_where_there_is_no_sander_or_of_no_amount_is_a_mistake(axle: int, kg_min: float) -> None:
    with pytest.raises(InputError):
        Bench(SANDED).sand(axle, kg_min)
    with pytest.raises(InputError, match="axle 1 has no sander"):
        Bench(replace(SANDED, sanders=None)).sand(1, 1.0)


# --- policies


class Driven:
    """A policy, cycle by cycle of a train at a steady speed. Says which sanders lay sand."""

    def __init__(self, policy: Policy, speed: float = 20.0, needed: float = 0.09) -> None:
        self._policy, self.speed, self.needed = policy, speed, needed
        self.now_us, self.position_m = 0, 0.0
        self.rates: tuple[float, ...] = ()

    def go(self, seconds: float, sliding: Sequence[int] = (), low: Sequence[int] = (), mu: float = 0.05) -> list[bool]:
        """Run for so long; sliding and low are places of axles. Returns what the last cycle gives."""
        for _ in range(round(seconds / 0.01)):
            self.now_us += 10_000
            self.position_m += 0.01 * self.speed
            adhesion = tuple(UsableAdhesion(mu if k in low else 0.3, 0.02, False) for k in range(4))
            self.rates = self._policy.step(
                SandCycle(
                    self.now_us, self.speed, self.position_m, self.needed, tuple(k in sliding for k in range(4)),
                    adhesion,
                )
            )  # fmt: skip
        return [rate > 0.0 for rate in self.rates]


def test_at_slide_sands_with_all_while_any_slides_and_holds() -> None:
    train = Driven(AtSlide(FACTS))
    assert train.go(1.0, low=[0, 1, 2, 3]) == [False, False]
    assert train.go(0.01, sliding=[3]) == [True, True]
    assert train.rates == (2.0, 2.0)
    assert train.go(HOLD_S - 0.02) == [True, True]
    assert train.go(0.04) == [False, False]


def test_rate_at_low_speed_keeps_to_the_published_density() -> None:
    train = Driven(AtSlide(FACTS), speed=2.0)
    train.go(0.01, sliding=[0])
    assert train.rates == pytest.approx((0.9, 0.9))  # 7.5 g/m
    train.speed = 0.0
    assert train.go(0.01, sliding=[0]) == [False, False]


def test_below_speed_sands_at_a_slide_and_never_below_its_bound() -> None:
    train = Driven(BelowSpeed(FACTS), speed=MIN_SPEED_M_S + 0.1)
    assert train.go(0.1, sliding=[0]) == [True, True]
    train.speed = MIN_SPEED_M_S - 0.1
    assert train.go(0.1, sliding=[0]) == [False, False]


def test_when_low_sands_before_a_slide_where_the_upper_end_is_below_what_the_brake_needs() -> None:
    train = Driven(WhenLow(FACTS))
    assert train.go(1.0, low=[2], mu=0.075) == [False, False]  # up to 0.095
    assert train.go(0.01, low=[2], mu=0.065) == [True, True]
    assert Driven(WhenLow(FACTS)).go(0.01, sliding=[1]) == [True, True]
    assert Driven(WhenLow(FACTS), needed=0.0).go(1.0, low=[0, 1, 2, 3]) == [False, False]


def test_at_place_sands_behind_the_leading_axle_where_that_has_been_low() -> None:
    train = Driven(AtPlace(FACTS))
    train.go(1.0)
    begins = train.position_m - SEEN_S * train.speed  # of what is known to be low
    assert train.go(0.5, low=[0]) == [False, True]  # 10 m: the third axle's sand falls there already
    ends = train.position_m
    state = [(train.position_m, train.go(0.01)) for _ in range(300)]
    assert not any(on[0] for _, on in state)
    falls = [at + train.speed * (0.01 + 0.5) - 19.0 + AHEAD_M for at, on in state if on[1]]
    assert max(falls) == pytest.approx(ends, abs=1.5)
    assert begins < min(falls)


def test_at_place_begins_so_early_that_its_sand_falls_on_the_first_low_place() -> None:
    train = Driven(AtPlace(FACTS), speed=10.0)
    train.go(1.0)
    low_m = train.position_m
    train.go(0.1, sliding=[0])
    while not train.go(0.01)[1]:
        assert train.position_m < 100.0
    assert train.position_m - 19.0 + AHEAD_M + 0.5 * 10.0 == pytest.approx(low_m - SEEN_S * 10.0, abs=1.1)


def test_at_place_takes_no_spin_for_a_low_place() -> None:
    assert Driven(AtPlace(FACTS), needed=0.0).go(2.0, sliding=[0]) == [False, False]


def test_policies_of_the_command_are_those_that_there_are() -> None:
    assert tuple(POLICIES) == SANDING


# --- the controller


@pytest.mark.parametrize("name", POLICIES)
def test_policy_without_sanders_or_its_daemon_is_a_mistake(name: str) -> None:
    with pytest.raises(InputError, match="the train has no sanders"):
        make_sanding(name, Facts.of(replace(SANDED, sanders=None)))
    if POLICIES[name].needs_adhesion:
        with pytest.raises(InputError, match="there is none"):
            make_sanding(name, FACTS)
        make_sanding(name, FACTS, load_packaged(4))


def test_controller_sends_sand_every_50_ms_and_nothing_before_the_driver() -> None:
    controller = make_controller("thresholds", FACTS, sanding=make_sanding("at-slide", FACTS))
    ids = {rig_message(f"Sand_A{n}").frame_id: n for n in (1, 3)}
    assert controller.tick(50_000) == []
    sent: list[tuple[int, int]] = []
    run = Lockstep(SANDED, controller, None, lambda at, i, _: sent.append((at, ids[i])) if i in ids else None)
    for _ in range(200):
        run.step()
    assert sent == [(at, n) for at in range(50_000, 1_000_001, 50_000) for n in (1, 3)]


class Keeps(AtSlide):
    """A policy that keeps what it was given."""

    def __init__(self, facts: Facts) -> None:
        super().__init__(facts)
        self.seen: list[SandCycle] = []

    def wanted(self, seen: SandCycle) -> Sequence[bool]:
        self.seen.append(seen)
        return super().wanted(seen)


@pytest.mark.parametrize("share", [-0.4, 0.4])
def test_policy_is_given_position_need_and_usable_adhesion(share: float) -> None:
    config = load_packaged(4)
    said = DaemonFrames(config)
    train = scenario(rail="B", demand=share, speed_m_s=20.0, duration_s=3.0, axles=[1, 2, 3, 4], sanders={"axles": [1]})
    facts = Facts.of(train)
    keeps = Keeps(facts)
    sanding = SandControl(facts, keeps, {1: usable_receiver(config, config.axles[0])})
    controller = make_controller("thresholds", facts, sanding=sanding)
    for step in Lockstep(train, controller, None):
        if step.due_us % 20_000 == 0:
            f = said.adhesion(step.due_us, GOOD)
            controller.hear(f.can_id, f.data, step.due_us)
    last = keeps.seen[-1]
    assert last.position_m == pytest.approx(step.distance_m, abs=1.0)
    assert last.speed_m_s == pytest.approx(step.speed_m_s, abs=0.3)
    assert last.needed == pytest.approx(max(-step.mu_used.mean(), 0.0), rel=0.03)
    assert last.adhesion[0] is not None
    assert last.adhesion[1:] == (None, None, None)


def test_stop_with_sand_at_slides_is_much_shorter_than_without() -> None:
    stop = replace(SANDED, stop_m_s=15.0)
    ways, sand = [], []
    for sanding in (None, make_sanding("at-slide", FACTS)):
        steps = list(Lockstep(replace(stop, train=replace(stop.train, duration_s=40.0)),
                              make_controller("thresholds", FACTS, sanding=sanding), None))  # fmt: skip
        ways.append(steps[-1].distance_m)
        sand.append(sum(float(s.sand_kg.sum()) for s in steps))
    assert ways[1] < 0.6 * ways[0]
    assert sand[0] == 0.0 < sand[1]
