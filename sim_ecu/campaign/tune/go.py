"""`sim-ecu tune`: the stages one after the other, and the files that they leave in the folder."""

import json
import time
from concurrent.futures import Executor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from sim_ecu import resources as rig
from sim_ecu.campaign.runner import local
from sim_ecu.campaign.tune.candidates import Candidate, Judging, search
from sim_ecu.campaign.tune.designs import Designs, save
from sim_ecu.campaign.tune.finalists import Final, Finalist, play_off
from sim_ecu.campaign.tune.goals import Difference, Outcome, differences, operations, outcome
from sim_ecu.campaign.tune.journal import Journal
from sim_ecu.campaign.tune.pieces import Pieces
from sim_ecu.campaign.tune.played import Seen, play_all, test
from sim_ecu.campaign.tune.tables import front_table, pace, said, test_table
from sim_ecu.design.brief import written
from sim_ecu.design.make import Brief
from sim_ecu.design.search import objective_words
from sim_ecu.design.source import load_source
from sim_ecu.score.report import plain
from wrcd import resources
from wrcd.errors import InputError, Status
from wrcd.estimator.design import load_design
from wrcd.tools.progress import Progress

JOURNAL, BRIEF, DESIGN, FIGURES = "journal.jsonl", "brief.toml", "tuned.design.json", "tune.json"
DESIGNS = "designs"
SAID = {
    Outcome.BEATS: "beats {}",
    Outcome.EQUALS: "equals {}: every difference lies within its margin",
    Outcome.FAILS: "does not reach {}",
    Outcome.OPEN: "cannot tell from {}: these runs leave a difference beyond its margin open, either way",
}


@dataclass(frozen=True, slots=True)
class Asked:
    """What is tuned. played: designs that are played on whole runs; 0: none, and no design is made."""

    start: Brief
    groups: tuple[str, ...]
    budget: int
    played: int
    seed: int
    jobs: int
    against: Path | None


def tune(asked: Asked, folder: Path) -> int:
    """Search, play, choose, compare; print it, and leave it in the folder. What an earlier go with the same question
    has found out there is not worked out again."""
    journal = Journal(folder / JOURNAL)
    if len(journal):
        print(f"{folder / JOURNAL}: {len(journal)} answers of an earlier go; those that are still asked for count")
    try:
        with local(asked.jobs) as executor:
            return _Go(asked, folder, journal, executor).run()
    finally:
        journal.close()


class _Go:
    def __init__(self, asked: Asked, folder: Path, journal: Journal, executor: Executor) -> None:
        self._asked, self._folder, self._journal, self._executor = asked, folder, journal, executor
        self._result: dict[str, Any] = {
            "asked": {"over": asked.groups, "budget": asked.budget, "played": asked.played, "seed": asked.seed}
        }

    def run(self) -> int:
        asked, began = self._asked, time.monotonic()
        candidates = self._candidates()
        if not asked.played:
            self._write_brief(candidates[0].brief, ["No design was played (--played 0)."])
            self._write()
            return Status.DONE
        progress = Pieces()
        designs = Designs(self._folder / DESIGNS, progress.at)
        final = Final(designs, asked.seed, self._journal, self._executor, asked.jobs, progress.at)
        play_off(asked.start, candidates, asked.groups, asked.played, asked.seed, final)
        progress.end()
        chosen = final.best
        if final.lost:
            print(
                f"no design came of {final.lost} that were to be played: a filter has no steady gain or is not stable"
            )
        print("\n".join(front_table(final.every, final.front, chosen)))
        self._result |= {
            "played": [_row(f) for f in final.every], "no_design": final.lost,
            "front": [f.name for f in final.front], "chosen": chosen.name,
        }  # fmt: skip
        self._write_brief(chosen.brief, [f"Chosen: {chosen.name}."])
        status = self._on_test(final, designs)
        self._result["seconds"] = round(time.monotonic() - began)
        self._write()
        return status

    def _candidates(self) -> list[Candidate]:
        asked, progress = self._asked, Progress(steps=True)
        judging = Judging(asked.start, asked.seed, self._journal, self._executor, asked.jobs)
        first = judging.errors([asked.start])[0]
        if judging.computed:
            print(pace(judging.seconds, asked.budget - 1, asked.jobs, asked.played))
        start = Candidate(asked.start, first)
        found = search(start, asked.groups, asked.budget, asked.seed, judging, progress.at)
        progress.end()
        words = objective_words(asked.start.form)
        print(said(words, first, found[0].error, asked.budget, judging))
        self._result["candidates"] = {
            "what": words, "start": first, "best": found[0].error, "distinct": len(found),
            "no_filter": sum(c.error == float("inf") for c in found), "failed": judging.failed,
        }  # fmt: skip
        return found

    def _on_test(self, final: Final, designs: Designs) -> int:
        """The whole design of the chosen brief, the start as it was played, and the one to reach, on the test seeds'
        same frames."""
        asked, progress = self._asked, Pieces()
        made = designs.of(final.best.brief)
        if made is None:
            raise InputError(
                "gives a draft, but no design from all its conditions", file=self._folder / BRIEF,
                hint="search on from it with another --seed",
            )  # fmt: skip
        design = self._folder / DESIGN
        save(design, lambda partly: partly.write_bytes(made.read_bytes()))
        start, shipped = final.every[0].design, self._to_reach()
        every = {} if shipped is None else {"to reach": shipped}
        every |= {"start": start, "tuned": design}
        runs = test(load_source(design))
        played = play_all(list(every.values()), runs, self._journal, self._executor, asked.jobs, progress.at)
        progress.end()
        seen: dict[str, list[Seen]] = dict(zip(every, played, strict=True))
        reference = next(iter(every))
        costs = {name: operations(load_design(file)) for name, file in every.items()}
        found = {n: differences(s, seen[reference], (costs[n], costs[reference]))
                 for n, s in seen.items() if n != reference}  # fmt: skip
        what = outcome(found["tuned"])
        print("\n".join(test_table(reference, found, len(runs))))
        print(f"{design}: {SAID[what].format(every[reference])}")
        self._result["test"] = {
            "reference": reference, "verdict": what, "runs": len(runs),
            "designs": {name: str(file) for name, file in every.items()},
            "differences": {name: [_difference(d) for d in of] for name, of in found.items()},
        }  # fmt: skip
        return Status.DONE if what in (Outcome.BEATS, Outcome.EQUALS) else Status.STOPPED

    def _to_reach(self) -> Path | None:
        """What the tuned design is to reach: as asked for, or the packaged one of its form; None for another wheelset
        or tick than that is for: then it is the start."""
        if self._asked.against is not None:
            return self._asked.against
        brief = self._asked.start
        packaged = rig.PAPER_DESIGN if brief.form == "paper" else resources.DESIGN
        source = load_source(packaged)
        same = source.wheelset == brief.wheelset and source.design.tick_s == brief.tick_s
        return packaged if same else None

    def _write_brief(self, brief: Brief, comments: list[str]) -> None:
        asked = self._asked
        file = self._folder / BRIEF
        over = ", ".join(asked.groups)
        how = f"Found by `sim-ecu tune` over {over}: {asked.budget} candidates, seed {asked.seed}."
        found = self._result["candidates"]
        errors = f"{found['what']} start {found['start']:.4f}, best candidate {found['best']:.4f}."
        text = written(brief, [how, errors, *comments, "Makes a design: `sim-ecu design --config`."])
        save(file, lambda partly: partly.write_text(text, encoding="utf-8"))
        print(f"{file}: the brief of it")

    def _write(self) -> None:
        text = json.dumps(plain(self._result), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
        save(self._folder / FIGURES, lambda partly: partly.write_text(text, encoding="utf-8"))


def _row(f: Finalist) -> dict[str, Any]:
    return {"name": f.name, "design": str(f.design), "against_start": f.against_start} | asdict(f.figures)


def _difference(d: Difference) -> dict[str, Any]:
    return {
        "goal": d.words, "unit": d.unit, "value": d.ours, "reference": d.theirs, "difference": d.ours - d.theirs,
        "low": d.low, "high": d.high, "margin": d.margin, "verdict": d.verdict,
    }  # fmt: skip
