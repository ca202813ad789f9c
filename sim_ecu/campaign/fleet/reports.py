"""A `wrcd report` of each log, on the campaign's workers."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from sim_ecu.campaign.go import Workers
from sim_ecu.campaign.job import Ending
from sim_ecu.campaign.runner import run
from wrcd.config import load_config
from wrcd.tools.progress import Progress
from wrcd.tools.report.page import write
from wrcd.tools.story.gather import gather

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
    begun = output.with_name(f"{output.name}.new")
    write(story, None, begun)
    begun.replace(output)


def make_all(every: Sequence[Wanted], workers: Workers, limit_s: float | None) -> list[str]:
    """Those that are not there yet. Returns a sentence for each that could not be made."""
    left = [w for w in every if not w.is_there]
    progress, failed, part = Progress(steps=True), [], max(1, len(left) // LINES)
    outcomes = run(make, left, workers.executor, workers.count, limit_s, ahead=workers.ahead, idle=workers.idle)
    for done, o in enumerate(outcomes, 1):
        if done % part == 0:
            progress.at(f"{done} of {len(left)} reports", done / len(left))
        if o.ending is not Ending.DONE:
            failed.append(f"{left[o.place].output}: {o.error or o.ending.value}")
    progress.end()
    return sorted(failed)
