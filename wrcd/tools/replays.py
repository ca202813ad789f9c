"""`wrcd replay` of several logs: each as if it were alone, several at once."""

import contextlib
import io
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

from wrcd.errors import InputError, Status
from wrcd.tools.outputs import Outputs, check_outputs
from wrcd.tools.replay import replay
from wrcd.tools.selection import WHOLE, Selection

SUFFIXES = {".log", ".gz", ".blf", ".asc", ".trc", ".mf4", ".csv", ".db"}


def replays(
    logs: Sequence[Path],
    config: Path | None,
    output: Path | None,
    table: Path | None,
    explained: bool,
    jobs: int,
    changes: Path | None = None,
    *,
    selection: Selection = WHOLE,
    mf4: Path | None = None,
    mcap: Path | None = None,
) -> int:
    """Replay logs into folders: NAME.log of the frames sent in `output`, NAME.csv in `table`, NAME.events.csv in
    `changes`, NAME.mf4 in `mf4`, NAME.mcap in `mcap`. What is said of each log is printed in their order.

    Returns the largest exit status. Raises InputError before the first log where the outputs cannot be.
    """
    if jobs < 1:
        raise InputError(f"takes 1 or more, not {jobs}", key="--jobs")
    folders = (("-o", output), ("--csv", table), ("--events", changes), ("--mf4", mf4), ("--mcap", mcap))
    if not any(folder is not None for _, folder in folders):
        raise InputError(
            "are several logs",
            key="LOG",
            hint="name a folder for what comes of them: --csv DIR, --events DIR, --mf4 DIR, --mcap DIR or -o DIR",
        )
    if explained and table is None:
        raise InputError("needs a folder for the rows of several logs", key="--explain", hint="name it: --csv DIR")
    names = [_name(log) for log in logs]
    if twice := sorted({n for n in names if names.count(n) > 1}):
        raise InputError(f"two logs are called {twice[0]}", key="LOG", hint="rename one, or replay it alone")
    outputs = [
        Outputs(
            output / f"{name}.log" if output else None,
            table / f"{name}.csv" if table else None,
            changes / f"{name}.events.csv" if changes else None,
            mf4 / f"{name}.mf4" if mf4 else None,
            mcap / f"{name}.mcap" if mcap else None,
        )
        for name in names
    ]
    check_outputs(outputs, logs, config)
    for key, folder in folders:
        if folder is not None:
            try:
                folder.mkdir(parents=True, exist_ok=True)
            except OSError as e:
                raise InputError(f"is no folder: {e.strerror}", file=folder, key=key) from None
    status = 0
    with ProcessPoolExecutor(min(jobs, len(logs)), mp_context=get_context("spawn")) as pool:
        runs = [pool.submit(_one, log, config, to, explained, selection) for log, to in zip(logs, outputs, strict=True)]
        for log, run in zip(logs, runs, strict=True):
            ended, said = run.result()
            print(f"{log}:\n{said.rstrip()}", file=sys.stderr)
            status = max(status, ended)
    return status


def _one(log: Path, config: Path | None, to: Outputs, explained: bool, selection: Selection) -> tuple[int, str]:
    """One log in a process of its own: its exit status, and what it says."""
    said = io.StringIO()
    with contextlib.redirect_stderr(said):
        try:
            status = replay(
                log, config, to.frames, to.rows, explained, to.events, selection=selection, mf4=to.mf4, mcap=to.mcap
            )
        except InputError as e:
            print(f"wrcd: error: {e}", file=said)
            status = Status.BAD_INPUT
    return status, said.getvalue()


def _name(log: Path) -> str:
    """A log's name without the suffixes that tell its format."""
    name = log.name
    while (suffix := Path(name).suffix) in SUFFIXES:
        name = name.removesuffix(suffix)
    return name
