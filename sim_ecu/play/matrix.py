"""`sim-ecu faults`: every row of the fault matrix, played into the daemon's own core on a virtual clock."""

import copy
import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from sim_ecu.play.encoder import SAMPLE_US, Sample, databases
from sim_ecu.play.expected import LONG_ROWS, ROWS, Row
from sim_ecu.play.expected_lines import wrong_lines
from sim_ecu.play.faults import Fault
from sim_ecu.play.inject import inject
from sim_ecu.play.judge import HEAD, Said, Verdict, judge, line
from sim_ecu.play.play import LOG_START_US
from sim_ecu.play.player import Player
from sim_ecu.play.scenario import load_scenario
from wrcd.bus.frame import Frame
from wrcd.bus.link import LinkHealth
from wrcd.config import load_config
from wrcd.core.core import Core
from wrcd.service.journal import CounterLog
from wrcd.tools.progress import Progress

# When the fault begins: the axle has been Valid for a while, and slots and cycles are met at different points.
BEGINS_S = (2.5, 2.813, 3.207)
AFTER_S = 2.35  # judged so long after the fault's end
SLOT_US = 20_000
SCENARIO = "half-wet"


class NoLink:
    """A link that carries nothing: for the journal, which looks at its health."""

    name = "none"

    def __init__(self, health: LinkHealth) -> None:
        self.health = health

    def receive(self, now_us: int) -> list[Frame]:
        """Nothing."""
        return []

    def send(self, frame: Frame) -> bool:
        """Nothing leaves."""
        return False

    def close(self) -> None:
        """There is nothing to let go of."""


class Matrix:
    """One simulation, played for every row from the state that the core is in when the fault begins."""

    def __init__(self, rows: Sequence[Row] = (*ROWS, *LONG_ROWS), begins_s: Sequence[float] = BEGINS_S) -> None:
        longest_s = max(r.fault.duration_s for r in rows)
        scenario = replace(load_scenario(SCENARIO), duration_s=max(begins_s) + longest_s + AFTER_S)
        self._numbers = [a.number for a in scenario.axles]
        self._seed = scenario.axles[0].seed
        self._samples: list[Sample] = list(Player(scenario).measured())
        core = Core(load_config(None))
        # what all copies of the core share
        self._shared = {id(x): x for x in (core.config, *core.config.database.messages)}
        self._message = databases()[0].get_message_by_name("Adhesion_A1")
        self._before: dict[float, Core] = {}
        said, since_s = [], 0.0
        for begin_s in sorted(begins_s):
            said += self.said(core, (), since_s, begin_s)
            self._before[begin_s] = self._copy(core)
            since_s = begin_s
        said += self.said(core, (), since_s, scenario.duration_s)
        self._without = {s.slot: s.mu_pct for s in said if s.valid and s.mu_pct is not None}

    def _copy(self, core: Core) -> Core:
        return copy.deepcopy(core, dict(self._shared))

    def said(
        self,
        core: Core,
        faults: Sequence[Fault],
        since_s: float,
        until_s: float,
        look: Callable[[int], None] = lambda _: None,
    ) -> list[Said]:
        """Axle 1's adhesion frames when a core that knows all up to a time is played what comes then; look is told of
        the time after every half sample, as the loop does after every turn."""
        first, last = (math.ceil(round(t * 1e6) / SAMPLE_US) - 1 for t in (since_s, until_s))
        samples, out = self._samples[max(first, 0) : last], []
        for due_us, frames in inject(samples, faults, self._numbers, self._seed, truth=False):
            for f in frames:
                out += core.feed(Frame(LOG_START_US + f.due_us, f.can_id, f.data, error=f.error))
            look(LOG_START_US + due_us)
        until_us = LOG_START_US + round(until_s * 1e6)
        out += core.advance(until_us)
        look(until_us)
        return [self._said(o.frame) for o in out if o.frame.can_id == self._message.frame_id]

    def _said(self, frame: Frame) -> Said:
        values: Any = self._message.decode(frame.data)
        mu = values["MuAvailable"] if isinstance(values["MuAvailable"], float) else None
        return Said(frame.stamp_us, frame.stamp_us // SLOT_US, str(values["Validity"]) == "Valid", mu)

    def play(self, row: Row) -> Verdict:
        """What comes of a row's fault, at the worst of its moments."""
        return functools.reduce(Verdict.worst, [self._play(row, begin_s) for begin_s in self._before])

    def _play(self, row: Row, begin_s: float) -> Verdict:
        fault = replace(row.fault, at_s=begin_s)
        until_s = begin_s + fault.duration_s + AFTER_S
        core, lines = self._copy(self._before[begin_s]), list[str]()
        journal = CounterLog(core, NoLink(core.health.link), lines.append)
        journal.look(LOG_START_US + fault.begin_us - 2_000_000)  # what has been told before
        lines.clear()
        said = self.said(core, (fault,), begin_s, until_s, journal.look)
        verdict = judge(row.must, LOG_START_US + fault.begin_us, LOG_START_US + fault.end_us, said, self._without)
        return replace(verdict, wrong=verdict.wrong or wrong_lines(row, lines))


def run() -> int:
    """Print the table. Returns 1 if a row failed."""
    progress = Progress()
    matrix = Matrix()
    print(HEAD)
    failed = 0
    rows = (*ROWS, *LONG_ROWS)
    for k, row in enumerate(rows):
        progress.at(row.fault.kind, k / len(rows))
        verdict = matrix.play(row)
        failed += bool(verdict.wrong)
        progress.end()
        print(line(row, verdict), flush=True)
    return 1 if failed else 0
