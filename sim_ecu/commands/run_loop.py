"""`sim-ecu loop`: drives the suites in lockstep, judges every run, prints the tables."""

import signal
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

from sim_ecu.commands.outputs import check_output, write_results
from sim_ecu.loop.names import BROAD, UNPROTECTED, WITH
from sim_ecu.loop.play import Outcome, play
from sim_ecu.loop.report import judge_all
from sim_ecu.loop.suites import cases
from sim_ecu.loop.suites.case import FEW_SEEDS, SEEDS, Case
from sim_ecu.loop.tables import tables
from wrcd.errors import InputError
from wrcd.tools.progress import Progress

QUICK_SEEDS = 1
# Processor time of a run, about: what the time left is told from.
COST, COST_UNPROTECTED, COST_OF_DAEMON, COST_OF_ITS_AXLE = 1.0, 1.5, 1.2, 0.8
_Job = tuple[str, tuple[str, ...], int]


def run(
    suite: str | None, only: str, quick: bool, seeds: int | None, jobs: int, json_out: Path | None,
    html_out: Path | None,
) -> int:  # fmt: skip
    """Drive, judge, print; write the figures as JSON and a page where asked for."""
    check_output("--json", json_out)
    check_output("--html", html_out)
    every = cases(suite, only)
    if not every:
        hint = f"rows: {'; '.join(dict.fromkeys(c.name for c in cases(suite)))}"
        raise InputError(f"no row's name holds {only!r}", key="--only", hint=hint)
    began = time.monotonic()
    asked = seeds or (QUICK_SEEDS if quick else None)
    outcomes = play_all(every, asked, jobs)
    counts = {"seeds": asked or SEEDS, "seeds_of_broad": asked or FEW_SEEDS}
    result = {"run": {"quick": quick, "jobs": jobs} | counts} | judge_all(every, outcomes)
    result["run"]["seconds"] = round(time.monotonic() - began)
    print("\n".join(tables(result)))
    write_results(result, json_out, html_out, lambda: _page(result, outcomes))
    return 0


def _page(result: dict[str, Any], outcomes: list[Outcome]) -> str:
    from sim_ecu.loop.page import page

    return page(result, outcomes)


def play_all(every: Sequence[Case], seeds: int | None, jobs: int) -> list[Outcome]:
    """In processes of their own; the order of the outcomes does not depend on them. seeds None: each suite's own."""
    progress = Progress(steps=True)
    groups = _groups(every)
    work = [(group, number) for group in groups for number in range(seeds or _seeds(group[0]))]
    cost = [sum(map(_cost, group)) for group, _ in work]
    done, found = 0.0, []
    with ProcessPoolExecutor(jobs, initializer=_dies_of_ctrl_c) as pool:
        try:
            parts = pool.map(_play, [(g[0].suite, tuple(c.name for c in g), number) for g, number in work])
            for k, part in enumerate(parts):
                found += part
                done += cost[k]
                progress.at(f"{work[k][0][0].suite}: run {k + 1} of {len(work)}", done / sum(cost))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    progress.end()
    place = {(case.suite, case.name): k for k, case in enumerate(every)}
    return sorted(found, key=lambda o: (place[o.suite, o.case], o.number))


def _groups(every: Sequence[Case]) -> list[list[Case]]:
    """Cases by themselves, but those that branch off another one's runs with it."""
    return [
        [case, *(c for c in every if c.fault is not None and (c.suite, c.bare) == (case.suite, case.name))]
        for case in every if case.fault is None
    ]  # fmt: skip


def _seeds(case: Case) -> int:
    return FEW_SEEDS if case.suite in BROAD else SEEDS


def _dies_of_ctrl_c() -> None:
    """At a terminal it reaches every process: none goes on with what nobody waits for."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def _cost(case: Case) -> float:
    out = 0.0
    for name in case.controllers:
        out += COST_UNPROTECTED if name == UNPROTECTED else COST
        if name in WITH.values():
            out += COST_OF_DAEMON + COST_OF_ITS_AXLE * (case.axles - 1)
    return out


_cases: dict[tuple[str, str], Case] = {}


def _play(job: _Job) -> list[Outcome]:
    if not _cases:
        _cases.update({(c.suite, c.name): c for c in cases()})
    suite, names, number = job
    first, *branches = (_cases[suite, name] for name in names)
    return play(first, number, branches)
