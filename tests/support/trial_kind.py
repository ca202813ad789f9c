"""A kind of job for tests: it adds up, and fails, hangs or dies where it is asked to; each execution leaves a line.

`python -m tests.support.trial_kind campaign …` is `sim-ecu campaign …` with this kind.
"""

import json
import os
import shutil
import signal
import sqlite3
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

from sim_ecu.campaign.kind import Factor, Kind, Metric, Type
from sim_ecu.jobs.job import Job, Scalar
from wrcd.errors import InputError

Write: TypeAlias = Callable[..., Path]  # the fixture that writes a campaign's file
HANGS_S = 600.0


def figures(job: Job) -> Mapping[str, Scalar]:
    """The work."""
    inputs = job.inputs
    if inputs.get("record"):
        fd = os.open(str(inputs["record"]), os.O_WRONLY | os.O_APPEND | os.O_CREAT)
        os.write(fd, f"{inputs['x']:g} {inputs['seed']} {os.getpid()}\n".encode())
        os.close(fd)
    if inputs.get("waits_for") and inputs["seed"] >= inputs.get("waits_from", 0):
        while not Path(str(inputs["waits_for"])).exists():
            time.sleep(0.01)
    time.sleep(float(inputs.get("takes_s", 0.0)))
    act(str(inputs.get("act", "")), int(inputs["seed"]))
    text = Path(str(inputs["file"])).read_text(encoding="utf-8") if inputs.get("file") else ""
    return {"sum": float(inputs["x"]) + int(inputs["seed"]), "letters": len(text), "even": inputs["seed"] % 2 == 0}


def act(what: str, seed: int) -> None:
    """Fail, hang or die, where the seed is a multiple of 3."""
    if seed % 3 or not what:
        return
    if what == "fail":
        raise ValueError(f"seed {seed} at {object()!r}")
    if what == "hang":
        time.sleep(HANGS_S)
    os.kill(os.getpid(), signal.SIGKILL)


def check(inputs: Mapping[str, Any]) -> None:
    """Not everything goes with everything."""
    if inputs["x"] > 100:
        raise InputError(f"takes 100 at most, not {inputs['x']:g}", key="x")


TRIAL = Kind(
    "trial",
    "adds up",
    (
        Factor("x", Type.NUMBER, "a number"),
        Factor("mode", Type.TEXT, "a word", "plain", choices=("plain", "fancy")),
        Factor("act", Type.TEXT, "what goes wrong", "", choices=("", "fail", "hang", "die")),
        Factor("file", Type.TEXT, "a file to read", "", is_file=True),
        Factor("takes_s", Type.NUMBER, "how long it takes", 0.0, "s"),
        Factor("record", Type.TEXT, "where each execution leaves a line", ""),
        Factor("waits_for", Type.TEXT, "a file that it waits for", ""),
        Factor("waits_from", Type.WHOLE, "the first seed that does", 0),
        Factor("level", Type.WHOLE, "a whole number", 0),
        Factor("on", Type.FLAG, "a flag", False),
    ),
    (
        Metric("sum", Type.NUMBER, "x and seed", "m", "less"),
        Metric("letters", Type.WHOLE, "of the file"),
        Metric("even", Type.FLAG, "whether the seed is"),
    ),
    figures,
    open_factors=("scenario.",),
    check=check,
    suite="mode",
)


def lines(file: Path) -> list[str]:
    """Those of a file that are whole."""
    return file.read_text().split("\n")[:-1] if file.exists() else []


def rows(file: Path) -> list[dict[str, Any]]:
    """The figures of the rows that are in a store's file, whoever writes it; none where it is not readable yet."""
    with TemporaryDirectory() as copy:
        for part in (file, file.with_name(f"{file.name}-wal")):  # it is open for one process: a copy is looked at
            if part.exists():
                shutil.copy(part, copy)
        with closing(sqlite3.connect(f"{copy}/{file.name}")) as database:
            try:
                return [json.loads(figures) for (figures,) in database.execute("SELECT figures FROM rows")]
            except sqlite3.DatabaseError:
                return []


@contextmanager
def meanwhile(work: Callable[[], None]) -> Iterator[None]:
    """Beside a block, in a thread; what it raises fails the test."""
    failed: list[BaseException] = []

    def body() -> None:
        try:
            work()
        except BaseException as e:
            failed.append(e)

    thread = threading.Thread(target=body)
    thread.start()
    try:
        yield
    finally:
        thread.join()
    assert failed == []


def main() -> int:
    """sim-ecu with this kind."""
    from sim_ecu.campaign import definition
    from sim_ecu.cli.main import main as sim_ecu
    from tests.support.trial_kind import TRIAL as importable  # children find its function by this module's name

    definition.KINDS = (*definition.KINDS, importable)
    return sim_ecu(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
