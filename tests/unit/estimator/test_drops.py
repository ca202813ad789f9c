"""The first signs of a drop: innovations that grow on one axle, and a torque that one axle gives up."""

import numpy as np
import pytest

from wrcd.estimator.design import CHANNELS as SENSORS
from wrcd.estimator.design import MODELS, FloatArray
from wrcd.estimator.drops import JOLT_BLOCKS, PAUSE, REFERENCE, DropWatch
from wrcd.estimator.window import BLOCK_TICKS

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
            ratio = np.tile(self.torque, (BLOCK_TICKS, 1))
            usable = np.ones((BLOCK_TICKS, AXLES), dtype=bool)
            self.watch.add(self.block * BLOCK_TICKS, w, usable, ratio, self.block * BLOCK_M, BLOCK_M, BEHIND)
            self.block += 1
        return self.watch.take()


@pytest.fixture
def train() -> Train:
    """One that has been watched for long enough."""
    t = Train()
    assert not t.watch.ready.any()
    assert np.isnan(t.run(2 * REFERENCE)).all()
    assert t.watch.ready.all()
    return t


def test_unchanging_rail_shows_no_sign(train: Train) -> None:
    assert np.isnan(train.run(500)).all()


def test_innovations_of_one_axle_are_a_sign_within_three_blocks(train: Train) -> None:
    train.louder[1] = 10.0
    begun_m = train.block * BLOCK_M
    met_m = train.run(3)
    assert np.isnan(met_m[[0, 2]]).all()
    assert met_m[1] == pytest.approx(begun_m, abs=2 * BLOCK_M)


def test_rougher_track_under_all_models_is_no_sign(train: Train) -> None:
    train.all_louder = 2.0
    assert np.isnan(train.run(20)).all()


def test_joint_that_drives_all_models_is_no_sign(train: Train) -> None:
    train.all_louder, train.louder[1] = 10.0, 1.5
    train.run(2)
    train.all_louder, train.louder[1] = 1.0, 1.0
    assert np.isnan(train.run(2 * JOLT_BLOCKS)).all()


def test_worse_rail_is_seen_again_once_a_joint_is_gone(train: Train) -> None:
    train.all_louder = 4.0
    train.run(1)
    train.all_louder = 1.0
    train.run(REFERENCE + JOLT_BLOCKS)
    train.louder[1] = 10.0
    assert np.isfinite(train.run(3)).tolist() == [False, True, False]


def test_innovations_that_come_with_a_change_of_torque_are_no_sign(train: Train) -> None:
    train.torque[:] = 0.3
    train.run(1)
    train.louder[1] = 10.0
    assert np.isnan(train.run(10)).all()


def test_torque_that_one_axle_gives_up_is_a_sign(train: Train) -> None:
    train.torque[0] = 0.1
    met_m = train.run(4)
    assert np.isfinite(met_m).tolist() == [True, False, False]


def test_axle_without_torque_hides_no_sign_of_others(train: Train) -> None:
    train.torque[1] = 0.0
    train.run(2 * REFERENCE)
    train.torque[0] = 0.1
    assert np.isfinite(train.run(4)).tolist() == [True, False, False]
    train.torque[2] = 0.0
    train.run(2 * REFERENCE)
    train.torque[0] = 0.05
    assert np.isnan(train.run(30)).all()  # nobody is left to compare with


def test_axle_whose_torque_changes_or_that_just_gave_a_sign_is_not_ready(train: Train) -> None:
    train.torque[1] = 0.3
    train.louder[0] = 10.0
    train.run(3)
    assert train.watch.ready.tolist() == [False, False, True]
    train.run(PAUSE)
    assert train.watch.ready.all()


def test_torque_that_all_axles_give_up_is_none(train: Train) -> None:
    train.torque[:] = 0.1
    assert np.isnan(train.run(30)).all()


def test_torque_of_the_last_axle_is_none(train: Train) -> None:
    train.torque[2] = 0.1
    assert np.isnan(train.run(30)).all()


def test_second_sign_of_an_axle_waits(train: Train) -> None:
    train.torque[0] = 0.1
    assert np.isfinite(train.run(4)[0])
    train.louder[0] = 10.0
    assert np.isnan(train.run(PAUSE // 2)).all()


def test_gap_and_reset_begin_anew(train: Train) -> None:
    train.watch.reset(1)
    assert train.watch.ready.tolist() == [True, False, True]
    train.block += 5
    train.louder[0] = 10.0
    assert np.isnan(train.run(10)).all()
    assert not train.watch.ready.any()
