"""`sim-ecu sand`: drives all stops by every policy, judges, prints the tables."""

import time
from pathlib import Path
from typing import Any

from sim_ecu.jobs.whole import Piece, every, left_out, not_whole
from sim_ecu.loop.sand.sand_figures import judge_all
from sim_ecu.loop.sand.sand_page import page, text
from sim_ecu.loop.sand.sanded_stops import RAILS, SLIPPERY, SandJob, drive_stops
from sim_ecu.loop.suites.rides import FIRST_TEST_SEED
from sim_ecu.reporting.result_files import check_output, write_results
from wrcd.errors import Status

SEEDS, QUICK_SEEDS = 5, 2
COSTS = {True: 6.0, False: 1.0}  # where all policies differ, and where none sands, about


def run(quick: bool, seeds: int | None, jobs: int, json_out: Path | None, html_out: Path | None) -> int:
    """Drive, judge, print; write the figures as JSON and a page where requested."""
    for key, file in (("--json", json_out), ("--html", html_out)):
        check_output(key, file)
    began = time.monotonic()
    of_each = QUICK_SEEDS if quick else seeds or SEEDS
    work = [SandJob(rail, FIRST_TEST_SEED + n) for rail in RAILS for n in range(of_each)]
    pieces = [Piece(w.rail, f"seed {w.seed}", COSTS[w.rail in SLIPPERY]) for w in work]
    whole = every(drive_stops, work, pieces, jobs)
    holed = dict.fromkeys(m.piece.suite for m in whole.missing)
    driven = [d for d in whole.results if d is not None and d.rail not in holed]
    about = {"quick": quick, "jobs": jobs, "seeds": of_each, "left_out": left_out(whole.missing, holed)}
    result: dict[str, Any] = {"run": about} | judge_all(driven)
    result["run"]["seconds"] = round(time.monotonic() - began)
    if driven:
        print("\n".join(text(result)))
        write_results(result, json_out, html_out, lambda: page(result))
    if whole.missing:
        raise not_whole(whole.missing)
    return Status.DONE
