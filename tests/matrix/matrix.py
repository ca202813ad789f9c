"""Every row of the fault matrix, played into the daemon's own core on a virtual clock, and judged."""

import copy
import functools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

from sim_ecu.play.encoder import SAMPLE_US, SensorSample, databases
from sim_ecu.play.faults import ALL, KINDS, Fault, Stage
from sim_ecu.play.inject import inject
from sim_ecu.play.play import LOG_START_US
from sim_ecu.play.player import Player
from sim_ecu.play.scenario import load_scenario
from sim_ecu.play.vehicles import load_vehicle
from tests.matrix.expected import (
    LONG_ROWS,
    ROWS,
    SETTLED_AFTER_MS,
    SETTLED_PP,
    Found,
    Leaves,
    MatrixRow,
    Must,
    Stays,
    wrong_lines,
)
from wrcd.bus.frame import Frame
from wrcd.config.config import load_config
from wrcd.config.packaged_designs import design_path
from wrcd.core.core import Core
from wrcd.core.reports import Outgoing
from wrcd.progress import Progress
from wrcd.resources import LONE
from wrcd.service.journal import CounterLog

# When the fault begins: the axle has been Valid for a while, and slots and cycles are met at different points.
BEGINS_S = (2.5, 2.813, 3.207)
AFTER_S = SETTLED_AFTER_MS / 1000 + 0.2  # judged so long after the fault's end
SLOT_US = 20_000
SCENARIO = "half-wet"


@dataclass(frozen=True, slots=True)
class SentAdhesion:
    """One adhesion frame. slot numbers it, mu_pct is None where it says not available."""

    stamp_us: int
    slot: int
    valid: bool
    mu_pct: float | None


@dataclass(frozen=True, slots=True)
class Verdict:
    """What was measured, None where it never happened, and what is wrong with it (empty: nothing)."""

    left_ms: float | None  # Valid, after the fault's begin
    back_ms: float | None  # to Valid, after its end
    change_pp: float | None  # of MuAvailable, at most, while Valid
    settled_pp: float | None  # the same, SETTLED_AFTER_MS after the fault
    wrong: str

    def worst(self, other: "Verdict") -> "Verdict":
        """Of two plays of a row, the larger figures and what is wrong with either."""

        def larger(a: float | None, b: float | None) -> float | None:
            return max((x for x in (a, b) if x is not None), default=None)

        return Verdict(
            larger(self.left_ms, other.left_ms), larger(self.back_ms, other.back_ms),
            larger(self.change_pp, other.change_pp), larger(self.settled_pp, other.settled_pp),
            self.wrong or other.wrong,
        )  # fmt: skip


def judge(
    must: Must, begin_us: int, end_us: int, sent: Sequence[SentAdhesion], without: Mapping[int, float]
) -> Verdict:
    """Judge the frames of an axle from a fault's begin on, beside MuAvailable without the fault, by slot."""
    sent = [s for s in sent if s.stamp_us > begin_us]
    left = next((s.stamp_us for s in sent if not s.valid), None)
    back = next((s.stamp_us for s in sent if s.valid and left is not None and s.stamp_us > max(end_us, left)), None)
    changes = [
        (s.stamp_us, abs(s.mu_pct - without[s.slot]))
        for s in sent
        if s.valid and s.mu_pct is not None and s.slot in without
    ]
    settled_us = end_us + round(SETTLED_AFTER_MS * 1000)
    verdict = Verdict(
        left_ms=None if left is None else (left - begin_us) / 1000,
        back_ms=None if back is None else (back - end_us) / 1000,
        change_pp=max((pp for _, pp in changes), default=None),
        settled_pp=max((pp for t, pp in changes if t > settled_us), default=None),
        wrong="",
    )
    wrong = ""
    if isinstance(must, Leaves):
        wrong = _left(must, verdict)
        if any(s.valid for s in sent if left is not None and left < s.stamp_us <= end_us):
            wrong = wrong or "Valid during the fault"
        if any(not s.valid for s in sent if back is not None and s.stamp_us > back):
            wrong = wrong or "not Valid for good afterwards"
    elif isinstance(must, Stays):
        wrong = _stayed(must, verdict)
    elif isinstance(must, Found):
        until_us = begin_us + round(must.within_ms * 1000)
        late = any(s.valid for s in sent if until_us < s.stamp_us <= end_us)
        return replace(verdict, back_ms=None, settled_pp=None, wrong="not found out" if late else "")
    if verdict.settled_pp is None or verdict.settled_pp > SETTLED_PP:
        wrong = wrong or "not itself again"
    return replace(verdict, wrong=wrong)


def _left(must: Leaves, v: Verdict) -> str:
    if v.left_ms is None or v.left_ms > must.within_ms:
        return "Valid for too long"
    return "not Valid again in time" if v.back_ms is None or v.back_ms > must.back_ms else ""


def _stayed(must: Stays, v: Verdict) -> str:
    if v.left_ms is not None:
        return "not Valid throughout"
    return "changed too much" if v.change_pp is None or v.change_pp > must.within_pp else ""


HEAD = (
    "| fault | of | s | must | left Valid after, ms | Valid again after, ms | largest change while Valid, pp "
    f"| {SETTLED_AFTER_MS / 1000:g} s later, pp | passed |\n"
    "|---|---|---|---|---|---|---|---|---|"
)


def _of_bus(fault: Fault) -> bool:
    return KINDS[fault.kind].stage is Stage.BUS


def whole_axle(row: MatrixRow) -> bool:
    """Whether a row is of all signals of the axle at once: it does as that of the yaw rate alone does."""
    return row.fault.of == ALL and not _of_bus(row.fault)


def which(row: MatrixRow) -> tuple[str, str, str]:
    """A row's fault for a person: the kind, of what, for how many seconds."""
    f = row.fault
    of = "all of the axle" if whole_axle(row) else "bus" if _of_bus(f) else f.of.replace("_", " ")
    return f.kind if f.amount is None else f"{f.kind} {f.amount:g}", of, f"{f.duration_s:g}"


def line(row: MatrixRow, v: Verdict) -> str:
    """A row of the table, as Markdown."""

    def shown(x: float | None, digits: int) -> str:
        return "–" if x is None else f"{x:.{digits}f}"

    return (
        f"| {' | '.join(which(row))} | {row.must} | {shown(v.left_ms, 0)} | {shown(v.back_ms, 0)} "
        f"| {shown(v.change_pp, 2)} | {shown(v.settled_pp, 2)} | {f'NO: {v.wrong}' if v.wrong else 'yes'} |"
    )


class Matrix:
    """One simulation, played for every row from the state that the core is in when the fault begins."""

    def __init__(self, rows: Sequence[MatrixRow] = (*ROWS, *LONG_ROWS), begins_s: Sequence[float] = BEGINS_S) -> None:
        longest_s = max(r.fault.duration_s for r in rows)
        # the figures of the table are of a lone wheelset
        scenario = replace(
            load_scenario(SCENARIO), wheelset=load_vehicle(LONE), duration_s=max(begins_s) + longest_s + AFTER_S
        )
        self._numbers = [a.number for a in scenario.axles]
        self._seed = scenario.axles[0].seed
        self._samples: list[SensorSample] = list(Player(scenario).measured())
        core = Core(load_config(None, design_file=design_path(LONE)))
        self._message = databases()[0].get_message_by_name("Adhesion_A1")
        self._before: dict[float, Core] = {}
        sent, since_s = [], 0.0
        for begin_s in sorted(begins_s):
            sent += self.sent(core, (), since_s, begin_s)
            self._before[begin_s] = copy.deepcopy(core)
            since_s = begin_s
        sent += self.sent(core, (), since_s, scenario.duration_s)
        self._without = {s.slot: s.mu_pct for s in sent if s.valid and s.mu_pct is not None}

    def sent(
        self,
        core: Core,
        faults: Sequence[Fault],
        since_s: float,
        until_s: float,
        look: Callable[[int], None] = lambda _: None,
    ) -> list[SentAdhesion]:
        """Return axle 1's adhesion frames of a core that has had all up to since_s and is fed the rest. look gets the
        time after every half sample, as after every turn of the loop."""
        first, last = (math.ceil(round(t * 1e6) / SAMPLE_US) - 1 for t in (since_s, until_s))
        samples, out = self._samples[max(first, 0) : last], list[Outgoing]()
        for due_us, frames in inject(samples, faults, self._numbers, self._seed, truth=False):
            for f in frames:
                out += core.feed(Frame(LOG_START_US + f.due_us, f.can_id, f.data, error=f.error))
            look(LOG_START_US + due_us)
        until_us = LOG_START_US + round(until_s * 1e6)
        out += core.advance(until_us)
        look(until_us)
        return [self._sent(o.frame) for o in out if o.frame.can_id == self._message.frame_id]

    def _sent(self, frame: Frame) -> SentAdhesion:
        values: Any = self._message.decode(frame.data)
        mu = values["MuAvailable"] if isinstance(values["MuAvailable"], float) else None
        return SentAdhesion(frame.stamp_us, frame.stamp_us // SLOT_US, str(values["Validity"]) == "Valid", mu)

    def play(self, row: MatrixRow) -> Verdict:
        """Return what comes of a row's fault, at the worst of its moments."""
        return functools.reduce(Verdict.worst, [self._play(row, begin_s) for begin_s in self._before])

    def _play(self, row: MatrixRow, begin_s: float) -> Verdict:
        fault = replace(row.fault, at_s=begin_s)
        # what is found out in the sensors' signals is not judged afterwards
        until_s = begin_s + fault.duration_s + (0.0 if isinstance(row.must, Found) else AFTER_S)
        core, lines = copy.deepcopy(self._before[begin_s]), list[str]()
        link: Any = SimpleNamespace(health=core.health.link)  # all that the journal looks at
        journal = CounterLog(core, link, lines.append)
        journal.look(LOG_START_US + fault.begin_us - 2_000_000)  # what has been reported before
        lines.clear()
        sent = self.sent(core, (fault,), begin_s, until_s, journal.look)
        verdict = judge(row.must, LOG_START_US + fault.begin_us, LOG_START_US + fault.end_us, sent, self._without)
        return replace(verdict, wrong=verdict.wrong or wrong_lines(row, lines))


def verdicts() -> Iterator[tuple[MatrixRow, Verdict]]:
    """Every row with its verdict, as they come: minutes."""
    progress, matrix = Progress(), Matrix()
    rows = (*ROWS, *LONG_ROWS)
    for k, row in enumerate(rows):
        progress.at(row.fault.kind, k / len(rows))
        verdict = matrix.play(row)
        progress.end()
        yield row, verdict
