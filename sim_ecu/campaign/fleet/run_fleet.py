"""`sim-ecu campaign --logs`: a fleet's logs through the core, a table and a page of what they came to."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from sim_ecu.campaign.campaign_folder import opened_store
from sim_ecu.campaign.definition import Campaign, placed
from sim_ecu.campaign.fleet.find import Fleet, campaign, find, printable
from sim_ecu.campaign.fleet.fleet_page import page, tables
from sim_ecu.campaign.fleet.summary import Summary, summary
from sim_ecu.campaign.go import go
from sim_ecu.campaign.run_campaign import terminated_like_ctrl_c, workers_for
from sim_ecu.jobs import pool
from sim_ecu.jobs.job import Ending
from sim_ecu.jobs.pool import RESUMES, Workers
from sim_ecu.jobs.store import save
from wrcd.config.config import load_config
from wrcd.errors import Status, create, need
from wrcd.logs.story import gather
from wrcd.progress import Progress
from wrcd.report.report_page import write

FOLDER = "reports"
LINES = 20  # about, of progress where there is no terminal


@dataclass(frozen=True, slots=True)
class Wanted:
    """A report. Paths are absolute; configuration empty for the packaged one, channel for the only one."""

    log: str
    configuration: str
    channel: str
    output: str

    @property
    def is_there(self) -> bool:
        """Whether it was made since the log and the configuration were written."""
        output = Path(self.output)
        files = [Path(file) for file in (self.log, self.configuration) if file]
        return output.is_file() and all(output.stat().st_mtime >= f.stat().st_mtime for f in files if f.exists())


def make(wanted: Wanted) -> None:
    """Write a report: the whole of it or none. Raises InputError as `wrcd report` does."""
    config = load_config(Path(wanted.configuration) if wanted.configuration else None)
    story = gather(Path(wanted.log), config, replay=True, channel=wanted.channel or None)
    output = Path(wanted.output)
    output.parent.mkdir(parents=True, exist_ok=True)
    save(output, lambda beside: write(story, None, beside))


def make_all(every: Sequence[Wanted], workers: Workers, limit_s: float | None) -> list[str]:
    """Those that are not there yet. Returns a sentence for each that could not be made."""
    left = [w for w in every if not w.is_there]
    progress, failed, part = Progress(steps=True), [], max(1, len(left) // LINES)
    outcomes = pool.run(make, left, workers, limit_s)
    for done, o in enumerate(outcomes, 1):
        if done % part == 0:
            progress.at(f"{done} of {len(left)} reports", done / len(left))
        if o.ending is not Ending.DONE:
            failed.append(f"{left[o.place].output}: {o.error or o.ending.value}")
    progress.end()
    return sorted(failed)


PAGE = "summary.html"


@dataclass(frozen=True, slots=True)
class Logs:
    """Which logs to judge, and how."""

    where: str
    train: str | None
    configuration: Path | None
    channel: str
    limit_s: float | None
    reports: bool


def plan(logs: Logs) -> int:
    """Check, and say what would run."""
    fleet = find(logs.where, logs.train, logs.configuration)
    _campaign(logs, fleet)
    print(_found(fleet))
    for name, count in fleet.trains.items():
        print(f"  {name}: {count}")
    return Status.DONE


def run(logs: Logs, folder: Path, jobs: int, scheduler: str | None, again: bool) -> int:
    """Replay, print, write the page; reports where requested. Returns 1 where a log could not be judged."""
    if logs.reports:
        need(("bokeh",), "report")
    fleet = find(logs.where, logs.train, logs.configuration)
    print(_found(fleet), file=sys.stderr)
    made = _campaign(logs, fleet)
    try:
        with (
            terminated_like_ctrl_c(),
            workers_for(jobs, scheduler, made) as workers,
            opened_store(folder, made.request, made.keys) as store,
        ):
            finished = go(made, folder, store, workers, again=again)
            found = summary(made.request.title, finished.pairs)
            there = _reports(made, found, folder, workers) if logs.reports else {}
    except KeyboardInterrupt:
        print(f"stopped; what is finished is in {folder}, {RESUMES}", file=sys.stderr)
        return Status.INTERRUPTED
    with create(folder / PAGE) as file:
        file.write(page(found, printable(str(made.folder)), there))
    print("\n".join(tables(found)))
    print(f"\npage: {folder / PAGE}\nresults: {finished.results}")
    return Status.DONE if finished.count(Ending.DONE) == len(finished.pairs) else Status.STOPPED


def _found(fleet: Fleet) -> str:
    return f"{len(fleet.logs)} logs of {len(fleet.trains)} trains"


def _campaign(logs: Logs, fleet: Fleet) -> Campaign:
    return campaign(fleet, logs.channel, logs.limit_s, Progress())


def _reports(made: Campaign, found: Summary, folder: Path, workers: Workers) -> dict[str, str]:
    """Make them. Returns their places from the folder, by log."""
    wanted = {}
    for p in found.every.done:
        inputs = placed(made.request.kind, p.inputs, made.folder)
        output = (folder / FOLDER / f"{p.name}.html").absolute()
        wanted[p.name] = Wanted(inputs["log"], inputs["configuration"], inputs["channel"], str(output))
    for line in make_all(list(wanted.values()), workers, made.limit_s):
        print(f"sim-ecu: warning: no report: {line}", file=sys.stderr)
    return {name: f"{FOLDER}/{name}.html" for name, w in wanted.items() if w.is_there}
