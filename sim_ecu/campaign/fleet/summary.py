"""What a fleet's logs come to: by train, by cause, by suspicious sensor."""

import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sim_ecu.campaign.fleet.tally import CLASSES, FloatArray
from sim_ecu.campaign.kinds.log import CAUSES, cause_column, class_column
from sim_ecu.jobs.job import Ending, Job, JobRow, Scalar
from wrcd.core.causes import Cause

NO_FRAME = "NoFrame"
EARLIEST_S, LATEST_S = 946_684_800.0, 4_102_444_800.0  # 2000 to 2100: other stamps count from somewhere else


@dataclass(frozen=True, slots=True)
class Played:
    """A log and what it came to. number: its place in the summary, from 1. detail: empty unless it is done."""

    number: int
    inputs: Mapping[str, Any]
    ending: Ending
    error: str
    figures: Mapping[str, Scalar]
    detail: Mapping[str, Any]

    @property
    def name(self) -> str:
        """Its path below the fleet's folder."""
        return str(self.inputs["log"])

    @property
    def done(self) -> bool:
        """Whether it has figures."""
        return self.ending is Ending.DONE

    @property
    def begin_s(self) -> float:
        """Since 1970; NaN where its stamps count from somewhere else."""
        found = self.number_of("begin_s")
        return found if EARLIEST_S <= found < LATEST_S else math.nan

    @property
    def suspects(self) -> Sequence[Mapping[str, Any]]:
        """As the detail has them."""
        found: Sequence[Mapping[str, Any]] = self.detail.get("suspects", ())
        return found

    @property
    def axle_hours(self) -> float:
        """What its shares are of."""
        return float(self.classes("hours").sum())

    def number_of(self, name: str) -> float:
        """A figure; NaN where there is none."""
        value = self.figures.get(name)
        return float(value) if isinstance(value, int | float) else math.nan

    def classes(self, prefix: str) -> FloatArray:
        """(len(CLASSES),): axle-kilometres (km) or axle-hours (hours)."""
        return np.array([self.number_of(class_column(prefix, c)) for c in CLASSES])

    def causes(self) -> dict[Cause, float]:
        """Axle-hours that were not Valid, by cause."""
        hours = self.axle_hours
        return {c: share * hours for c in CAUSES if (share := self.number_of(cause_column(c))) > 0}


@dataclass(frozen=True, slots=True)
class LogGroup:
    """Logs of a train, or of all. Those without figures are among them."""

    name: str
    logs: Sequence[Played]

    @property
    def done(self) -> list[Played]:
        """Those with figures."""
        return [p for p in self.logs if p.done]

    def sum(self, name: str) -> float:
        """Of a figure."""
        return sum(p.number_of(name) for p in self.done)

    @property
    def axle_hours(self) -> float:
        """What its shares are of."""
        return sum(p.axle_hours for p in self.done)

    def share(self, name: str) -> float:
        """A share of the axles' time, over all logs; NaN without any."""
        hours = self.axle_hours
        return sum(p.number_of(name) * p.axle_hours for p in self.done) / hours if hours else math.nan

    def classes(self, prefix: str) -> FloatArray:
        """Axle-kilometres (km) or axle-hours (hours) of each class."""
        return sum((p.classes(prefix) for p in self.done), np.zeros(len(CLASSES)))

    def causes(self) -> list[tuple[Cause, float]]:
        """Causes and their shares of the axles' time, the largest first."""
        hours: Counter[Cause] = Counter()
        for p in self.done:
            hours.update(p.causes())
        every = self.axle_hours
        return [(c, h / every) for c, h in hours.most_common() if h]

    @property
    def without_frame(self) -> list[int]:
        """Axles of the configuration that no log has a frame of."""
        found = [set(p.detail["without_frame"]) for p in self.done]
        return sorted(set.intersection(*found)) if found else []

    def by_axle(self) -> dict[int, float]:
        """Share Valid of each axle."""
        seconds: Counter[int] = Counter()
        valid: Counter[int] = Counter()
        for p in self.done:
            for a in (a for a in p.detail["axles"] if a["seconds"]):
                seconds[a["axle"]] += a["seconds"]
                valid[a["axle"]] += a["valid"] * a["seconds"]
        return {axle: valid[axle] / s for axle, s in sorted(seconds.items()) if s}


@dataclass(frozen=True, slots=True)
class Suspicion:
    """One sensor of one train, over all logs in which it was named. text: of the log in which it was so for longest."""

    train: str
    axle: int
    what: str
    text: str
    first_s: float  # since 1970, in the first log; NaN where that has no date
    seconds: float
    logs: Sequence[Played]  # in their order


@dataclass(frozen=True, slots=True)
class Summary:
    """A fleet."""

    title: str
    every: LogGroup
    trains: Sequence[LogGroup]
    suspicions: Sequence[Suspicion]  # the longest first, but axles without a frame last

    @property
    def failed(self) -> list[Played]:
        """Logs without figures."""
        return [p for p in self.every.logs if not p.done]


def summary(title: str, pairs: Sequence[tuple[Job, JobRow]]) -> Summary:
    """Of a campaign's jobs and rows. The logs of a train come in the order of their time, those without one by name."""
    read = [_played(job, row) for job, row in pairs]
    read.sort(key=lambda p: (p.inputs["train"], not p.begin_s > 0, p.begin_s if p.begin_s > 0 else 0.0, p.name))
    logs = [Played(k, p.inputs, p.ending, p.error, p.figures, p.detail) for k, p in enumerate(read, 1)]
    trains: dict[str, list[Played]] = {}
    for p in logs:
        trains.setdefault(p.inputs["train"], []).append(p)
    groups = [LogGroup(name, found) for name, found in trains.items()]
    suspicions = [s for g in groups for s in _suspicions(g)]
    suspicions.sort(key=lambda s: (s.what == NO_FRAME, -s.seconds, s.train, s.axle, s.what))
    return Summary(title, LogGroup("all", logs), groups, suspicions)


def _played(job: Job, row: JobRow) -> Played:
    detail = row.figures.get("detail")
    return Played(0, job.inputs, row.ending, row.error, row.figures, json.loads(str(detail)) if detail else {})


def _suspicions(train: LogGroup) -> list[Suspicion]:
    found: dict[tuple[int, str], list[tuple[Played, Mapping[str, Any]]]] = {}
    missing = train.without_frame  # of every log: the configuration's matter
    for p in train.done:
        for s in (*p.suspects, *_missing(p, missing)):
            found.setdefault((s["axle"], s["what"]), []).append((p, s))
    out = []
    for (axle, what), named in found.items():
        text = max(named, key=lambda one: float(one[1]["seconds"]))[1]["text"]
        seconds = sum(float(s["seconds"]) for _, s in named)
        first_s = named[0][0].begin_s + float(named[0][1]["first_s"])
        out.append(Suspicion(train.name, axle, what, text, first_s, seconds, [p for p, _ in named]))
    return out


def _missing(p: Played, everywhere: Sequence[int]) -> Iterator[Mapping[str, Any]]:
    """Axles that a log has no frame of, and another log of its train has."""
    for axle in p.detail["without_frame"]:
        if axle not in everywhere:
            text = "the log has no frame of this axle, others of this train have"
            yield {"what": NO_FRAME, "axle": axle, "text": text, "first_s": 0.0, "seconds": 3600 * p.number_of("hours")}
