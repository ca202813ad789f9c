"""Blocks of ticks stepped at once give what tick by tick gives, but for rounding."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from tests.support.lone_wheelset import LONE_DESIGN
from tests.support.signals import hunting, measured
from wrcd.estimator.design import Design, FloatArray, load_design
from wrcd.estimator.estimator import Estimator, step_through
from wrcd.estimator.paper.window import BLOCK_TICKS, Window
from wrcd.estimator.records import Estimate, StepResult, Ticks
from wrcd.estimator.signals.gate import Gate
from wrcd.estimator.trust.pair import PairSums
from wrcd.recorder.state import capture

RTOL = 1e-9
PER_S = 200
SETTLED = 3 * PER_S  # ticks after which every running mean is settled
NOISE = (3e-4, 0.01)
SPEED = 25.0
ALL_OF_TWO = np.ones(2, dtype=bool)


@pytest.fixture(scope="module")
def design() -> Design:
    return load_design(LONE_DESIGN)


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
    age = np.arange(len(noise["past"]))[::-1, None, None]
    noise["past"] = np.where(age < noise["run"], noise["past"], 0.0)
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


def results(messy: Messy, estimator: Estimator, every: int = 25) -> tuple[list[StepResult], list[tuple[Any, Estimate]]]:
    """All results, and state and estimate at the end of every so many blocks."""
    number, found, ends = messy.ticks.number, [], []
    for result in messy.run(estimator):
        found.append(deepcopy(result))  # the estimator goes on in its arrays
        number += len(result)
        if number % (every * BLOCK_TICKS) == 0:
            ends.append((state(estimator), estimator.estimate()))
    return found, ends


@pytest.mark.parametrize(("axles", "number"), [(1, 1001), (4, 1002), (4, 1003)])
def test_blocks_and_ticks_give_the_same(design: Design, axles: int, number: int) -> None:
    messy, fast, slow = Messy(axles, 11 * axles, number), Counting(design, axles), TickByTick(design, axles)
    (ours, ends), (theirs, others) = results(messy, fast), results(messy, slow)
    for (a, one), (b, other) in zip(ends, others, strict=True):
        assert_close(a, b)
        assert_same_estimate(one, other)
    assert len(ends) > 45
    assert fast.outliers == slow.outliers > 4
    assert fast.at_once > 0.15 * len(messy.ticks)
    assert fast.taken_back > 100
    together = [[r.needs_reset.tolist() for r in run if r.needs_reset.any()] for run in (ours, theirs)]
    assert together[0] == together[1] != []
    for name in {f.name for f in fields(StepResult)} - {"needs_reset"}:
        a, b = (np.concatenate([getattr(r, name) for r in run]) for run in (ours, theirs))
        assert_close(a, b, name)
        assert name not in ("near_pulse", "outliers") or a.any()
    assert (max(map(len, ours)), max(map(len, theirs))) == (BLOCK_TICKS, 1)


def test_blocks_and_ticks_give_the_same_for_a_hunting_wheelset(design: Design) -> None:
    fast, slow = Counting(design, 1), TickByTick(design, 1)
    stops = range(BLOCK_TICKS - 1, len(hunting()), 25 * BLOCK_TICKS)
    for _ in zip(*(step_through(estimator, hunting(), stops) for estimator in (fast, slow)), strict=True):
        assert_close(state(fast), state(slow))
        assert_same_estimate(fast.estimate(), slow.estimate())
    assert fast.at_once > 0


@pytest.mark.parametrize(("axles", "idle"), [(1, ()), (4, ()), (3, (1,))])
def test_blocks_of_a_track_are_stepped_at_once(design: Design, axles: int, idle: tuple[int, ...]) -> None:
    """Beside an axle that does not run, too."""
    z = tracks(axles)[: 8 * PER_S].copy()
    present = np.ones(z.shape, dtype=bool)
    present[:, :, idle] = False
    z[~present] = np.nan
    ticks = Ticks(0, z, present, np.full((len(z), axles), 0.136), [SPEED] * len(z))
    fast, slow = Counting(design, axles), TickByTick(design, axles)
    list(step_through(slow, ticks))
    list(step_through(fast, ticks.part(0, SETTLED)))
    fast.at_once = fast.taken_back = 0
    list(step_through(fast, ticks.part(SETTLED, len(ticks))))
    assert fast.at_once > 0.98 * (len(ticks) - SETTLED)
    assert fast.taken_back <= 0.02 * (len(ticks) - SETTLED)
    assert_close(state(fast), state(slow))
    assert fast.started.tolist() == [a not in idle for a in range(axles)]


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


@pytest.mark.parametrize("at", range(BLOCK_TICKS))
@pytest.mark.parametrize("channel", [0, 1])
def test_gate_learns_nothing_from_a_block_with_an_outlier(at: int, channel: int) -> None:
    rng = np.random.default_rng(9)
    e, yaw = rng.standard_normal((204, 4, 2, 2)), np.zeros((204, 2))
    gate, none = Gate(2), np.zeros((2, 2), dtype=bool)
    for k in range(200):
        gate.learn(e[k], yaw[k], ALL_OF_TWO, none)
    before = repr(capture(gate))
    e[200 + at, :, channel, 1] = 15.0
    assert not gate.step_settled(e[200:], yaw[200:], None)
    assert repr(capture(gate)) == before
    # who is exempt is neither judged nor learnt from
    assert gate.step_settled(e[200:], yaw[200:], np.array([False, True]))
    alone = Gate(1)
    for k in range(204):
        alone.learn(e[k, ..., :1], yaw[k, :1], ALL_OF_TWO[:1], none[:, :1])
    assert_close(gate._power[..., :1], alone._power)


@pytest.mark.parametrize("idle", [False, True])
def test_pairs_are_summed_up_alike_at_once_and_tick_by_tick(idle: bool) -> None:
    z = tracks(3)[:1000].copy()
    used = np.array([True, not idle, True])
    z[:, :, ~used] = 0.0
    fast, slow = PairSums(np.array(NOISE), 0.005, 3, 2.5), PairSums(np.array(NOISE), 0.005, 3, 2.5)
    for row in z[:400]:
        for pairs in (fast, slow):
            pairs.step(row, used)
    assert fast.settled[used].all()
    for part in steps(z[400:]):
        fast.step_settled(z[400:][part], used if idle else None)
    for row in z[400:]:
        slow.step(row, used)
    assert_close(capture(fast), capture(slow))
    span, other = fast.take(20.0), slow.take(20.0)
    for field in fields(span):
        np.testing.assert_allclose(getattr(span, field.name), getattr(other, field.name), rtol=RTOL, atol=1e-9)
    assert span.ticks.tolist() == (1000.0 * used).tolist()


def test_reset_axle_beside_a_running_one_begins_as_a_new_one() -> None:
    """Whatever it said before: what is idle while blocks are stepped stays at rest."""
    z = white(2400, 2) + np.array([[0.3], [5.0]])
    used, both = np.array([True, False]), ALL_OF_TWO
    old, new = PairSums(np.array(NOISE), 0.005, 2, 2.5), PairSums(np.array(NOISE), 0.005, 2, 2.5)
    for row in z[:500]:
        old.step(row, both)
        new.step(row, used)
    old.reset(1)
    for part in steps(z[500:1300]):
        rows = np.where(used, z[500:1300][part], 0.0)
        for pairs in (old, new):
            pairs.step_settled(rows, used)
    for row in z[1300:]:
        old.step(row, both)
        new.step(row, both)
    assert_close(capture(old), capture(new))


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
