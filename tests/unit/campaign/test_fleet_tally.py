"""What is added up of a log, part by part."""

from collections import Counter

import numpy as np
import pytest

from sim_ecu.campaign.fleet.classes import CLASSES, NOT_VALID, Bins, classes
from sim_ecu.campaign.fleet.suspects import Refusals, Spells
from sim_ecu.campaign.fleet.tally import MAX_HOLD_US, Speed
from wrcd.bus.reasons import Reason
from wrcd.core.causes import Cause
from wrcd.core.messages import surface

CYCLE_US = 20_000


@pytest.mark.parametrize("mu", [0.0, 3.99, 4.0, 7.99, 8.0, 14.9, 15.0, 24.9, 25.0, 50.0])
def test_class_of_a_valid_frame_is_the_daemons_surface(mu: float) -> None:
    (of,) = classes(np.array([True]), np.array([mu])).tolist()
    assert CLASSES[of] == surface(mu)


@pytest.mark.parametrize(("valid", "mu"), [(False, 30.0), (True, float("nan"))])
def test_frame_that_says_nothing_to_use_is_of_no_surface(valid: bool, mu: float) -> None:
    (of,) = classes(np.array([valid]), np.array([mu])).tolist()
    assert CLASSES[of] == NOT_VALID


def test_bins_keep_every_amount_when_they_are_merged() -> None:
    bins, rng = Bins(100.0), np.random.default_rng(1)
    for first in (0.0, 900.0):
        bins.add(first + 900 * np.sort(rng.random(50)), rng.integers(0, len(CLASSES), 50), np.full(50, 2.0))
    merged = bins.merged(1000.0)
    assert merged.shape == (2, len(CLASSES))
    np.testing.assert_allclose(merged.sum(axis=0), bins.total)
    assert bins.total.sum() == pytest.approx(200.0)


def test_speed_holds_for_a_second_and_no_longer() -> None:
    speed = Speed(None)
    speed.put(1_000_000, -20.0)
    at = np.array([999_999, 1_000_000, 1_000_000 + MAX_HOLD_US, 1_000_001 + MAX_HOLD_US])
    assert speed.at(at).tolist() == [0.0, 20.0, 20.0, 0.0]


def test_speed_that_is_let_go_of_is_known_as_long_as_it_may_be_asked_for() -> None:
    speed = Speed(None)
    for k in range(5):
        speed.put(k * MAX_HOLD_US, float(k))
    speed.forget(4 * MAX_HOLD_US)
    assert speed.at(np.array([4 * MAX_HOLD_US - 1, 4 * MAX_HOLD_US])).tolist() == [3.0, 4.0]


def spells(*causes: tuple[Cause, int]) -> Spells:
    """Frames of causes, so many of each in a row, in two parts."""
    every = np.concatenate([np.full(n, cause, np.uint8) for cause, n in causes])
    stamps, out = CYCLE_US * np.arange(len(every), dtype=np.int64), Spells()
    half = len(every) // 2
    out.add(stamps[:half], every[:half])
    out.add(stamps[half:], every[half:])
    return out


def test_spell_over_two_parts_is_one() -> None:
    found = spells((Cause.NONE, 10), (Cause.GYRO_DEAD, 80), (Cause.NONE, 10), (Cause.GYRO_DEAD, 20))
    (one,) = found.suspects(3, 0, CYCLE_US * 1e-6)
    assert (one.what, one.axle, one.times) == ("GyroDead", 3, 2)
    assert [one.first_s, one.seconds] == pytest.approx([0.2, 2.0])


def test_input_that_was_silent_for_a_moment_is_not_suspicious() -> None:
    assert spells((Cause.INPUT_SILENT, 49), (Cause.NONE, 51)).suspects(1, 0, CYCLE_US * 1e-6) == []
    assert spells((Cause.INPUT_SILENT, 51), (Cause.NONE, 49)).suspects(1, 0, CYCLE_US * 1e-6) != []


def test_cause_of_the_ride_is_no_suspect() -> None:
    assert spells((Cause.STANDSTILL, 500), (Cause.HARSH, 500)).suspects(1, 0, CYCLE_US * 1e-6) == []


def test_text_is_that_of_the_longest_spell() -> None:
    found = spells((Cause.GYRO_DEAD, 100))
    for stamp_s, cause, text in ((0, Cause.GYRO_DEAD, "short"), (1, Cause.NONE, ""), (2, Cause.GYRO_DEAD, "long"),
                                 (9, Cause.NONE, "")):  # fmt: skip
        found.told(stamp_s * 1_000_000, cause, text)
    (one,) = found.suspects(1, 0, 0.02)
    assert one.text == "long"


@pytest.mark.parametrize(("refused", "suspects"), [(9, 0), (11, 1)])
def test_message_is_suspicious_from_one_refused_frame_in_a_hundred_on(refused: int, suspects: int) -> None:
    refusals = Refusals()
    refusals.accepted["YawRate_A1"] = 1000 - refused
    refusals.look(Counter({("YawRate_A1", Reason.CRC): 1}), 5_000_000)
    refusals.look(Counter({("YawRate_A1", Reason.CRC): refused}), 7_000_000)
    found = refusals.suspects({"YawRate_A1": 1}, 1_000_000, 101_000_000)
    assert len(found) == suspects
    assert refusals.document(1_000_000) == [
        {"message": "YawRate_A1", "reason": "crc", "frames": refused, "first_s": 4.0, "last_s": 6.0}
    ]
    for one in found:  # 11 of 1000 frames in 100 s
        assert (one.what, one.axle, one.first_s) == ("RefusedCrc", 1, 4.0)
        assert one.seconds == pytest.approx(1.1)


def test_two_refused_frames_far_apart_are_not_all_the_time_between() -> None:
    refusals = Refusals()
    refusals.accepted["YawRate_A1"] = 98
    for frames, stamp_us in ((1, 0), (2, 7_200_000_000)):
        refusals.look(Counter({("YawRate_A1", Reason.CRC): frames}), stamp_us)
    (one,) = refusals.suspects({}, 0, 7_200_000_000)
    assert one.seconds == pytest.approx(144.0)
