"""Why an axle's adhesion is what it is at a time, in words."""

import math

import numpy as np

from wrcd.tools.explain import sentence
from wrcd.tools.monitor.axle import INPUTS, AxleModel, row_at
from wrcd.tools.monitor.board import Board
from wrcd.tools.monitor.happenings import spell_text
from wrcd.tools.monitor.model import Model
from wrcd.tools.monitor.panels import NO_VALUE, axle_at, interval, percent
from wrcd.tools.monitor.watched import REASONS

AROUND_US = 1_000_000  # before and after that are shown beside it
DETAIL_US = 400_000  # a Detail frame older than this says nothing of a moment
Line = tuple[str, str]  # a text and its style


def why(board: Board, at_us: int) -> list[Line]:
    """Of the chosen axle: what it was, a second before and after, which model and rule decided, what spoke against."""
    model, axle = board.model, board.axle
    now = axle_at(model, axle, at_us)
    lines: list[Line] = [(f"Axle {axle.number} at {board.clock(at_us)}", "title")]
    near = [h for h in board.happenings() if abs(h.time_us - at_us) <= AROUND_US]
    lines += [(f"{board.clock(h.time_us).split('  ')[0]}: {h.text}", "warn") for h in near[:3]]
    if now.spell is not None and not any(spell_text(now.spell) in h.text for h in near):
        lines.append((spell_text(now.spell), "good" if now.spell.state == "Valid" else "warn"))
    lines.append((
        f"available {percent(now.available_pct)} (90 % interval {interval(now)}), in use {percent(now.used_pct)}, "
        f"contact {now.contact or NO_VALUE}, surface {now.surface or NO_VALUE}",
        "plain",
    ))  # fmt: skip
    if math.isfinite(now.truth_pct):
        lines.append((f"truth {percent(now.truth_pct)}, in use {percent(now.truth_used_pct)}", "truth"))
    lines += [*_inputs(axle, at_us), ("", "plain")]
    return [*lines, *_models(model, axle, at_us)]


def _models(model: Model, axle: AxleModel, at_us: int) -> list[Line]:
    detail, design = axle.detail, model.config.design
    times = [at_us - AROUND_US, at_us, min(at_us + AROUND_US, model.now_us)]
    rows = [row_at(detail.time_us, t, DETAIL_US) if axle.has_detail else None for t in times]
    if rows[1] is None:
        text = "no AdhesionDetail frame near that time" if axle.has_detail else "this train sends no AdhesionDetail"
        return [(f"{text}: model, rule and residuals are not known", "dim")]
    heads = ("a second before", "then", "a second after")
    width = max(map(len, design.model_names)) + 2
    out: list[Line] = [("residuals in dB".ljust(width + 2) + "".join(f"{h:>17}" for h in heads), "label")]
    for m, name in enumerate(design.model_names):
        text = f"{m + 1} {name}".ljust(width + 2)
        for k in rows:
            value = math.nan if k is None else float(detail.residual_db[k, m])
            wins = k is not None and int(detail.winner[k]) == m + 1
            text += f"{(f'{value:+.1f}' if math.isfinite(value) else NO_VALUE) + (' wins' if wins else ''):>17}"
        out.append((text, "selected" if int(detail.winner[rows[1]]) == m + 1 else "plain"))
    available = [axle_at(model, axle, t).available_pct for t in times]
    out.append(("available".ljust(width + 2) + "".join(f"{percent(v):>17}" for v in available), "available"))
    told: dict[int, list[str]] = {}
    for head, k in zip(heads, rows, strict=True):
        if k is not None:
            told.setdefault(int(detail.rule[k]), []).append(head)
    out.append(("", "plain"))
    winners = [0 if k is None else int(detail.winner[k]) for k in rows]
    if 0 < winners[1] <= len(design.model_names):
        before = f", a second before {design.model_names[winners[0] - 1]}" if 0 < winners[0] != winners[1] else ""
        out.append((f"model: {design.model_names[winners[1] - 1]}{before}", "plain"))
    for rule, when in told.items():
        text = sentence(design, rule - 1) if 0 < rule <= len(design.rules) else "no rule spoke"
        out.append((f"rule {rule}, {' and '.join(when)}: {text}", "plain"))
    return out


def _inputs(axle: AxleModel, at_us: int) -> list[Line]:
    """What was wrong with inputs within a second before."""
    out: list[Line] = []
    detail, health = axle.detail, axle.health
    first, end = np.searchsorted(detail.time_us, (at_us - AROUND_US, at_us), side="right")
    stale = [bool(detail.stale[first:end, place].any()) for place in range(len(INPUTS))]
    first, end = np.searchsorted(health.time_us, (at_us - AROUND_US, at_us), side="right")
    part = slice(first, end)
    for place, name in enumerate(INPUTS):
        found = []
        if stale[place]:
            found.append("past its time-out")
        reasons = sorted({int(r) for r in health.refused[part, place] if 0 < r < len(REASONS)})
        if reasons:
            found.append("refused for " + ", ".join(REASONS[r] for r in reasons))
        if end > first and (health.reach[part, place] != 255).any():
            found.append("not always reached")
        if found:
            out.append((f"{name}: {'; '.join(found)}", "bad"))
    if end > first:
        if health.outlier[part].any():
            out.append(("measurements were left out as outliers", "warn"))
        if health.unchanged[part].any():
            out.append(("a sensor said the same all the time", "bad"))
    return out or [("nothing is said against its inputs in the second before", "dim")]
