"""The oracle of the estimate: from a window and the rules' word to the adhesion, its interval, and what speaks against
it."""

from dataclasses import dataclass

import numpy as np

from tests.oracle import bands
from tests.oracle.memory import SIGMAS, Remembered, Word, decades, spoken
from tests.oracle.residuals import IN_BANDS, Lengths, Statistics, Window, mean_ratio, statistics
from tests.oracle.rules import SWING, Inference, Past, RuleInputs, Rules
from wrcd.core.design import BoolArray, Design, FloatArray, IntArray, IntervalModel
from wrcd.core.records import Estimate
from wrcd.core.terms import MODELS, EstimateDoubt, Regime

LOW_FIRING = 0.2  # below, few training conditions were like the moment: the interval is wider
MOVED = 0.1  # decades, above and below together, by which the torque has moved within half a second
COASTS = 0.1  # of what is available: less in use tells hardly anything
# Standard deviations above the word that what was in use at the last peak may lift it, and the most: three times the
# word, six times where little of it is in use. A torque that is lost with the rail is no slip cycle, and there the word
# is vague.
ALLOWED, LIFTS, LITTLE_LIFTS, LITTLE = 4.0, np.log(3.0), np.log(6.0), 0.5
LEAST_PCT = 0.01  # a word of less is this: there is no logarithm of nothing
NEWEST_SHARE = 0.5  # of the newest part's half-width that the interval is made to reach down to
# More in use than the rules say there is: beyond the interval, and by this share of what they say, one is wrong.
CONTRADICTION_SHARE, CONTRADICTION_PP = 0.2, 0.3
# of the window that must hold data far from pulses, and data at all
HARSH_SHARE, GAPS_SHARE = 0.1, 0.4
MIN_M = 2.9  # the least way that a wheelset must have run to tell
# The first that applies counts.
_REASONS = np.array(
    [
        EstimateDoubt.GAPS, EstimateDoubt.HARSH, EstimateDoubt.BEYOND_TRAINING,
        EstimateDoubt.NO_RULE, EstimateDoubt.SHORT, EstimateDoubt.NONE,
    ], dtype=np.int64
)  # fmt: skip
BEYOND_WIDER = 2.0  # the half-width grows by this factor for each range that an input lies outside the sets


@dataclass(frozen=True, slots=True)
class Draft:
    """What an estimate is made from, as it is at one moment: of the axles' windows nothing else is needed."""

    blocks: IntArray  # (k, n) the windows' lengths: the usual one, the newest part; in the paper's form one
    sums: FloatArray  # (COLUMNS, k, n) over those windows
    now: FloatArray  # (n,) torque ratio of the moment
    lasting: FloatArray  # (n,) of the moment or of a moment before, whichever is less
    lasted: FloatArray  # (n,) the same, and of LASTS_S: no inertia of a wheel that speeds up
    lowest: FloatArray  # (n,) of half a second
    highest: FloatArray
    recent: FloatArray  # (plain columns, n) plain sums over the newest part, and over the half second before it
    before: FloatArray
    noise_factor: FloatArray  # (2, n)
    floor: FloatArray  # (n, 4) mean square residual that sensors so noisy leave
    speed_m_s: float
    grid_speed_m_s: float  # held within the design's grid
    memory: FloatArray  # (7, n) what is Remembered
    partner_counts: BoolArray  # (n,) its signals, beside the axle's own

    def in_use_pct(self, recent_pct: FloatArray) -> FloatArray:
        """(n,): of what the newest part says that there is it counts at once, more of it only where it lasted."""
        return np.asarray(np.fmax(100.0 * self.lasted, np.fmin(100.0 * self.lasting, recent_pct)))


@dataclass(frozen=True, slots=True)
class Answer:
    """What the rules say of one window of every axle (n,): adhesion, and its half-width as a share of it."""

    mu_from_rules_pct: FloatArray
    spread: FloatArray
    inputs: FloatArray
    live_share: FloatArray  # of the window, with data far from pulses

    @property
    def word(self) -> Word:
        """The same in logarithms."""
        return Word(np.log(np.maximum(self.mu_from_rules_pct, LEAST_PCT)), self.spread / SIGMAS)


class Answers:
    """Estimates of windows, at a speed (m/s) and with sensors noise_factor (2, n) times as noisy as the design's."""

    def __init__(self, design: Design, axles: int) -> None:
        self._d, self._axles, self._wrcd = design, axles, design.form == "wrcd"
        self._lengths = Lengths(design)
        self._in_bogie = design.wheelset.get("bogie") is not None
        self._rules = Rules(design)
        self._rule_inputs = RuleInputs(design)
        self._low = np.array([s.centres[0] for s in design.residual_sets])
        self._width = np.array([s.centres[-1] - s.centres[0] for s in design.residual_sets])
        self._range = np.maximum(design.high - design.low, 1e-9)[:MODELS]
        self._ends = design.low[:MODELS], design.high[:MODELS]

    def torque_now(self, window: Window) -> FloatArray:
        """(n,): torque ratio of the moment; NaN where it is not known. Within quiet()."""
        return mean_ratio(window.plain(0, self._lengths.now))

    def draft(
        self, window: Window, noise_factor: FloatArray, speed_m_s: float, grid_speed_m_s: float, memory: FloatArray,
        partner_sound: BoolArray,
    ) -> Draft:  # fmt: skip
        """Take from a window what the estimate is made from. Within quiet()."""
        k = self._lengths
        filled = window.filled()
        usual = np.minimum(filled, k.usual)
        now = self.torque_now(window)
        lengths: tuple[IntArray, ...] = (usual,)
        if self._wrcd:
            lengths = usual, np.minimum(filled, k.recent)
        return self._draft(
            window, np.array(lengths), now, noise_factor, speed_m_s, grid_speed_m_s, memory, partner_sound
        )

    def _draft(
        self, window: Window, blocks: IntArray, now: FloatArray, noise_factor: FloatArray, speed_m_s: float,
        grid_speed_m_s: float, memory: FloatArray, partner_sound: BoolArray,
    ) -> Draft:  # fmt: skip
        k, half = self._lengths, self._lengths.usual // 2
        lowest, highest = window.torque_range(half)
        return Draft(
            blocks=blocks,
            sums=window.sums(blocks),
            now=now,
            lasting=(lasting := np.fmin(now, mean_ratio(window.kept(k.now, k.now + k.step)))),
            lasted=np.fmin(lasting, mean_ratio(window.kept(k.now, k.now + k.lasts))),
            lowest=lowest,
            highest=highest,
            recent=window.kept(0, k.recent),
            before=window.kept(k.recent, k.recent + half),
            noise_factor=noise_factor,
            floor=self._rule_inputs.floor(noise_factor, grid_speed_m_s),
            speed_m_s=speed_m_s,
            grid_speed_m_s=grid_speed_m_s,
            memory=memory,
            partner_counts=partner_sound & self._in_bogie,
        )

    def estimate(self, draft: Draft) -> Estimate:
        """The adhesion that the windows' residuals and torque speak for. Within quiet()."""
        d, n = self._d, len(draft.now)
        now = draft.now
        used = 100.0 * now
        answers, inference, chosen = self.answers(draft)
        best = answers[0]
        if not self._wrcd:
            from_rules, spread = best.mu_from_rules_pct, best.spread
            mu = np.minimum(np.fmax(from_rules, used), 100.0)
            mu[np.isnan(from_rules)] = np.nan
            doubt, goes_on = np.zeros((2, n), dtype=np.int64)
            reaches, in_use = np.full(n, np.nan), used
        else:
            memory, recent = Remembered(*draft.memory), answers[1]
            inference, chosen = inference.take(slice(0, n)), chosen.take(slice(0, n))
            cut = draft.blocks[0] < self._lengths.usual
            word, _ = spoken(memory, best.word, ~cut)
            from_rules, spread = np.exp(word.log_pct), SIGMAS * word.sigma
            # what has been in use lately is available: the estimate cannot lie below it
            lifts = np.where(used < LITTLE * from_rules, LITTLE_LIFTS, LIFTS)
            allowed = np.minimum(memory.peak_pct, np.exp(word.log_pct + np.minimum(ALLOWED * word.sigma, lifts)))
            in_use = draft.in_use_pct(recent.mu_from_rules_pct)
            carried = np.fmax(in_use, allowed)
            mu = np.minimum(np.maximum(from_rules, carried), 100.0)
            spread = np.maximum(spread, (mu - from_rules) / mu)
            # the newest part may know of a drop that the memory does not show yet: reach down to it
            newest_pct = np.fmax(recent.mu_from_rules_pct, carried)
            reaches = newest_pct * (1.0 - NEWEST_SHARE * recent.spread)
            reach = mu - reaches
            spread = np.where(reach > spread * mu, reach / mu, spread)
            goes_on = regime(best.inputs[:, SWING], used / mu, cut, used >= d.saturated_share * mu)
            if d.interval is not None:
                spread = spread * widening(d.interval, goes_on, np.full(n, draft.speed_m_s))
            spread, doubt = self._doubted(spread, best, inference, chosen, draft.speed_m_s)
        fits = (best.inputs[:, :MODELS] - self._low) / self._width
        unknown = np.isnan(fits)
        nearest = np.where(unknown, np.inf, fits).argmin(axis=1) + 1
        margin = np.maximum(spread * from_rules, CONTRADICTION_SHARE * from_rules + CONTRADICTION_PP)
        return Estimate(
            residuals=chosen.residuals,
            torque_ratio=chosen.ratio,
            inputs=best.inputs,
            fuzzy=inference.output,
            firing=inference.firing,
            rule=inference.rule,
            rule_share=inference.rule_share,
            winner=np.where(np.logical_or.reduce(unknown, axis=1), 0, nearest),
            mu_available_pct=mu,
            half_width_pp=np.maximum(spread * mu, used - from_rules),
            used_pct=used,
            saturated=used >= d.saturated_share * mu,
            contradicted=in_use > from_rules + margin,
            doubt=doubt,
            window_s=chosen.ticks * d.tick_s,
            mu_from_rules_pct=from_rules,
            live_share=chosen.live_share,
            regime=goes_on,
            reaches_pct=reaches,
        )

    def inputs_of(
        self,
        window: Window,
        blocks: IntArray,
        now: FloatArray,
        noise_factor: FloatArray,
        grid_speed_m_s: float,
        partner_sound: BoolArray,
    ) -> tuple[FloatArray, Statistics]:
        """What the rules are given (m, COLUMNS) of windows of so many blocks (m,), and the windows' statistics.

        m may be several times the axles: all of them with one length after all with another. now is (n,). In a window
        shorter than the usual one the torque has changed: that of the moment counts. Within quiet().
        """
        lengths = blocks.reshape(-1, self._axles)
        memory = np.zeros((len(Remembered._fields), self._axles))
        return self._inputs(
            self._draft(window, lengths, now, noise_factor, grid_speed_m_s, grid_speed_m_s, memory, partner_sound)
        )

    def _inputs(self, draft: Draft) -> tuple[FloatArray, Statistics]:
        """What the rules are given of every window, one length after another, and the windows' statistics."""
        k = self._lengths
        sums = draft.sums.reshape(len(draft.sums), -1)
        s, counts = statistics(sums, k.min_ticks), np.resize(draft.partner_counts, sums.shape[1])
        ratio = s.ratio
        if self._wrcd:
            ratio = np.where(draft.blocks < k.usual, draft.now, ratio.reshape(draft.blocks.shape)).reshape(-1)
        past = Past(draft.now, draft.lowest, draft.highest, decades(draft.recent, draft.before, k.min_ticks))
        given = bands.columns(sums[IN_BANDS], counts)
        columns = self._rule_inputs.columns(
            s, ratio, past, draft.noise_factor, draft.floor, draft.grid_speed_m_s, given
        )
        return columns, s

    def answers(self, draft: Draft) -> tuple[list[Answer], Inference, Statistics]:
        """What the rules say of each of the windows' lengths; inference and statistics of all, one after another.
        Within quiet()."""
        n = len(draft.now)
        inputs, s = self._inputs(draft)
        inference = self._rules.infer(inputs)
        from_rules = 0.0 * inference.output
        for factor in self._d.polynomial:
            from_rules = from_rules * inference.output + factor
        low, high = self._d.adhesion_range_pct
        from_rules = np.minimum(np.maximum(from_rules, low), high).reshape(-1, n)
        spread, inputs = inference.spread.reshape(-1, n), inputs.reshape(len(from_rules), n, -1)
        live = s.live_share.reshape(-1, n)
        found = [Answer(*of) for of in zip(from_rules, spread, inputs, live, strict=True)]
        return found, inference, s

    def _doubted(
        self,
        spread: FloatArray,
        best: Answer,
        inference: Inference,
        s: Statistics,
        speed_m_s: float,
    ) -> tuple[FloatArray, IntArray]:
        """The spread, wider where few rules fire or the inputs are unusual; and what is too much of it, a doubt."""
        d, residuals = self._d, best.inputs[:, :MODELS]
        # coasting, a long window and quiet sensors are no news: only the residuals can be unlike any that were seen
        outside = np.maximum(self._ends[0] - residuals, residuals - self._ends[1]) / self._range
        far = np.maximum(np.maximum.reduce(outside, axis=1), 0.0)
        few = np.minimum(np.maximum(LOW_FIRING / np.maximum(inference.firing, 1e-9), 1.0), 3.0)
        spread = spread * few * (1.0 + BEYOND_WIDER * far)
        seconds = s.ticks * d.tick_s
        applies = np.empty((len(_REASONS), len(spread)), dtype=bool)
        # of what is missing in the window, more was lost than is about pulses
        is_lost = 1.0 - s.heard_share > s.heard_share - s.live_share
        is_blind = np.isnan(s.mean_square[:, 0])  # too few ticks are left for a residual
        applies[0] = (s.heard_share < GAPS_SHARE) | (is_blind & is_lost)
        applies[1] = (s.live_share < HARSH_SHARE) | is_blind
        np.greater(far, d.beyond, out=applies[2])
        np.equal(inference.rule, 0, out=applies[3])
        np.less(seconds * speed_m_s, MIN_M, out=applies[4])
        applies[5] = True
        return spread, _REASONS[applies.argmax(axis=0)]


def regime(swing: FloatArray, share: FloatArray, cut: BoolArray, saturated: BoolArray) -> IntArray:
    """(n,): of the torque's swing (n, 2), the share (n,) of what is available that is in use, and whether the window
    was cut, and the contact is saturated (n,)."""
    applies = np.array([swing.sum(axis=1) > MOVED, share < COASTS, cut, saturated])
    last = len(applies) - applies[::-1].argmax(axis=0)
    return np.where(applies.any(axis=0), last, Regime.STEADY)


def widening(model: IntervalModel, of: IntArray, speed_m_s: FloatArray) -> FloatArray:
    """(n,): what the half-width is multiplied by, in regimes at speeds (n,); beyond the model's, those at its ends."""
    held = np.fmin(np.fmax(speed_m_s, model.speeds_m_s[0]), model.speeds_m_s[-1])
    at = np.interp(np.log(held), np.log(model.speeds_m_s), np.arange(len(model.speeds_m_s)))
    low = np.minimum(at.astype(np.int64), len(model.speeds_m_s) - 2)
    share = at - low
    return np.asarray((1.0 - share) * model.factors[of, low] + share * model.factors[of, low + 1])
