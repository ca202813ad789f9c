"""`sim-ecu loop`: drives the suites in lockstep, judges every run, prints the tables."""

import json
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from sim_ecu.loop.names import UNPROTECTED, WITH
from sim_ecu.loop.play import Outcome, play
from sim_ecu.loop.report import judge_all
from sim_ecu.loop.suites import cases
from sim_ecu.loop.suites.case import SEEDS, Case
from sim_ecu.loop.tables import tables
from sim_ecu.score.report import plain
from wrcd.errors import InputError, create
from wrcd.tools.progress import Progress

QUICK_SEEDS = 2
# Processor time of a run, about: what the time left is told from.
COST, COST_UNPROTECTED, COST_OF_DAEMON, COST_OF_ITS_AXLE = 1.0, 1.5, 1.2, 0.8
_Job = tuple[str, str, int]


def run(
    suite: str | None, quick: bool, seeds: int | None, jobs: int, json_out: Path | None, html_out: Path | None
) -> int:
    """Drive, judge, print; write the figures as JSON and a page where asked for."""
    for key, out in (("--json", json_out), ("--html", html_out)):
        if out is not None and not out.parent.is_dir():
            raise InputError("no such folder", file=out.parent, key=key)
        if out is not None and out.is_dir():
            raise InputError("is a folder", file=out, key=key, hint="name the file to write")
    began = time.monotonic()
    every = cases(suite)
    n = seeds or (QUICK_SEEDS if quick else SEEDS)
    outcomes = play_all(every, n, jobs)
    result = {"run": {"quick": quick, "jobs": jobs, "seeds": n}} | judge_all(every, outcomes)
    result["run"]["seconds"] = round(time.monotonic() - began)
    print("\n".join(tables(result)))
    if json_out:
        with create(json_out) as file:
            file.write(json.dumps(plain(result), indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    if html_out:
        from sim_ecu.loop.page import page

        with create(html_out) as file:
            file.write(page(result, outcomes))
    return 0


def play_all(every: Sequence[Case], seeds: int, jobs: int) -> list[Outcome]:
    """In processes of their own; the order of the outcomes does not depend on them."""
    progress = Progress(steps=True)
    work = [(case, number) for case in every for number in range(seeds)]
    cost = [_cost(case) for case, _ in work]
    done, outcomes = 0.0, []
    with ProcessPoolExecutor(jobs) as pool:
        try:
            parts = pool.map(_play, [(case.suite, case.name, number) for case, number in work])
            for k, part in enumerate(parts):
                outcomes += part
                done += cost[k]
                progress.at(f"{work[k][0].suite}: run {k + 1} of {len(work)}", done / sum(cost))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    progress.end()
    return outcomes


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
    suite, name, number = job
    return play(_cases[suite, name], number)
