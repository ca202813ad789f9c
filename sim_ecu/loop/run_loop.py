"""`sim-ecu loop`: drives the suites in lockstep, judges every run, prints the tables."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from sim_ecu.jobs.whole import Missing, Piece, every, left_out, not_whole
from sim_ecu.loop import BROAD, UNPROTECTED, WITH
from sim_ecu.loop.comparison_figures import judge_all
from sim_ecu.loop.lockstep import cost_of_driving
from sim_ecu.loop.loop_page import page, text
from sim_ecu.loop.loop_rides import RideResult, play
from sim_ecu.loop.suites import cases
from sim_ecu.loop.suites.rides import FEW_SEEDS, FIRST_TEST_SEED, SEEDS, LoopCase
from sim_ecu.reporting.result_files import check_output, status_by_goals, write_results
from wrcd.errors import InputError

QUICK_SEEDS = 1
UNPROTECTED_TAKES = 1.5  # times as long to stop, about


@dataclass(frozen=True, slots=True)
class Work:
    """A run of a case, and of those that branch off it."""

    suite: str
    names: tuple[str, ...]
    number: int


def run(
    suite: str | None, only: str, quick: bool, seeds: int | None, jobs: int, json_out: Path | None,
    html_out: Path | None, fail_on: str | None,
) -> int:  # fmt: skip
    """Drive, judge, print; write the figures as JSON and a page where requested."""
    check_output("--json", json_out)
    check_output("--html", html_out)
    selected = cases(suite, only)
    if not selected:
        hint = f"rows: {'; '.join(dict.fromkeys(c.name for c in cases(suite)))}"
        raise InputError(f"no row's name holds {only!r}", key="--only", hint=hint)
    began = time.monotonic()
    count = seeds or (QUICK_SEEDS if quick else None)
    outcomes, missing = play_all(selected, count, jobs)
    holed = dict.fromkeys(m.piece.suite for m in missing)
    shown = [case for case in selected if case.suite not in holed]
    outcomes = [o for o in outcomes if o.suite not in holed]
    counts = {"seeds": count or SEEDS, "seeds_of_broad": count or FEW_SEEDS}
    about = {"quick": quick, "jobs": jobs, "left_out": left_out(missing, holed)} | counts
    result: dict[str, Any] = {"run": about} | judge_all(shown, outcomes)
    result["run"]["seconds"] = round(time.monotonic() - began)
    if shown:
        print("\n".join(text(result)))
        write_results(result, json_out, html_out, lambda: page(result, outcomes))
    if missing:
        raise not_whole(missing)
    return status_by_goals(fail_on, result["goals"])


def play_all(selected: Sequence[LoopCase], seeds: int | None, jobs: int) -> tuple[list[RideResult], Sequence[Missing]]:
    """In processes of their own; the order of the outcomes does not depend on them. seeds None: each suite's own. And
    the runs that failed."""
    groups = _groups(selected)
    every_run = [(group, number) for group in groups for number in range(seeds or _seeds(group[0]))]
    work = [Work(group[0].suite, tuple(c.name for c in group), number) for group, number in every_run]
    pieces = [Piece(w.suite, f"{w.names[0]}, seed {FIRST_TEST_SEED + w.number}", sum(map(_cost, group)))
              for w, (group, _) in zip(work, every_run, strict=True)]  # fmt: skip
    whole = every(play_one, work, pieces, jobs)
    found = [o for part in whole.results if part is not None for o in part]
    place = {(case.suite, case.name): k for k, case in enumerate(selected)}
    return sorted(found, key=lambda o: (place[o.suite, o.case], o.number)), whole.missing


def _groups(selected: Sequence[LoopCase]) -> list[list[LoopCase]]:
    """Cases by themselves, but those that branch off another one's runs with it."""
    return [
        [case, *(c for c in selected if c.fault is not None and (c.suite, c.bare) == (case.suite, case.name))]
        for case in selected if case.fault is None
    ]  # fmt: skip


def _seeds(case: LoopCase) -> int:
    return FEW_SEEDS if case.suite in BROAD else SEEDS


def _cost(case: LoopCase) -> float:
    out = 0.0
    for name in case.controllers:
        takes = UNPROTECTED_TAKES if name == UNPROTECTED else 1.0
        out += takes * cost_of_driving(case.axles, name in WITH.values())
    return out


@cache
def _cases() -> dict[tuple[str, str], LoopCase]:
    """All; made once in a process."""
    return {(c.suite, c.name): c for c in cases()}


def play_one(work: Work) -> list[RideResult]:
    """Drive and judge the runs of a piece of work."""
    first, *branches = (_cases()[work.suite, name] for name in work.names)
    return play(first, work.number, branches)
