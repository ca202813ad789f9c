"""`sim-ecu fronts`: drives each law at every set point with wrcd and without, prints one front over the other."""

import time
from pathlib import Path
from typing import Any

from sim_ecu.jobs.whole import Piece, every, left_out, not_whole
from sim_ecu.loop import LAWS, WITH
from sim_ecu.loop.fronts import RAILS
from sim_ecu.loop.fronts.front_figures import judge_all
from sim_ecu.loop.fronts.front_page import page, text
from sim_ecu.loop.fronts.front_rides import SET_POINTS, TOLD_PCT, FrontWork, play_one
from sim_ecu.loop.lockstep import cost_of_driving
from sim_ecu.loop.suites.rides import FIRST_TEST_SEED
from sim_ecu.reporting.result_files import check_output, write_results

SLOW = {"low": 1.6}  # times as long as a stop on the others, about


def run(rail: str | None, seeds: int, jobs: int, json_out: Path | None, html_out: Path | None) -> int:
    """Drive, judge, print; write the figures as JSON and a page where requested."""
    check_output("--json", json_out)
    check_output("--html", html_out)
    began = time.monotonic()
    rails = [rail] if rail else list(RAILS)
    work = [FrontWork(r, law, number) for r in rails for number in range(seeds) for law in LAWS]
    pieces = [Piece(w.rail, f"{w.law}, seed {FIRST_TEST_SEED + w.number}", _cost(w)) for w in work]
    whole = every(play_one, work, pieces, jobs)
    holed = dict.fromkeys(m.piece.suite for m in whole.missing)
    rides = [ride for part in whole.results if part is not None for ride in part if ride.rail not in holed]
    about = {"seeds": seeds, "jobs": jobs, "left_out": left_out(whole.missing, holed)}
    result: dict[str, Any] = {"run": about} | judge_all(rides)
    about["seconds"] = round(time.monotonic() - began)
    if rides:
        print("\n".join(text(result)))
        write_results(result, json_out, html_out, lambda: page(result))
    if whole.missing:
        raise not_whole(whole.missing)
    return 0


def _cost(w: FrontWork) -> float:
    bare, own = (len(SET_POINTS[w.law]) * cost_of_driving(1, name == WITH[w.law]) for name in (w.law, WITH[w.law]))
    return SLOW.get(w.rail, 1.0) * (bare + own + len(TOLD_PCT))
