"""What the runs of all suites come to: figures by suite and case, goals, runs whose daemon was wrong."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from sim_ecu.loop.goals import goals
from sim_ecu.loop.judge import Figures
from sim_ecu.loop.names import BARE_AND_WITH, IDEAL, LAWS, WITH
from sim_ecu.loop.play import Outcome
from sim_ecu.loop.statistics import against, front, spreads
from sim_ecu.loop.suites.case import FIRST_TEST_SEED, Case

Found = Mapping[str, Mapping[int, Outcome]]  # by controller and number


def judge_all(cases: Sequence[Case], outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """All figures: leaves are Spreads, Figures, numbers and words."""
    found: dict[tuple[str, str], dict[str, dict[int, Outcome]]] = {}
    for o in outcomes:
        found.setdefault((o.suite, o.case), {}).setdefault(o.controller, {})[o.number] = o
    suites: dict[str, Any] = {}
    for case in cases:
        bare = found.get((case.suite, case.bare), {}) if case.bare else {}
        own = {**{k: v for k, v in bare.items() if k not in case.controllers}, **found[case.suite, case.name]}
        suites.setdefault(case.suite, {})[case.name] = _case(case, own)
    return {
        "suites": suites,
        "goals": [
            {
                "suite": g.suite,
                "kind": g.kind,
                "what": g.goal.what,
                "figure": g.goal.figure,
                "bound": g.goal.bound,
                "at_least": g.goal.at_least,
                "verdict": g.goal.verdict,
                "ideal": g.ideal,
                "ideal_is": g.ideal_is,
            }
            for g in goals(suites)
        ],
        "wrong": [_wrong(o, h.axle, h.outside_s, h.over_s) for o in outcomes for h in o.said if h.wrong],
        "runs": [_row(o) for o in outcomes],
    }


def _case(case: Case, found: Found) -> dict[str, Any]:
    runs: dict[str, dict[int, Figures]] = {
        name: {n: o.figures for n, o in part.items()} for name, part in found.items()
    }
    braking = case.braking
    whole = all(name in runs for name in BARE_AND_WITH)
    return {
        "braking": braking,
        "known_before": case.known_before,
        "axles": case.axles,
        "controllers": {
            name: {"runs": len(r), "not_stopped": sum(braking and not f.stopped for f in r.values())} | spreads(r)
            for name, r in runs.items()
        },
        "against": {law: against(runs[WITH[law]], runs[law], braking) for law in LAWS if whole},
        "ideal": {law: against(runs[IDEAL], runs[law], braking) for law in LAWS if whole and IDEAL in runs},
        "front": front({name: runs[name] for name in BARE_AND_WITH}, braking) if whole else None,
        "said": {law: _said(list(found[WITH[law]].values())) for law in LAWS if WITH[law] in found},
    }


def _said(outcomes: Sequence[Outcome]) -> dict[str, float]:
    """What a daemon said; of rows without one, that it said nothing."""
    every = [h for o in outcomes for h in o.said]
    if not every:
        return {"valid": math.nan, "outside": math.nan, "outside_s": 0.0, "wrong_runs": 0, "runs": len(outcomes)}
    return {
        "valid": float(np.mean([h.valid for h in every])),
        "outside": float(np.mean([h.outside for h in every])),
        "outside_s": max(h.outside_s for h in every),
        "wrong_runs": sum(any(h.wrong for h in o.said) for o in outcomes),
        "runs": len(outcomes),
    }


def _wrong(o: Outcome, axle: int, outside_s: float, over_s: float) -> dict[str, Any]:
    return {
        "suite": o.suite, "case": o.case, "controller": o.controller, "seed": FIRST_TEST_SEED + o.number,
        "axle": axle, "outside_s": outside_s, "over_s": over_s,
    }  # fmt: skip


def _row(o: Outcome) -> dict[str, Any]:
    return {
        "suite": o.suite, "case": o.case, "controller": o.controller, "seed": FIRST_TEST_SEED + o.number,
        **asdict(o.figures), "said": [asdict(h) for h in o.said],
    }  # fmt: skip
