"""The reference engine's window and rules: plain lists of ticks, numpy's fits, scikit-fuzzy's membership functions. No
code in common with the engine on the train."""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import skfuzzy
from numpy.typing import NDArray

from wrcd.estimator.design import Design

FloatArray = NDArray[np.float64]
Answer = Callable[[FloatArray], tuple[float, float]]
Word = tuple[float, float]

NOW_BLOCKS = 3  # of four ticks: the torque of so many is that of the moment


@dataclass(frozen=True, slots=True)
class Row:
    """One tick of one axle: its number, filtered innovations (8,), those of four ticks before, the unfiltered ones,
    whether they are live and calm, the torque ratio."""

    tick: int
    w: FloatArray
    earlier: FloatArray
    raw: FloatArray
    live: bool
    calm: bool
    ratio: float


class Memory:
    """The words of one axle's window, fused: a mean by their spreads that forgets."""

    def __init__(self) -> None:
        self._mean, self._spread, self._far = 0.0, 0.0, 0  # a spread of 0: nothing is remembered

    def anew(self, word: Word | None, whole: bool, newest: Word | None) -> bool:
        """Take up a word, of a window that is whole or cut; None: it holds too little. Whether the newest part has
        spoken of another rail twice on end: then nothing is remembered."""
        if word is None:
            self._spread, self._far = 0.0, 0
            return False
        log, spread = word
        old, new = (0.94 / self._spread**2 if self._spread else 0.0), 0.048 / spread**2
        mean, narrower = (old * self._mean + new * log) / (old + new), (old + new) ** -0.5
        off = (log - mean) / spread / (1.0 if whole else 0.5)
        if not self._spread or off <= -2.5 or off >= 3.0 or (spread >= 0.3 and not whole):
            mean, narrower = log, spread / 0.2**0.5
        self._mean, self._spread = mean, narrower
        apart = 0.0 if newest is None else (newest[0] - mean) / ((1.8 * newest[1]) ** 2 + narrower**2) ** 0.5
        self._far = self._far + 1 if whole and (apart < -2.0 or apart > 2.5) else 0
        if self._far < 2:
            return False
        self._spread = 0.0
        return True


def _word(answer: tuple[float, float]) -> Word:
    """The logarithm of an adhesion, and its standard deviation."""
    share, half = answer
    return float(np.log(share)), half / 1.645


class SlidingWindow:
    """The last ticks of one axle as plain lists; lengths are in blocks of four ticks, counted from the newest block."""

    def __init__(self, design: Design) -> None:
        self._design = design
        self._blocks = [-(-round(s / design.tick_s) // 4) for s in (design.longest_s, design.window_s, design.recent_s)]
        self._rows: deque[Row] = deque()
        self._kept: deque[Row] = deque()  # where the rest is dropped, too
        self._memory = Memory()

    def reset(self) -> None:
        """Forget them."""
        self._rows.clear()
        self._kept.clear()
        self._memory = Memory()

    def put(self, row: Row, speed_m_s: float) -> None:
        """One tick. At a block's end a change of rail or torque is looked for: what was before it is dropped."""
        self._rows.append(row)
        self._kept.append(row)
        longest, usual, recent = self._blocks
        while self._kept[0].tick // 4 <= row.tick // 4 - longest:
            self._kept.popleft()
        while self._rows[0].tick // 4 <= row.tick // 4 - longest:
            self._rows.popleft()
        if row.tick % 4 != 3 or self._design.form != "wrcd":
            return
        new = self._newest(recent)
        old = self._newest(usual)[: -len(new)]
        if 2 * min(sum(r.calm for r in new), sum(r.calm for r in old)) < recent * 4:
            return
        d = self._design
        limits = [np.interp(speed_m_s, d.change_speeds_m_s, column) for column in d.changes.T]
        step = np.abs(0.5 * np.log10(raw_powers(new) / raw_powers(old)))
        now, just, before = ratio(self._newest(NOW_BLOCKS)), ratio(self._just_before()), ratio(old)
        quick = abs(now - just) > 0.15 * max(now, just) + 0.004
        if np.any(step > limits) or quick or abs(now - before) > 0.15 * max(now, before) + 0.01:
            self._rows = deque(new)

    def _just_before(self) -> list[Row]:
        """The 0.16 s before those of the moment."""
        blocks = round(0.16 / self._design.tick_s / 4)
        return self._newest(NOW_BLOCKS + blocks)[: -len(self._newest(NOW_BLOCKS))]

    def inputs(self, noise: FloatArray, factor: FloatArray, speed_m_s: float) -> FloatArray | None:
        """What the rules are given (24 or so,) of the usual window, or None with too little data. noise (4, 2): what
        the sensors leave."""
        _, usual, _ = self._blocks
        return self._given(usual, noise, factor, speed_m_s)

    def remember(self, noise: FloatArray, factor: FloatArray, speed_m_s: float, answer: Answer) -> None:
        """Every 16 ticks: words are fused; where the newest part's lies far from them twice, the rest is dropped.

        answer: what the rules say of such inputs, adhesion as a share and relative half-width.
        """
        _, usual, recent = self._blocks
        whole = bool(self._rows) and len({r.tick // 4 for r in self._rows}) >= usual
        words = [None if x is None else _word(answer(x)) for x in
                 (self._given(blocks, noise, factor, speed_m_s) for blocks in (usual, recent))]  # fmt: skip
        newest = self._newest(recent) if self._rows else []
        clear = sum(r.live for r in newest) >= 0.8 * len(newest)
        if self._memory.anew(words[0], whole, words[1] if clear else None):
            self._rows = deque(newest)

    def _given(self, blocks: int, noise: FloatArray, factor: FloatArray, speed_m_s: float) -> FloatArray | None:
        if not self._rows:
            return None
        _, usual, recent = self._blocks
        blocks = min(blocks, len({r.tick // 4 for r in self._rows}))
        rows = self._newest(blocks)
        if 2 * sum(r.live for r in rows) < recent * 4:
            return None
        short = blocks < usual and self._design.form == "wrcd"
        torque = ratio(self._newest(NOW_BLOCKS)) if short else ratio(rows)
        return self._columns(rows, noise, factor, speed_m_s, torque)

    def _newest(self, blocks: int) -> list[Row]:
        last = self._rows[-1].tick // 4
        return [r for r in self._rows if r.tick // 4 > last - blocks]

    def _columns(
        self, rows: list[Row], noise: FloatArray, factor: FloatArray, speed_m_s: float, torque: float
    ) -> FloatArray:
        power = powers(rows)
        lag, cross = correlations(rows)
        square = power.mean(axis=1)
        if self._design.form == "wrcd":
            floor = (noise * factor**2).mean(axis=1)
            square = np.maximum(square - floor, 0.03 * floor)
            square = np.append(square[:3] / square[3], square[3])
        scalars = np.log10([max(torque, 0.003), speed_m_s])
        rest = np.log10([len(rows) * self._design.tick_s, *factor])
        return np.concatenate((0.5 * np.log10(square), scalars, lag, cross, rest, self._swing(), self._steps()))

    def _swing(self) -> FloatArray:
        """Decades by which the torque's means over blocks have been above and below that of the moment (2,)."""
        blocks: dict[int, list[float]] = {}
        for row in self._kept:
            blocks.setdefault(row.tick // 4, []).append(row.ratio)
        newest = sorted(blocks)[-(self._blocks[1] // 2) :]
        means = [float(np.mean(blocks[b])) for b in newest]
        now = float(np.mean([x for b in newest[-NOW_BLOCKS:] for x in blocks[b]]))
        low, middle, high = np.log10(np.array([min(means), now, max(means)]) + 0.01)
        return np.array([high - middle, middle - low])

    def _steps(self) -> FloatArray:
        """Decades by which the newest part's unfiltered residuals lie above those of the half second before (4,)."""
        _, usual, recent = self._blocks
        ages = [self._kept[-1].tick // 4 - row.tick // 4 for row in self._kept]
        new = [row for row, age in zip(self._kept, ages, strict=True) if age < recent]
        old = [row for row, age in zip(self._kept, ages, strict=True) if recent <= age < recent + usual // 2]
        if 2 * min(sum(r.calm for r in new), sum(r.calm for r in old)) < recent * 4:
            return np.zeros(4)
        first, second, third, fourth = np.clip(0.5 * np.log10(raw_powers(new) / raw_powers(old)), -1.5, 1.5)
        largest = max(abs(first), abs(second), abs(third), abs(fourth))
        return np.array([(first + second) / 2, third, fourth, largest])


def ratio(rows: Sequence[Row]) -> float:
    """Mean torque ratio."""
    return float(np.mean([r.ratio for r in rows]))


def _about_a_line(rows: Sequence[Row]) -> tuple[FloatArray, FloatArray]:
    """Innovations (ticks, 8) about a straight line, and the line."""
    w = np.array([r.w for r in rows])
    t = np.array([r.tick for r in rows], dtype=np.float64) - rows[0].tick
    line = np.asarray(np.polynomial.polynomial.polyval(t, np.polynomial.polynomial.polyfit(t, w, 1)).T, np.float64)
    return np.asarray(w - line), line


def powers(rows: Sequence[Row]) -> FloatArray:
    """Mean square of the innovations about a line, of the live ticks (4, 2)."""
    rest, _ = _about_a_line(rows)
    live = sum(r.live for r in rows)
    return np.asarray(np.square(rest).sum(axis=0).reshape(4, 2) / live)


def raw_powers(rows: Sequence[Row]) -> FloatArray:
    """Mean square of the unfiltered innovations of the calm ticks about their mean (4,)."""
    raw = np.array([r.raw for r in rows if r.calm])
    return np.asarray(raw.var(axis=0).reshape(4, 2).mean(axis=1))


def correlations(rows: Sequence[Row]) -> tuple[FloatArray, FloatArray]:
    """Of each innovation with itself four ticks before (8,), and of a model's two innovations (4,)."""
    rest, line = _about_a_line(rows)
    w, earlier = np.array([r.w for r in rows]), np.array([r.earlier for r in rows])
    power = np.square(rest).mean(axis=0)
    lag = ((w * earlier).mean(axis=0) - np.square(line).mean(axis=0)) / power
    pairs = rest.reshape(-1, 4, 2)
    cross = pairs.prod(axis=2).mean(axis=0) / np.sqrt(power.reshape(4, 2).prod(axis=1))
    return _held(lag), _held(cross)


def _held(correlation: Any) -> FloatArray:
    return np.clip(np.asarray(correlation, dtype=np.float64), -1.0, 1.0)


class FuzzyReference:
    """The rule base rule by rule: scikit-fuzzy's membership functions, the product of the degrees, the weighted mean.

    Not by skfuzzy.control: a rule's output is linear in the inputs, which its consequents cannot say; as seven
    consequents beside each other (a constant and six slopes) it takes minutes for what this does in milliseconds.
    """

    def __init__(self, design: Design) -> None:
        self._design = design
        self._functions = []
        for sets in design.sets:
            c, last = sets.centres, len(sets.centres) - 1
            self._functions.append(
                [skfuzzy.trimf(c, [c[max(j - 1, 0)], c[j], c[min(j + 1, last)]]) for j in range(len(c))]
            )

    def outputs(self, inputs: FloatArray) -> FloatArray:
        """Fuzzy outputs (n,) for inputs (n, columns); NaN where no rule speaks at all."""
        return np.array([self._weighted(row, self._design.bases, self._design.slopes) for row in inputs]).clip(0, 100)

    def answer(self, row: FloatArray) -> tuple[float, float]:
        """Adhesion (a share) and the relative half-width of its interval for one row of inputs."""
        d = self._design
        mu = np.clip(np.polyval(d.polynomial, np.clip(self._weighted(row, d.bases, d.slopes), 0, 100)),
                     *d.adhesion_range_pct)  # fmt: skip
        spread = self._weighted(row, np.log10(d.spreads), d.spread_slopes)
        return float(mu) / 100, float(10 ** np.clip(spread, -2.7, 0.3))

    def _weighted(self, row: FloatArray, bases: FloatArray, slopes: FloatArray) -> float:
        d = self._design
        held = [min(max(float(x), low), high) for x, low, high in zip(row, d.low, d.high, strict=True)]
        above = total = 0.0
        for rule, base, rule_slopes in zip(d.rules, bases, slopes, strict=True):
            weight, says = 1.0, float(base)
            for i, (x, slope) in enumerate(zip(held, rule_slopes, strict=True)):
                if i < len(d.sets):
                    centres = d.sets[i].centres
                    if len(centres) > 1:  # one set alone always holds
                        weight *= float(skfuzzy.interp_membership(centres, self._functions[i][rule[i]], x))
                    middle = float(centres[rule[i]])
                else:
                    middle = float(d.middle[i])
                says += float(slope) * (x - middle)
            above, total = above + weight * says, total + weight
        return above / total if total > 0 else float("nan")
