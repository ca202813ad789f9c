"""`sim-ecu campaign --logs`: a fleet's logs through the core, a table and a page of what they came to."""

import sys
from dataclasses import dataclass
from pathlib import Path

from sim_ecu.campaign.definition import Campaign, placed
from sim_ecu.campaign.fleet import reports
from sim_ecu.campaign.fleet.find import Fleet, find, printable
from sim_ecu.campaign.fleet.jobs import campaign
from sim_ecu.campaign.fleet.page import page, tables
from sim_ecu.campaign.fleet.summary import Summary, summary
from sim_ecu.campaign.go import RESUMES, Workers, go, opened
from sim_ecu.campaign.job import Ending, code
from sim_ecu.commands.run_campaign import terminated_like_ctrl_c, workers_for
from wrcd.errors import Status, create
from wrcd.tools.progress import Progress
from wrcd.tools.story.outputs import need

PAGE = "summary.html"


@dataclass(frozen=True, slots=True)
class Logs:
    """What is asked of which logs."""

    where: str
    train: str | None
    configuration: Path | None
    channel: str
    limit_s: float | None
    reports: bool


def plan(asked: Logs) -> int:
    """Check, and say what would run."""
    fleet = find(asked.where, asked.train, asked.configuration)
    _campaign(asked, fleet)
    print(_found(fleet))
    for name, count in fleet.trains.items():
        print(f"  {name}: {count}")
    return Status.DONE


def run(asked: Logs, folder: Path, jobs: int, scheduler: str | None, again: bool) -> int:
    """Replay, tell, write the page; reports where they are asked for. 1 where a log could not be judged."""
    if asked.reports:
        need(("bokeh",), "report")
    fleet = find(asked.where, asked.train, asked.configuration)
    print(_found(fleet), file=sys.stderr)
    made = _campaign(asked, fleet)
    try:
        with terminated_like_ctrl_c(), workers_for(jobs, scheduler) as workers, opened(made, folder) as ready:
            finished = go(ready, workers, again=again)
            found = summary(made.asked.title, finished.pairs)
            there = _reports(made, found, folder, workers) if asked.reports else {}
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


def _campaign(asked: Logs, fleet: Fleet) -> Campaign:
    return campaign(fleet, asked.channel, asked.limit_s, code(), Progress())


def _reports(made: Campaign, found: Summary, folder: Path, workers: Workers) -> dict[str, str]:
    """Make them. Returns their places from the folder, by log."""
    wanted = {}
    for p in found.every.done:
        inputs = placed(made.asked.kind, p.inputs, made.folder)
        output = (folder / reports.FOLDER / f"{p.name}.html").absolute()
        wanted[p.name] = reports.Wanted(inputs["log"], inputs["configuration"], inputs["channel"], str(output))
    for line in reports.make_all(list(wanted.values()), workers, made.limit_s):
        print(f"sim-ecu: warning: no report: {line}", file=sys.stderr)
    return {name: f"{reports.FOLDER}/{name}.html" for name, w in wanted.items() if w.is_there}
