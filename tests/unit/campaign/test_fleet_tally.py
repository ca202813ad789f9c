"""What is added up of a log, part by part."""

from collections import Counter

import numpy as np
import pytest

from sim_ecu.campaign.fleet.suspects import RefusalTally, Suspect, SuspectSpells
from sim_ecu.campaign.fleet.tally import CLASSES, MAX_HOLD_US, NOT_VALID, Bins, Speed, classes
from wrcd.bus.reasons import Reason
from wrcd.core.causes import Cause
from wrcd.core.messages import surface


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


def suspects(*changes: tuple[float, Cause, str]) -> list[Suspect]:
    """Of changes at times (s), the last of which is the log's end."""
    spells = SuspectSpells()
    for at_s, cause, text in changes:
        spells.change(round(1e6 * at_s), cause, text)
    return spells.suspects(3, 0)


def test_sensor_is_named_from_when_for_how_long_how_often_and_by_the_text_of_its_longest_spell() -> None:
    dead = Cause.GYRO_DEAD
    changes = ((0.2, dead, "short"), (1.2, Cause.NONE, ""), (2.0, dead, "long"), (3.0, dead, "Degraded now"))
    (one,) = suspects(*changes, (8.0, Cause.NONE, ""))
    assert (one.what, one.axle, one.times, one.text) == ("GyroDead", 3, 2, "long")
    assert [one.first_s, one.seconds] == pytest.approx([0.2, 7.0])


@pytest.mark.parametrize(
    ("cause", "seconds", "named"),
    [(Cause.INPUT_SILENT, 0.98, False), (Cause.INPUT_SILENT, 1.02, True), (Cause.STANDSTILL, 500.0, False),
     (Cause.HARSH, 500.0, False)],
)  # fmt: skip
def test_input_that_was_silent_for_a_moment_and_a_cause_of_the_ride_are_no_suspects(
    cause: Cause, seconds: float, named: bool
) -> None:
    assert bool(suspects((0.0, cause, ""), (seconds, Cause.NONE, ""))) is named


@pytest.mark.parametrize(("refused", "suspects"), [(9, 0), (11, 1)])
def test_message_is_suspicious_from_one_refused_frame_in_a_hundred_on(refused: int, suspects: int) -> None:
    refusals = RefusalTally()
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
    refusals = RefusalTally()
    refusals.accepted["YawRate_A1"] = 98
    for frames, stamp_us in ((1, 0), (2, 7_200_000_000)):
        refusals.look(Counter({("YawRate_A1", Reason.CRC): frames}), stamp_us)
    (one,) = refusals.suspects({}, 0, 7_200_000_000)
    assert one.seconds == pytest.approx(144.0)
