"""The columns of a Story that a page holds, by table."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from wrcd.core.causes import Validity
from wrcd.core.vocabulary import MESSAGES, Numeric
from wrcd.tools.report.columns import CODE, NUMBER, TIME, Column, step_of
from wrcd.tools.report.gaps import thin, with_gaps
from wrcd.tools.story.counts import NO_COUNTS, added
from wrcd.tools.story.explain import INPUT_MAX_AGE_US
from wrcd.tools.story.records import Adhesion, Axle, Detail, Health, Series, Story, Times, Truth
from wrcd.tools.story.statistics import SECOND_US

Table = Mapping[str, Column]
INPUTS = ("yaw", "lateral", "torque", "speed")
VALIDITIES = (Validity.NOT_AVAILABLE, Validity.VALID, Validity.DEGRADED)  # as places in the vocabulary
REASONS = 13  # places of a reason, 0: none was refused
SOME_MISSING, ALL_MISSING, STALE = REASONS, REASONS + 1, REASONS + 2  # codes of an input beside the reasons
# between two rows, where they are too few to tell: as the frames' own cycles
FAST_US, SLOW_US, DAEMON_US = 20_000, 100_000, SECOND_US
TIME_STEP_S = 1e-4
MAX_SERIES_HZ = 20.0  # of speed and torque: more of their samples than this are left out


def tables(story: Story) -> dict[str, Table]:
    """Tables by name; an axle's begin with "axle" and its number."""
    out: dict[str, Table] = {}
    for axle in story.axles:
        for name, table in _of_axle(story, axle).items():
            out[f"axle{axle.number}.{name}"] = table
        if (torque := story.torque.get(axle.number)) is not None:
            out[f"axle{axle.number}.torque"] = _series(story, torque)
    for name, series in (("speed", story.speed), ("distance", story.distance)):
        if series is not None and len(series.time_us):
            out[name] = _series(story, series)
    for name, series, key in (
        ("status", story.status, "status_message"),
        ("rejects", story.rejects, "rejects_message"),
        ("link", story.link, "link_message"),
    ):
        if series is not None and len(series.time_us):
            out[name] = _counts(story, series, key)
    bus = story.bus
    rates = {"time": _time(story, bus.time_us), **_numbers({"rate": bus.frames_per_s, "load": bus.load_pct})}
    out["bus"] = with_gaps(rates, bus.time_us, SECOND_US)
    return out


def _of_axle(story: Story, axle: Axle) -> dict[str, Table]:
    out: dict[str, Table] = {"events": _events(story, axle)}
    if len(axle.adhesion.time_us):
        out["adhesion"] = _adhesion(story, axle.adhesion)
        out["ages"] = _ages(axle.adhesion)
    if axle.detail is not None and len(axle.detail.time_us):
        out["detail"] = _detail(story, axle.detail)
    if axle.health is not None and len(axle.health.time_us):
        out["inputs"] = _health(story, axle.health, axle.detail)
    if axle.truth is not None and len(axle.truth.time_us):
        out["truth"] = _truth(story, axle.truth)
    return out


def _time(story: Story, time_us: Times, step_s: float = TIME_STEP_S) -> Column:
    return Column((time_us - story.begin_us) / 1e6, step_s, TIME)


def _numbers(values: Mapping[str, NDArray[np.floating]]) -> dict[str, Column]:
    return {name: Column(v, step_of(v), NUMBER) for name, v in values.items()}


def _adhesion(story: Story, a: Adhesion) -> Table:
    """The interval is held as its distance from the estimate, which is the same for most frames."""
    table = {
        "time": _time(story, a.time_us),
        "available": Column(a.available_pct, 0.01),
        "used": Column(a.used_pct, 0.01),
        "low": Column(a.available_pct - a.low_pct, 0.01, base="available", sign=-1),
        "high": Column(a.high_pct - a.available_pct, 0.01, base="available"),
        "age": Column(a.age_ms, 1.0),
        **{
            name: Column(codes, 1.0, CODE)
            for name, codes in (
                ("validity", a.validity), ("confidence", a.confidence), ("contact", a.contact), ("surface", a.surface),
            )
        },
    }  # fmt: skip
    rows = thin(a.available_pct, (a.validity, a.contact))
    time_us = a.time_us
    if rows is not None:
        table, time_us = _taken(table, rows), time_us[rows]
    return with_gaps(table, time_us, FAST_US)


def _ages(a: Adhesion) -> Table:
    """Share of frames, %, whose age is beyond each millisecond; NaN where none is."""
    ages = np.sort(a.age_ms[np.isfinite(a.age_ms)])
    edges = np.arange(0.0, float(ages.max(initial=0.0)) + 2.0)
    beyond = len(ages) - np.searchsorted(ages, edges, side="right")
    share = np.where(beyond > 0, 100.0 * beyond / max(len(ages), 1), np.nan)
    return {"time": Column(edges, 1.0, TIME), "share": Column(share, 1e-4)}


def _detail(story: Story, d: Detail) -> Table:
    residuals = {f"residual{m + 1}": Column(d.residual_db[:, m], 0.1) for m in range(d.residual_db.shape[1])}
    winner = np.clip(d.winner, 0, 4)
    padded = np.column_stack([np.full(len(winner), np.nan, dtype=np.float32), d.residual_db])
    lowest = padded[np.arange(len(winner)), winner]
    stale = d.stale @ (1 << np.arange(d.stale.shape[1]))
    table = {
        "time": _time(story, d.time_us),
        **residuals,
        "winning": Column(lowest, 0.1),
        "winner": Column(winner, 1.0, CODE),
        "rule": Column(d.rule, 1.0, CODE),
        "cause": Column(d.cause, 1.0, CODE),
        "stale": Column(stale, 1.0, CODE),
    }
    return with_gaps(table, d.time_us, SLOW_US)


def _health(story: Story, h: Health, detail: Detail | None) -> Table:
    """Of each input one code: why a frame was refused, else whether frames are missing or it is stale."""
    table = {"time": _time(story, h.time_us)}
    place = (
        None if detail is None or not len(detail.time_us) else np.searchsorted(detail.time_us, h.time_us, "right") - 1
    )
    for i, name in enumerate(INPUTS):
        reach = h.reach[:, i].astype(np.int16)  # -1 is a row of a gap
        code = np.where(reach == 0, ALL_MISSING, np.where(reach < 255, SOME_MISSING, 0))
        code = np.where(h.refused[:, i] > 0, h.refused[:, i], code)
        if place is not None and detail is not None:
            code = np.where((place >= 0) & detail.stale[np.maximum(place, 0), i] & (code == 0), STALE, code)
        table[name] = Column(code, 1.0, CODE)
        table[f"{name}_reach"] = Column(reach, 1.0, CODE)
    table["plausibility"] = Column(h.plausibility, 1.0, CODE)
    table["marks"] = Column(h.outlier + 2 * h.unchanged.astype(int), 1.0, CODE)
    return with_gaps(table, h.time_us, SLOW_US)


def _truth(story: Story, t: Truth) -> Table:
    table = {
        "time": _time(story, t.time_us),
        "available": Column(t.available_pct, 0.01),
        "used": Column(t.used_pct, 0.01),
    }
    rows, time_us = thin(t.available_pct), t.time_us
    if rows is not None:
        table, time_us = _taken(table, rows), time_us[rows]
    return with_gaps(table, time_us, FAST_US)


def _events(story: Story, axle: Axle) -> Table:
    validity = np.array([VALIDITIES.index(e.validity) for e in axle.events], dtype=np.int8)
    cause = np.array([int(e.cause) for e in axle.events], dtype=np.int8)
    begin = np.array([e.begin_us for e in axle.events], dtype=np.int64)
    end = np.array([e.end_us for e in axle.events], dtype=np.int64)
    return {
        "time": _time(story, begin, 1e-6), "end": _time(story, end, 1e-6),
        "validity": Column(validity, 1.0, CODE), "cause": Column(cause, 1.0, CODE),
        "state": Column(32 * validity.astype(np.int16) + cause, 1.0, CODE),
    }  # fmt: skip


def _series(story: Story, series: Series) -> Table:
    """At most MAX_SERIES_HZ: the first sample of each slot."""
    slot = (series.time_us - story.begin_us) // int(1e6 / MAX_SERIES_HZ)
    first = np.flatnonzero(np.diff(slot, prepend=np.int64(np.iinfo(np.int64).min)))
    rows = first if len(first) < len(slot) else np.arange(len(slot))
    time_us = series.time_us[rows]
    table = {"time": _time(story, time_us), **_numbers({n: v[rows] for n, v in series.values.items()})}
    if series.constant:
        return table
    return with_gaps(table, time_us, INPUT_MAX_AGE_US // 3)


def _counts(story: Story, series: Series, key: str) -> Table:
    """States as codes, counts as what was added since the frame before: WrcdRejects says so itself, others count on."""
    table = {"time": _time(story, series.time_us)}
    grown = added(series, key)
    for name, values in series.values.items():
        if not isinstance(MESSAGES[key].get(name), Numeric):
            table[name] = Column(values, 1.0, CODE)
        elif name not in NO_COUNTS:
            table[name] = Column(grown.get(name, values), 1.0)
    return with_gaps(table, series.time_us, DAEMON_US)


def _taken(table: Mapping[str, Column], rows: NDArray[np.intp]) -> dict[str, Column]:
    return {name: Column(c.values[rows], c.step, c.kind, c.base, c.sign) for name, c in table.items()}
