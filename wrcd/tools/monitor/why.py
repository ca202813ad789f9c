"""Why an axle's adhesion is what it is: what `wrcd why` says, of what is held; and the residuals around."""

import math
from pathlib import Path

import numpy as np

from wrcd.tools.monitor.axle import AxleModel, row_at
from wrcd.tools.monitor.board import Board
from wrcd.tools.monitor.model import Model
from wrcd.tools.monitor.panels import NO_VALUE, percent
from wrcd.tools.story import why as story_why
from wrcd.tools.story.events import of_frames
from wrcd.tools.story.inputs import Inputs
from wrcd.tools.story.records import Axle, BusStatistics, Fall, Story

AROUND_US = 1_000_000  # before and after that are shown beside a moment
DETAIL_US = 400_000  # a Detail frame older than this says nothing of a moment
AROUND_STORY_US = 120_000_000  # of what is held, that goes into the story
Line = tuple[str, str]  # a text and its style


def why(board: Board, at_us: int, width: int) -> list[Line]:
    """Of the chosen axle."""
    model, axle = board.model, board.axle
    if not len(axle.adhesion.time_us):
        return [("no Adhesion frame has come of it", "bad")]
    told = story(model, axle, tuple(f for f in board.falls(axle) if abs(f.end_us - at_us) < AROUND_STORY_US), at_us)
    at_us = max(told.begin_us, min(at_us, told.end_us))
    head, *rest = story_why.answer(told, axle.number, at_us, width)
    return [(head, "title"), *((text, "plain") for text in rest), ("", "plain"), *_residuals(model, axle, at_us)]


def story(model: Model, axle: AxleModel, falls: tuple[Fall, ...], at_us: int) -> Story:
    """What is held of an axle around a time, as the story of a log."""
    adhesion, detail, health = axle.adhesion, axle.detail, axle.health
    rows = slice(*np.searchsorted(adhesion.time_us, (at_us - AROUND_STORY_US, at_us + AROUND_STORY_US)))
    part = type(adhesion)(*(getattr(adhesion, name)[rows] for name in adhesion.__slots__))
    if not len(part.time_us):
        part = adhesion
    begin_us, end_us = model.begin_us or 0, model.now_us
    has_detail = axle.has_detail and len(detail.time_us) > 0
    has_health = axle.has_health and len(health.time_us) > 0
    events = of_frames(
        axle.number, part, detail if has_detail else None, health if has_health else None, axle.cycle_us,
        max(begin_us, int(part.time_us[0])), min(end_us, int(part.time_us[-1]) + axle.cycle_us),
    )  # fmt: skip
    truth = axle.truth if len(axle.truth.time_us) else None
    record = Axle(
        axle.number, adhesion, detail if has_detail else None, health if has_health else None, truth, events
    )  # fmt: skip
    held, place = model.inputs_within(at_us - AROUND_STORY_US, at_us + AROUND_STORY_US), model.axles.index(axle)
    inputs = Inputs(model.config)
    torque = inputs.torque(held, place)
    none = np.zeros(0)
    bus = BusStatistics(
        (), none.astype(np.int64), none.astype(np.float32), none.astype(np.float32), 0, none.astype(np.int64)
    )
    return Story(
        Path(), "", model.source, begin_us, end_us, (record,), inputs.speed(held), None,
        {} if torque is None else {axle.number: torque}, None, None, None, bus, falls, (), (), model.config,
    )  # fmt: skip


def _residuals(model: Model, axle: AxleModel, at_us: int) -> list[Line]:
    detail, design = axle.detail, model.config.design
    times = [at_us - AROUND_US, at_us, min(at_us + AROUND_US, model.now_us)]
    rows = [row_at(detail.time_us, t, DETAIL_US) if axle.has_detail else None for t in times]
    if rows[1] is None:
        text = "no AdhesionDetail frame near that time" if axle.has_detail else "this train sends no AdhesionDetail"
        return [(f"{text}: model, rule and residuals are not known", "dim")]
    heads = ("a second before", "then", "a second after")
    width = max(map(len, design.model_names)) + 4
    out: list[Line] = [("residuals in dB".ljust(width) + "".join(f"{h:>17}" for h in heads), "label")]
    for m, name in enumerate(design.model_names):
        text = f"{m + 1} {name}".ljust(width)
        for k in rows:
            value = math.nan if k is None else float(detail.residual_db[k, m])
            wins = k is not None and int(detail.winner[k]) == m + 1
            text += f"{(f'{value:+.1f}' if math.isfinite(value) else NO_VALUE) + (' wins' if wins else ''):>17}"
        out.append((text, "selected" if int(detail.winner[rows[1]]) == m + 1 else "plain"))
    a = axle.adhesion
    at = [row_at(a.time_us, t, DETAIL_US) for t in times]
    values = [math.nan if k is None else float(a.available_pct[k]) for k in at]
    return [*out, ("available".ljust(width) + "".join(f"{percent(v):>17}" for v in values), "available")]
