"""The inference of one axle against scikit-fuzzy's control system, against its primitives, and against C."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
import skfuzzy

from tests.bench.native import RulesLoop, library
from tests.bench.timing import Case, Goal, Row, in_turn, show
from wrcd import resources
from wrcd.estimator.design import Design, FloatArray, load_design
from wrcd.estimator.fuzzy import LOG_SPREADS, MIN_FIRING, Fuzzy

AXLES = (1, 4, 8, 32)
MOMENTS = 64  # different inputs that are inferred in turn
HALF_TERM, EDGE = 0.05, 0.0005  # of an output term of the control system: as good as a bar
KEYS = ("residual 1", "residual 2", "residual 3", "residual 4", "torque", "speed")


def moments(design: Design, axles: int, count: int = MOMENTS, seed: int = 1) -> FloatArray:
    """(count, n, COLUMNS): inputs near the middle of a rule's sets, so that some rules fire."""
    rng = np.random.default_rng(seed)
    out = np.tile(design.middle, (count, axles, 1)) + 0.05 * rng.standard_normal((count, axles, len(design.middle)))
    chosen = design.rules[rng.integers(len(design.rules), size=(count, axles))]
    for i, s in enumerate(design.sets):
        span = s.centres[-1] - s.centres[0]
        out[..., i] = s.centres[chosen[..., i]] + 0.1 * span * rng.standard_normal((count, axles))
    return np.ascontiguousarray(np.clip(out, design.low, design.high))


def without_slopes(design: Design) -> Design:
    """The rules with constant outputs: all that a control system's consequents can say. The arithmetic here is the
    same whatever the slopes are."""
    return replace(design, slopes=np.zeros_like(design.slopes))


class ControlPeer:
    """skfuzzy.control with the design's rules: product, and outputs as bars of one width, so that the centroid is the
    weighted mean."""

    def __init__(self, design: Design) -> None:
        from skfuzzy import control  # needs networkx, which scikit-fuzzy does not ask for

        inputs = {}
        for key, s in zip(KEYS, design.sets, strict=True):
            c, last = s.centres, len(s.centres) - 1
            inputs[key] = control.Antecedent(c, key)
            for j in range(len(c)):
                inputs[key][str(j)] = skfuzzy.trimf(c, [c[max(j - 1, 0)], c[j], c[min(j + 1, last)]])
        bars = np.array([-HALF_TERM, -HALF_TERM + EDGE, HALF_TERM - EDGE, HALF_TERM])
        bases = np.unique(design.bases)
        output = control.Consequent(np.unique((bases[:, None] + bars).ravel()), "adhesion")
        output.accumulation_method = np.add  # of the rules that say the same
        for base in bases:
            output[f"{base:g}"] = skfuzzy.trapmf(output.universe, base + bars)
        rules = []
        for chosen, base in zip(design.rules, design.bases, strict=True):
            terms = [inputs[key][str(j)] for key, j in zip(KEYS, chosen, strict=True)]
            whole = terms[0]
            for term in terms[1:]:
                whole = whole & term
            rules.append(control.Rule(whole, output[f"{base:g}"], and_func=np.multiply))
        self._simulation = control.ControlSystemSimulation(control.ControlSystem(rules))
        self._calls = 0

    def infer(self, row: FloatArray) -> float:
        """One axle's output for a row of inputs; NaN where no rule fires."""
        self._calls += 1
        for key, x in zip(KEYS, row, strict=False):
            # never the same twice: the simulation keeps its answers
            self._simulation.input[key] = float(x) + 1e-12 * self._calls
        self._simulation.compute()
        return min(max(float(self._simulation.output.get("adhesion", np.nan)), 0.0), 100.0)


class PrimitivesPeer:
    """skfuzzy's membership functions, and numpy for the rest: what a careful user of the library writes."""

    def __init__(self, design: Design) -> None:
        self._d = design
        self._functions = []
        for s in design.sets:
            c, last = s.centres, len(s.centres) - 1
            self._functions.append(
                [skfuzzy.trimf(c, [c[max(j - 1, 0)], c[j], c[min(j + 1, last)]]) for j in range(len(c))]
            )
        middle = np.tile(design.middle, (len(design.rules), 1))
        for i, s in enumerate(design.sets):
            middle[:, i] = s.centres[design.rules[:, i]]
        self._offset = design.bases - (design.slopes * middle).sum(axis=1)
        self._spread_offset = np.log10(design.spreads) - (design.spread_slopes * middle).sum(axis=1)

    def infer(self, row: FloatArray) -> tuple[float, float]:
        """One axle's output and spread; NaN where no rule fires."""
        d = self._d
        held = np.clip(row, d.low, d.high)
        weights = np.ones(len(d.rules))
        for i, (s, functions) in enumerate(zip(d.sets, self._functions, strict=True)):
            x = min(max(float(row[i]), s.centres[0]), s.centres[-1])
            degrees = np.array([float(skfuzzy.interp_membership(s.centres, f, x)) for f in functions])
            weights *= degrees[d.rules[:, i]]
        total = float(weights.sum())
        if total < MIN_FIRING:
            return float("nan"), float("nan")
        weights /= total
        output = float(weights @ self._offset + (weights @ d.slopes) @ held)
        logs = float(weights @ self._spread_offset + (weights @ d.spread_slopes) @ held)
        return min(max(output, 0.0), 100.0), float(10 ** min(max(logs, LOG_SPREADS[0]), LOG_SPREADS[1]))


def rows() -> Iterator[Row]:
    """By axles. Times are per axle: the peers take one at a time, ours all in one call, C in one loop."""
    design = load_design(resources.DESIGN)
    c = library()
    show("skfuzzy's control system is built")
    primitives = PrimitivesPeer(design)
    skipped = [] if c is not None else ["C skipped: no compiler (cc)"]
    try:
        system = ControlPeer(without_slopes(design))
    except ModuleNotFoundError as e:
        system = None
        skipped.append(f"skfuzzy.control skipped: {e.msg}")
    for axles in AXLES:
        show(f"fuzzy inference, {axles} axles")
        inputs = moments(design, axles)
        flat = inputs.reshape(-1, inputs.shape[-1])
        rules = Fuzzy(design)
        cases = {
            "ours": Case(partial(_ours, rules, inputs), MOMENTS * axles),
            "skfuzzy primitives": Case(partial(_primitives, primitives, flat), 32),
        }
        if system is not None:
            cases["skfuzzy.control"] = Case(partial(_control, system, flat), 2)
        if c is not None:
            cases["C"] = Case(partial(_native, RulesLoop(c, design), flat), len(flat))
        row = Row("fuzzy: the inference, µs an axle", f"{axles} axles", times=in_turn(cases, 3.0))
        row.note = "; ".join(skipped)
        row.compare("skfuzzy.control", "ours", Goal("≥", 1000) if axles == 4 else None)
        row.compare("skfuzzy primitives", "ours")
        row.compare("ours", "C")
        yield row


def _ours(rules: Fuzzy, inputs: FloatArray, count: int) -> None:
    for i in range(max(1, count // inputs.shape[1])):
        rules.infer(inputs[i % MOMENTS])


def _control(peer: ControlPeer, flat: FloatArray, count: int) -> None:
    for i in range(count):
        peer.infer(flat[i % len(flat)])


def _primitives(peer: PrimitivesPeer, flat: FloatArray, count: int) -> None:
    for i in range(count):
        peer.infer(flat[i % len(flat)])


def _native(loop: RulesLoop, flat: FloatArray, count: int) -> None:
    output, firing, spread = np.empty(count), np.empty(count), np.empty(count)
    loop.run(flat[:count], output, firing, spread)
