"""The score as tables for a person (Markdown; the README's are these)."""

import math
from typing import Any

from sim_ecu.score.metrics import OURS


def tables(result: dict[str, Any]) -> list[str]:
    """Markdown, line by line."""
    s, d = result["suites"], result["design"]
    out = [
        f"design {d['name']} {d['checksum'][:12]}, window {d['window_s']:g} s; "
        "errors in percentage points (pp) of MuAvailable",
        result["seeds"],
    ]
    if g := s.get("grid"):
        lo, hi = g["speeds"]
        out += ["", f"**grid**: curves A to F and between, {lo:g} to {hi:g} m/s, good and poor track, mems sensors", ""]
        out += _accuracy_table(g["compared"])
        if g["tactical"]:
            out += _rows([("wrcd, tactical sensors", g["tactical"])])
        out += ["", *_by_table(g)]
    if r := s.get("robust"):
        out += ["", "**robust**: a world that is not as the design thinks, mems sensors", ""]
        out += _accuracy_table(r["compared"])
        out += ["", *_groups_table(r["groups"])]
    if r := s.get("rough"):
        out += ["", "**rough**: tracks smoother and rougher than any in the training, mems sensors", ""]
        out += _groups_table(r["groups"])
    if p := s.get("paper"):
        out += ["", "**paper**: held at the peak at 25 m/s, from 1.0 s after the creep is there", ""]
        out += ["| curve | true, % | mean error | within 1 pp or 10 % |", "|---|---|---|---|"]
        out += [f"| {c} | {v['true']:.1f} | {v['mean']:.2f} | {_pct(v['share'])} |" for c, v in p["curves"].items()]
    if t := s.get("transitions"):
        out += ["", "**transitions**: seconds from a change of rail until the estimate crosses the geometric mean", ""]
        out += ["| | median | 95th percentile | changes | on that side before |", "|---|---|---|---|---|"]
        rows = [("all", t["all"])] + [
            (f"{'dry to ' + c if way == 'from dry' else c + ' to dry'}", v)
            for c, both in t["curves"].items()
            for way, v in both.items()
        ]
        out += [
            f"| {n} | {v['median']:.2f} | {v['p95']:.2f} | {v['changes']} | {v['already_there']} |" for n, v in rows
        ]
    if h := s.get("dry-hours"):
        out += [
            "",
            f"**dry-hours**: called Low or worse {h['episodes']} times in {h['hours']:.2f} h of dry rail, poor track",
        ]
    out += ["", "**goals**: what the default design is held to", ""]
    out += ["| goal | value | bound | |", "|---|---|---|---|"]
    for goal in result["goals"]:
        sign = "≥" if goal["at_least"] else "≤"
        out.append(
            f"| {goal['what']} | {goal['value']:.3g} | {sign} {goal['bound']:g} | "
            + ("met |" if goal["met"] else "MISSED |")
        )
    return out


def _accuracy_table(compared: dict[str, Any]) -> list[str]:
    head = ["| | mean | p95 | below half | above 0.9 | frames |", "|---|---|---|---|---|---|"]
    return head + _rows(list(compared.items()))


def _rows(rows: list[tuple[str, dict[str, float]]]) -> list[str]:
    return [
        f"| {n} | {v['mean']:.2f} | {v['p95']:.2f} | {v['below_half']:.2f} | {v['above_0.9']:.2f} | {v['frames']} |"
        for n, v in rows
        if v["frames"]
    ]


def _groups_table(groups: dict[str, Any]) -> list[str]:
    names = [n for n in next(iter(groups.values())) if n not in ("available", "IMM")]
    out = [f"| mean error (p95 of {OURS}) | " + " | ".join(names) + " |", "|---|" + "---|" * len(names)]
    for group, row in groups.items():
        cells = [f"{row[n]['mean']:.2f}" + (f" ({row[n]['p95']:.1f})" if n == OURS else "") for n in names]
        out.append(f"| {group} | " + " | ".join(cells) + " |")
    return out


def _by_table(g: dict[str, Any]) -> list[str]:
    out = []
    for key in ("utilisation", "curve"):
        row = g["by"][key]
        out += [f"| {key} | " + " | ".join(row) + " |", "|---|" + "---|" * len(row)]
        out += ["| mean error | " + " | ".join(f"{v:.2f}" for v in row.values()) + " |", ""]
    names = list(g["surfaces"])
    out += ["| truly | " + " | ".join(f"said {n}" for n in names) + " |", "|---|" + "---|" * len(names)]
    out += [f"| {t} | " + " | ".join(_pct(row.get(n, 0.0)) for n in names) + " |" for t, row in g["surfaces"].items()]
    c = g["confidence"]
    out += ["", "| Confidence | share of frames | holds the truth |", "|---|---|---|"]
    out += [f"| {n} | {_pct(v['share'])} | {_pct(v['covers'])} |" for n, v in c["levels"].items()]
    out += ["", f"Median half-width {c['median_half_width']:g} pp; one constant interval that holds the truth as often "
            f"({_pct(c['covers'])}) needs {c['constant_half_width']:.2f} pp."]  # fmt: skip
    k = g["contact"]
    out += [f"ContactState right in {_pct(k['right'])} outside utilisations of 0.85 … 1; of the frames from 0.98 on, "
            f"{_pct(k['saturated_right'])} are called Saturated. MuAvailable there in "
            f"{_pct(g['available'])} of the frames from 2 s on."]  # fmt: skip
    return out


def _pct(x: float) -> str:
    return "–" if math.isnan(x) else f"{100 * x:.1f} %"
