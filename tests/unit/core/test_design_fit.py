"""Whether a design is this train's, from calm running of a bogie: what is said, when it is not, and what the core makes
of it. That the figures are those of numpy's fit is in tests/oracle/test_design_fit.py."""

from collections.abc import Callable
from copy import deepcopy
from itertools import groupby

import numpy as np
import pytest

from tests.support.bogie_signals import OWN, TICK_S, Bogie, Ride, frames, ride
from tests.support.can_ids import ADHESION, WRCD_STATUS
from tests.support.core_state import of_core
from wrcd.bus.dbc import find_message
from wrcd.bus.frame import Frame
from wrcd.config.config import load_packaged
from wrcd.core.core import Core
from wrcd.core.reports import Made
from wrcd.core.vocabulary import FITS
from wrcd.fit.bogie import BogieConstants

YAW, DAMPER, GAMMA = "primary_yaw_N_m_rad", "secondary_yaw_damping_N_m_s_rad", "gamma"
UNSURE = FITS.index("Unsure")


def times(name: str, factor: float) -> BogieConstants:
    return OWN.changed({name: float(np.log(factor))})


def test_own_vehicle_is_like_the_design() -> None:
    for seed in range(3):
        b = Bogie().run(ride(seed=seed))
        assert b.word == "Like"
        assert b.of("ratio") < 12.0
        assert abs(b.of("bias_pp")) < 3.0 * b.of("bias_sigma_pp")


@pytest.mark.parametrize(
    ("name", "factor", "sign"), [(YAW, 2.0, -1), (YAW, 0.5, 1), (DAMPER, 5.0, -1), (DAMPER, 0.2, 1)]
)
def test_another_vehicle_is_unlike_and_told_by_what_and_which_way(name: str, factor: float, sign: int) -> None:
    """A stiffer bogie and a stronger damper make a design too low: see BIAS_PP."""
    b = Bogie().run(ride(times(name, factor)))
    assert b.word == "Unlike"
    assert np.sqrt(factor * b.times(name)) == pytest.approx(factor, rel=0.15)
    assert sign * b.of("bias_pp") > 2.0 * b.of("bias_sigma_pp") > 0.0


def test_conicity_within_the_scatter_of_worn_wheels_is_found_and_still_like() -> None:
    b = Bogie().run(ride(times(GAMMA, 1.5)))
    assert b.word == "Like"
    assert b.times(GAMMA) == pytest.approx(1.5, rel=0.1)
    assert b.of("bias_pp") > 2.0 * b.of("bias_sigma_pp")


@pytest.mark.parametrize("gain", [0.97, 1.03])
def test_gyro_that_reads_some_percent_off_is_no_other_bogie(gain: float) -> None:
    b = Bogie()
    for seed in range(4):
        r = ride(seed=seed)
        b.run(Ride(r.z * (gain, 1.0, 1.0, 1.0), r.speed_m_s))
        assert b.word == "Like"


@pytest.mark.parametrize("rms", [1e-120, 1e-9, 1e-5])
def test_signals_far_below_the_noise_say_nothing(rms: float) -> None:
    noise = np.random.default_rng(3).normal(0.0, rms, (48_000, 4))
    b = Bogie().run(Ride(noise, np.full(len(noise), 25.0)))
    assert (b.word, b.of("weight")) == ("Unknown", 0.0)
    assert b.run(ride()).word == "Like"
    assert np.isfinite(b.said).all()


def test_verdict_begins_after_twenty_stretches() -> None:
    """Of fourteen a block is complete; a second one is needed."""
    b, whole, said = Bogie(), ride(times(DAMPER, 5.0), (25.0,)), list[tuple[str, float]]()
    for at in range(0, 20_000, 100):
        b.run(whole.part(at, at + 100))
        said.append((b.word, float(b.of("weight"))))
    assert [of for of, _ in groupby(said)] == [
        ("Unknown", 0.0), ("Unknown", 14.0), ("Unlike", pytest.approx(14.0 + 14.0 * 0.99**14))
    ]  # fmt: skip


def test_verdict_goes_when_the_train_is_the_designs_again() -> None:
    """The sum forgets: a hundredth at each stretch."""
    b = Bogie().run(ride(times(YAW, 2.0), (25.0,)))
    assert b.word == "Unlike"
    words = [b.run(ride(seed=2 + k)).word for k in range(6)]
    assert words[-1] == "Like"


def too_short(r: Ride) -> Ride:
    return r.part(0, 7000)


def changing(r: Ride) -> Ride:
    """By a twelfth in 5.12 s."""
    return Ride(r.z, 10.0 * np.exp(np.arange(len(r.z)) * TICK_S / 60.0))


def curve(r: Ride) -> Ride:
    """To the left and to the right, of 1000 m."""
    z = r.z.copy()
    z[:, ::2] += (r.speed_m_s / 1000.0 * np.sin(2 * np.pi * np.arange(len(z)) * TICK_S / 7.0))[:, None]
    return Ride(z, r.speed_m_s)


def slow(r: Ride) -> Ride:
    return Ride(r.z, np.full_like(r.speed_m_s, 8.0))


def standing(r: Ride) -> Ride:
    return Ride(r.z, np.zeros_like(r.speed_m_s))


def one_signal(r: Ride) -> Ride:
    z = r.z.copy()
    z[:, 2] = np.nan
    return Ride(z, r.speed_m_s)


def joints(r: Ride) -> Ride:
    z = r.z.copy()
    z[::500, 1] += 3.0
    return Ride(z, r.speed_m_s)


@pytest.mark.parametrize("spoil", [too_short, changing, curve, slow, standing, one_signal, joints])
def test_what_is_not_calm_says_nothing(spoil: Callable[[Ride], Ride]) -> None:
    b = Bogie().run(spoil(ride(times(DAMPER, 5.0), (25.0, 20.0), seconds=60.0)))
    assert (b.word, b.said) == ("Unknown", (0.0, 0.0, 0.0, 0.0))


def test_gyros_zeros_are_no_curve() -> None:
    r = ride()
    assert Bogie().run(Ride(r.z + [0.02, 0.0, -0.01, 0.0], r.speed_m_s)).said == pytest.approx(
        Bogie().run(r).said, rel=0.02
    )


def test_few_missing_samples_change_little() -> None:
    """One of a hundred, each the one before it: less than what stretches may lack."""
    r = ride(times(YAW, 2.0))
    missing = np.random.default_rng(3).random(r.z.shape) < 0.01
    whole, holed = Bogie().run(r), Bogie().run(Ride(np.where(missing, np.nan, r.z), r.speed_m_s))
    assert holed.word == whole.word == "Unlike"
    assert holed.of("weight") == pytest.approx(whole.of("weight"), rel=0.02)
    assert holed.of("ratio") == pytest.approx(whole.of("ratio"), rel=0.2)
    assert holed.times(YAW) == pytest.approx(whole.times(YAW), rel=0.1)


def test_too_many_missing_samples_say_nothing() -> None:
    r = ride()
    missing = np.random.default_rng(3).random(r.z.shape) < 0.04
    assert Bogie().run(Ride(np.where(missing, np.nan, r.z), r.speed_m_s)).of("weight") == 0.0


def test_gap_of_ticks_ends_a_block_and_nothing_else() -> None:
    r, b = ride(times(YAW, 2.0), (25.0, 25.0)), Bogie()
    for at in range(0, len(r.z), 9000):
        b.run(r.part(at, at + 9000))
        b.tick += 37
    whole = Bogie().run(r)
    assert b.word == whole.word == "Unlike"
    assert b.of("weight") < whole.of("weight")
    assert b.times(YAW) == pytest.approx(whole.times(YAW), rel=0.2)


@pytest.mark.parametrize("at", [3000, 9000, 17_001])
def test_copy_goes_on_to_the_same_bits(at: int) -> None:
    r = ride(times(DAMPER, 5.0), (25.0, 20.0), seconds=60.0)
    b = Bogie().run(r.part(0, at))
    twin = b.copy().run(r.part(at))
    assert b.state.tobytes() != twin.state.tobytes()
    assert b.run(r.part(at)).state.tobytes() == twin.state.tobytes()


def test_stretch_by_stretch_is_the_same_as_at_once() -> None:
    r, b = ride(speeds_m_s=(25.0,), seconds=60.0), Bogie()
    for at in range(0, len(r.z), 777):
        b.run(r.part(at, at + 777))
    assert b.state.tobytes() == Bogie().run(r).state.tobytes()


def test_train_that_turns_round_keeps_what_was_said_and_begins_anew() -> None:
    r = ride(times(DAMPER, 5.0), (25.0,))
    b = Bogie().run(r)
    assert b.word == "Unlike"
    before, free = b.said, b.of("free").copy()
    b.step(r.z[0], 25.0, is_reverse=True)
    assert (b.word, b.said[:3], b.of("weight")) == ("Unlike", before[:3], 0.0)
    np.testing.assert_array_equal(b.of("free"), free)
    assert not b.information.any()
    fresh = Bogie()
    fresh.step(r.z[0], 25.0, is_reverse=True)
    kept = ("ratio", "bias_pp", "bias_sigma_pp", "incoherence", "free", "verdict", "newest_tick")
    for name in set(b.state.dtype.names or ()) - set(kept):
        np.testing.assert_array_equal(b.of(name), fresh.of(name), err_msg=name)


def test_train_that_goes_on_backwards_is_told_anew_after_twenty_stretches() -> None:
    """Until then word and figures are those of before."""
    b, own = Bogie().run(ride(times(DAMPER, 5.0), (25.0,))), ride(speeds_m_s=(25.0,), seconds=90.0)
    before = b.said[:3]
    said = list[tuple[str, bool, float]]()
    for z in own.z:
        b.step(z, 25.0, is_reverse=True)
        said.append((b.word, b.said[:3] == before, float(b.of("weight"))))
    assert [of for of, _ in groupby(said)][:2] == [("Unlike", True, 0.0), ("Unlike", True, 14.0)]
    assert said[-1][:2] == ("Like", False)
    assert b.of("is_reverse") == 1


HUGE, TINY = 1e300, 5e-324


@pytest.mark.parametrize("before", [0, 10_000, 24_000])
@pytest.mark.parametrize("value", [0.0, TINY, 1e6, 1e150, HUGE, -HUGE, np.inf, "alternating"])
def test_absurd_values_say_nothing_and_no_figure_is_ever_nan(before: int, value: float | str) -> None:
    """For a minute, then every third: where that is a 0 the others still tell what the vehicle is."""
    r = ride(times(DAMPER, 5.0), (25.0,))
    b = Bogie().run(r.part(0, before))
    word, n = b.word, 12_000
    z = np.full((n, 4), value if isinstance(value, float) else HUGE)
    if value == "alternating":
        z[::2] *= -1.0
    b.run(Ride(z, np.full(n, 25.0)), np.ones(z.shape, bool))
    b.run(Ride(np.where(np.arange(n)[:, None] % 3, r.z[:n], z), np.full(n, 25.0)), np.ones(z.shape, bool))
    assert b.word in ((word, "Unlike") if value in (0.0, TINY) else (word,))
    assert np.isfinite(b.said).all()
    assert np.isfinite(b.of("free")).all()
    assert np.isfinite(b.information).all()


@pytest.mark.parametrize("speed_m_s", [np.nan, np.inf, -25.0, 1e-300, 1e300])
def test_absurd_speeds_say_nothing(speed_m_s: float) -> None:
    r = ride(speeds_m_s=(25.0,), seconds=60.0)
    b = Bogie().run(Ride(r.z, np.full(len(r.z), speed_m_s)))
    assert (b.word, b.said) == ("Unknown", (0.0, 0.0, 0.0, 0.0))
    assert np.isfinite(b.of("cross")).all()


def test_after_absurd_values_and_a_gap_calm_running_tells_as_before() -> None:
    r = ride(times(DAMPER, 5.0))
    b = Bogie().run(Ride(np.full((3000, 4), HUGE), np.full(3000, 25.0)))
    b.tick += 1
    assert b.run(r).word == "Unlike"


# through the core


class Played:
    """A core of two axles after a minute and a half of a bogie's frames, and what it sent."""

    def __init__(self, c: BogieConstants) -> None:
        self.core, self.made = Core(load_packaged(2)), list[Made]()
        z = ride(c, (25.0,), seconds=90.0)
        self.frames = frames(z)
        self.feed(self.frames[:-400])

    def feed(self, part: list[Frame]) -> None:
        self.made.append(self.core.feed(part))

    def words(self) -> list[str]:
        message = find_message(self.core.config.database, "WrcdStatus")
        rows = [message.decode(o.frame.data) for made in self.made for o in made if o.frame.can_id == WRCD_STATUS]
        return [str(row["DesignFit"]) for row in rows if isinstance(row, dict)]


@pytest.fixture(scope="module")
def stiff() -> Played:
    return Played(times(YAW, 2.0))


def test_status_tells_the_verdict(stiff: Played) -> None:
    assert [word for word, _ in groupby(stiff.words())] == ["Unknown", "Unlike"]


def test_core_sees_what_the_bogie_alone_does(stiff: Played) -> None:
    """But for the steps of the signals on the bus, and what it leaves out while it begins."""
    (fit,) = stiff.core.design_fits
    b = Bogie().run(ride(times(YAW, 2.0), (25.0,), seconds=90.0))
    assert (fit.axles, fit.word, fit.stretches) == ((1, 2), "Unlike", b.of("weight"))
    assert fit.ratio == pytest.approx(b.of("ratio"), rel=0.1)
    assert fit.times[YAW] == pytest.approx(b.times(YAW), rel=0.05)


def test_interval_is_wider_while_the_design_is_another_bogies(stiff: Played) -> None:
    wide, narrow = deepcopy(stiff.core), deepcopy(stiff.core)
    narrow._train.state["bogie_state"]["verdict"] = UNSURE
    bogie = wide._train.state["bogie_state"][0].copy()
    for core in (wide, narrow):
        core.feed(stiff.frames[-400:])
    widths = [core._reports["estimate"]["half_width_pp"] for core in (wide, narrow)]
    assert wide._reports["has_estimate"].tolist() == [1, 1]
    np.testing.assert_allclose(widths[0], 1.5 * widths[1] + abs(bogie["bias_pp"]) + 1.645 * bogie["bias_sigma_pp"])
    assert (widths[1] > 0.0).all()
    for name in ("mu_available_pct", "mu_used_pct", "validity", "cause"):
        np.testing.assert_array_equal(wide._reports[name], narrow._reports[name], err_msg=name)


@pytest.mark.parametrize(("sums", "is_wider"), [((8.0, 1.0, 0.13), False), ((8.0, 5.6, 3.92), True)])
def test_of_what_bogie_and_slides_say_of_the_interval_the_wider_holds(
    stiff: Played, sums: tuple[float, float, float], is_wider: bool
) -> None:
    """They may tell of the same bias."""
    both, unlike = deepcopy(stiff.core), deepcopy(stiff.core)
    slides = deepcopy(stiff.core)
    slides._train.state["bogie_state"]["verdict"] = UNSURE
    for core in (both, slides):
        core.estimator.take_slides(sums)
        assert core.estimator.slides[3] > 0.0
    for core in (both, unlike, slides):
        core.feed(stiff.frames[-400:])
    widths = [core._reports["estimate"]["half_width_pp"] for core in (both, unlike, slides)]
    np.testing.assert_allclose(widths[0], np.maximum(*widths[1:]))
    np.testing.assert_allclose(widths[0], widths[2 if is_wider else 1])


def test_copy_of_the_core_goes_on_alike(stiff: Played) -> None:
    one, twin = deepcopy(stiff.core), deepcopy(stiff.core)
    assert twin.design_fits == stiff.core.design_fits
    sent = [[o.frame for o in core.feed(stiff.frames[-400:])] for core in (one, twin)]
    assert sent[0] == sent[1]
    assert any(f.can_id in ADHESION.values() for f in sent[0])
    assert of_core(one) == of_core(twin) != of_core(stiff.core)


def test_sentence_is_for_a_person(stiff: Played) -> None:
    (fit,) = stiff.core.design_fits
    assert fit.sentence.startswith("axles 1 and 2: the design is another bogie's (likelihood ratio ")
    assert "primary yaw stiffness x 2" in fit.sentence
    assert fit.sentence.endswith(f"adhesion is about {-fit.bias_pp:.1f} points too low here")


def test_core_that_takes_over_what_another_knows_says_the_same_of_every_bogie(stiff: Played) -> None:
    core, (fit,) = Core(load_packaged(4)), stiff.core.design_fits
    core.take_design_fit(stiff.core)
    assert [(f.word, f.ratio, f.bias_pp) for f in core.design_fits] == [(fit.word, fit.ratio, fit.bias_pp)] * 2


def test_design_of_a_lone_wheelset_says_nothing() -> None:
    core = Core(load_packaged(2, "lone-wheelset"))
    assert core.design_fits == ()
    assert core._tables["fit"]["ticks"] == 0


def test_of_axles_each_two_are_a_bogie_and_one_left_over_is_none() -> None:
    assert [len(Core(load_packaged(n)).design_fits) for n in (1, 2, 3, 4)] == [0, 1, 1, 2]
    first, second = Core(load_packaged(4)).design_fits
    assert (first.axles, second.axles) == ((1, 2), (3, 4))
    assert first.sentence == "axles 1 and 2: too little calm running to tell whether the design is this train's"
