"""A fleet's logs as a campaign: a job for each."""

import os
from pathlib import Path
from typing import Any

from sim_ecu.campaign.definition import Campaign, placed
from sim_ecu.campaign.fleet.find import Fleet, Log, printable
from sim_ecu.campaign.job import Job
from sim_ecu.campaign.kinds.log import KIND, OWN
from sim_ecu.campaign.store import Asked
from sim_ecu.campaign.task import digest
from wrcd.errors import InputError
from wrcd.tools.progress import Progress

LABELS = ("train",)  # the same log of another train is the same question


def campaign(fleet: Fleet, channel: str, limit_s: float | None, code: str, progress: Progress) -> Campaign:
    """Raises InputError for a configuration that has a mistake. A log that cannot be read fails in its own job."""
    jobs, paths = [], {}
    for number, one in enumerate(fleet.logs):
        progress.at(f"looked at {number} of {len(fleet.logs)} logs", number / len(fleet.logs))
        inputs = _inputs(one, fleet.folder, channel)
        files = _digests(placed(KIND, inputs, fleet.folder))
        absolute = placed(KIND, inputs, fleet.folder.resolve())
        # a log that changes meanwhile, for it is still being written, is its job's matter and ends nobody else's
        paths[tuple(absolute[f.name] for f in KIND.factors if f.is_file)] = {
            str(path.resolve()): found for name, (path, found) in files.items() if name not in OWN
        }
        jobs.append(Job(KIND.name, inputs, {name: found for name, (_, found) in files.items()}, LABELS))
    progress.end()
    types = {f.name: f.type for f in KIND.factors}
    asked = Asked(f"Logs of {printable(fleet.folder.absolute().name)}", KIND, types, code)
    return Campaign(asked, tuple(jobs), {}, None, 0, limit_s, fleet.folder.resolve(), paths)


def _inputs(one: Log, folder: Path, channel: str) -> dict[str, Any]:
    """File names are relative to the folder: a fleet that is moved asks the same."""
    configuration = "" if one.configuration is None else os.path.relpath(one.configuration, folder)
    return {"train": one.train, "log": one.name, "configuration": configuration, "channel": channel}


def _digests(inputs: dict[str, Any]) -> dict[str, tuple[Path, str]]:
    out = {}
    for name, path in KIND.files(inputs).items():
        try:
            out[name] = path, digest(path)
        except InputError:
            if name not in OWN:
                raise
    return out
