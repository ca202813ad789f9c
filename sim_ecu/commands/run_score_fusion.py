"""`sim-ecu score --suite fusion`: drives patches and other rails, judges what was told of them, prints the tables."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from sim_ecu.campaign.whole import Missing, Piece, every, not_whole
from sim_ecu.commands.outputs import check_output, status_by_goals, write_results
from sim_ecu.loop.fusion.patches import PLACES_M, Drive, patches, rails
from sim_ecu.loop.fusion.play import Played, play
from sim_ecu.loop.fusion.report import judge
from sim_ecu.loop.fusion.tables import tables
from sim_ecu.score.names import FUSION
from sim_ecu.score.report import SEEDS
from sim_ecu.score.suites.run import FIRST_TEST_SEED
from wrcd import resources
from wrcd.config import load_packaged
from wrcd.core.configuration import Config
from wrcd.estimator.design import load_design

QUICK = 0.25  # share of the runs in a quick score
BESIDE = 4  # of every so many runs the frames are made without fusion, too
TRAINING = 1000  # the signs were set on seeds below


@dataclass(frozen=True, slots=True)
class Work:
    """A run, and the design that plays it."""

    drive: Drive
    design: Path


def run(quick: bool, jobs: int, design_file: Path | None, json_out: Path | None, fail_on: str | None) -> int:
    """Drive, judge, print; write the figures as JSON where asked for."""
    check_output("--json", json_out)
    design = design_file or resources.DESIGN
    _configs(design)  # a bad file is told of here
    began = time.monotonic()
    scale = QUICK if quick else 1.0
    played, missing = play_all([*patches(scale), *rails(scale)], jobs, design)
    if missing:
        raise not_whole(missing)
    result = judge(played, quick)
    result["run"] = {"quick": quick, "jobs": jobs, "seconds": round(time.monotonic() - began)}
    print(SEEDS.format(first=FIRST_TEST_SEED, last=TRAINING))
    print("\n".join(("", *tables(result))))
    write_results(result, json_out, None, lambda: "")
    return status_by_goals(fail_on, result["goals"])


@lru_cache(1)
def _configs(design_file: Path) -> tuple[Config, Config]:
    """With fusion and without."""
    design = load_design(design_file)
    fusing, plain = load_packaged(len(PLACES_M), PLACES_M), load_packaged(len(PLACES_M))
    return replace(fusing, design=design), replace(plain, design=design)


def play_one(work: Work) -> Played:
    """What a process does with each piece of work."""
    fusing, plain = _configs(work.design)
    return play(work.drive, fusing, plain if work.drive.number % BESIDE == 0 else None)


def play_all(drives: Sequence[Drive], jobs: int, design: Path) -> tuple[list[Played], Sequence[Missing]]:
    """In processes of their own, in the order of the drives. And the runs that failed."""
    pieces = [Piece(FUSION, f"{d.kind}, run {d.number}", d.scenario.train.duration_s) for d in drives]
    whole = every(play_one, [Work(d, design) for d in drives], pieces, jobs)
    return [p for p in whole.results if p is not None], whole.missing
