"""What the paper says of its figures, checked by arithmetic on the data that ours are drawn from.

Each function takes plain data and returns statements with their verdicts. The thresholds below were set before any
of them was looked at; a statement that is false here stays false.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from sim_ecu.design.linear import Point
from sim_ecu.score.figure_data import SATURATED, HeldTrace, Levels, own_range
from wrcd.estimator.design import MODELS, Sets

FloatArray = NDArray[np.float64]

THROUGHOUT = 0.9  # "is the lowest": in this share of the estimates, or of the conditions
FLAT = 0.01  # "g11 is zero": this small against g22
STRAIGHT = 0.1  # "linear region": slope and secant differ by less than this share
DIFFERENT = 1.1  # "different": by this factor at least
STEADY = 5.0  # the fuzzy output stays this close to its mean, of 100: one output set
RIGHT_PP, RIGHT_SHARE = 1.0, 0.1  # "almost equal": within 1 percentage point or a tenth of the truth
INTERVAL = 0.9  # what the half-width claims
REACTION_S = 2.0
PAPER_SETS = ("Low", "Moderate", "High")
# The two rules that the paper prints: the sets of residuals 1 … 4.
PAPER_RULE_40 = ("Low", "Low", "High", "Moderate")
PAPER_RULE_10_20 = ("Low", "Low", "Moderate", "Low")
IN_OWN_RANGE = "the same of what the rules see, in each one's own Low to High"


@dataclass(frozen=True, slots=True)
class PaperClaim:
    """What should be seen in a figure (the paper's words unless it says "ours"), whether it is, what was measured."""

    figure: int
    says: str
    holds: bool
    numbers: str

    @property
    def verdict(self) -> str:
        """In words."""
        return "holds" if self.holds else "DOES NOT HOLD"

    def line(self) -> str:
        """For the screen."""
        return f"Fig. {self.figure:<3} {self.verdict:14} {self.says}: {self.numbers}"


def creep_curves(
    slopes: Mapping[str, tuple[float, float]], peaks: Mapping[str, float], points: Sequence[Point]
) -> list[PaperClaim]:
    """Fig. 1. slopes: g11 and g22 (N) at the peak of each curve; peaks: mu there; points: the four models'."""
    flat = max(abs(g11 / g22) for g11, g22 in slopes.values())
    order = sorted(slopes, key=lambda name: -peaks[name])
    step = min(slopes[a][1] / slopes[b][1] for a, b in pairwise(order))
    found = [(p.curve.name, p.creep_of_peak) for p in points]
    as_designed = [f[0] for f in found] == ["A", "C", "D", "B"] and all(f[1] == SATURATED for f in found[:3])
    g22 = ", ".join(f"{name} {slopes[name][1]:.3g}" for name in order) + f" N; smallest step x {step:.2f}"
    named = ", ".join(f"{m + 1}: {name} at {share:g} of the peak's creep" for m, (name, share) in enumerate(found))
    designed = "models 1 to 3 are designed at the peaks of curves A, C and D, model 4 below the peak of B"
    return [
        PaperClaim(1, "at the saturation points g11 is zero", flat <= FLAT, f"|g11| at most {flat:.1e} of g22"),
        PaperClaim(1, "at the saturation points g22 differs between the adhesion levels", step >= DIFFERENT, g22),
        PaperClaim(1, designed, as_designed and found[3][1] < SATURATED, named),
    ]


def straight(figure: int, says: str, g11_N: float, g22_N: float) -> PaperClaim:
    """Whether a point of a curve lies in its linear region: slope and secant agree."""
    ratio = g11_N / g22_N
    return PaperClaim(figure, says, abs(ratio - 1.0) <= STRAIGHT, f"the slope is {ratio:.2f} of the secant there")


def lowest(figure: int, where: str, model: int, trace: HeldTrace) -> list[PaperClaim]:
    """Figs. 3 to 5: a model (from 1) has the lowest residual, as it is and within each model's own range."""
    mean = np.exp(np.log(trace.residuals).reshape(-1, MODELS).mean(axis=0))
    places = trace.own_range.reshape(-1, MODELS).mean(axis=0)
    out = []
    for says, winner, what, means in (
        (f"the residual of model {model} is the lowest", np.argmin(trace.residuals, axis=-1) + 1, "residuals", mean),
        (f"as the rules see them, model {model} is the lowest in its own Low to High", trace.winner, "places", places),
    ):
        shares = [float(np.mean(winner == m + 1)) for m in range(MODELS)]
        most = int(np.argmax(shares))
        numbers = f"in {100 * shares[model - 1]:.0f} % of the estimates"
        numbers += f", model {most + 1} in {100 * shares[most]:.0f} %" * (most != model - 1)
        numbers += f"; mean {what} {', '.join(f'{v:.3g}' for v in means)}"
        out.append(PaperClaim(figure, f"{where}, {says}", shares[model - 1] >= THROUGHOUT, numbers))
    return out


def increased(figure: int, model: int, here: HeldTrace, before: HeldTrace) -> PaperClaim:
    """A model's residual is larger here than before, track by track (geometric means over time)."""
    now, then = (np.log(t.residuals[:, :, model - 1]).mean(axis=0) for t in (here, before))
    numbers = (
        f"{np.exp(then.mean()):.3g} to {np.exp(now.mean()):.3g}, larger on {np.sum(now > then)} of {len(now)} tracks"
    )
    says = f"the residual of model {model} is increased against Fig. {figure - 1}"
    return PaperClaim(figure, says, bool(np.mean(now > then) >= THROUGHOUT), numbers)


def matched(points: Sequence[tuple[Levels, float]], ranges: Sequence[Sets]) -> list[PaperClaim]:
    """Fig. 6: at each model's design point, given as region and adhesion, that model is the lowest of the four."""
    out = []
    for says, values in (
        ("each filter's residual is the lowest of the four at its own design point", [p.at(mu) for p, mu in points]),
        (IN_OWN_RANGE, [own_range(ranges, p.seen_at(mu)) for p, mu in points]),
    ):
        lowest_there = [int(np.argmin(v)) + 1 for v in values]
        numbers = ", ".join(f"at model {m + 1}'s: model {found}" for m, found in enumerate(lowest_there))
        out.append(PaperClaim(6, says, lowest_there == list(range(1, MODELS + 1)), f"lowest {numbers}"))
    return out


def unsaturated(regions: Sequence[Levels], ranges: Sequence[Sets]) -> list[PaperClaim]:
    """Fig. 6: off the saturation points the residual of model 4 is the lowest, whatever the curve and the creep."""
    out = []
    for says, values in (
        ("off the saturation points the residual of model 4 is the lowest",
         [np.log(r.windows).mean(axis=0) for r in regions]),
        (IN_OWN_RANGE, [own_range(ranges, r.seen.mean(axis=0)) for r in regions]),
    ):  # fmt: skip
        winners = [np.argmin(v, axis=-1) + 1 for v in values]
        numbers = ", ".join(
            f"{np.sum(winner == MODELS)} of {len(winner)} at {levels.creep_of_peak:g}"
            for levels, winner in zip(regions, winners, strict=True)
        )
        holds = bool(np.mean(np.concatenate(winners) == MODELS) >= THROUGHOUT)
        out.append(PaperClaim(6, says, holds, f"on {numbers} of the peak's creep"))
    return out


def paper_rules(saturated: Levels, below: Levels, ranges: Sequence[Sets]) -> list[PaperClaim]:
    """Fig. 6: the sets that the paper's two printed rules name for about 40 % and for 10 to 20 % adhesion.

    Where our input does not have such a set the statement is false; its numbers say what is nearest.
    """
    some = [float(mu) for mu in np.exp(np.linspace(np.log(10.0), np.log(20.0), 8))]
    return [
        _printed("at 40 % adhesion", PAPER_RULE_40, [(saturated, 40.0)], ranges),
        _printed("between 10 and 20 % adhesion", PAPER_RULE_10_20,
                 [(levels, mu) for levels in (saturated, below) for mu in some], ranges),
    ]  # fmt: skip


def _printed(
    where: str, rule: tuple[str, ...], points: Sequence[tuple[Levels, float]], ranges: Sequence[Sets]
) -> PaperClaim:
    """Whether a printed rule's sets are the strongest at one of the points, and the nearest of them."""
    seen = [levels.seen_at(mu) for levels, mu in points]
    found = [tuple(s.names[int(s.memberships(x[m : m + 1]).argmax())] for m, s in enumerate(ranges)) for x in seen]
    alike = [sum(a == b for a, b in zip(names, rule, strict=True)) for names in found]
    best = int(np.argmax(alike))
    levels, mu = points[best]
    numbers = f"nearest at {levels.creep_of_peak:g} of the peak's creep on {mu:.0f} %: {', '.join(found[best])}"
    numbers += f", {alike[best]} of {MODELS} as printed"
    for m, place in enumerate(own_range(ranges, seen[best])):
        if rule[m] not in ranges[m].names:
            names = ranges[m].names
            numbers += f"; ours {m + 1} has no {rule[m]}: it lies {place:.2f} of the way from {names[0]} to {names[-1]}"
    return PaperClaim(6, f"{where} the residuals are {', '.join(rule)}", rule in found, numbers)


def divided(figure: int, model: int, sets: Sets, seen: FloatArray) -> PaperClaim:
    """Figs. 8, 9: what the rules see of a residual is divided into Low, Moderate and High, each somewhere strongest."""
    shares = np.bincount(sets.memberships(seen).argmax(axis=1), minlength=len(sets.names)) / len(seen)
    outside = np.mean((seen < sets.centres[0]) | (seen > sets.centres[-1]))
    says = f"residual {model} of Fig. 6, as the rules see it, is divided into {', '.join(PAPER_SETS)}"
    numbers = ", ".join(f"{name} the strongest in {100 * s:.0f} %" for name, s in zip(sets.names, shares, strict=True))
    numbers += f" of its windows; {100 * outside:.0f} % lie beyond the outer centres"
    return PaperClaim(figure, says, sets.names == PAPER_SETS and bool((shares > 0).all()), numbers)


def output_map(bases: FloatArray, polynomial: FloatArray, printed: FloatArray) -> list[PaperClaim]:
    """Fig. 10: the output's range, and what turns it into adhesion; printed is the paper's (16).

    bases are the rules' outputs in the middle of their sets; the output is held to 0 … 100.
    """
    low, high = float(bases.min()), float(bases.max())
    numbers = f"the rules say {low:g} to {high:g} in the middle of their sets, "
    numbers += f"{np.sum((bases < 0.0) | (bases > 100.0))} of {len(bases)} beyond 0 to 100, where the output is held"
    out = [PaperClaim(10, "the numeric output ranges from 0 to 100", low <= 0.0 and high >= 100.0, numbers)]
    n = np.linspace(0.0, 100.0, 1001)
    for what, coefficients in (("our polynomial", polynomial), ("(16) as printed", printed)):
        mu = np.polyval(coefficients, n)
        order = len(np.trim_zeros(coefficients, "f")) - 1
        falls = bool((np.diff(mu) < 0).all())
        numbers = f"{mu[0]:.3g} % at 0, {mu[-1]:.3g} % at 100, least {mu.min():.3g} %"
        numbers += f", {'falls' if falls else 'does not fall'} throughout"
        says = f"{what} turns every output into an adhesion, the larger the output the lower"
        out.append(PaperClaim(10, f"{what} is of sixth order", order == 6, f"order {order}"))
        out.append(PaperClaim(10, says, falls and bool(mu.min() >= 0.0), numbers))
    return out


def right(figure: int, curve: str, whole: HeldTrace, settled: HeldTrace) -> list[PaperClaim]:
    """Figs. 11 to 13: steady and almost equal to the truth when settled; and, ours, whether the interval holds it."""
    moves = np.nanmax(np.abs(settled.fuzzy - np.nanmean(settled.fuzzy, axis=0)))
    close = np.abs(whole.mu_pct - whole.truth_pct) <= np.maximum(RIGHT_PP, RIGHT_SHARE * whole.truth_pct)
    wrong = np.flatnonzero(~close.all(axis=1))
    never = bool(len(wrong)) and wrong[-1] == len(whole.t_s) - 1
    since = 0.0 if not len(wrong) else float(whole.t_s[-1 if never else wrong[-1] + 1])
    errors, alone = (np.abs(pct - settled.truth_pct) for pct in (settled.mu_pct, settled.unbounded_pct))
    inside = float((errors <= settled.half_width_pp).mean())
    known = bool(np.isfinite(settled.mu_pct).all())
    after = f"after 2 s on curve {curve} the"
    steady = f"within {moves:.1f} of 100 of its mean {np.nanmean(settled.fuzzy):.1f} ({STEADY:g} is called steady)"
    equal = (
        f"truth {settled.truth_pct.mean():.1f} %; error mean {np.nanmean(errors):.2f}, "
        f"largest {np.nanmax(errors):.2f} pp; "
        + ("never settles" if never else f"stays within 1 pp or a tenth from {since:.2f} s on")
        + f"; from the fuzzy output alone mean {np.nanmean(alone):.2f}, largest {np.nanmax(alone):.2f} pp"
    )
    holds = f"in {100 * inside:.0f} % of the estimates, half-width {np.nanmean(settled.half_width_pp):.2f} pp"
    return [
        PaperClaim(figure, f"{after} fuzzy output is steady", known and bool(moves <= STEADY), steady),
        PaperClaim(figure, f"{after} estimated adhesion is almost equal to the true one",
              known and not never and since <= REACTION_S, equal),
        PaperClaim(figure, f"(ours) {after} 90 % interval holds the truth", inside >= INTERVAL, holds),
    ]  # fmt: skip
