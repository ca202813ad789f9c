"""Two stories beside each other."""

from pathlib import Path

import numpy as np
import pytest

from tests.support.story import DEGRADED, VALID, Ride, adhesion, axle, detail, renamed, story
from wrcd import resources
from wrcd.core.causes import Cause
from wrcd.core.configuration import Config
from wrcd.errors import NotThere
from wrcd.logs.log_comparison import compare, sentences, with_design
from wrcd.logs.story_events import with_falls


def test_story_against_itself_differs_nowhere(ride: Ride) -> None:
    (a,) = compare(ride.sent, ride.sent)
    assert (a.mean_absolute_pp, a.worst_pp, a.only_other) == (0.0, 0.0, ())
    assert a.both_valid == (ride.sent.axles[0].adhesion.validity == VALID).sum()
    assert [d.delay_s for d in a.delays] == [0.0, 0.0]
    share = 100 * a.valid_shares[0]
    (told,) = sentences(ride.sent, ride.sent)
    assert told.text == (
        f"Axle 1: Valid for {share:.1f} % here, {share:.1f} % there; the same MuAvailable in {a.both_valid} slots that "
        "both call Valid."
    )


def test_estimate_against_frames_of_one_log_is_the_same(ride: Ride) -> None:
    (a,) = compare(ride.sent, ride.estimated)
    assert (a.mean_absolute_pp, a.worst_pp) == (0.0, 0.0)


def test_differences_are_those_of_slots_that_both_call_valid(config: Config) -> None:
    one = story(config, axle(adhesion(np.full(100, 30.0))))
    validity = [VALID] * 80 + [DEGRADED] * 20
    values = np.full(100, 33.0)
    values[50] = 20.0
    other = story(config, axle(adhesion(values, validity), detail(100, [0] * 16 + [Cause.HARSH] * 4)))
    (a,) = compare(one, other)
    assert a.both_valid == 80
    assert a.worst_pp == pytest.approx(-10.0)
    assert a.worst_at_us == int(one.axles[0].adhesion.time_us[50])
    assert a.mean_pp == pytest.approx((79 * 3 - 10) / 80)
    assert a.valid_shares == pytest.approx((1.0, 0.81), abs=0.005)


def test_logs_are_compared_after_their_beginnings(config: Config) -> None:
    values = np.linspace(30, 40, 100)
    one, other = story(config, axle(adhesion(values))), story(config, axle(adhesion(values)))
    shifted = adhesion(values)
    shifted.time_us[:] += 77_000_000_000
    later = renamed(story(config, axle(shifted, events=other.axles[0].events)), "later.log")
    later = type(later)(
        **{**{n: getattr(later, n) for n in later.__slots__}, "begin_us": one.begin_us + 77_000_000_000}
    )
    (a,) = compare(one, later)
    assert (a.both_valid, a.mean_absolute_pp) == (100, 0.0)


def test_fall_that_comes_later_and_one_that_is_missing_are_told(config: Config) -> None:
    def dropped(*at: int) -> np.ndarray:
        values = np.full(1500, 38.0)
        for k in at:
            values[k : k + 300] = 5.0
        return values

    one = with_falls(story(config, axle(adhesion(dropped(400, 1000)))))
    other = with_falls(story(config, axle(adhesion(dropped(410)))))
    (a,) = compare(one, other)
    assert [d.delay_s for d in a.delays[:2]] == pytest.approx([0.2, 0.2])
    assert [d.other for d in a.delays[2:]] == [None, None]
    told = [f.text for f in sentences(one, other)]
    assert "Axle 1: fell from 38 to 5.0 % at 8.0 s here; there 0.20 s later." in told
    assert any("at 20.0 s here, not there" in t for t in told)
    assert any("there, not here" in f.text for f in sentences(other, one))


def test_axles_that_one_story_lacks_are_named(config: Config) -> None:
    a, b = axle(adhesion(np.full(100, 30.0))), axle(adhesion(np.full(100, 30.0)), number=2)
    assert "Only the first has axle 2." in [f.text for f in sentences(story(config, a, b), story(config, a))]


def test_design_takes_the_place_of_the_configurations(config: Config, tmp_path: Path) -> None:
    copy = tmp_path / "other.design.json"
    copy.write_bytes(resources.DESIGN.read_bytes())
    assert with_design(config, copy).design_file == copy
    assert with_design(config, copy).design.checksum == config.design.checksum
    with pytest.raises(NotThere):
        with_design(config, tmp_path / "never.json")
