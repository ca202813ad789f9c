"""What lies ahead of an axle: made by those before it, told by distance, forgotten when it is passed."""

from dataclasses import fields

import numpy as np
import pytest

from wrcd.core.ahead import BORNE_OUT_S, MAX_DROPS, ON_M, Ahead, RailAhead
from wrcd.core.causes import Cause, Validity
from wrcd.core.front import View
from wrcd.core.messages import Report
from wrcd.estimator.records import Estimate
from wrcd.recorder.state import StateMismatch, capture, encode, restore

X_M = np.array([0.0, -2.5, -19.0, -21.5])
SLOT_S = 0.02


def estimate(mu: np.ndarray, past_s: np.ndarray) -> Estimate:
    n = len(mu)
    values = {f.name: np.zeros(n) for f in fields(Estimate)}
    return Estimate(**values | {  # what is not read here is zero
        "mu_available_pct": mu, "half_width_pp": np.full(n, 1.0), "past_s": past_s, "used_pct": np.full(n, 5.0),
    })  # fmt: skip


class Train:
    """Four axles at 20 m/s on a rail of 30 %."""

    def __init__(self) -> None:
        self.ahead = Ahead((1, 2, 3, 4))
        self.x_m, self.speed_m_s, self.way_m, self.now_us, self.epoch = X_M, 20.0, 0.0, 1_790_000_000_000_000, 1
        self.mu, self.past_s = np.full(4, 30.0), np.full(4, 1.0)
        self.validity = [Validity.VALID] * 4
        self.ready = np.ones(4, dtype=bool)
        self.told: list[RailAhead] = []

    def run(
        self, seconds: float, met: int | None = None, before_m: float = 0.0, lost: int | None = None
    ) -> list[RailAhead]:
        """Go on; an axle (place) that meets a worse rail does it in the first slot, or has so many metres before; one
        that is lost is it in the first slot, too."""
        for k in range(round(seconds / SLOT_S)):
            self.now_us += round(1e6 * SLOT_S)
            self.way_m += self.speed_m_s * SLOT_S
            met_m = np.full(4, np.nan)
            broke = np.zeros(4, dtype=bool)
            if met is not None and k == 0:
                met_m[met] = self.way_m - before_m
            if lost is not None and k == 0:
                broke[lost] = True
            view = View(self.epoch, self.way_m, self.speed_m_s, self.x_m, met_m, self.ready, broke)
            reports = [Report(v, 30.0, 5.0, 5, "Dry", "Adhering", "Within1pp", Cause.NONE) for v in self.validity]
            self.told = self.ahead.update(self.now_us, view, reports, estimate(self.mu, self.past_s))
        return self.told


@pytest.fixture
def train() -> Train:
    t = Train()
    t.run(3.0)
    return t


def states(told: list[RailAhead]) -> list[str]:
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


@pytest.mark.parametrize("between_s", [SLOT_S, 0.12])  # a jolt of both axles, a joint that both run over
def test_second_sign_at_the_same_place_proves_nothing(train: Train, between_s: float) -> None:
    train.run(between_s, met=0)
    told = train.run(SLOT_S, met=1)
    assert [(t.evidence, t.seen_by, t.mu_pct) for t in told[2:]] == [("Suspected", 1, None)] * 2
    train.past_s[0] = 0.3
    assert not any(t.warns for t in train.run(2 * BORNE_OUT_S))


def test_estimate_of_the_axle_on_it_says_how_much_there_is(train: Train) -> None:
    train.run(0.4, met=0)
    train.mu[0], train.past_s[0] = 6.0, 0.2
    told = train.run(SLOT_S)
    assert [(t.evidence, t.mu_pct) for t in told[2:]] == [("Confirmed", 6.0)] * 2


def test_estimate_that_has_not_fallen_takes_a_suspicion_back(train: Train) -> None:
    assert train.run(0.4, met=0)[2].warns
    train.past_s[0] = 0.3
    assert not train.run(SLOT_S)[2].warns  # there is no less than it has
    train.run(BORNE_OUT_S)
    train.mu[:] = 90.0
    assert not train.run(SLOT_S)[2].warns


def test_fall_of_an_estimate_without_a_sign_is_a_drop(train: Train) -> None:
    train.mu[0], train.past_s[0] = 5.0, 0.3
    train.run(0.1)
    assert not train.told[2].warns
    told = train.run(0.3)
    assert (told[2].evidence, told[2].mu_pct) == ("Confirmed", 5.0)
    assert told[2].distance_m == pytest.approx(19.0 - 20.0 * 0.5, abs=2.5)


def test_drop_is_told_until_the_axle_is_well_on_it(train: Train) -> None:
    train.run(SLOT_S, met=0)
    train.mu[0], train.past_s[0] = 6.0, 0.2
    assert train.run(0.9)[2].state == "Entering"
    assert train.run(0.06)[2].state == "OnIt"
    assert train.told[2].distance_m == 0.0
    assert train.run(ON_M / 20.0 + SLOT_S)[2].state == "NothingSeen"


def test_no_more_adhesion_than_predicted_is_no_warning(train: Train) -> None:
    train.mu[2:] = 6.0  # they have no more than that already
    train.run(0.4, met=0)
    train.mu[0], train.past_s[0] = 6.0, 0.2
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


def on_leaves(train: Train) -> None:
    """The first axle is on a drop, and knows it."""
    train.run(0.4, met=0)
    train.mu[0], train.past_s[0] = 4.0, 0.2
    assert train.run(SLOT_S)[2].evidence == "Confirmed"


def test_standing_train_keeps_the_place(train: Train) -> None:
    on_leaves(train)
    train.speed_m_s, train.validity = 0.0, [Validity.NOT_AVAILABLE] * 4
    told = train.run(60.0)
    assert [(t.state, t.mu_pct, t.age_ms) for t in told[2:]] == [("Ahead", 4.0, 4000)] * 2
    train.speed_m_s = 20.0
    assert train.run(0.6)[2].state == "OnIt"


def test_leader_that_sees_nothing_is_not_one_that_saw_nothing() -> None:
    train = Train()
    train.validity[0] = Validity.DEGRADED
    assert states(train.run(3.0)) == ["NotAvailable", "NotAvailable", "NothingSeen", "NothingSeen"]
    train.validity[1] = Validity.DEGRADED
    assert states(train.run(3.0)) == ["NotAvailable", "NotAvailable", "NotAvailable", "NothingSeen"]


def test_place_that_a_leader_passed_unseeing_is_not_promised(train: Train) -> None:
    train.ready[:2] = False
    train.run(0.1)
    train.ready[:2] = True
    assert states(train.run(0.5))[1:3] == ["NothingSeen", "NotAvailable"]
    assert states(train.run(0.5))[1:3] == ["NothingSeen", "NothingSeen"]


def test_restart_takes_back_what_an_axle_suspected_and_promises_nothing(train: Train) -> None:
    train.run(SLOT_S, met=0)
    train.ready[0] = False
    assert states(train.run(SLOT_S, lost=0)) == ["NotAvailable"] * 4
    on_leaves(again := settled())
    assert again.run(SLOT_S, lost=0)[2].evidence == "Confirmed"


def settled() -> Train:
    train = Train()
    train.run(3.0)
    return train


def test_adhesion_of_long_ago_is_no_reference(train: Train) -> None:
    train.validity = [Validity.NOT_AVAILABLE] * 4
    train.run(6.0)
    assert not any(t.warns for t in train.run(SLOT_S, met=0))


def test_more_drops_than_are_kept_lose_a_suspected_one(train: Train) -> None:
    on_leaves(train)
    train.speed_m_s = 1.0
    train.past_s[:] = 1.0
    for k in range(MAX_DROPS):
        train.run(SLOT_S, met=0, before_m=3.5 - 3.5 * k)
    assert train.told[2].evidence == "Confirmed"


def drops(train: Train, *drops: tuple[float, float]) -> None:
    """Confirmed drops, so many metres ahead of the third axle, of so much adhesion (%; NaN: suspected alone)."""
    train.ahead._drops[:] = np.nan
    for row, (distance, mu) in enumerate(drops):
        place = train.way_m + train.x_m[2] + distance + train.speed_m_s * SLOT_S
        train.ahead._drops[row] = place, train.now_us, 0, 1.0 + np.isfinite(mu), mu, 30.0


NONE = float("nan")


@pytest.mark.parametrize(
    ("ahead", "told"),
    [
        ([(-1.0, 20.0), (4.0, 4.0)], ("Entering", "Confirmed", 4.0, 4.0)),  # the next, not the one that is reached
        ([(-1.0, 4.0), (15.0, NONE)], ("Ahead", "Suspected", None, 15.0)),
        ([(4.0, NONE), (8.0, 4.0)], ("Entering", "Confirmed", 4.0, 8.0)),
        ([(12.0, NONE), (16.0, 4.0)], ("Ahead", "Confirmed", 4.0, 16.0)),
        ([(4.0, NONE), (16.0, 4.0)], ("Entering", "Suspected", None, 4.0)),
        ([(4.0, 20.0), (8.0, 4.0)], ("Entering", "Confirmed", 4.0, 4.0)),  # the least within half a second
        ([(4.0, 20.0), (16.0, 4.0)], ("Entering", "Confirmed", 20.0, 4.0)),
        ([(-3.0, 4.0), (-1.0, 20.0)], ("OnIt", "Confirmed", 20.0, 0.0)),
    ],
)
def test_of_two_drops_the_one_that_matters_is_told(
    train: Train, ahead: list[tuple[float, float]], told: tuple[str, str, float | None, float]
) -> None:
    drops(train, *ahead)
    t = train.run(SLOT_S)[2]
    assert (t.state, t.evidence, t.mu_pct) == told[:3]
    assert t.distance_m == pytest.approx(told[3])


def test_sign_of_an_axle_that_never_was_valid_is_none() -> None:
    train = Train()
    train.validity = [Validity.NOT_AVAILABLE] * 4
    train.run(1.0)
    assert states(train.run(SLOT_S, met=0)) == ["NotAvailable"] * 4


@pytest.mark.parametrize("wrong", [(2, 99.0), (2, 0.5), (3, 7.0), (3, 2.0), (1, NONE), (0, NONE)])
def test_state_with_a_drop_that_cannot_be_is_refused(train: Train, wrong: tuple[int, float]) -> None:
    drops(train, (10.0, NONE))
    node = encode(capture(train.ahead))
    restore(Ahead((1, 2, 3, 4)), node)
    train.ahead._drops[0, wrong[0]] = wrong[1]
    with pytest.raises(StateMismatch, match="holds what cannot be"):
        restore(Ahead((1, 2, 3, 4)), encode(capture(train.ahead)))
