"""The columns of a story that a page holds, by table: with gaps where frames are missing, thinned where there are too
many, and packed as whole steps, differences, byte planes, gzip, base64. data.js unpacks them."""

import base64
import gzip
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wrcd.core.vocabulary import MESSAGES, Numeric
from wrcd.logs.statistics import NO_COUNTS, SECOND_US, added
from wrcd.logs.story_events import VALIDITIES
from wrcd.logs.story_records import AdhesionRecord, Detail, HealthRecord, Series, Story, StoryAxle, Times, TruthRecord
from wrcd.logs.why import INPUT_MAX_AGE_US

TIME, NUMBER, CODE = "time", "number", "code"  # float64, float32 and int16 in the browser
LEVEL = 6  # of gzip: 9 takes three times as long for 2 % less
MAX_STEPS = 30_000  # of a column whose step is chosen by its values
MAX_ROWS = 200_000  # of a table; an hour of Adhesion has 180 000
GAP_CYCLES = 3.5  # a consumer calls it stale after three
MIN_GAP_US = 30_000
MIN_ROWS = 4  # whose median tells how often they come
INPUTS = ("yaw", "lateral", "torque", "speed")
REASONS = 13  # places of a reason, 0: none was refused
SOME_MISSING, ALL_MISSING, STALE = REASONS, REASONS + 1, REASONS + 2  # codes of an input beside the reasons
# between two rows, where they are too few to tell: as the frames' own cycles
FAST_US, SLOW_US, DAEMON_US = 20_000, 100_000, SECOND_US
TIME_STEP_S = 1e-4
MAX_SERIES_HZ = 20.0  # of speed and torque: more of their samples than this are left out


@dataclass(frozen=True, slots=True)
class PageColumn:
    """Values (n,) that are kept to the nearest step. NaN, and a code below 0, is: there is none.

    base and sign: the page holds base + sign * values, base another column of the table.
    """

    values: NDArray[Any]
    step: float
    kind: str = NUMBER
    base: str = ""
    sign: int = 1


PageTable = Mapping[str, PageColumn]


@dataclass(frozen=True, slots=True)
class PackedTable:
    """A table for the page: what the browser must know of it, as JSON, and its bytes in base64."""

    head: dict[str, Any]
    text: str


def step_of(values: NDArray[Any]) -> float:
    """Return 1, 2 or 5 times a power of ten, such that values take at most MAX_STEPS of them."""
    finite = values[np.isfinite(values)]
    widest = float(np.abs(finite).max(initial=0.0))
    if widest == 0.0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(widest / MAX_STEPS))
    return float(next(power * m for m in (1, 2, 5, 10) if power * m * MAX_STEPS >= widest))


def pack(table: PageTable) -> PackedTable:
    """Return columns of one length, packed."""
    heads, parts, count = [], [], 0
    for name, column in table.items():
        count = len(column.values)
        head, part = _packed(column)
        heads.append({"name": name, **head})
        parts.append(part)
    data = gzip.compress(b"".join(parts), LEVEL, mtime=0)
    return PackedTable({"rows": count, "columns": heads}, base64.b64encode(data).decode("ascii"))


def _packed(column: PageColumn) -> tuple[dict[str, Any], bytes]:
    values = np.asarray(column.values, dtype=np.float64)
    there = np.isfinite(values)
    if column.kind == CODE:
        there &= values >= 0
    step = column.step
    while True:
        whole = np.rint(values / step)
        low = float(whole[there].min()) if there.any() else 0.0
        high = float(whole[there].max()) - low + 1.0 if there.any() else 0.0
        if high < 2.0**32:
            break
        step *= 10.0  # of times: hours of whole microseconds do not fit
    width = 1 if high < 2**8 else 2 if high < 2**16 else 4
    steps = np.where(there, whole - low + 1.0, 0.0).astype(f"<u{width}")
    order = 2 if column.kind == TIME else 1
    for _ in range(order):
        steps = np.diff(steps, prepend=steps.dtype.type(0))
    planes = steps.view(np.uint8).reshape(len(steps), width).T
    head: dict[str, Any] = {"kind": column.kind, "width": width, "order": order, "step": step, "low": low}
    if column.base:
        head |= {"base": column.base, "sign": column.sign}
    return head, planes.tobytes()


def with_gaps(table: PageTable, time_us: NDArray[np.int64], cycle_us: int) -> dict[str, PageColumn]:
    """Return columns with a row of nothing where frames are missing, and behind the last: a curve breaks there, and the
    cursor finds none. cycle_us: between two rows where they are too few to tell."""
    if not len(time_us):
        return dict(table)
    between = np.diff(time_us)
    usual_us = cycle_us if len(time_us) < MIN_ROWS else int(np.median(between))
    at = np.append(np.flatnonzero(between > max(GAP_CYCLES * usual_us, MIN_GAP_US)) + 1, len(time_us))
    return {name: _inserted(c, at, usual_us) for name, c in table.items()}


def _inserted(c: PageColumn, at: NDArray[np.intp], usual_us: int) -> PageColumn:
    nothing = c.values[at - 1] + 3.0 * usual_us / 1e6 if c.kind == TIME else -1 if c.kind == CODE else np.nan
    return replace(c, values=np.insert(c.values, at, nothing))


def thin(
    values: NDArray[np.float32], codes: tuple[NDArray[np.int8], ...] = (), most: int = MAX_ROWS
) -> NDArray[np.intp] | None:
    """Return rows that a page keeps of more than `most`: extremes of each run, changes of codes; else None."""
    n = len(values)
    if n <= most:
        return None
    run = math.ceil(2 * n / most)
    starts = np.arange(0, n, run)
    padded = np.full(len(starts) * run, np.nan, dtype=np.float32)
    padded[:n] = values
    runs = padded.reshape(-1, run)
    low = starts + np.where(np.isnan(runs), np.inf, runs).argmin(axis=1)
    high = starts + np.where(np.isnan(runs), -np.inf, runs).argmax(axis=1)
    changes = [np.flatnonzero(np.diff(c)) + 1 for c in codes]
    return np.unique(np.concatenate([low, high, *changes, [n - 1]]))


def tables(story: Story) -> dict[str, PageTable]:
    """Return tables by name; an axle's begin with "axle" and its number."""
    out: dict[str, PageTable] = {}
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


def _of_axle(story: Story, axle: StoryAxle) -> dict[str, PageTable]:
    out: dict[str, PageTable] = {"events": _events(story, axle)}
    if len(axle.adhesion.time_us):
        out["adhesion"] = _adhesion(story, axle.adhesion)
        out["ages"] = _ages(axle.adhesion)
    if axle.detail is not None and len(axle.detail.time_us):
        out["detail"] = _detail(story, axle.detail)
    if axle.health is not None and len(axle.health.time_us):
        out["inputs"] = _health(story, axle.health, axle.detail)
    if axle.own is not None:
        out["own"] = _series(story, axle.own)
    if axle.truth is not None and len(axle.truth.time_us):
        out["truth"] = _truth(story, axle.truth)
    return out


def _time(story: Story, time_us: Times, step_s: float = TIME_STEP_S) -> PageColumn:
    return PageColumn((time_us - story.begin_us) / 1e6, step_s, TIME)


def _numbers(values: Mapping[str, NDArray[np.floating]]) -> dict[str, PageColumn]:
    return {name: PageColumn(v, step_of(v), NUMBER) for name, v in values.items()}


def _adhesion(story: Story, a: AdhesionRecord) -> PageTable:
    """The interval is held as its distance from the estimate, which is the same for most frames."""
    table = {
        "time": _time(story, a.time_us),
        "available": PageColumn(a.available_pct, 0.01),
        "used": PageColumn(a.used_pct, 0.01),
        "low": PageColumn(a.available_pct - a.low_pct, 0.01, base="available", sign=-1),
        "high": PageColumn(a.high_pct - a.available_pct, 0.01, base="available"),
        "age": PageColumn(a.age_ms, 1.0),
        **{
            name: PageColumn(codes, 1.0, CODE)
            for name, codes in (
                ("validity", a.validity), ("confidence", a.confidence), ("contact", a.contact), ("surface", a.surface),
            )
        },
    }  # fmt: skip
    return _thinned(table, a.time_us, a.available_pct, (a.validity, a.contact))


def _ages(a: AdhesionRecord) -> PageTable:
    """Share of frames, %, whose age is beyond each millisecond; NaN where none is."""
    ages = np.sort(a.age_ms[np.isfinite(a.age_ms)])
    edges = np.arange(0.0, float(ages.max(initial=0.0)) + 2.0)
    beyond = len(ages) - np.searchsorted(ages, edges, side="right")
    share = np.where(beyond > 0, 100.0 * beyond / max(len(ages), 1), np.nan)
    return {"time": PageColumn(edges, 1.0, TIME), "share": PageColumn(share, 1e-4)}


def _detail(story: Story, d: Detail) -> PageTable:
    residuals = {f"residual{m + 1}": PageColumn(d.residual_db[:, m], 0.1) for m in range(d.residual_db.shape[1])}
    winner = np.clip(d.winner, 0, 4)
    padded = np.column_stack([np.full(len(winner), np.nan, dtype=np.float32), d.residual_db])
    lowest = padded[np.arange(len(winner)), winner]
    stale = d.stale @ (1 << np.arange(d.stale.shape[1]))
    table = {
        "time": _time(story, d.time_us),
        **residuals,
        "winning": PageColumn(lowest, 0.1),
        "winner": PageColumn(winner, 1.0, CODE),
        "rule": PageColumn(d.rule, 1.0, CODE),
        "cause": PageColumn(d.cause, 1.0, CODE),
        "stale": PageColumn(stale, 1.0, CODE),
    }
    return with_gaps(table, d.time_us, SLOW_US)


def _health(story: Story, h: HealthRecord, detail: Detail | None) -> PageTable:
    """Of each input one code: why a frame was refused, else whether frames are missing or it is stale."""
    table = {"time": _time(story, h.time_us)}
    stale = np.zeros((len(h.time_us), len(INPUTS)), dtype=bool)
    if detail is not None and len(detail.time_us):
        place = np.searchsorted(detail.time_us, h.time_us, "right") - 1
        stale = detail.stale[place.clip(0)] & (place >= 0)[:, None]
    for i, name in enumerate(INPUTS):
        reach = h.reach[:, i].astype(np.int16)  # -1 is a row of a gap
        code = np.where(reach == 0, ALL_MISSING, np.where(reach < 255, SOME_MISSING, 0))
        code = np.where(h.refused[:, i] > 0, h.refused[:, i], code)
        code = np.where(stale[:, i] & (code == 0), STALE, code)
        table[name] = PageColumn(code, 1.0, CODE)
        table[f"{name}_reach"] = PageColumn(reach, 1.0, CODE)
    table["plausibility"] = PageColumn(h.plausibility, 1.0, CODE)
    table["marks"] = PageColumn(h.outlier + 2 * h.unchanged.astype(int), 1.0, CODE)
    return with_gaps(table, h.time_us, SLOW_US)


def _truth(story: Story, t: TruthRecord) -> PageTable:
    table = {
        "time": _time(story, t.time_us),
        "available": PageColumn(t.available_pct, 0.01),
        "used": PageColumn(t.used_pct, 0.01),
    }
    return _thinned(table, t.time_us, t.available_pct)


def _events(story: Story, axle: StoryAxle) -> PageTable:
    rows = [(VALIDITIES.index(e.validity), int(e.cause), e.begin_us, e.end_us) for e in axle.spells.events]
    validity, cause, begin, end = np.array(rows, dtype=np.int64).reshape(-1, 4).T
    return {
        "time": _time(story, begin, 1e-6), "end": _time(story, end, 1e-6),
        "validity": PageColumn(validity, 1.0, CODE), "cause": PageColumn(cause, 1.0, CODE),
        "state": PageColumn(32 * validity + cause, 1.0, CODE),
    }  # fmt: skip


def _series(story: Story, series: Series) -> PageTable:
    """At most MAX_SERIES_HZ: the first sample of each slot."""
    slot = (series.time_us - story.begin_us) // int(1e6 / MAX_SERIES_HZ)
    first = np.flatnonzero(np.diff(slot, prepend=np.int64(np.iinfo(np.int64).min)))
    rows = first if len(first) < len(slot) else np.arange(len(slot))
    time_us = series.time_us[rows]
    table = {"time": _time(story, time_us), **_numbers({n: v[rows] for n, v in series.values.items()})}
    if series.constant:
        return table
    return with_gaps(table, time_us, INPUT_MAX_AGE_US // 3)


def _counts(story: Story, series: Series, key: str) -> PageTable:
    """States as codes, counts as what was added since the frame before: WrcdRejects says so itself, others count on."""
    table = {"time": _time(story, series.time_us)}
    grown = added(series, key)
    for name, values in series.values.items():
        if not isinstance(MESSAGES[key].get(name), Numeric):
            table[name] = PageColumn(values, 1.0, CODE)
        elif name not in NO_COUNTS:
            table[name] = PageColumn(grown.get(name, values), 1.0)
    return with_gaps(table, series.time_us, DAEMON_US)


def _thinned(
    table: PageTable, time_us: Times, values: NDArray[np.float32], codes: tuple[NDArray[np.int8], ...] = ()
) -> PageTable:
    rows = thin(values, codes)
    if rows is not None:
        table, time_us = {name: replace(c, values=c.values[rows]) for name, c in table.items()}, time_us[rows]
    return with_gaps(table, time_us, FAST_US)
