"""Which plots a page has, as records: Bokeh's figures and the script in the browser are both made from these."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from wrcd.bus.reasons import Reason
from wrcd.core.causes import Cause
from wrcd.core.vocabulary import MESSAGES, Words
from wrcd.tools.report.tables import ALL_MISSING, INPUTS, SOME_MISSING, STALE, Table

AGAINST = "against."  # before the names of the other side's tables
INPUT_WORDS = {"yaw": "yaw rate", "lateral": "lateral acc.", "torque": "torque", "speed": "speed"}
MAX_PCT = 100.0  # of adhesion: no plot goes beyond
RESIDUAL_DASHES = ("solid", "dashed", "dotted", "dotdash")


@dataclass(frozen=True, slots=True)
class Curve:
    """A column over its table's times. shape: line, step, band (to the column `upper`)."""

    label: str
    table: str
    column: str
    colour: str  # a variable of page.css
    shape: str = "line"
    dash: str = "solid"
    upper: str = ""
    width: float = 1.5
    alpha: float = 1.0
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Row:
    """A line of a strip: codes of a column, each with its word and class (good, warn, none, bad, c0 …)."""

    label: str
    table: str
    column: str
    words: Mapping[int, tuple[str, str]]
    ends: bool = False  # the table has a column `end`, and a block is a row of it


@dataclass(frozen=True, slots=True)
class Plot:
    """A plot. axis: time, distance; anything else is drawn once, over the columns named by it."""

    key: str
    title: str
    unit: str
    low: float
    high: float
    height: int
    curves: tuple[Curve, ...] = ()
    rows: tuple[Row, ...] = ()
    axis: str = "time"
    axle: int = 0
    note: str = ""


@dataclass(frozen=True, slots=True)
class Part:
    """A section of the page that folds."""

    key: str
    title: str
    plots: tuple[Plot, ...]
    lines: tuple[str, ...] = field(default=())


def parts(tables: Mapping[str, Table], axles: Sequence[int], sides: tuple[str, str]) -> list[Part]:
    """All sections with plots. tables holds those of both sides, the other's with AGAINST before their names."""
    there = [p for p in ("", AGAINST) if any(n.startswith(p + "axle") for n in tables)] or [""]
    names = dict(zip(("", AGAINST), sides, strict=True))
    overview = _overview(tables, axles, there, names)
    out = [Part("overview", "All axles", (overview,) if overview.rows else ())]
    out += [
        Part(f"axle{a}", f"Axle {a}", tuple(_axle(tables, a, there, names)))
        for a in axles
        if any(n.endswith(f"axle{a}.adhesion") for n in tables)
    ]
    for key, title, plots in (
        ("train", "Train", _train(tables, axles, there, names)),
        ("health", "Faults, rejects, link and reach", _health(tables, axles, there, names)),
        ("delays", "Delays", _delays(tables, axles, there, names)),
        ("bus", "Bus", _bus(tables, there, names)),
    ):
        out.append(Part(key, title, tuple(plots)))
    return out


def _label(text: str, side: str, names: Mapping[str, str], there: Sequence[str]) -> str:
    return text if len(there) == 1 else f"{text}, {names[side]}"


def _validity_words() -> dict[int, tuple[str, str]]:
    """Codes of events: validity times 32 plus cause."""
    words = {
        32 * v: (text, css)
        for v, text, css in ((0, "NotAvailable", "none"), (1, "Valid", "good"), (2, "Degraded", "warn"))
    }
    for c in Cause:
        if c is not Cause.NONE:
            words |= {0 + int(c): (c.label, "none"), 64 + int(c): (c.label, "warn"), 32 + int(c): (c.label, "good")}
    return words


def _overview(
    tables: Mapping[str, Table], axles: Sequence[int], there: Sequence[str], names: Mapping[str, str]
) -> Plot:
    rows = tuple(
        Row(f"axle {a}" if side == "" else f"{a}, against", f"{side}axle{a}.events", "state", _validity_words(), True)
        for a in axles
        for side in there
        if f"{side}axle{a}.events" in tables
    )
    return Plot("overview", "Validity and its cause, every axle", "", 0, len(rows), _strip_height(len(rows)), rows=rows)


def _strip_height(rows: int) -> int:
    return 34 + 24 * max(rows, 1)


def _top(columns: Sequence[NDArray[np.floating]], least: float = 10.0, step: float = 5.0) -> float:
    """The upper end of an axis: above all but one in a thousand values."""
    high = least
    for c in columns:
        finite = c[np.isfinite(c)]
        if len(finite):
            high = max(high, float(np.quantile(finite, 0.999)) * 1.08)
    return float(np.ceil(high / step) * step)


def _top_of_interval(tables: Mapping[str, Table], names: Sequence[str], step: float = 5.0) -> float:
    """The highest end of an interval: a band that the plot's edge cuts looks narrower than it is."""
    there = [tables[n] for n in names if n in tables]
    ends = [float(np.nanmax(t["available"].values + t["high"].values, initial=0.0)) for t in there]
    return float(np.ceil(max(ends, default=0.0) / step) * step)


def _values(tables: Mapping[str, Table], names: Sequence[str], column: str) -> list[NDArray[np.floating]]:
    return [tables[n][column].values for n in names if n in tables and column in tables[n]]


def _axle(tables: Mapping[str, Table], a: int, there: Sequence[str], names: Mapping[str, str]) -> Iterator[Plot]:
    adhesion = [f"{side}axle{a}.adhesion" for side in there]
    truth = [f"{side}axle{a}.truth" for side in there]
    top = _top([*_values(tables, adhesion, "available"), *_values(tables, truth, "available")])
    top = max(top, min(_top_of_interval(tables, adhesion), MAX_PCT))
    curves: list[Curve] = []
    for side in reversed(there):
        table = f"{side}axle{a}.adhesion"
        if table not in tables:
            continue
        main, used = ("available", "used") if side == "" else ("against", "against-used")
        curves += [
            Curve(_label("90 % interval", side, names, there), table, "low", main, "band", upper="high", alpha=0.22),
            Curve(_label("in use", side, names, there), table, "used", used, dash="solid" if side == "" else "dashed"),
            Curve(_label("available", side, names, there), table, "available", main, width=2.0),
        ]
    for side in there:
        if f"{side}axle{a}.truth" in tables:
            curves.append(
                Curve(_label("truth", side, names, there), f"{side}axle{a}.truth", "available", "truth", dash="dashed")
            )
            break
    first = Plot(f"axle{a}.time", "Adhesion against time", "%", 0, top, 260, tuple(curves), axle=a)
    yield first
    yield _states(tables, a, there)
    if residuals := _residuals(tables, a, there, names):
        yield residuals
    if "distance" in tables:
        yield Plot(
            f"axle{a}.distance", "Adhesion against distance", "%", 0, top, 220, tuple(curves), axis="distance", axle=a
        )


def _states(tables: Mapping[str, Table], a: int, there: Sequence[str]) -> Plot:
    rows: list[Row] = []
    for side in there:
        own = "" if side == "" else " 2"
        base = f"{side}axle{a}"
        rows.append(Row(f"validity{own}", f"{base}.events", "state", _validity_words(), True))
        rows.append(
            Row(f"contact{own}", f"{base}.adhesion", "contact", _words("ContactState", ("none", "good", "warn")))
        )
        rows.append(
            Row(
                f"surface{own}",
                f"{base}.adhesion",
                "surface",
                _words("Surface", ("none", "c0", "c1", "c2", "c3", "c4")),
            )
        )
        if f"{base}.detail" in tables:
            rows.append(
                Row(f"model{own}", f"{base}.detail", "winner",
                    {0: ("none", "none"), **{m: (f"model {m}", f"m{m}") for m in range(1, 5)}})
            )  # fmt: skip
    rows = [r for r in rows if r.table in tables]
    return Plot(
        f"axle{a}.states", "Validity with its cause, contact, surface, winning model", "", 0, len(rows),
        _strip_height(len(rows)), rows=tuple(rows), axle=a,
    )  # fmt: skip


def _words(signal: str, classes: Sequence[str]) -> dict[int, tuple[str, str]]:
    kind = MESSAGES["adhesion"][signal]
    assert isinstance(kind, Words)
    return {i: (word, css) for i, (word, css) in enumerate(zip(kind.words, classes, strict=True))}


def _residuals(tables: Mapping[str, Table], a: int, there: Sequence[str], names: Mapping[str, str]) -> Plot | None:
    curves: list[Curve] = []
    extremes: list[NDArray[np.floating]] = []
    for side in reversed(there):
        table = f"{side}axle{a}.detail"
        if table not in tables:
            continue
        if side == "":
            curves.append(Curve("winner", table, "winning", "winner", width=7.0, alpha=0.35))
        for m in range(1, 5):
            curves.append(
                Curve(_label(f"model {m}", side, names, there), table, f"residual{m}", f"m{m}",
                      dash=RESIDUAL_DASHES[m - 1], alpha=1.0 if side == "" else 0.45, width=1.5 if side == "" else 1.0)
            )  # fmt: skip
            extremes.append(tables[table][f"residual{m}"].values)
    if not curves:
        return None
    low, high = _span(extremes)
    return Plot(
        f"axle{a}.residuals",
        "Residuals of the four models, the winner's marked",
        "dB",
        low,
        high,
        190,
        tuple(curves),
        axle=a,
    )


def _span(columns: Sequence[NDArray[np.floating]], step: float = 5.0) -> tuple[float, float]:
    values = [c[np.isfinite(c)] for c in columns]
    values = [v for v in values if len(v)]
    if not values:
        return 0.0, step
    low = float(np.floor(min(np.quantile(v, 0.001) for v in values) / step) * step)
    high = float(np.ceil(max(np.quantile(v, 0.999) for v in values) / step) * step)
    return (low, high) if high > low else (low - step, high + step)


AXLE_DASHES = ("solid", "dashed", "dotted", "dotdash")


def _axle_curves(
    tables: Mapping[str, Table], axles: Sequence[int], kind: str, column: str, shape: str = "line"
) -> list[Curve]:
    return [
        Curve(f"axle {a}", f"axle{a}.{kind}", column, f"a{(a - 1) % 4 + 1}", shape, AXLE_DASHES[i // 4 % 4])
        for i, a in enumerate(axles)
        if f"axle{a}.{kind}" in tables
    ]


def _train(
    tables: Mapping[str, Table], axles: Sequence[int], there: Sequence[str], names: Mapping[str, str]
) -> Iterator[Plot]:
    del there, names
    if "speed" in tables:
        top = _top([tables["speed"]["speed_m_s"].values], 5.0)
        yield Plot("speed", "Speed", "m/s", 0, top, 150, (Curve("speed", "speed", "speed_m_s", "available"),))
    torques = _axle_curves(tables, axles, "torque", "torque_Nm")
    if torques:
        low, high = _span([tables[c.table][c.column].values for c in torques], 1000.0)
        yield Plot("torque", "Torque at the axles", "N m", low, high, 190, tuple(torques))


def _health(
    tables: Mapping[str, Table], axles: Sequence[int], there: Sequence[str], names: Mapping[str, str]
) -> Iterator[Plot]:
    words: dict[int, tuple[str, str]] = {0: ("all came", "good")}
    words |= {i + 1: (f"refused: {r.value}", "bad") for i, r in enumerate(Reason)}
    words |= {SOME_MISSING: ("some missing", "warn"), ALL_MISSING: ("silent", "none"), STALE: ("stale", "warn")}
    for a in axles:
        if f"axle{a}.inputs" in tables:
            rows = tuple(Row(INPUT_WORDS[i], f"axle{a}.inputs", i, words) for i in INPUTS)
            yield Plot(
                f"axle{a}.inputs",
                f"Inputs of axle {a}: reach and refusals",
                "",
                0,
                4,
                _strip_height(4),
                rows=rows,
                axle=a,
            )
    states: list[Row] = []
    for table, column, label in (("status", "State", "daemon"), ("link", "LinkState", "link")):
        kind = MESSAGES[f"{table}_message"][column]
        if column in tables.get(table, {}) and isinstance(kind, Words):
            found = {i: (w, "good" if i == 0 else "bad") for i, w in enumerate(kind.words)}
            states.append(Row(label, table, column, found))
    if states:
        yield Plot("daemon", "Daemon and link", "", 0, len(states), _strip_height(len(states)), rows=tuple(states))
    counters = list(_counters(tables, there, names))
    if counters:
        values = [tables[c.table][c.column].values for c in counters]
        top = max(float(np.nanmax(v, initial=0.0)) for v in values) * 1.1
        yield Plot("counts", "What was counted since the message before", "", 0, max(1.0, top), 170, tuple(counters))


def _counters(tables: Mapping[str, Table], there: Sequence[str], names: Mapping[str, str]) -> Iterator[Curve]:
    """Counters that have moved, by size; at most eight."""
    found = [
        (float(np.nansum(column.values)), side, table, name)
        for side in there
        for table in ("rejects", "status", "link")
        for name, column in tables.get(side + table, {}).items()
        if name not in ("time", "State", "LastReason", "LinkState", "RejectedFrames") and np.nansum(column.values) > 0
    ]
    found.sort(key=lambda f: -f[0])
    for i, (_, side, table, name) in enumerate(found[:8]):
        label = f"refused: {_spaced(name.removeprefix('Rejected'))}" if name.startswith("Rejected") else _spaced(name)
        yield Curve(_label(label, side, names, there), side + table, name, f"a{i % 4 + 1}", "step", AXLE_DASHES[i // 4])


def _spaced(name: str) -> str:
    return "".join(f" {c.lower()}" if c.isupper() else c for c in name).strip()


def _delays(
    tables: Mapping[str, Table], axles: Sequence[int], there: Sequence[str], names: Mapping[str, str]
) -> Iterator[Plot]:
    del there, names
    ages = _axle_curves(tables, axles, "adhesion", "age")
    if ages:
        top = _top([tables[c.table]["age"].values for c in ages], 10.0)
        yield Plot("age", "Age of the oldest measurement at the tick (SampleAge)", "ms", 0, top, 170, tuple(ages))
        shares = [Curve(c.label, c.table.replace("adhesion", "ages"), "share", c.colour, "step", c.dash) for c in ages]
        yield Plot(
            "ages",
            "Distribution of SampleAge: share of frames that are older (powers of ten) against age",
            "%",
            0.001,
            100,
            200,
            tuple(shares),
            axis="age",
        )


def _bus(tables: Mapping[str, Table], there: Sequence[str], names: Mapping[str, str]) -> Iterator[Plot]:
    for key, title, unit, least in (("rate", "Frames a second", "1/s", 10.0), ("load", "Bus load", "%", 10.0)):
        sides = [s for s in there if f"{s}bus" in tables and len(tables[f"{s}bus"]["time"].values)]
        curves = [
            Curve(_label(key, s, names, there), f"{s}bus", key, "available" if s == "" else "against", "step")
            for s in sides
        ]
        if curves:
            columns = [tables[c.table][key].values for c in curves]
            top = min(_top(columns, least), 100.0) if unit == "%" else _top(columns, least, 10.0)
            yield Plot(key, title, unit, 0, top, 140, tuple(curves))
