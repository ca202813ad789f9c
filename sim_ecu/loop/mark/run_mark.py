"""`sim-ecu mark`: drives all lines by every policy, judges, prints the tables."""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sim_ecu.jobs.whole import Missing, Piece, every, left_out, not_whole
from sim_ecu.loop.mark.lines import MARK_WORLDS, STATIONS
from sim_ecu.loop.mark.mark_figures import judge_all
from sim_ecu.loop.mark.mark_page import page, picture, text
from sim_ecu.loop.mark.policies import DrivenStop, drive_line
from sim_ecu.loop.suites.rides import FIRST_TEST_SEED
from sim_ecu.reporting.result_files import check_output, status_by_goals, write_results
from wrcd.errors import InputError

QUICK_LINES = 1  # of every world


@dataclass(frozen=True, slots=True)
class Line:
    """A line to drive: its world's place, its number, and the first seed."""

    world: int
    number: int
    first_seed: int


def run(
    world: str | None, quick: bool, lines: int | None, training: bool, jobs: int, json_out: Path | None,
    html_out: Path | None, png_out: Path | None, fail_on: str | None,
) -> int:  # fmt: skip
    """Drive, judge, print; write the figures as JSON, a page and its first picture where requested."""
    for key, file in (("--json", json_out), ("--html", html_out), ("--png", png_out)):
        check_output(key, file)
    places = [k for k, w in enumerate(MARK_WORLDS) if world in (None, w.name)]
    if not places:
        raise InputError(f"there is no world {world!r}", key="--world", hint=", ".join(w.name for w in MARK_WORLDS))
    began = time.monotonic()
    of_each = QUICK_LINES if quick else lines
    first_seed = 0 if training else FIRST_TEST_SEED
    work = [Line(k, n, first_seed) for k in places for n in range(of_each or MARK_WORLDS[k].lines)]
    driven, missing = drive_all(work, jobs)
    holed = dict.fromkeys(m.piece.suite for m in missing)
    driven = [d for d in driven if d.world not in holed]
    about = {"quick": quick, "jobs": jobs, "first_seed": first_seed, "lines_of_each": of_each,
             "left_out": left_out(missing, holed)}  # fmt: skip
    result: dict[str, Any] = {"run": about} | judge_all(driven)
    result["run"]["seconds"] = round(time.monotonic() - began)
    if driven:
        print("\n".join(text(result)))
        write_results(result, json_out, html_out, lambda: page(result))
        if png_out is not None:
            png_out.write_bytes(picture(result))
    if missing:
        raise not_whole(missing)
    return status_by_goals(fail_on, result["goals"])


def drive_all(work: list[Line], jobs: int) -> tuple[list[DrivenStop], list[Missing]]:
    """In processes of their own; the order of the stops does not depend on them. And the lines that failed."""
    pieces = [Piece(MARK_WORLDS[w.world].name, f"line {w.number}", float(STATIONS)) for w in work]
    whole = every(play_one, work, pieces, jobs)
    return [d for part in whole.results if part is not None for d in part], list(whole.missing)


def play_one(line: Line) -> list[DrivenStop]:
    """Drive a line."""
    return drive_line(line.world, line.number, line.first_seed)
