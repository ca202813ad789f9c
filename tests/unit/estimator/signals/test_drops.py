"""The first signs of a drop: innovations that grow on one axle, and a torque that one axle gives up."""

from collections.abc import Sequence

import numpy as np
import pytest

from wrcd.estimator.design import CHANNELS as SENSORS
from wrcd.estimator.design import MODELS, FloatArray
from wrcd.estimator.paper.window import BLOCK_TICKS
from wrcd.estimator.signals.drops import JOLT_BLOCKS, PAUSE, REFERENCE, DropWatch

AXLES = 3
BEHIND: tuple[list[int], ...] = ([1, 2], [2], [])
BLOCK_M = 0.4
LINEAR = 3  # the model that a worse rail leaves


class Train:
    """White innovations of three axles, block by block."""

    def __init__(self) -> None:
        self.watch = DropWatch(AXLES)
        self.rng = np.random.default_rng(5)
        self.block = 10
        self.louder = np.ones(AXLES)  # the linear model's innovations, by axle
        self.all_louder = 1.0
        self.torque = np.full(AXLES, 0.2)

    def run(self, blocks: int) -> FloatArray:
        """So many blocks; where each axle met a worse rail."""
        for _ in range(blocks):
            one = self.all_louder * self.rng.normal(size=(BLOCK_TICKS, 1, SENSORS, AXLES))
            w = np.repeat(one, MODELS, axis=1)  # one track drives all models
            w[:, LINEAR] *= self.louder
            for number, row in enumerate(w, self.block * BLOCK_TICKS):
                usable = np.ones(AXLES, dtype=bool)
                self.watch.add(number, row, usable, self.torque, self.block * BLOCK_M, BLOCK_M, BEHIND)
            self.block += 1
        met_m = self.watch.met_m.copy()
        self.watch.met_m[:] = np.nan
        return met_m


@pytest.fixture
def train() -> Train:
    """One that has been watched for long enough."""
    t = Train()
    assert not t.watch.ready.any()
    assert np.isnan(t.run(2 * REFERENCE)).all()
    assert t.watch.ready.all()
    return t


# what the train does: attributes that change (an axle's own by its place), then so many blocks
JOINT: dict[str, float | dict[int, float]] = {"all_louder": 10.0, "louder": {1: 1.5}}  # drives all models
Part = tuple[dict[str, float | dict[int, float]], int]


def after(train: Train, parts: Sequence[Part]) -> list[int]:
    """The axles that gave a sign in the last part."""
    met_m = np.full(AXLES, np.nan)
    for changed, blocks in parts:
        for name, value in changed.items():
            if isinstance(value, dict):
                getattr(train, name)[list(value)] = list(value.values())
            else:
                setattr(train, name, value)
        met_m = train.run(blocks)
    return np.flatnonzero(np.isfinite(met_m)).tolist()


@pytest.mark.parametrize(
    ("parts", "signs"),
    [
        ([({}, 500)], []),
        ([({"all_louder": 2.0}, 20)], []),  # a rougher track, under all models
        # a joint that drives all models
        (
            [({"all_louder": 10.0, "louder": {1: 1.5}}, 2), ({"all_louder": 1.0, "louder": {1: 1.0}}, 2 * JOLT_BLOCKS)],
            [],
        ),
        # a worse rail once a joint is gone
        ([({"all_louder": 4.0}, 1), ({"all_louder": 1.0}, REFERENCE + JOLT_BLOCKS), ({"louder": {1: 10.0}}, 3)], [1]),
        # with a change of torque
        ([({"torque": {0: 0.3, 1: 0.3, 2: 0.3}}, 1), ({"louder": {1: 10.0}}, 10)], []),
        ([({"torque": {0: 0.1}}, 4)], [0]),  # given up by one axle
        ([({"torque": {1: 0.0}}, 2 * REFERENCE), ({"torque": {0: 0.1}}, 4)], [0]),  # another has none
        ([({"torque": {1: 0.0, 2: 0.0}}, 2 * REFERENCE), ({"torque": {0: 0.05}}, 30)], []),  # nobody to compare with
        ([({"torque": {0: 0.1, 1: 0.1, 2: 0.1}}, 30)], []),  # given up by all
        ([({"torque": {2: 0.1}}, 30)], []),  # the last axle's
        ([({"torque": {0: 0.1}}, 4), ({"louder": {0: 10.0}}, PAUSE // 2)], []),  # a second sign waits
    ],
)
def test_sign_of_a_drop_is_one_axles_own(train: Train, parts: Sequence[Part], signs: list[int]) -> None:
    assert after(train, parts) == signs


def test_sign_is_where_the_innovations_began_to_grow(train: Train) -> None:
    begun_m = train.block * BLOCK_M
    train.louder[1] = 10.0
    met_m = train.run(3)
    assert np.isnan(met_m[[0, 2]]).all()
    assert met_m[1] == pytest.approx(begun_m, abs=2 * BLOCK_M)


def test_axle_whose_torque_changes_or_that_just_gave_a_sign_is_not_ready(train: Train) -> None:
    assert after(train, [({"torque": {1: 0.3}, "louder": {0: 10.0}}, 3)]) == [0]
    assert train.watch.ready.tolist() == [False, False, True]
    train.run(PAUSE)
    assert train.watch.ready.all()


def test_gap_and_reset_begin_anew(train: Train) -> None:
    train.watch.reset(1)
    assert train.watch.ready.tolist() == [True, False, True]
    train.block += 5
    assert after(train, [({"louder": {0: 10.0}}, 10)]) == []
    assert not train.watch.ready.any()
