"""The kind `log`: a recorded log through the daemon's core."""

import json
import math
from collections.abc import Mapping, Sequence
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from sim_ecu.campaign.fleet.tally import CLASSES, STEP_M, STEP_S, VALIDITIES, AxleTally, Tally
from sim_ecu.campaign.kind import Factor, Kind, Metric, Type
from sim_ecu.jobs.job import Job, Scalar, digest
from wrcd.config.config import load_config
from wrcd.core.causes import RESERVED, Cause, Validity
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.messages import nan_to_none
from wrcd.core.vocabulary import snake
from wrcd.errors import InputError
from wrcd.logs.damage import Damage
from wrcd.logs.feed import outgoing_of_log
from wrcd.logs.reader import LogReader

CAUSES = tuple(c for c in Cause if c is not Cause.NONE and c not in RESERVED)
OWN = "log"  # among Job.files: what the job itself looks at
MAX_FINE = 50  # steps of 100 m or 10 s that are kept as they are; of a longer log they are kilometres and minutes
ESCAPED = "\\x"  # in a name instead of a byte that is no text
KILOMETRE, MINUTE = 1000.0, 60.0


def cause_column(cause: Cause) -> str:
    """The figure's name: cause_gyro_dead."""
    return f"cause_{snake(cause.label)}"


def class_column(prefix: str, name: str) -> str:
    """The figure's name: km_very_low, hours_not_valid."""
    return f"{prefix}_{snake(name.replace(' ', '').replace('notV', 'NotV'))}"


FIGURES = (
    Metric("begin_s", Type.NUMBER, "the log's first stamp, since 1970", "s"),
    Metric("hours", Type.NUMBER, "what the daemon had something to say of", "h"),
    Metric("km", Type.NUMBER, "way in that time", "km"),
    Metric("axles", Type.WHOLE, "axles that the log has frames of"),
    Metric("valid", Type.NUMBER, "share of the axles' time that is Valid", better="more"),
    Metric("degraded", Type.NUMBER, "share that is Degraded", better="less"),
    Metric("not_available", Type.NUMBER, "share that is NotAvailable", better="less"),
    Metric("read", Type.WHOLE, "frames read"),
    Metric("accepted", Type.WHOLE, "frames accepted"),
    Metric("refused", Type.WHOLE, "mapped frames refused", better="less"),
    Metric("restarts", Type.WHOLE, "how often an axle was started anew", better="less"),
    Metric("clock_steps", Type.WHOLE, "how often the log's clock was set back"),
    Metric("whole", Type.FLAG, "all of the log could be read"),
    Metric("suspects", Type.WHOLE, "suspicious sensors and messages", better="less"),
    Metric("worst_s", Type.NUMBER, "the longest time that one of them was named", "s", "less"),
    *(Metric(class_column("km", c), Type.NUMBER, f"axle-kilometres, {c}", "km") for c in CLASSES),
    *(Metric(class_column("hours", c), Type.NUMBER, f"axle-hours, {c}", "h") for c in CLASSES),
    *(Metric(cause_column(c), Type.NUMBER, f"share of the axles' time: {c.words}", better="less") for c in CAUSES),
    Metric("detail", Type.TEXT, "by axle, kilometre and minute, and what is suspicious, as JSON"),
)


def replayed(job: Job) -> Mapping[str, Scalar]:
    """The figures of a log. Raises InputError for one that cannot be read, or has no usable input."""
    inputs = job.inputs
    log, channel = Path(inputs["log"]), inputs.get("channel") or None
    _unchanged(job, log)
    if ESCAPED in str(log) and not log.exists():
        raise InputError("has a name that is no UTF-8, and is not read", file=log, hint="rename the file or its folder")
    shared = tuple(sorted((name, found) for name, found in job.files.items() if name != OWN))
    config = _config(inputs.get("configuration") or "", shared)
    tally, reader = Tally(config), LogReader(log, channel)
    core, onward, damage = Core(config, observer=tally), reader.clock, reader.damage
    begin_us = newest_us = None
    for o, _ in outgoing_of_log(core, reader):
        tally.correction_us = onward.correction_us
        frame, _ = onward.moved((o.frame, ""))
        begin_us = frame.stamp_us if begin_us is None else begin_us
        newest_us = frame.stamp_us
        tally.sent(core, frame, o.cause)
    if not tally.taken:
        raise InputError(
            f"none of its {damage.read} frames is a usable input of this configuration", file=log,
            hint="wrcd check --log tells why",
        )  # fmt: skip
    if begin_us is None or newest_us is None:
        raise InputError("is too short: not one slot ends in it", file=log, hint="leave it out")
    tally.end(core, newest_us)
    return _figures(tally, (begin_us, newest_us), damage, len(onward.steps), reader.warnings)


def _unchanged(job: Job, log: Path) -> None:
    """Raises InputError for a log that has changed since it was requested."""
    if OWN in job.files and digest(log) != job.files[OWN]:
        raise InputError("has changed since the campaign began", file=log, hint="begin it again")


@lru_cache(maxsize=8)
def _config(file: str, contents: tuple[tuple[str, str], ...]) -> Config:
    """A configuration, read once by a process for all logs of it. contents: an edited one is another."""
    del contents
    return load_config(Path(file) if file else None)


def _figures(
    tally: Tally, span_us: tuple[int, int], damage: Damage, steps: int, warnings: Sequence[str]
) -> Mapping[str, Scalar]:
    """span_us: the log's begin and end."""
    axles = tally.with_frames()
    seconds = sum(a.seconds for a in axles)
    begin_us = span_us[0]
    suspects = list(tally.suspects(*span_us))
    out: dict[str, Scalar] = {
        "begin_s": begin_us * 1e-6,
        "hours": max(a.seconds for a in axles) / 3600,
        "km": max(a.metres for a in axles) / 1000,
        "axles": len(axles),
        **{snake(v): _share(sum(a.by_validity[k] * a.cycle_s for a in axles), seconds)
           for k, v in enumerate(VALIDITIES) if v in set(Validity)},
        "read": damage.read,
        "accepted": tally.taken,
        "refused": tally.refusals.total,
        "restarts": sum(a.spells.times[Cause.RESTARTED] for a in axles),
        "clock_steps": steps,
        "whole": damage.whole,
        "suspects": len(suspects),
        "worst_s": max((s.seconds for s in suspects), default=0.0),
    }  # fmt: skip
    way, time = (sum((bins.total for bins in of), np.zeros(len(CLASSES)))
                 for of in ([a.way for a in axles], [a.time for a in axles]))  # fmt: skip
    out |= {class_column("km", c): float(way[k]) / 1000 for k, c in enumerate(CLASSES)}
    out |= {class_column("hours", c): float(time[k]) / 3600 for k, c in enumerate(CLASSES)}
    out |= {cause_column(c): _share(sum(a.by_cause[c] * a.cycle_s for a in axles), seconds) for c in CAUSES}
    detail = {
        "axles": by_axle(axles),
        "without_frame": [a.number for a in tally.axles.values() if a not in axles],
        "suspects": [s.document() for s in suspects],
        "refused": tally.refusals.document(begin_us),
        "warnings": list(warnings),
    }
    return out | {"detail": json.dumps(detail, separators=(",", ":"))}


def _share(part: float, of: float) -> float:
    return float(part) / of if of else math.nan


def by_axle(axles: Sequence[AxleTally]) -> list[dict[str, Any]]:
    """The detail of each. All have the steps that the longest needs, so that they can be added up."""
    step_m = _step(max(a.metres for a in axles), STEP_M, KILOMETRE)
    step_s = _step(max(a.seconds for a in axles), STEP_S, MINUTE)
    return [_axle(a, step_m, step_s) for a in axles]


def _axle(a: AxleTally, step_m: float, step_s: float) -> dict[str, Any]:
    """An axle's part of the detail. way: metres of each class, time: seconds, by step."""
    share = _share(int(a.by_validity[VALIDITIES.index(Validity.VALID)]), a.frames)
    return {
        "axle": a.number,
        "seconds": round(a.seconds, 3),
        "metres": round(a.metres, 1),
        "valid": nan_to_none(share),
        "causes": {c.label: round(int(a.by_cause[c]) * a.cycle_s, 3) for c in CAUSES if a.by_cause[c]},
        "step_m": step_m,
        "way": np.round(a.way.merged(step_m)).astype(int).tolist() if a.metres else [],
        "step_s": step_s,
        "time": np.round(a.time.merged(step_s), 1).tolist(),
    }


def _step(length: float, fine: float, coarse: float) -> float:
    return fine if length <= MAX_FINE * fine else coarse


def _cost(inputs: Mapping[str, Any]) -> float:
    """The log's size, in bytes."""
    log = Path(inputs["log"])
    return float(log.stat().st_size) if log.is_file() else 1.0


def _named(inputs: Mapping[str, Any]) -> dict[str, Path]:
    """The configuration's DBC and design."""
    if not inputs.get("configuration"):
        return {}
    config = _beside(inputs["configuration"])
    return {"dbc": config.dbc_file, "design": config.design_file}


@cache
def _beside(file: str) -> Config:
    """A configuration, read once for all logs of it when the jobs are made."""
    return load_config(Path(file))


KIND = Kind(
    "log",
    "a recorded log through the daemon's core",
    (
        Factor("train", Type.TEXT, "whose log it is", default=""),
        Factor("log", Type.TEXT, "the log", is_file=True),
        Factor("configuration", Type.TEXT, "the daemon's; empty: the packaged one", default="", is_file=True),
        Factor("channel", Type.TEXT, "of a log that has several; empty: the only one", default=""),
    ),
    FIGURES,
    replayed,
    seeded=False,
    cost=_cost,
    suite="train",
    named=_named,
)
