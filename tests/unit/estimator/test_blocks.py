"""Blocks of ticks stepped at once give what tick by tick gives, but for rounding."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from tests.support.signals import hunting, measured
from wrcd.estimator.bank import Bank
from wrcd.estimator.design import Design, FloatArray, load_design
from wrcd.estimator.estimator import Estimator, step_through
from wrcd.estimator.gate import Gate
from wrcd.estimator.identity import Identity
from wrcd.estimator.joints import Joints
from wrcd.estimator.noise import NoiseLevel
from wrcd.estimator.offset import Offset
from wrcd.estimator.records import Estimate, StepResult, Ticks
from wrcd.estimator.recursion import MAX_TICKS, exponential, smoothed
from wrcd.estimator.sections import Sections
from wrcd.estimator.window import BLOCK_TICKS, LAG, Window
from wrcd.recorder.state import capture
from wrcd.resources import DESIGN

RTOL = 1e-9
PER_S = 200
SETTLED = 3 * PER_S  # ticks after which every running mean is settled
NOISE = (3e-4, 0.01)
SPEED = 25.0
ALL_OF_TWO = np.ones(2, dtype=bool)


@pytest.fixture(scope="module")
def design() -> Design:
    return load_design(DESIGN)


class TickByTick(Estimator):
    """Never steps a block at once."""

    def _step_settled(self, ticks: Ticks, first: int) -> StepResult | None:
        return None


class Counting(Estimator):
    """Counts the ticks of blocks that were stepped at once, and the blocks that were taken back."""

    at_once = taken_back = 0

    def _step_settled(self, ticks: Ticks, first: int) -> StepResult | None:
        result = super()._step_settled(ticks, first)
        self.at_once += 0 if result is None else len(result)
        self.taken_back += result is None
        return result


def assert_close(a: object, b: object, where: str = "") -> None:
    """Two captured states, or parts of them."""
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        assert a.keys() == b.keys(), where
        for key in a:
            assert_close(a[key], b[key], f"{where}.{key}")
    elif isinstance(a, list) and isinstance(b, list):
        assert len(a) == len(b), where
        for i, (x, y) in enumerate(zip(a, b, strict=True)):
            assert_close(x, y, f"{where}[{i}]")
    elif isinstance(a, np.ndarray) and a.dtype.kind != "f":
        np.testing.assert_array_equal(a, b, err_msg=where)
    elif isinstance(a, (np.ndarray, float)):
        finite = np.abs(np.asarray(a))[np.isfinite(a)]
        scale = float(finite.max(initial=0.0))
        np.testing.assert_allclose(a, np.asarray(b), rtol=RTOL, atol=RTOL * scale, err_msg=where)
    else:
        assert a == b, where


def state(estimator: Estimator) -> dict[str, Any]:
    """Without the samples of the noise level from before a gap: no difference is made of them."""
    out = capture(estimator)
    noise = out["noise"]
    age = np.arange(len(noise["past_samples"]))[::-1, None, None]
    noise["past_samples"] = np.where(age < noise["ticks_without_gap"], noise["past_samples"], 0.0)
    return out


def assert_same_estimate(a: Estimate, b: Estimate) -> None:
    for f in fields(Estimate):
        assert_close(getattr(a, f.name), getattr(b, f.name), f.name)


def tracks(axles: int) -> FloatArray:
    """z (ticks, 2, n) of axles on tracks and rails of their own."""
    return np.stack([measured("BDAC"[a], 1_500.0, seconds=26.0, seed=a) for a in range(axles)], axis=2)


class Messy:
    """Ticks of some axles on which much happens, and which axles are reset before which tick."""

    def __init__(self, axles: int, seed: int, number: int = 1001, seconds: float = 26.0) -> None:
        rng = np.random.default_rng(seed)
        n = round(seconds * PER_S)
        z = tracks(axles)[:n].copy()
        present = np.ones((n, 2, axles), dtype=bool)
        ratio = np.tile(np.linspace(0.12, 0.16, axles), (n, 1)) + 0.001 * rng.standard_normal((n, axles))
        self.resets: dict[int, list[int]] = {}
        first, last = 0, axles - 1
        # joints on the first axle, and vibration that is above the band for a while
        for k in range(4 * PER_S + 1, 8 * PER_S, 343):
            z[k : k + 6, 1, first] += 1.5 * np.sin(2 * np.pi * (np.arange(6) + 0.5) / 6)
        z[1500:1530, 1] += 0.03 * rng.standard_normal((30, axles))
        # single measurements and both are lost
        present[9 * PER_S : 10 * PER_S] &= rng.random((PER_S, 2, axles)) > 0.03
        present[2107:2110, :, last] = False
        ratio[2215:2222, first] = np.nan
        # outliers: one, and so many that the axle needs a reset
        z[2301, 0, last] += 0.5
        z[2402, 1, first] -= 9.0
        z[2607:2613, 0, first] += 0.4
        # torque and rail change
        ratio[3403:] += 0.06
        z[4002:] *= 1.7
        # a reset within a block while the axle goes on, and one for a standstill
        self.resets[2703] = [last]
        if axles > 1:
            present[3602:3809, :, last] = False
            self.resets[3602] = [last]
            present[: SETTLED + 3, :, 1] = False
        z[~present] = np.nan
        speed = np.repeat(SPEED + np.cumsum(0.02 * rng.standard_normal(n // 4)), 4)
        self.ticks = Ticks(number, z, present, ratio, speed.tolist())

    def run(self, estimator: Estimator) -> Iterator[StepResult]:
        """As the core does: block by block, no further than a reset."""
        ticks, at = self.ticks, 0
        while at < len(ticks):
            for axle in self.resets.get(at, ()):
                estimator.reset(axle)
            end = at + 1
            while end < len(ticks) and end not in self.resets and not estimator.block_end(ticks.number + end - 1):
                end += 1
            result = estimator.step(ticks.part(0, end), at)
            for axle in np.flatnonzero(result.needs_reset).tolist():
                estimator.reset(axle)
            yield result
            at += len(result)


def ends(messy: Messy, estimator: Estimator, every: int = 25) -> Iterator[tuple[dict[str, Any], Estimate]]:
    """State and estimate at the end of every so many blocks."""
    number = messy.ticks.number
    for result in messy.run(estimator):
        number += len(result)
        if number % (every * BLOCK_TICKS) == 0:
            yield state(estimator), estimator.estimate()


@pytest.mark.parametrize(("axles", "number"), [(1, 1000), (1, 1001), (4, 1002), (4, 1003)])
def test_blocks_and_ticks_give_the_same_state_and_estimate(design: Design, axles: int, number: int) -> None:
    messy, fast, slow = Messy(axles, 11 * axles, number), Counting(design, axles), TickByTick(design, axles)
    compared = 0
    for (a, one), (b, other) in zip(ends(messy, fast), ends(messy, slow), strict=True):
        assert_close(a, b)
        assert_same_estimate(one, other)
        compared += 1
    assert compared > 45
    assert fast.outliers == slow.outliers > 4
    assert fast.at_once > 0.15 * len(messy.ticks)
    assert fast.taken_back > 100


@pytest.mark.parametrize("axles", [1, 4])
def test_blocks_and_ticks_give_the_same_step_results(design: Design, axles: int) -> None:
    messy = Messy(axles, 5)
    runs = [list(messy.run(kind(design, axles))) for kind in (Counting, TickByTick)]
    for f in fields(StepResult):
        if f.name == "needs_reset":
            together = [[r.needs_reset.tolist() for r in run if r.needs_reset.any()] for run in runs]
            assert together[0] == together[1] != []
        else:
            a, b = (np.concatenate([getattr(r, f.name) for r in run]) for run in runs)
            assert_close(a, b, f.name)
    for name in ("near_pulse", "outliers"):
        assert any(getattr(r, name).any() for r in runs[0])
    assert max(map(len, runs[0])) == BLOCK_TICKS
    assert max(map(len, runs[1])) == 1


def test_blocks_and_ticks_give_the_same_for_a_hunting_wheelset(design: Design) -> None:
    fast, slow = Counting(design, 1), TickByTick(design, 1)
    stops = range(BLOCK_TICKS - 1, len(hunting()), 25 * BLOCK_TICKS)
    for _ in zip(*(step_through(estimator, hunting(), stops) for estimator in (fast, slow)), strict=True):
        assert_close(state(fast), state(slow))
        assert_same_estimate(fast.estimate(), slow.estimate())
    assert fast.at_once > 0


@pytest.mark.parametrize("axles", [1, 4])
def test_blocks_of_a_track_are_stepped_at_once(design: Design, axles: int) -> None:
    z = tracks(axles)[: 12 * PER_S]
    ratio = np.full((len(z), axles), 0.136)
    ticks = Ticks(0, z, np.ones(z.shape, dtype=bool), ratio, [SPEED] * len(z))
    estimator = Counting(design, axles)
    list(step_through(estimator, ticks.part(0, SETTLED)))
    estimator.at_once = estimator.taken_back = 0
    list(step_through(estimator, ticks.part(SETTLED, len(ticks))))
    assert estimator.at_once > 0.98 * (len(ticks) - SETTLED)
    assert estimator.taken_back <= 0.02 * (len(ticks) - SETTLED)


def test_blocks_are_stepped_at_once_beside_an_axle_that_does_not_run(design: Design) -> None:
    z = tracks(3)[: 8 * PER_S].copy()
    present = np.ones(z.shape, dtype=bool)
    present[:, :, 1] = False
    z[~present] = np.nan
    ticks = Ticks(0, z, present, np.full((len(z), 3), 0.136), [SPEED] * len(z))
    fast, slow = Counting(design, 3), TickByTick(design, 3)
    for estimator in (fast, slow):
        list(step_through(estimator, ticks))
    assert fast.at_once > 0.98 * (len(ticks) - SETTLED)
    assert_close(state(fast), state(slow))
    assert not fast.started[1]


@pytest.mark.parametrize("what", ["pulse", "outlier", "gap", "jump"])
@pytest.mark.parametrize("at", range(BLOCK_TICKS))
def test_a_block_that_is_taken_back_leaves_nothing(design: Design, what: str, at: int) -> None:
    z = tracks(1)[: 4 * PER_S + BLOCK_TICKS].copy()
    present = np.ones(z.shape, dtype=bool)
    k = 4 * PER_S + at
    if what == "pulse":
        z[k, 1] += 2.0
    elif what == "outlier":
        z[k, 1] -= 9.0
    elif what == "gap":
        present[k, 0] = False
    else:
        z[k, 0] += 0.09
    ticks = Ticks(0, z, present, np.full((len(z), 1), 0.136), [SPEED] * len(z))
    estimator = Counting(design, 1)
    list(step_through(estimator, ticks.part(0, 4 * PER_S)))
    assert estimator.at_once > PER_S
    before = capture(estimator)
    assert estimator._step_settled(ticks, 4 * PER_S) is None
    assert repr(capture(estimator)) == repr(before)
    assert len(estimator.step(ticks, 4 * PER_S)) == 1


def test_step_through_stops_where_it_is_asked_to(design: Design) -> None:
    z = tracks(1)[: 4 * PER_S]
    ratio = np.linspace(0.1, 0.15, len(z))[:, None]
    ticks = Ticks(7, z, np.ones(z.shape, dtype=bool), ratio, [SPEED] * len(z))
    fast, slow = Counting(design, 1), TickByTick(design, 1)
    stops = [3, 602, 603, 700]
    found = [(k, fast.torque_now()[0]) for k in step_through(fast, ticks, stops)]
    assert [k for k, _ in found] == [*stops, len(ticks) - 1]
    first = 0
    for k, ratio in found:
        for at in range(first, k + 1):
            slow.step(ticks.part(at, at + 1))
        first = k + 1
        assert_close(slow.torque_now()[0], ratio)
    assert_close(state(fast), state(slow))


def steps(z: Sequence[Any] | FloatArray, sizes: Iterable[int] = (4, 3, 1, 4, 2)) -> Iterator[slice]:
    """Parts of z of a few ticks each."""
    at, sizes = 0, list(sizes)
    while at < len(z):
        for m in sizes:
            if at < len(z):
                yield slice(at, min(at + m, len(z)))
            at += m


def white(ticks: int, axles: int = 2, seed: int = 3) -> FloatArray:
    rng = np.random.default_rng(seed)
    return np.asarray(np.array(NOISE)[:, None] * rng.standard_normal((ticks, 2, axles)) + [[0.01], [0.4]])


def test_smoothed_is_a_running_mean() -> None:
    rng, gain = np.random.default_rng(1), 0.07
    matrices = exponential(gain)
    for m in range(1, MAX_TICKS + 1):
        before, values = rng.standard_normal((3, 2)), rng.standard_normal((m, 3, 2))
        expected = [before]
        for x in values:
            expected.append(expected[-1] + gain * (x - expected[-1]))
        assert_close(smoothed(matrices, before, values), np.array(expected))


def test_offset_takes_blocks() -> None:
    z, yes = white(900), np.ones((2, 2), dtype=bool)
    fast, slow = Offset(400, 2), Offset(400, 2)
    for row in z[:400]:
        fast.step(row, yes)
        slow.step(row, yes)
    assert fast.settled.all()
    for part in steps(z[400:]):
        got = fast.step_settled(z[400:][part])
        assert_close(got, np.array([slow.step(row, yes) for row in z[400:][part]]))
    assert_close(capture(fast), capture(slow))


def test_noise_level_takes_blocks() -> None:
    z = white(1200)
    z[700::90, 1, 0] += 0.5  # a power that counts in part
    fast, slow = NoiseLevel(np.array(NOISE), 2), NoiseLevel(np.array(NOISE), 2)
    for row in z[:500]:
        fast.step(row, ALL_OF_TWO)
        slow.step(row, ALL_OF_TWO)
    assert fast.settled.all()
    for part in steps(z[500:]):
        fast.step_settled(z[500:][part])
        for row in z[500:][part]:
            slow.step(row, ALL_OF_TWO)
        assert_close(capture(fast), capture(slow))


def test_joints_take_blocks_without_a_pulse(design: Design) -> None:
    """Squares that count in part are among them; with a pulse among them nothing is to be believed."""
    a = white(3000, seed=8)[:, 1]
    rms = NOISE[1]
    a[800::70] += 3.5 * rms
    a[2503, 1] += 1.0
    fast, slow = Joints(design.highpass, rms, 2), Joints(design.highpass, rms, 2)
    for row in a[:500]:
        fast.step(row, ALL_OF_TWO)
        slow.step(row, ALL_OF_TWO)
    assert fast.settled.all()
    taken_back = 0
    for part in steps(a[500:2600]):
        rows, before = a[500:2600][part], fast.checkpoint()
        pulses = [slow.step(row, ALL_OF_TWO)[0] for row in rows]
        usual = fast.settled.all() and fast.step_settled(rows)
        assert not (usual and np.any(pulses))
        if not usual:
            fast.rollback(before)
            taken_back += 1
            for row in rows:
                fast.step(row, ALL_OF_TWO)
        assert_close(capture(fast), capture(slow))
    assert 1 <= taken_back < 20


def test_gate_takes_blocks_of_usual_innovations() -> None:
    rng = np.random.default_rng(9)
    e, yaw = rng.standard_normal((700, 4, 2, 2)), 0.005 * rng.standard_normal((700, 2))
    none = np.zeros((2, 2), dtype=bool)
    fast, slow = Gate(2), Gate(2)
    for k in range(200):
        for gate in (fast, slow):
            gate.learn(e[k], yaw[k], ALL_OF_TWO, none)
    assert fast.settled.all()
    for part in steps(e[200:]):
        assert fast.step_settled(e[200:][part], yaw[200:][part], None)
        for x, y in zip(e[200:][part], yaw[200:][part], strict=True):
            assert not slow.outliers(x, y, ALL_OF_TWO).any()
            slow.learn(x, y, ALL_OF_TWO, none)
        assert_close(capture(fast), capture(slow))


@pytest.mark.parametrize("at", range(BLOCK_TICKS))
@pytest.mark.parametrize("channel", [0, 1])
def test_gate_learns_nothing_from_a_block_with_an_outlier(at: int, channel: int) -> None:
    rng = np.random.default_rng(9)
    e, yaw = rng.standard_normal((204, 4, 2, 2)), np.zeros((204, 2))
    gate, none = Gate(2), np.zeros((2, 2), dtype=bool)
    for k in range(200):
        gate.learn(e[k], yaw[k], ALL_OF_TWO, none)
    before = repr(capture(gate))
    e[200 + at, :, channel, 1] = 9.0
    assert not gate.step_settled(e[200:], yaw[200:], None)
    assert repr(capture(gate)) == before
    # who is exempt is neither judged nor learnt from
    assert gate.step_settled(e[200:], yaw[200:], np.array([False, True]))
    alone = Gate(1)
    for k in range(204):
        alone.learn(e[k, ..., :1], yaw[k, :1], ALL_OF_TWO[:1], none[:, :1])
    assert_close(gate._power[..., :1], alone._power)


def test_bank_steps_blocks_at_speeds_that_move(design: Design) -> None:
    z, yes = white(400), np.ones((2, 2), dtype=bool)
    speeds = np.linspace(2.0, 61.0, len(z)).tolist()
    fast, slow = Bank(design, 2), Bank(design, 2)
    for part in steps(z):
        e, w = fast.step_all(z[part], speeds[part])
        expected = [slow.step(row, yes, v) for row, v in zip(z[part], speeds[part], strict=True)]
        assert_close(e, np.array([x for x, _ in expected]))
        assert_close(w, np.array([x for _, x in expected]))
    assert_close(capture(fast), capture(slow))


def test_sections_filter_blocks(design: Design) -> None:
    u = np.random.default_rng(2).standard_normal((500, 3, 2))
    for sos in (design.lowpass, design.highpass):
        fast, slow = Sections(sos, 3, 2), Sections(sos, 3, 2)
        for part in steps(u):
            assert_close(fast.step(u[part]), np.concatenate([slow.step(x[None]) for x in u[part]]))
        assert_close(capture(fast), capture(slow))


@pytest.mark.parametrize("phase", range(BLOCK_TICKS))
@pytest.mark.parametrize("idle", [False, True])
def test_identity_sums_up_blocks_that_end_within_its_own(phase: int, idle: bool) -> None:
    """Its blocks are of 50 ticks and the wiring's seconds of 200: with any phase to the ticks stepped at once."""
    z = tracks(3)[:3200].copy()
    z[:, 0, 0] *= -1.0  # the wrong way round: there is something to judge
    used = np.array([True, not idle, True])
    saturated = np.array([False, False, True])
    fast, slow = Identity(NOISE, 0.005, 3), Identity(NOISE, 0.005, 3)
    begin = 400 + phase
    z[:, :, ~used] = 0.0
    for row in z[:begin]:
        for identity in (fast, slow):
            identity.step(row, used, SPEED, saturated)
    assert fast.settled[used].all()
    within, found = set(), set()
    for at in range(begin, len(z) - BLOCK_TICKS, BLOCK_TICKS):
        rows = z[at : at + BLOCK_TICKS]
        speeds = [SPEED + 0.01 * (at + k) for k in range(BLOCK_TICKS)]
        filled = slow._filled[0]
        fast.step_settled(rows, used if idle else None, speeds, saturated)
        for k, row in enumerate(rows):
            slow.step(row, used, speeds[k], saturated)
            if slow._filled[0] > filled:
                filled = slow._filled[0]
                within.add(k)
        assert fast.doubt.tolist() == slow.doubt.tolist()
        found |= set(fast.doubt.tolist())
        assert_close(capture(fast), capture(slow))
    assert len(within) == 2  # 50 is no multiple of 4
    assert len(found) > 1
    assert np.isfinite(fast._wiring._seconds[:, 0, 0]).all()


def test_reset_axle_beside_a_running_one_begins_as_a_new_one() -> None:
    """Whatever it said before: what is idle while blocks are stepped stays at rest."""
    z = white(2400, 2) + np.array([[0.3], [5.0]])
    used, both = np.array([True, False]), ALL_OF_TWO
    old, new = Identity(NOISE, 0.005, 2), Identity(NOISE, 0.005, 2)
    for row in z[:500]:
        old.step(row, both, SPEED, ~both)
        new.step(row, used, SPEED, ~both)
    old.reset(1)
    for part in steps(z[500:1300]):
        rows = np.where(used, z[500:1300][part], 0.0)
        for identity in (old, new):
            identity.step_settled(rows, used, [SPEED] * len(rows), ~both)
    for row in z[1300:]:
        old.step(row, both, SPEED, ~both)
        new.step(row, both, SPEED, ~both)
    a, b = capture(old), capture(new)
    assert_close(a["filters"], b["filters"])
    assert_close(a["mean"], b["mean"])
    newest = slice(0, 20)
    assert_close(a["blocks"][newest], b["blocks"][newest])


@pytest.mark.parametrize("phase", range(BLOCK_TICKS))
def test_window_takes_blocks(phase: int) -> None:
    rng = np.random.default_rng(4)
    n, blocks, start = 900, 40, 1000 + phase
    w, raw = rng.standard_normal((2, n, 4, 2, 2))
    heard, ratio = rng.random((n, 2)) > 0.05, rng.uniform(0.1, 0.2, (n, 2))
    live = heard & (rng.random((n, 2)) > 0.05)
    calm = live & (rng.random((n, 2)) > 0.05)
    ratio[rng.random((n, 2)) < 0.02] = np.nan
    fast, slow = Window(blocks, 2), Window(blocks, 2)
    at = 0
    while at < n:
        end = min(n, at + BLOCK_TICKS - (start + at) % BLOCK_TICKS)
        running = np.array([True, end > 300])
        for window, each in ((fast, end - at), (slow, 1)):
            for k in range(at, end, each):
                now = slice(k, k + each)
                window.put(start + k, w[now], raw[now], running, heard[now], live[now], calm[now], ratio[now])
        assert_close(capture(fast), capture(slow))
        at = end
    assert fast.filled().tolist() == [blocks, blocks]
    assert LAG == BLOCK_TICKS


@pytest.mark.parametrize("ticks", range(1, 10))
def test_window_of_an_axle_that_begins_within_a_block_holds_that_block(ticks: int) -> None:
    """Beside another axle, as after a reset within the block."""
    window, yes = Window(20, 2), np.ones((1, 2), dtype=bool)
    w = np.ones((1, 4, 2, 2))
    for k in range(24):
        running = np.array([True, k >= 24 - ticks])
        window.put(k, w, w, running, yes & running, yes & running, yes & running, np.full((1, 2), 0.1))
    assert window.filled().tolist() == [6, -(-ticks // BLOCK_TICKS)]
    assert window.sums(window.filled()[None])[0].tolist() == [[24.0, ticks]]
