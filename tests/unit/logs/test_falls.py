"""Falls and rises: found where a level changes for good, and nowhere else."""

import numpy as np
import pytest

from tests.support.story import BEGIN_US, DEGRADED, VALID, Ride, adhesion, axle
from wrcd.logs.story_events import falls_of
from wrcd.logs.story_records import Fall

RNG = np.random.default_rng(7)


def level(pct: float, seconds: float, noise_pp: float = 0.0) -> np.ndarray:
    return pct + noise_pp * RNG.standard_normal(round(50 * seconds))


def begin_s(f: Fall) -> float:
    return (f.begin_us - BEGIN_US) * 1e-6


def test_step_down_and_up_is_a_fall_and_a_rise() -> None:
    falls = falls_of(axle(adhesion(np.concatenate((level(38, 9, 0.5), level(5, 8, 0.2), level(38, 5, 0.5))))))
    assert [(round(f.before_pct), round(f.after_pct)) for f in falls] == [(38, 5), (5, 38)]
    assert [begin_s(f) for f in falls] == pytest.approx([9.0, 17.0], abs=0.05)
    assert all(f.end_us - f.begin_us <= 60_000 for f in falls)


@pytest.mark.parametrize("seed", range(20))
def test_noise_of_a_steady_rail_is_no_fall(seed: int) -> None:
    """Slow noise of the size that the interval states, as windows of a second give it."""
    rng = np.random.default_rng(seed)
    noise = np.convolve(rng.standard_normal(3050), np.ones(50) / 50**0.5, "valid")[:3000]
    assert falls_of(axle(adhesion(38.0 + 3.0 * noise, half=5.0))) == []


def test_step_within_the_intervals_is_no_fall() -> None:
    values = np.concatenate((level(38, 10, 0.3), level(32, 10, 0.3)))
    assert falls_of(axle(adhesion(values, half=5.0))) == []
    assert len(falls_of(axle(adhesion(values, half=1.0)))) == 1 - int(6 <= 0.2 * 38)


def test_slow_ramp_is_one_fall() -> None:
    ramp = np.linspace(38, 5, 200)
    (fall,) = falls_of(axle(adhesion(np.concatenate((level(38, 8, 0.3), ramp, level(5, 8, 0.1))))))
    assert (round(fall.before_pct), round(fall.after_pct)) == (38, 5)
    assert 2.5 <= (fall.end_us - fall.begin_us) * 1e-6 <= 4.5
    assert begin_s(fall) == pytest.approx(8.2, abs=0.5)


def test_what_is_not_valid_between_two_levels_belongs_to_the_fall() -> None:
    values = np.concatenate((level(38, 9, 0.3), level(20, 0.6), level(5, 8, 0.1)))
    validity = np.full(len(values), VALID)
    validity[450:480] = DEGRADED
    (fall,) = falls_of(axle(adhesion(values, validity)))
    assert (fall.end_us - fall.begin_us) * 1e-6 == pytest.approx(0.62, abs=0.05)
    assert begin_s(fall) == pytest.approx(9.0, abs=0.05)


def test_fall_to_a_low_level_ends_where_that_is_reached() -> None:
    values = np.concatenate((level(38, 9, 0.3), level(9.5, 0.6), level(2.8, 8, 0.05)))  # nearer to 3 than to 38
    (fall,) = falls_of(axle(adhesion(values)))
    assert (fall.end_us - fall.begin_us) * 1e-6 == pytest.approx(0.62, abs=0.05)


@pytest.mark.parametrize(
    ("levels", "validity"),
    [
        (((38, 10, 0.3), (5, 0.5, 0.0), (38, 10, 0.3)), VALID),  # a short dip
        (((38, 10, 0.0), (5, 10, 0.0)), [VALID] * 500 + [DEGRADED] * 500),
        (((38, 5, 0.0),), DEGRADED),
    ],
)
def test_what_does_not_last_or_is_not_valid_is_no_fall(
    levels: tuple[tuple[float, float, float], ...], validity: int | list[int]
) -> None:
    assert falls_of(axle(adhesion(np.concatenate([level(*x) for x in levels]), validity))) == []


def test_falls_of_a_ride_are_those_of_the_truth(ride: Ride) -> None:
    for story in (ride.estimated, ride.sent):
        down, up = story.falls
        true = story.axles[0].truth
        assert true is not None
        steps = np.flatnonzero(np.abs(np.diff(true.available_pct)) > 5)
        assert [f.begin_us for f in (down, up)] == pytest.approx(true.time_us[steps + 1].tolist(), abs=200_000)
        assert down.before_pct == pytest.approx(38.4, abs=4)
        assert down.after_pct == pytest.approx(2.7, abs=1)
        assert up.after_pct == pytest.approx(38.4, abs=4)
        assert (down.end_us - down.begin_us) < 800_000
