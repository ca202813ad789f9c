"""The train's advice: a deceleration from its axles' estimates, on the cautious side, and only while they are Valid."""

import json
import math
from dataclasses import fields
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from wrcd.bus.dbc import find_message
from wrcd.bus.frame import Frame
from wrcd.bus.signals import Output
from wrcd.config.config import load_packaged
from wrcd.core.advice import NO_ADVICE, Advice, Adviser, category
from wrcd.core.ahead import RailAhead
from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import AdviceConfig
from wrcd.core.core import Core
from wrcd.core.messages import Report
from wrcd.core.vocabulary import CATEGORY_LIMITS
from wrcd.estimator.records import Estimate
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log
from wrcd.recorder.state import StateMismatch, capture, encode, restore
from wrcd.resources import LONE

LOG = Path(__file__).parents[2] / "golden" / "leaf-film.log"
ADVISING = load_packaged(1, design=LONE, advice=True)
LIMITS = tuple(limit for _, limit in CATEGORY_LIMITS)
SLOT_S, G = 0.2, 9.80665
AXLES = 4
MEAN_BELOW_PCT = 9.0  # of three such decelerations the mean is a rounding below


def adviser() -> Adviser:
    return Adviser(AXLES, AdviceConfig(Output("AdhesionAdvice", round(1e6 * SLOT_S), None), LIMITS))


class Train:
    """Four Valid axles at 20 m/s on a rail of 20 %, known to 2 percentage points. They coast: 2 % are in use."""

    def __init__(self) -> None:
        self.adviser, self.now_us = adviser(), 1_790_000_000_000_000
        self.speed_m_s, self.below_min_speed = 20.0, False
        self.mu, self.half_width = np.full(AXLES, 20.0), np.full(AXLES, 2.0)
        self.used, self.contact = 2.0, "Adhering"
        self.validity = [Validity.VALID] * AXLES
        self.ahead: list[RailAhead] | None = None
        self.told = NO_ADVICE

    def run(self, seconds: float) -> Advice:
        for _ in range(round(seconds / SLOT_S)):
            self.now_us += round(1e6 * SLOT_S)
            reports = [
                Report(v, mu, min(self.used, mu), 5, "Wet", self.contact, "Within2pp", Cause.NONE)
                for v, mu in zip(self.validity, self.mu.tolist(), strict=True)
            ]
            values: dict[str, Any] = {f.name: np.zeros(AXLES) for f in fields(Estimate)}
            values |= {"mu_available_pct": self.mu, "half_width_pp": self.half_width}
            self.told = self.adviser.update(
                self.now_us, self.speed_m_s, self.below_min_speed, reports, Estimate(**values), self.ahead
            )
        return self.told


@pytest.fixture
def train() -> Train:
    t = Train()
    t.run(6.0)
    return t


def of(told: Advice) -> tuple[float, float]:
    """Deceleration and lower end, in percent of g."""
    assert told.deceleration_m_s2 is not None
    assert told.low_m_s2 is not None
    return 100 * told.deceleration_m_s2 / G, 100 * told.low_m_s2 / G


def test_even_rail_gives_its_adhesion_times_g(train: Train) -> None:
    assert train.told.validity == "Valid"
    assert of(train.told) == pytest.approx((20.0, 18.0))
    assert train.told.distance_m == pytest.approx(40.0)  # two seconds
    assert (train.told.category, train.told.age_ms, train.told.ahead) == ("Dry", 0.0, "None")


def test_deceleration_is_the_axles_mean_and_its_lower_end_their_least(train: Train) -> None:
    train.mu = np.array([10.0, 20.0, 20.0, 30.0])
    train.half_width = np.array([1.0, 2.0, 15.0, 1.0])
    assert of(train.run(2.0)) == pytest.approx((20.0, 5.0))
    train.half_width[2] = 2.0
    assert of(train.run(2.0)) == pytest.approx((20.0, 9.0))


@pytest.mark.parametrize(("half_width", "used", "contact", "low"), [
    (math.nan, 2.0, "Adhering", 2.0),  # without an interval: what is in use
    (15.0, 2.0, "Adhering", 5.0),
    (15.0, 16.0, "Adhering", 16.0),  # what is in use is there
    (15.0, 16.0, "Saturated", 5.0),  # but not while the wheel slides
    (25.0, 16.0, "Saturated", 0.0),
    (15.0, 25.0, "Adhering", 20.0),
])  # fmt: skip
def test_lower_end_is_at_least_what_is_in_use(
    train: Train, half_width: float, used: float, contact: str, low: float
) -> None:
    train.half_width[:], train.used, train.contact = half_width, used, contact
    assert of(train.run(2.0)) == pytest.approx((20.0, low))


@pytest.mark.parametrize(("speed_m_s", "way_m", "slots"), [
    (20.0, 40.0, 6),  # 2 s are 11 slots
    (60.0, 96.0, 5),  # 100 m are 9
    (-5.0, 10.0, 6),  # backwards it is way, too
])  # fmt: skip
def test_coasting_train_follows_another_rail_by_half_of_what_it_keeps(
    train: Train, speed_m_s: float, way_m: float, slots: int
) -> None:
    train.speed_m_s = speed_m_s
    train.run(4.0)
    assert train.told.distance_m == pytest.approx(way_m)
    train.mu[:] = 5.0
    assert of(train.run((slots - 1) * SLOT_S)) == pytest.approx((20.0, 18.0))
    assert of(train.run(SLOT_S)) == pytest.approx((5.0, 3.0))


def test_three_samples_under_load_replace_coasting_ones_at_once(train: Train) -> None:
    train.mu[:], train.used = 10.0, 3.0
    assert of(train.run(0.4)) == pytest.approx((20.0, 18.0))
    assert of(train.run(SLOT_S)) == pytest.approx((10.0, 8.0))
    assert train.told.distance_m == pytest.approx(40.0)
    train.mu[:] = 30.0  # they are a median of themselves
    assert of(train.run(0.4)) == pytest.approx((10.0, 8.0))
    assert of(train.run(0.4)) == pytest.approx((30.0, 28.0))


def test_samples_under_too_little_load_replace_nothing(train: Train) -> None:
    train.mu[:], train.used = 10.0, 2.9
    assert of(train.run(1.0)) == pytest.approx((20.0, 18.0))


def test_samples_under_load_are_alone_for_a_second(train: Train) -> None:
    train.mu[:], train.used = 10.0, 5.0
    train.run(0.6)
    train.mu[:], train.used = 20.0, 2.0
    assert of(train.run(0.6)) == pytest.approx((10.0, 8.0))
    assert of(train.run(SLOT_S)) == pytest.approx((20.0, 18.0))  # the first of the three is a second behind


def test_lower_end_never_exceeds_the_deceleration(train: Train) -> None:
    """All of it in use, and a mean of three numbers that is a rounding below them."""
    train.validity[0], train.mu[:], train.used = Validity.DEGRADED, MEAN_BELOW_PCT, MEAN_BELOW_PCT
    middle, low = of(train.run(2.0))
    assert low <= middle
    restore(adviser(), encode(capture(train.adviser)))


def test_samples_that_are_too_far_behind_are_no_advice(train: Train) -> None:
    """At 200 m/s 100 m are over before the second is in which no axle is Valid."""
    train.speed_m_s = 200.0
    train.run(4.0)
    train.validity = [Validity.DEGRADED] * AXLES
    assert [train.run(SLOT_S).validity for _ in range(3)] == ["Degraded"] * 2 + ["NotAvailable"]


def test_part_of_the_axles_is_degraded_and_fewer_than_half_not_available(train: Train) -> None:
    train.validity[0] = Validity.DEGRADED
    train.mu[0] = 5.0  # what is not Valid counts for nothing
    assert train.run(4.2).validity == "Degraded"
    assert of(train.told) == pytest.approx((20.0, 18.0))
    train.validity[1] = Validity.NOT_AVAILABLE
    assert train.run(2.0).validity == "Degraded"
    train.validity[2] = Validity.DEGRADED
    assert train.run(1.0).validity == "Degraded"  # two of four were within the last second
    assert train.run(0.2) == NO_ADVICE
    assert NO_ADVICE.values() == {
        "Validity": "NotAvailable", "Deceleration": None, "DecelerationLow": None, "Distance": None,
        "Category": "Unknown", "Age": None, "Ahead": "None",
    }  # fmt: skip


def test_age_grows_while_no_axle_is_valid(train: Train) -> None:
    train.validity = [Validity.DEGRADED] * AXLES
    assert [(train.run(SLOT_S).validity, train.told.age_ms) for _ in range(6)] == [
        *(("Degraded", 200.0 * k) for k in range(1, 6)), ("NotAvailable", None),
    ]  # fmt: skip
    train.validity = [Validity.VALID] * AXLES
    assert train.run(SLOT_S).distance_m == 0.0  # what was before is forgotten


@pytest.mark.parametrize("speed_m_s", [math.nan, 2.0])
def test_unknown_and_low_speed_are_not_available(train: Train, speed_m_s: float) -> None:
    train.speed_m_s, train.below_min_speed = speed_m_s, speed_m_s == 2.0
    assert train.run(SLOT_S) == NO_ADVICE
    train.speed_m_s, train.below_min_speed = 20.0, False
    assert (train.run(SLOT_S).validity, train.told.distance_m) == ("Valid", 0.0)


@pytest.mark.parametrize("step_us", [-400_000, 0, 2_000_000])
def test_step_of_time_forgets_what_was_kept(train: Train, step_us: int) -> None:
    train.now_us += step_us - round(1e6 * SLOT_S)
    train.mu[:] = 5.0
    assert of(train.run(SLOT_S)) == pytest.approx((5.0, 3.0))
    assert train.told.distance_m == 0.0


def drop(evidence: str, mu_pct: float | None) -> RailAhead:
    return RailAhead("Ahead", evidence, 1, mu_pct, 30.0, 100.0)


def test_confirmed_drop_ahead_is_the_most_and_a_suspected_one_only_told(train: Train) -> None:
    nothing = RailAhead("NothingSeen")
    train.ahead = [nothing, drop("Suspected", None), nothing, nothing]
    assert train.run(SLOT_S).ahead == "Suspected"
    assert of(train.told) == pytest.approx((20.0, 18.0))
    train.ahead = [nothing, drop("Suspected", None), drop("Confirmed", 8.0), drop("Confirmed", 6.0)]
    assert train.run(SLOT_S).ahead == "Confirmed"
    assert of(train.told) == pytest.approx((6.0, 3.0))
    assert train.told.category == "VeryLow"
    train.ahead = [drop("Confirmed", 40.0)] + [nothing] * 3  # no less than there is here, but its half
    assert of(train.run(SLOT_S)) == pytest.approx((20.0, 18.0))


def test_category_begins_at_its_limit() -> None:
    lows = [2.5, 1.5, 1.49, 1.0, 0.99, 0.7, 0.69, 0.4, 0.39, 0.0]
    assert [category(low, LIMITS) for low in lows] == [
        "Dry", "Dry", "DryMedium", "DryMedium", "DryLow", "DryLow", "Low", "Low", "VeryLow", "VeryLow",
    ]  # fmt: skip


@pytest.mark.parametrize(("row", "column", "wrong"), [
    (-1, 0, math.inf),
    (-1, 0, 0.0),  # older than the one before
    (-1, 1, -1e9),
    (-1, 3, 1e9),  # the lower end above
    (-2, 2, math.nan),
])  # fmt: skip
def test_state_with_impossible_samples_is_refused(train: Train, row: int, column: int, wrong: float) -> None:
    restore(adviser(), encode(capture(train.adviser)))
    train.adviser._samples[row, column] = wrong
    with pytest.raises(StateMismatch):
        restore(adviser(), encode(capture(train.adviser)))


# --- the whole core, on a log of dry rail that ends in leaf film


@pytest.fixture(scope="module")
def log() -> list[Frame]:
    return [frame for frame, _ in read_log(LOG, Damage())]


def sent(core: Core, frames: list[Frame], live: bool = False) -> list[Frame]:
    out = []
    for f in frames:
        out += [*(core.advance(f.stamp_us) if live else ()), *core.feed(f)]
    return [o.frame for o in out if o.frame.can_id == 0xB3]


def test_frames_replayed_are_those_sent_live(log: list[Frame]) -> None:
    live = sent(Core(ADVISING), log, live=True)
    assert live == sent(Core(ADVISING), log)
    assert len(live) >= 24
    assert len({f.data[2:] for f in live}) > 15


def test_restored_state_goes_on_with_the_same_advice(log: list[Frame]) -> None:
    at = len(log) * 7 // 10
    core, again = Core(ADVISING), Core(ADVISING)
    for f in log[:at]:
        core.feed(f)
    restore(again, json.loads(json.dumps(encode(capture(core)))))
    assert sent(again, log[at:]) == sent(core, log[at:])


def test_advice_changes_no_other_frame(log: list[Frame]) -> None:
    both = [
        [o.frame for f in log for o in core.feed(f) if o.frame.can_id != 0xB3]
        for core in (Core(ADVISING), Core(load_packaged(1, design=LONE)))
    ]
    assert both[0] == both[1]


def test_every_frame_keeps_what_a_consumer_counts_on(log: list[Frame]) -> None:
    """A cycle of 200 ms, a counter that goes on, a lower end that is no more than the deceleration, no number without
    an advice, a category by the lower end."""
    frames = sent(Core(ADVISING), log)
    message = find_message(ADVISING.database, "AdhesionAdvice")
    for before, f in pairwise(frames):
        assert f.stamp_us - before.stamp_us == 200_000
        assert f.data[1] & 0x0F == ((before.data[1] & 0x0F) + 1) % 15
    names = set()
    for f in frames:
        said: Any = message.decode(f.data)
        numbers = [said[name] for name in ("Deceleration", "DecelerationLow", "Distance", "Age")]
        if str(said["Validity"]) == "NotAvailable":
            assert {*map(str, numbers)} == {"NotAvailable"}
            assert str(said["Category"]) == "Unknown"
        else:
            middle, low = numbers[:2]
            assert low <= middle
            assert str(said["Category"]) in {category(low, LIMITS), category(low + 0.01, LIMITS)}
            names.add(str(said["Category"]))
    assert {"Dry", "VeryLow"} <= names


def test_leaf_film_takes_the_advice_down(log: list[Frame]) -> None:
    frames = {f.stamp_us % 10**9 // 1000: f.data for f in sent(Core(ADVISING), log)}
    low = {ms: data[3] for ms, data in frames.items()}  # in 0.01 m/s²
    assert low[1000] == 255
    assert low[2400] == 250
    assert low[3600] < 40
    assert frames[3600][6] == 5  # VeryLow


def test_shutdown_says_not_available_with_a_new_counter(log: list[Frame]) -> None:
    core = Core(ADVISING)
    newest = sent(core, log)[-1]
    last = next(f for f in core.shutdown_frames(newest.stamp_us + 1) if f.can_id == 0xB3)
    assert (newest.data[1] >> 4 & 3, last.data[1] >> 4 & 3) == (1, 0)
    assert last.data[2:6] == b"\xff\xff\xff\xff"
    assert last.data[1] & 0x0F == (newest.data[1] & 0x0F) + 1
