"""A kind of job for tests: it adds up, and fails, hangs or dies where it is asked to; each execution leaves a line.

`python -m tests.support.trial_kind campaign …` is `sim-ecu campaign …` with this kind.
"""

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias

import pandas as pd

from sim_ecu.campaign.kind import Factor, Kind, Scalar
from tests.support.processes import wait_for
from wrcd.errors import InputError

Write: TypeAlias = Callable[..., Path]  # the fixture that writes a campaign's file
HANGS_S = 600.0
GATE_S = 120.0  # a test that failed opens none


def figures(inputs: Mapping[str, Any]) -> Mapping[str, Scalar]:
    """The work."""
    if inputs.get("record"):
        fd = os.open(str(inputs["record"]), os.O_WRONLY | os.O_APPEND | os.O_CREAT)
        os.write(fd, f"{inputs['x']:g} {inputs['seed']} {os.getpid()}\n".encode())
        os.close(fd)
    if inputs.get("waits_for") and inputs["seed"] >= inputs.get("waits_from", 0):
        wait_for("the gate", GATE_S, Path(str(inputs["waits_for"])).exists)
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


def check(inputs: Mapping[str, Any]) -> float:
    """Not everything goes with everything."""
    if inputs["x"] > 100:
        raise InputError(f"takes 100 at most, not {inputs['x']:g}", key="x")
    return 1.0


TRIAL = Kind(
    "trial",
    (
        Factor("x", float, needed=True),
        Factor("mode", str, choices=("plain", "fancy")),
        Factor("act", str, choices=("", "fail", "hang", "die")),
        Factor("file", str, is_file=True),
        Factor("record", str),
        Factor("waits_for", str),
        Factor("waits_from", int),
        Factor("level", int),
        Factor("on", bool),
    ),
    {"sum": float, "letters": int, "even": bool},
    figures,
    "mode",
    ("scenario.",),
    check=check,
)


def lines(file: Path) -> list[str]:
    """Those of a file that are whole."""
    return file.read_text().split("\n")[:-1] if file.exists() else []


def rows(folder: Path) -> pd.DataFrame:
    """The rows that are in a campaign's folder, as its user reads them, by x, act and seed."""
    if not list(folder.glob("rows/*.parquet")):
        return pd.DataFrame(columns=["key", "x", "seed"])
    found = pd.read_parquet(folder / "rows")
    return found.sort_values([c for c in ("x", "act", "seed") if c in found], ignore_index=True)


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
    from tests.support.trial_kind import TRIAL as importable  # workers find its function by this module's name

    definition.KINDS = (*definition.KINDS, importable)
    return sim_ecu(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
