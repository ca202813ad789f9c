"""`sim-ecu score --suite fusion`: drives patches and steady rails, judges what was told of them, prints the tables."""

import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

from sim_ecu.commands.outputs import check_output, write_results
from sim_ecu.loop.fusion.patches import PLACES_M, Drive, patches, steady
from sim_ecu.loop.fusion.play import Played, play
from sim_ecu.loop.fusion.report import judge, tables
from sim_ecu.score.report import SEEDS
from sim_ecu.score.suites.run import FIRST_TEST_SEED
from wrcd import resources
from wrcd.config import load_packaged
from wrcd.core.configuration import Config
from wrcd.estimator.design import load_design
from wrcd.tools.progress import Progress

QUICK = 0.25  # share of the runs in a quick score
TRAINING = 1000  # the signs were set on seeds below

_configs: tuple[Config, Config] | None = None


def run(quick: bool, jobs: int, design_file: Path | None, json_out: Path | None) -> int:
    """Drive, judge, print; write the figures as JSON where asked for."""
    check_output("--json", json_out)
    design = design_file or resources.DESIGN
    _prepare(design)  # a bad file is told of here
    began = time.monotonic()
    scale = QUICK if quick else 1.0
    driven, unchanged = list(patches(scale)), list(steady(scale))
    played = _play_all([*driven, *unchanged], jobs, design)
    result = judge(played[: len(driven)], played[len(driven) :], quick)
    result["run"] = {"quick": quick, "jobs": jobs, "seconds": round(time.monotonic() - began)}
    print(SEEDS.format(first=FIRST_TEST_SEED, last=TRAINING))
    print("\n".join(("", *tables(result))))
    write_results(result, json_out, None, lambda: "")
    return 0


def _prepare(design_file: Path) -> None:
    global _configs
    design = load_design(design_file)
    fusing, plain = load_packaged(len(PLACES_M), PLACES_M), load_packaged(len(PLACES_M))
    _configs = replace(fusing, design=design), replace(plain, design=design)


def _play(drive: Drive) -> Played:
    assert _configs is not None
    return play(drive, *_configs)


def _play_all(every: Sequence[Drive], jobs: int, design_file: Path) -> list[Played]:
    """In processes of their own, in the order of the drives."""
    progress = Progress(steps=True)
    whole_s = sum(d.scenario.train.duration_s for d in every)
    done_s, out = 0.0, []
    with ProcessPoolExecutor(jobs, initializer=_prepare, initargs=(design_file,)) as pool:
        for number, played in enumerate(pool.map(_play, every), 1):
            out.append(played)
            done_s += played.drive.scenario.train.duration_s
            progress.at(f"fusion: run {number} of {len(every)}", done_s / whole_s)
    progress.end()
    return out
