"""What lies ahead of an axle: made by those before it, told by distance, forgotten when it is passed."""

from dataclasses import fields

import numpy as np
import pytest

from wrcd.core.ahead import BORNE_OUT_S, MAX_AGE_S, ON_M, Ahead, Told
from wrcd.core.causes import Cause, Validity
from wrcd.core.front import View
from wrcd.core.messages import Report
from wrcd.estimator.records import Estimate

X_M = np.array([0.0, -2.5, -19.0, -21.5])
SLOT_S = 0.02


def estimate(mu: np.ndarray, window_s: np.ndarray) -> Estimate:
    n = len(mu)
    values = {f.name: np.zeros(n) for f in fields(Estimate)}
    return Estimate(**values | {  # what is not read here is zero
        "mu_available_pct": mu, "half_width_pp": np.full(n, 1.0), "window_s": window_s, "used_pct": np.full(n, 5.0),
    })  # fmt: skip


class Train:
    """Four axles at 20 m/s on a rail of 30 %."""

    def __init__(self) -> None:
        self.ahead = Ahead((1, 2, 3, 4))
        self.x_m, self.speed_m_s, self.way_m, self.now_s, self.epoch = X_M, 20.0, 0.0, 100.0, 1
        self.mu, self.window_s = np.full(4, 30.0), np.full(4, 1.0)
        self.validity = Validity.VALID
        self.told: list[Told] = []

    def run(self, seconds: float, met: int | None = None) -> list[Told]:
        """Go on; an axle (place) that meets a worse rail does it in the first slot."""
        for k in range(round(seconds / SLOT_S)):
            self.now_s += SLOT_S
            self.way_m += self.speed_m_s * SLOT_S
            met_m = np.full(4, np.nan)
            if met is not None and k == 0:
                met_m[met] = self.way_m
            view = View(self.epoch, self.way_m, self.speed_m_s, self.x_m, met_m, np.ones(4, dtype=bool))
            report = Report(self.validity, 30.0, 5.0, 5, "Dry", "Adhering", "Within1pp", Cause.NONE)
            self.told = self.ahead.update(self.now_s, view, [report] * 4, estimate(self.mu, self.window_s))
        return self.told


@pytest.fixture
def train() -> Train:
    t = Train()
    t.run(3.0)
    return t


def states(told: list[Told]) -> list[str]:
    return [t.state for t in told]


def test_first_axle_has_nobody_ahead_and_others_see_nothing(train: Train) -> None:
    assert states(train.told) == ["NotAvailable", "NothingSeen", "NothingSeen", "NothingSeen"]
    assert not any(t.warns for t in train.told)


def test_sign_is_told_at_once_by_distance_as_suspected(train: Train) -> None:
    told = train.run(SLOT_S, met=0)
    assert states(told) == ["NotAvailable", "Entering", "Ahead", "Ahead"]
    assert [t.distance_m for t in told[1:]] == pytest.approx([2.5, 19.0, 21.5])
    assert [(t.evidence, t.mu_pct, t.seen_by) for t in told[1:]] == [("Suspected", None, 1)] * 3
    assert train.run(0.2)[2].distance_m == pytest.approx(15.0)
    assert train.told[2].age_ms == pytest.approx(200)


def test_second_axle_at_the_same_place_confirms_it(train: Train) -> None:
    train.run(0.12, met=0)
    told = train.run(SLOT_S, met=1)
    assert [(t.evidence, t.seen_by) for t in told[2:]] == [("Confirmed", 1)] * 2


def test_estimate_of_the_axle_on_it_says_how_much_there_is(train: Train) -> None:
    train.run(0.4, met=0)
    train.mu[0], train.window_s[0] = 6.0, 0.2
    told = train.run(SLOT_S)
    assert [(t.evidence, t.mu_pct) for t in told[2:]] == [("Confirmed", 6.0)] * 2


def test_estimate_that_has_not_fallen_takes_a_suspicion_back(train: Train) -> None:
    assert train.run(0.4, met=0)[2].warns
    train.window_s[0] = 0.3
    assert not train.run(SLOT_S)[2].warns  # there is no less than it has
    train.run(BORNE_OUT_S)
    train.mu[:] = 90.0
    assert not train.run(SLOT_S)[2].warns


def test_fall_of_an_estimate_without_a_sign_is_a_drop(train: Train) -> None:
    train.mu[0], train.window_s[0] = 5.0, 0.3
    train.run(0.1)
    assert not train.told[2].warns
    told = train.run(0.3)
    assert (told[2].evidence, told[2].mu_pct) == ("Confirmed", 5.0)
    assert told[2].distance_m == pytest.approx(19.0 - 20.0 * 0.5, abs=2.5)


def test_drop_is_told_until_the_axle_is_well_on_it(train: Train) -> None:
    train.run(SLOT_S, met=0)
    train.mu[0], train.window_s[0] = 6.0, 0.2
    assert train.run(0.9)[2].state == "Entering"
    assert train.run(0.06)[2].state == "OnIt"
    assert train.told[2].distance_m == 0.0
    assert train.run(ON_M / 20.0 + SLOT_S)[2].state == "NothingSeen"


def test_no_more_adhesion_than_predicted_is_no_warning(train: Train) -> None:
    train.mu[2:] = 6.0  # they have no more than that already
    train.run(0.4, met=0)
    train.mu[0], train.window_s[0] = 6.0, 0.2
    assert [t.warns for t in train.run(SLOT_S)[2:]] == [False, False]


def test_reverse_turns_the_order_over() -> None:
    train = Train()
    train.x_m = -X_M
    train.run(3.0)
    told = train.run(SLOT_S, met=3)
    assert states(told) == ["Ahead", "Ahead", "Entering", "NotAvailable"]
    assert [t.seen_by for t in told[:3]] == [4] * 3


def test_another_epoch_forgets_every_place(train: Train) -> None:
    train.run(SLOT_S, met=0)
    train.epoch += 1
    assert not any(t.warns for t in train.run(SLOT_S))


def test_unknown_way_says_nothing(train: Train) -> None:
    train.run(SLOT_S, met=0)
    train.way_m = np.nan
    assert states(train.run(SLOT_S)) == ["NotAvailable"] * 4


def test_standing_train_forgets_with_time(train: Train) -> None:
    train.run(SLOT_S, met=0)
    train.speed_m_s = 0.0
    assert train.run(MAX_AGE_S - 1.0)[2].warns
    assert train.told[2].age_ms == 4000
    assert not train.run(2.0)[2].warns


def test_sign_of_an_axle_that_never_was_valid_is_none() -> None:
    train = Train()
    train.validity = Validity.NOT_AVAILABLE
    train.run(1.0)
    assert not any(t.warns for t in train.run(SLOT_S, met=0))
