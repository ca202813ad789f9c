"""Whether a gyro and an accelerometer are the pair that they should be: on the rig's own wheelsets."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import butter, lfilter
from wrcd.estimator.doubts import (
    BANDS_HZ,
    IN_BOGIE,
    LAT,
    LONE,
    LOW,
    MIDDLE,
    Doubt,
    Evidence,
    dead_alone,
    doubts,
    reversed_odds,
)
from wrcd.estimator.identity import FOURTH_DIFFERENCE, Filters, Identity, Wiring

from sim_ecu.design.cases import command
from sim_ecu.physics.contact import CURVES
from sim_ecu.physics.sensors import SENSOR_SETS
from sim_ecu.physics.simulation import Axle, Simulation
from sim_ecu.physics.track import QUALITY, Track
from sim_ecu.physics.wheelset import LAT_ACCEL, YAW_RATE, Wheelset
from sim_ecu.play.scenario import rail_table
from wrcd.estimator.design import FloatArray

TICK_S = 0.005
NOISE = (3e-4, 0.01)
SPEED = 25.0
AXLES = 4


def played(seconds: float, sensors: str = "mems") -> FloatArray:
    """What the sensors of four wheelsets on tracks of their own say, (ticks, 2, 4): dry and wet, half utilised."""
    n, rng = round(seconds / TICK_S), np.random.default_rng(7)
    out = np.empty((n, 2, AXLES))
    for a in range(AXLES):
        rail = rail_table([(0.0, CURVES["AC"[a % 2]], 0.0, 0.0)])
        axle = Axle(rail, Track(QUALITY["poor"], 2_900_000_000 + a))
        drive = command(n, utilisation=np.full((n, 1), 0.4), limit_of_peak=1.3)
        y = Simulation(Wheelset(), [axle], SPEED, TICK_S).advance(drive, np.full(n, SPEED)).outputs[:, 0]
        s = SENSOR_SETS[sensors]
        out[:, 0, a] = s.yaw_rate.measure(y[:, YAW_RATE], rng)
        out[:, 1, a] = s.lat_accel.measure(y[:, LAT_ACCEL], rng)
    return out


@pytest.fixture(scope="module")
def sound() -> FloatArray:
    return played(30.0)


def own_noise(z: FloatArray, channel: int, times: float = 1.0) -> None:
    z[:, channel] = times * NOISE[channel] * np.random.default_rng(channel).standard_normal(z[:, channel].shape)


def history(z: FloatArray, identity: Identity | None = None) -> list[list[int]]:
    """The doubts (AXLES,) after every tick."""
    identity = identity or Identity(NOISE, TICK_S, AXLES)
    used, out = np.ones(AXLES, dtype=bool), []
    for tick in z:
        identity.step(tick, used, SPEED, ~used)
        out.append([int(d) for d in identity.doubt])
    return out


def test_the_filters_are_butterworths_and_leave_white_noise_its_power() -> None:
    z = np.random.default_rng(1).standard_normal((20_000, 2, 1))
    filters = Filters(TICK_S, 1)
    got = np.array([filters.step(x[None])[0] for x in z])
    for k, (low, high) in enumerate(BANDS_HZ):
        b, a = butter(1, high, fs=200) if low == 0 else butter(1, [low, high], "band", fs=200)
        want = lfilter(b, a, z, axis=0)
        gain = np.sqrt((lfilter(b, a, np.eye(1, 20_000)[0]) ** 2).sum())
        assert np.allclose(got[:, k], want / gain, atol=1e-9)
        assert np.mean(got[:, k] ** 2) == pytest.approx(1.0, rel=0.15)
    want = lfilter(FOURTH_DIFFERENCE, 1, z, axis=0) / np.sqrt(70)
    assert np.allclose(got[:, -1], want, atol=1e-9)


def test_a_sound_pair_is_never_doubted(sound: FloatArray) -> None:
    assert np.max(history(sound)) == Doubt.NONE


def test_better_and_noisier_sensors_than_the_designs_are_not_doubted(sound: FloatArray) -> None:
    assert np.max(history(played(12.0, "tactical"))) == Doubt.NONE
    more = np.sqrt(3) * np.array(NOISE)[:, None] * np.random.default_rng(3).standard_normal(sound.shape)
    assert np.max(history(sound + more)) == Doubt.NONE


def times(z: FloatArray, channel: int, factor: float) -> None:
    z[:, channel] *= factor


def swap(z: FloatArray) -> None:
    z[:, 1] = z[:, 1, ::-1].copy()


@pytest.mark.parametrize(
    ("fault", "expected", "within_s"),
    [
        (lambda z: times(z, 0, -1.0), Doubt.REVERSED, 3),  # clearly so, or beside a live one: within seconds
        (lambda z: own_noise(z, 0), Doubt.GYRO_DEAD, 3),
        (lambda z: own_noise(z, 1), Doubt.ACCEL_SMALL, 3),
        (swap, Doubt.UNRELATED, 10),
        (lambda z: times(z, 1, 1 / 9.81), Doubt.ACCEL_SMALL, 10),  # in g
        (lambda z: times(z, 0, 57.3), Doubt.ACCEL_SMALL, 10),  # the gyro in degrees
    ],
    ids=["reversed", "gyro dead", "accelerometer dead", "swapped wires", "accelerometer in g", "gyro in degrees"],
)
def test_a_wrong_pair_is_found_within_ten_seconds(
    sound: FloatArray, fault: Callable[[FloatArray], None], expected: Doubt, within_s: int
) -> None:
    z = sound[:2000].copy()
    fault(z)
    doubts = history(z)
    assert doubts[-1] == [expected] * AXLES
    if within_s < 10:
        assert all(any(row[axle] == expected for row in doubts[: 200 * within_s]) for axle in range(AXLES))
    else:
        assert not np.any(doubts[:1600])


@pytest.mark.parametrize("factor", [1.0, 2.0])
def test_dead_sensors_are_doubted_from_the_first_window_on(sound: FloatArray, factor: float) -> None:
    z = sound[:2400].copy()
    own_noise(z, 0, factor)
    own_noise(z, 1, factor)
    doubts = np.array(history(z))
    assert np.all(doubts[199:] == Doubt.SILENT)


def test_dying_sensors_are_doubted_and_trusted_again_within_1500_ms(sound: FloatArray) -> None:
    z, dies, lives = sound[:4000].copy(), 1130, 1930
    for channel in (0, 1):
        dead = z[dies:lives]
        own_noise(dead, channel)
        dead[:, channel] += 3 * NOISE[channel]  # with another bias
    doubts = np.array(history(z))
    assert not doubts[:dies].any()
    assert np.all(doubts[dies + 300 : lives] == Doubt.SILENT)
    assert np.all(doubts[lives + 500 : lives + 600] != Doubt.SILENT)


@pytest.mark.parametrize(("channel", "expected"), [(0, Doubt.GYRO_DEAD), (1, Doubt.ACCEL_SMALL)])
def test_sensor_that_dies_beside_a_live_one_is_doubted_within_two_seconds(
    sound: FloatArray, channel: int, expected: Doubt
) -> None:
    z, dies, lives = sound[:3000].copy(), 1130, 1700  # too short for the tests that look back for ten seconds
    own_noise(z[dies:lives], channel)
    doubts = np.array(history(z))
    assert not doubts[:dies].any()
    assert np.all(doubts[dies + 400 : lives] == expected)
    assert not doubts[lives + 700 :].any()


@pytest.fixture(scope="module")
def train() -> FloatArray:
    """What the sensors of three axles on one track say, 2.5 m behind each other, (ticks, 2, 3)."""
    n, rng = round(12.0 / TICK_S), np.random.default_rng(8)
    drive = command(n, utilisation=np.full((n, 1), 0.4), limit_of_peak=1.3)
    rail, track = rail_table([(0.0, CURVES["C"], 0.0, 0.0)]), (QUALITY["poor"], 2_900_000_010, 10.0)
    s, out = SENSOR_SETS["mems"], []
    for place in (0.0, -2.5, -5.0):
        axle = Simulation(Wheelset(), [Axle(rail, Track(*track), place)], SPEED, TICK_S)
        y = axle.advance(drive, np.full(n, SPEED)).outputs[:, 0]
        out.append((s.yaw_rate.measure(y[:, YAW_RATE], rng), s.lat_accel.measure(y[:, LAT_ACCEL], rng)))
    return np.moveaxis(np.array(out), (0, 2), (2, 0))


@pytest.mark.parametrize("saturated", [False, True])
@pytest.mark.parametrize(
    ("wires", "doubted"),
    [((0, 1, 2), [0, 0, 0]), ((1, 0, 2), [1, 1, 0]), ((0, 2, 1), [0, 1, 1]), ((2, 0, 1), [1, 1, 1])],
)
def test_wires_swapped_between_neighbours_on_one_track_are_found(
    train: FloatArray, wires: tuple[int, ...], doubted: list[bool], saturated: bool
) -> None:
    """What the other axle feels is the same, a tenth of a second later: below 1.5 Hz that hardly shows."""
    identity, used = Identity(NOISE, TICK_S, 3), np.ones(3, dtype=bool)
    for z in train:
        identity.step(np.stack((z[0], z[1, list(wires)])), used, SPEED, used & saturated)
    assert [d == Doubt.UNRELATED for d in identity.doubt] == doubted


def test_wires_are_not_judged_by_seconds_that_a_gap_breaks(train: FloatArray) -> None:
    identity, used = Identity(NOISE, TICK_S, 3), np.ones(3, dtype=bool)
    for k, z in enumerate(train):
        if k % 150 == 100:  # once in every second, and in none between
            identity.reset(0)
        identity.step(np.stack((z[0], z[1, [1, 0, 2]])), used, SPEED, used)
    assert not np.any(identity.doubt)


def test_a_saturated_wheelset_is_no_unrelated_pair(sound: FloatArray) -> None:
    """It swings by itself: its yaw rate goes with no lateral acceleration. The other tests go on."""
    z, used = sound[:3000].copy(), np.ones(AXLES, dtype=bool)
    z[:, 1] = sound[3000:, 1]
    own_noise(z[..., 3:], 0)
    free, saturated = (Identity(NOISE, TICK_S, AXLES) for _ in range(2))
    for tick in z:
        free.step(tick, used, SPEED, ~used)
        saturated.step(tick, used, SPEED, used)
    assert Doubt.UNRELATED in free.doubt
    assert Doubt.UNRELATED not in saturated.doubt
    assert saturated.doubt[3] == Doubt.GYRO_DEAD


def test_doubt_outlives_a_gap_and_ends_after_as_long_with_a_right_pair(sound: FloatArray) -> None:
    z = sound.copy()
    z[:2000, 0] *= -1
    identity = Identity(NOISE, TICK_S, AXLES)
    assert history(z[:2000], identity)[-1] == [Doubt.REVERSED] * AXLES
    for axle in range(AXLES):
        identity.reset(axle)
    doubts = np.array(history(z[2000:], identity))
    assert np.all(doubts[:1000] != Doubt.NONE)  # half of what is looked at is still the wrong one
    assert np.all(doubts[3900:] == Doubt.NONE)


def test_axles_without_data_learn_nothing_and_disturb_nobody(sound: FloatArray) -> None:
    alone, other = Identity(NOISE, TICK_S, 1), Identity(NOISE, TICK_S, 2)
    z = sound[:2000, :, :2].copy()
    z[:, 0, 0] *= -1
    z[:, :, 1] = np.nan
    for tick in z:
        alone.step(tick[:, :1], np.ones(1, dtype=bool), SPEED, np.zeros(1, dtype=bool))
        other.step(tick, np.array([True, False]), SPEED, np.zeros(2, dtype=bool))
    assert list(alone.doubt) == [Doubt.REVERSED]
    assert list(other.doubt) == [Doubt.REVERSED, Doubt.NONE]


def test_identity_takes_any_number() -> None:
    identity, used = Identity(NOISE, TICK_S, 2), np.ones(2, dtype=bool)
    with np.errstate(all="raise", under="ignore"):
        for k in range(2500):
            z = np.array([[0.0, 1e300 * (-1) ** k], [0.0, -1e300]])
            identity.step(z, used, 0.0, np.zeros_like(used))
    assert identity.doubt[0] in list(Doubt)


STRAIGHT = np.zeros(10, dtype=bool)  # seconds of a pair without a curve


def at_correlations(low: FloatArray, middle: FloatArray) -> Evidence:
    """Seconds in which both sensors are loud, and go together so much."""
    seconds, bands = len(low), len(BANDS_HZ)
    return Evidence(
        power=np.full((seconds, bands, 2), 20.0), cross=20.0 * np.stack((low, middle, 0.0 * low), axis=1),
        variance=np.full((seconds, 2), 20.0), noise=np.ones((seconds, 2)),
        speed_m_s=np.full(seconds, 25.0), saturated=np.ones(seconds),
    )  # fmt: skip


@pytest.mark.parametrize("seconds", [1, 2, 4, 10])
def test_chance_correlations_of_a_saturated_pair_tell_no_sign(seconds: int) -> None:
    """The track drives it no more: what is left is noise about zero, whose mean is below -0.1 in every fourth case."""
    rng = np.random.default_rng(11)
    pairs = [at_correlations(*rng.normal(0.0, [[0.4], [0.2]], (2, seconds)).clip(-0.95, 0.95)) for _ in range(1000)]
    assert np.mean([reversed_odds(e, STRAIGHT[: len(e.cross)]) > LONE.reversed for e in pairs]) < 0.003


def test_few_coherent_seconds_among_saturated_ones_tell_the_sign() -> None:
    low, middle = np.array([0.6, -0.5] * 4 + [0.9, 0.8]), np.array([0.1, -0.2] * 4 + [0.8, 0.7])
    assert reversed_odds(at_correlations(low, middle), STRAIGHT) < 0.0
    low[8:], middle[8:] = -low[8:], -middle[8:]
    # eight seconds say that nothing can be told
    assert reversed_odds(at_correlations(low, middle), STRAIGHT) < LONE.reversed
    assert reversed_odds(at_correlations(low[8:], middle[8:]), STRAIGHT[8:]) > LONE.reversed


@pytest.mark.parametrize(("low_power", "found"), [(20.0, {Doubt.REVERSED}), (2000.0, set())], ids=["track", "curve"])
def test_where_a_canted_curve_begins_the_slow_band_tells_nothing(low_power: float, found: set[Doubt]) -> None:
    """On a low rail the two hardly go together; gravity alone may set them against each other below 1.5 Hz."""
    e = at_correlations(np.full(10, -0.8), np.zeros(10))
    e.power[:, LOW], e.cross[:, LOW] = low_power, -0.8 * low_power
    assert doubts(e, *NOISE, TICK_S, LONE) == found


@pytest.mark.parametrize(("saturated", "found"), [(0.5, {Doubt.GYRO_DEAD}), (1.0, set())])
def test_quiet_gyro_of_a_saturated_wheelset_is_not_called_dead(saturated: float, found: set[Doubt]) -> None:
    """Held at the peak it yaws no more, and its acceleration in 3 to 10 Hz is as large as a free one's."""
    e = at_correlations(np.zeros(10), np.zeros(10))
    e.power[:], e.variance[:], e.saturated[:] = 1.0, 1.0, saturated
    e.power[:, MIDDLE, LAT], e.variance[:, LAT] = 20.0, 3.0
    assert doubts(e, *NOISE, TICK_S, LONE) == found
    assert dead_alone(e.of(np.arange(10) == 0), *NOISE, LONE) == (Doubt.GYRO_DEAD if found else Doubt.NONE)


def test_pair_in_a_bogie_that_is_somewhat_against_itself_is_sound_and_one_that_is_wholly_so_is_reversed() -> None:
    """The primary suspension and the gravity of cross-level part the two; a lone one's bounds accuse such a pair."""
    somewhat, wholly = (at_correlations(np.full(10, r), np.full(10, r)) for r in (-0.3, -0.9))
    assert doubts(somewhat, *NOISE, TICK_S, IN_BOGIE) == set()
    assert doubts(somewhat, *NOISE, TICK_S, LONE)
    assert Doubt.REVERSED in doubts(wholly, *NOISE, TICK_S, IN_BOGIE)


def test_gyros_that_are_against_their_own_accelerometers_alone_are_no_other_axles() -> None:
    """So it is near the peak in a bogie. Each that goes with the other's accelerometer is."""
    rng = np.random.default_rng(1)
    for crossed in (False, True):
        wiring = Wiring(TICK_S, 2)
        for _ in range(10):
            gyro = rng.standard_normal((200, 2))
            accel = gyro[:, ::-1] if crossed else -gyro
            y = np.stack((gyro, accel + rng.standard_normal((200, 2))), axis=1)
            wiring.add(y, np.square(y).sum(axis=0), None)
        assert wiring.partners().tolist() == ([1, 0] if crossed else [-1, -1])
