"""`sim-ecu score --suite fusion`: drives patches and other rails, judges what is reported of them, prints tables."""

import math
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from sim_ecu.jobs.whole import Missing, Piece, every, not_whole
from sim_ecu.loop.fusion.patches import KINDS, PATCH, PLACES_M, SPEEDS_M_S, PatchRide, patches, rails
from sim_ecu.loop.fusion.warnings_ahead import (
    BEHIND,
    FRAME_S,
    SAMPLE_S,
    Entry,
    FloatArray,
    PatchRecord,
    entry,
    false_lows,
    false_warnings,
    play,
)
from sim_ecu.reporting import verdicts
from sim_ecu.reporting.page import PageSection, markdown
from sim_ecu.reporting.result_files import check_output, status_by_goals, write_results
from sim_ecu.reporting.table import Table
from sim_ecu.reporting.values import Figure, Rounded, Share, share
from sim_ecu.reporting.verdicts import MIN_QUICK_RUNS, MIN_RUNS, Goal
from sim_ecu.score import FUSION
from sim_ecu.score.metrics import bootstrap
from sim_ecu.score.report import SEEDS
from sim_ecu.score.suites.run import FIRST_TEST_SEED
from wrcd.config.config import load_packaged
from wrcd.core.configuration import Config
from wrcd.estimator.design import load_design

WARNED_SHARE = 0.9
MAX_FALSE_PER_HOUR = 6.0  # of a train: one in ten minutes
SLIDING = "the driver asks for more than the patch carries"
FAR = 0.95  # quantile of Distance's error
CHANCE = 0.05  # with which a rate as high would show no event


def judge(played: Sequence[PatchRecord], quick: bool = False) -> dict[str, Any]:
    """All figures. Leaves are Figures, numbers and words."""
    patches = [p for p in played if p.drive.kind == PATCH]
    every = [e for p in patches for axle in BEHIND if (e := entry(p, axle)) is not None]
    out: dict[str, Any] = {
        "patches": {"asked": sum(not p.drive.held for p in patches), "held": sum(p.drive.held for p in patches)},
        "axles": {
            str(axle + 1): _axle(of := [e for e in every if e.axle == axle + 1])
            | {"never_there": len(patches) - len(of)}
            for axle in BEHIND
        },
        "false_warnings": {
            kind: _false_warnings([p for p in played if kind in (p.drive.kind, "all")]) for kind in ("all", *KINDS)
        },
        "false_lows": _false_lows(played),
        "same_frames": all(p.same for p in played),
    }
    out["goals"] = [goal.record() for goal in _goals(out, MIN_QUICK_RUNS if quick else MIN_RUNS)]
    return out


def _goals(out: dict[str, Any], min_runs: int) -> list[Goal]:
    warned = "fusion: axle {} warned before it is on the patch, {}"
    axles, false, low = out["axles"], out["false_warnings"]["all"], out["false_lows"]
    return [
        *(
            Goal(warned.format(a, "of all patches"), f["all"]["warned"], WARNED_SHARE, True, min_runs)
            for a, f in axles.items()
        ),
        *(
            Goal(warned.format(a, f"where {SLIDING}"), f["groups"][SLIDING]["warned"], WARNED_SHARE, True, min_runs)
            for a, f in axles.items()
        ),
        Goal("fusion: false warnings an hour of a train", false["per_hour"], MAX_FALSE_PER_HOUR),
        Goal("fusion: falsely told low ahead, s an hour of an axle", low["ahead_s_per_hour"], 0.0, never=True),
    ]


def _axle(of: Sequence[Entry]) -> dict[str, Any]:
    """Of one axle: of all patches, and of parts of them."""
    not_held = [e for e in of if not e.held]
    groups = {
        SLIDING: [e for e in not_held if e.slides],
        "for less, as it comes": [e for e in not_held if not e.slides],
        "always for less": [e for e in of if e.held],
        "cleaned by slip": [e for e in of if e.cleaned],
        "not cleaned": [e for e in of if not e.cleaned],
    }
    return {
        "all": _figures(of),
        "speeds": {f"{v:g}": _figures([e for e in of if e.speed_m_s == v]) for v in SPEEDS_M_S},
        "groups": {name: _figures(part) for name, part in groups.items()},
    }


def _figures(of: Sequence[Entry]) -> dict[str, Figure]:
    runs = np.array([e.run for e in of], np.int64)
    lead, stated, true = (np.array([getattr(e, name) for e in of]) for name in ("lead_s", "reported_pct", "true_pct"))
    warned, known = np.isfinite(lead), np.isfinite(stated)
    errors_m = np.abs(np.concatenate([e.errors_m for e in of] or [np.zeros(0)]))
    of_errors = np.repeat(runs, [len(e.errors_m) for e in of])
    return {
        "warned": bootstrap.share(warned, runs),
        "lead_s": bootstrap.quantile(lead[warned], runs[warned], 0.5),
        "told": bootstrap.share(known, runs),
        "confirmed": bootstrap.share(np.array([e.confirmed for e in of], bool), runs),
        "error_pp": bootstrap.mean(np.abs(stated - true)[known], runs[known]),
        "bias_pp": bootstrap.mean((stated - true)[known], runs[known]),
        "distance_m": bootstrap.quantile(errors_m, of_errors, 0.5),
        "distance_p95_m": bootstrap.quantile(errors_m, of_errors, FAR),
    }


def _hours(played: Sequence[PatchRecord]) -> FloatArray:
    return np.array([len(p.way_m) for p in played]) * SAMPLE_S / 3600.0


def _false_warnings(played: Sequence[PatchRecord]) -> dict[str, Any]:
    """Of whole runs: before, on and after a patch."""
    found, hours = np.array([false_warnings(p) for p in played], np.float64).reshape(-1, 2), _hours(played)
    return {
        "count": int(found[:, 0].sum()),
        "seconds": float(found[:, 1].sum()),
        "hours": float(hours.sum()),
        "per_hour": _rate(found[:, 0], hours),
    }


def _false_lows(played: Sequence[PatchRecord]) -> dict[str, Any]:
    """Frames that call a rail low that is not: of Adhesion, the same without fusion, and what fusion adds to them."""
    found = np.array([false_lows(p) for p in played]).reshape(-1, 2)
    seconds, hours = found[:, 1] * FRAME_S, _hours(played) * len(BEHIND)
    runs = np.arange(len(played))
    return {
        "adhesion": sum(p.false_lows for p in played),
        "ahead": int(found[:, 1].sum()),
        "ahead_told_low": int(found[:, 0].sum()),
        "ahead_s_per_hour": bootstrap.ratio(seconds, runs, hours, runs),
    }


def _rate(counts: FloatArray, hours: FloatArray) -> Figure:
    """Events an hour. Of none, the end of the interval is what would show so with a chance of 5 %."""
    runs = np.arange(len(counts))
    if not len(counts) or counts.any():
        return bootstrap.ratio(counts, runs, hours, runs)
    return Figure(0.0, 0.0, -math.log(CHANCE) / float(hours.sum()), len(counts), len(counts))


def sections(result: dict[str, Any]) -> list[PageSection]:
    """Return the tables of fusion along the vehicle."""
    patches, axles, low = result["patches"], result["axles"], result["false_lows"]
    never = ", ".join(str(f["never_there"]) for f in axles.values())
    about = (
        f"{patches['asked'] + patches['held']} patches of low rail, passed by four axles; what axles 2 to 4 were told "
        f"in the last frame before they were on it. On {patches['held']} of them the driver always asks for less than "
        f"they carry. Patches that an axle never came to: {never}."
    )
    head = ["axle", "warned before", "by (median), s", "confirmed", "adhesion told", "its error, pp", "bias, pp",
            "error of Distance (median), m", "95 % of it, m"]  # fmt: skip
    rows = [
        [name, Share(f["warned"]), f["lead_s"], Share(f["confirmed"]), Share(f["told"]), f["error_pp"], f["bias_pp"],
         f["distance_m"], f["distance_p95_m"]]
        for name, f in ((name, axle["all"]) for name, axle in axles.items())
    ]  # fmt: skip
    parts = [
        [
            f"{name}{unit}",
            *(f"{share(f[kind][name]['warned'])} of {f[kind][name]['warned'].count}" for f in axles.values()),
        ]
        for kind, unit in (("speeds", " m/s"), ("groups", ""))
        for name in next(iter(axles.values()))[kind]
    ]
    false = [
        [kind, Rounded(f["hours"], 3), f["count"], f["per_hour"], f["seconds"]]
        for kind, f in result["false_warnings"].items()
    ]
    same = "the same bytes." if result["same_frames"] else "NOT the same."
    return [PageSection("fusion", about, [
        Table(head, rows),
        Table(["warned before, of", *(f"axle {a}" for a in axles)], parts),
        Table(["false warnings of a train", "hours", "count", "an hour", "seconds"], false),
        f"Frames falsely called low: {low['adhesion']} of Adhesion, with fusion and without; {low['ahead']} of "
        f"AdhesionAhead, of {low['ahead_told_low']} that told low adhesion at a place that the axle then came to. "
        f"Adhesion frames with fusion and without are {same}",
        verdicts.table(result["goals"]),
    ])]  # fmt: skip


QUICK = 0.25  # share of the runs in a quick score
BESIDE = 4  # of every so many runs the frames are made without fusion, too
TRAINING = 1000  # the signs were set on seeds below


def run(quick: bool, jobs: int, design: Path, json_out: Path | None, fail_on: str | None) -> int:
    """Drive, judge, print; write the figures as JSON where requested."""
    check_output("--json", json_out)
    _configs(design)  # a bad file is reported here
    began = time.monotonic()
    scale = QUICK if quick else 1.0
    played, missing = play_all([*patches(scale), *rails(scale)], jobs, design)
    if missing:
        raise not_whole(missing)
    result = judge(played, quick)
    result["run"] = {"quick": quick, "jobs": jobs, "seconds": round(time.monotonic() - began)}
    print(SEEDS.format(first=FIRST_TEST_SEED, last=TRAINING))
    print("\n".join(markdown(sections(result))))
    write_results(result, json_out, None, lambda: "")
    return status_by_goals(fail_on, result["goals"])


@lru_cache(1)
def _configs(design_file: Path) -> tuple[Config, Config]:
    """With fusion and without."""
    design = load_design(design_file)
    fusing, plain = load_packaged(len(PLACES_M), PLACES_M), load_packaged(len(PLACES_M))
    return replace(fusing, design=design), replace(plain, design=design)


def play_one(design: Path, drive: PatchRide) -> PatchRecord:
    """What a process does with each run."""
    fusing, plain = _configs(design)
    return play(drive, fusing, plain if drive.number % BESIDE == 0 else None)


def play_all(drives: Sequence[PatchRide], jobs: int, design: Path) -> tuple[list[PatchRecord], Sequence[Missing]]:
    """In processes of their own, in the order of the drives. And the runs that failed."""
    pieces = [Piece(FUSION, f"{d.kind}, run {d.number}", d.scenario.train.duration_s) for d in drives]
    whole = every(partial(play_one, design), drives, pieces, jobs)
    return [p for p in whole.results if p is not None], whole.missing
