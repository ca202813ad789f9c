"""`sim-ecu tune`: the stages one after the other, and the files that they leave in the folder."""

import json
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Any

from sim_ecu import resources as rig
from sim_ecu.campaign.campaign_folder import read_results
from sim_ecu.campaign.comparison.compare import BETTER, SAME, WORSE, Result, compare, document
from sim_ecu.campaign.comparison.shown import tables
from sim_ecu.campaign.tune.played import GOALS, operations, play_test
from sim_ecu.campaign.tune.trials import Candidate, Final, Finalist, Judging, play_off, search
from sim_ecu.design.brief import load_source, written
from sim_ecu.design.make import Brief
from sim_ecu.design.search import objective_words
from sim_ecu.jobs.pool import Workers, local
from sim_ecu.jobs.store import Store, save
from sim_ecu.reporting.table import Table
from sim_ecu.reporting.values import plain
from wrcd.config.packaged_designs import design_path, packaged_designs
from wrcd.errors import InputError, Status
from wrcd.estimator.design import load_design
from wrcd.progress import Progress

CANDIDATES, BRIEF, DESIGN, FIGURES = "candidates.sqlite", "brief.toml", "tuned.design.json", "tune.json"
TEST = "test"
COMPARED = ("mean_error_pp", "valid", "drop_lie_s", "false_low_s")
ALPHA = 0.05
# what takes as long as so many candidates: to play a design on training runs; the whole design and the test
PLAYED_AS, TESTED_AS = 5, 60


class Outcome(StrEnum):
    """What the comparison with the design to reach comes to."""

    BEATS = "beats"
    EQUALS = "equals"
    FAILS = "does not reach"
    OPEN = "cannot tell"


MEANING = {
    Outcome.BEATS: "beats {}",
    Outcome.EQUALS: "equals {}: no run differs",
    Outcome.FAILS: "does not reach {}",
    Outcome.OPEN: "cannot tell from {}: what differs is within chance, or these runs are too few",
}


@dataclass(frozen=True, slots=True)
class Tuning:
    """What is tuned. played: designs that are played on whole runs; 0: none, and no design is made."""

    start: Brief
    groups: tuple[str, ...]
    budget: int
    played: int
    seed: int
    jobs: int
    against: Path | None


def tune(tuning: Tuning, folder: Path) -> int:
    """Search, play, choose, compare; print it, and leave it in the folder. What an earlier go with the same question
    has found out there is not worked out again."""
    with Store(folder / CANDIDATES) as store:
        if store.rows:
            print(f"{folder / CANDIDATES}: {len(store.rows)} candidates of an earlier go; those still asked for count")
        with local(tuning.jobs) as workers:
            return _Stages(tuning, folder, store, workers).run()


class _Stages:
    def __init__(self, tuning: Tuning, folder: Path, store: Store, workers: Workers) -> None:
        self._tuning, self._folder, self._store, self._workers = tuning, folder, store, workers
        self._result: dict[str, Any] = {
            "asked": {"over": tuning.groups, "budget": tuning.budget, "played": tuning.played, "seed": tuning.seed}
        }

    def run(self) -> int:
        tuning, began = self._tuning, time.monotonic()
        candidates = self._candidates()
        if not tuning.played:
            self._write_brief(candidates[0].brief, ["No design was played (--played 0)."])
            self._write()
            return Status.DONE
        final = Final(self._folder, tuning.seed, self._workers)
        play_off(tuning.start, candidates, tuning.groups, tuning.played, tuning.seed, final)
        chosen = final.best
        if final.lost:
            print(
                f"no design came of {final.lost} that were to be played: a filter has no steady gain or is not stable"
            )
        print("\n".join(front_table(final)))
        self._result |= {
            "played": [_row(f) for f in final.every], "no_design": final.lost,
            "front": [f.name for f in final.front], "chosen": chosen.name,
        }  # fmt: skip
        self._write_brief(chosen.brief, [f"Chosen: {chosen.name}."])
        status = self._on_test(final)
        self._result["seconds"] = round(time.monotonic() - began)
        self._write()
        return status

    def _candidates(self) -> list[Candidate]:
        tuning, progress = self._tuning, Progress(steps=True)
        judging = Judging(tuning.start, tuning.seed, self._store, self._workers)
        first = judging.errors([tuning.start])[0]
        if judging.computed:
            print(pace(judging.seconds, tuning.budget - 1, tuning.jobs, tuning.played))
        start = Candidate(tuning.start, first)
        found = search(start, tuning.groups, tuning.budget, tuning.seed, judging, progress.at)
        progress.end()
        words = objective_words(tuning.start.form)
        rate = f", {60.0 * judging.computed / judging.seconds:.1f} a minute" if judging.seconds else ""
        lost = f"; {len(judging.failed)} failed: {judging.failed[0]}" if judging.failed else ""
        count = "1 candidate" if tuning.budget == 1 else f"{tuning.budget} candidates"
        print(f"{count}{rate}: {words} {found[0].error:.4f}; of the start {first:.4f}{lost}")
        self._result["candidates"] = {
            "what": words, "start": first, "best": found[0].error, "distinct": len(found),
            "no_filter": sum(c.error == float("inf") for c in found), "failed": judging.failed,
        }  # fmt: skip
        return found

    def _on_test(self, final: Final) -> int:
        """The whole design of the chosen brief against the one to reach, on the same frames of test seeds."""
        made = final.designs.of(final.best.brief, judges=True)
        if made is None:
            raise InputError(
                "gives a draft, but no design from all its conditions", file=self._folder / BRIEF,
                hint="search on from it with another --seed",
            )  # fmt: skip
        design, progress = self._folder / DESIGN, Progress()
        save(design, lambda partly: partly.write_bytes(made.read_bytes()))
        start = final.every[0]
        reference = self._to_reach() or final.designs.of(start.brief, judges=True) or start.design
        final.designs.end()
        sides = [self._folder / TEST / name for name in ("reference", "tuned")]
        for file, folder in zip((reference, design), sides, strict=True):
            play_test(file, folder, self._workers)
        result = compare(read_results(sides[0]), read_results(sides[1]), COMPARED, ALPHA, progress.at)
        progress.end()
        what = outcome(result)
        costs = [operations(load_design(file)) for file in (reference, design)]
        print("\n".join(["", "The first: the design to reach. The second: the tuned one.", *tables(result, ((), ()))]))
        print(f"\nOperations of an axle's tick: {costs[0]} and {costs[1]}.")
        print(f"{design}: {MEANING[what].format(reference)}")
        self._result["test"] = {
            "reference": str(reference), "verdict": what, "operations": {"reference": costs[0], "tuned": costs[1]},
            "comparison": document(result),
        }  # fmt: skip
        return Status.DONE if what in (Outcome.BEATS, Outcome.EQUALS) else Status.STOPPED

    def _to_reach(self) -> Path | None:
        """What the tuned design is to reach: as requested, or the packaged one of its form and vehicle; None where none
        is for them and the tick: then it is the start."""
        if self._tuning.against is not None:
            return self._tuning.against
        brief = self._tuning.start
        every = [rig.PAPER_DESIGN] if brief.form == "paper" else [design_path(name) for name in packaged_designs()]
        for packaged in every:
            source = load_source(packaged)
            like = replace(source.wheelset, name=brief.wheelset.name) == brief.wheelset
            if like and source.design.tick_s == brief.tick_s:
                return packaged
        return None

    def _write_brief(self, brief: Brief, comments: list[str]) -> None:
        tuning = self._tuning
        file = self._folder / BRIEF
        over = ", ".join(tuning.groups)
        how = f"Found by `sim-ecu tune` over {over}: {tuning.budget} candidates, seed {tuning.seed}."
        found = self._result["candidates"]
        errors = f"{found['what']} start {found['start']:.4f}, best candidate {found['best']:.4f}."
        text = written(brief, [how, errors, *comments, "Makes a design: `sim-ecu design --config`."])
        save(file, lambda partly: partly.write_text(text, encoding="utf-8"))
        print(f"{file}: the brief of it")

    def _write(self) -> None:
        text = json.dumps(plain(self._result), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        save(self._folder / FIGURES, lambda partly: partly.write_text(text, encoding="utf-8"))


def outcome(result: Result) -> Outcome:
    """Return what a comparison of the tuned design (second) with the one to reach comes to."""
    found = {c.verdict for c in result.comparisons}
    if WORSE in found:
        return Outcome.FAILS
    if BETTER in found:
        return Outcome.BEATS
    return Outcome.EQUALS if found <= {SAME} else Outcome.OPEN


def pace(seconds: float, left: int, jobs: int, played: int) -> str:
    """Return what the budget comes to on this computer, from the time that the start took."""
    minutes = seconds * left / jobs / 60.0
    after = seconds * (PLAYED_AS * played + TESTED_AS) / jobs / 60.0
    rest = f", the play-off and the test some {after:.0f} more" if played else ""
    return (
        f"the start took {seconds:.0f} s, its conditions included: {left} further candidates on {jobs} "
        f"{'process' if jobs == 1 else 'processes'} take {minutes:.0f} minutes at most{rest}"
    )


def front_table(final: Final) -> Sequence[str]:
    """Return the designs that were played on training seeds, and which of them no other is ahead of in all goals."""
    rows = []
    for f in final.every:
        marks = ["front"] * (f in final.front) + ["chosen: least over the start"] * (f is final.best)
        values = [f"{v:.3f}" for v in f.figures.values]
        rows.append([f.name, *values, str(f.figures.cost), f"{f.against_start:+.3f}", ", ".join(marks)])
    about = (
        "Played on training seeds. Operations: an axle's, each tick. Over the start: the goals' logarithms by weight."
    )
    head = ["", *(f"{g.words}, {g.unit}" for g in GOALS), "operations", "over the start", ""]
    return ["", about, "", *Table(head, rows).markdown()]


def _row(f: Finalist) -> dict[str, Any]:
    return {"name": f.name, "design": str(f.design), "against_start": f.against_start} | asdict(f.figures)
