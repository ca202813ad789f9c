"""Logs of scenarios, made once per test run, and where tests may not be skipped."""

import gc
import hashlib
import os
import pickle
import signal
from collections.abc import Generator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

from sim_ecu.play.play import play_to_log
from sim_ecu.play.scenario import read_scenario
from tests.support.scenarios import LogOf
from wrcd.bus import dbc
from wrcd.config.settings import parse_toml
from wrcd.core import design

# Property tests. What `make test` runs is the same examples every time: a failure comes from the change at hand, on
# every machine, and nothing needs to be kept; 300 of them found no more than 50. `make fuzz` draws others each time
# and prints how to see one again.
# No deadline and no complaint about slow drawing: how long an example takes says how busy the machine is.
SLOW = [HealthCheck.too_slow]
settings.register_profile(
    "ci", max_examples=50, deadline=None, derandomize=True, database=None, suppress_health_check=SLOW
)
settings.register_profile(
    "long",
    max_examples=int(os.environ.get("EXAMPLES", 100_000)),
    deadline=None,
    print_blob=True,
    suppress_health_check=SLOW,
)
settings.load_profile("ci")

# cantools takes 60 ms to parse the packaged DBC, a copy of what it gave the first time 7.
_parse, _parsed = dbc._parse, dict[str, bytes]()


def _parse_once(text: str) -> object:
    if text not in _parsed:
        _parsed[text] = pickle.dumps(_parse(text))
    return pickle.loads(_parsed[text])


dbc._parse = _parse_once  # type: ignore[assignment]  # any file's, as an object that is pickled
# A design, which nothing changes once it is read, takes 40 ms. Its path is in the texts of errors alone.
design._parsed = cache(design._parsed)

# In the background of a script SIGINT is ignored, and after nohup SIGHUP, here and in every process that a test starts:
# one that waits for the end by them would wait for ever.
for number, usual in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, signal.SIG_DFL)):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, usual)

# python-can loads asammdf in each process, half a second, where it is installed. Programs that tests start have it only
# where they read MF4: these leave PYTHONPATH out.
os.environ["PYTHONPATH"] = str(Path(__file__).parent / "support/no_mdf")

# What needs a tool that this computer lacks is skipped; with NO_SKIPS=1, as in CI, it fails. On a native bus a test
# is rightly left out that only a kernel to throw away may try.
MAY_SKIP = Path(__file__).parent / "hil"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Turn a skip into a failure where none is allowed."""
    report = yield
    skipped = report.skipped and not hasattr(report, "wasxfail")
    if os.environ.get("NO_SKIPS") and skipped and MAY_SKIP not in item.path.parents:
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else report.longrepr
        report.outcome, report.longrepr = "failed", f"NO_SKIPS is set. {reason}"
    return report


TOOK: dict[str, dict[str, float]] = {}  # seconds of a test's set-up, call and tear-down


@pytest.hookimpl(wrapper=True)
def pytest_report_teststatus(
    report: pytest.TestReport | pytest.CollectReport,
) -> Generator[None, tuple[str, str, str | tuple[str, dict[str, bool]]], tuple[str, str, Any]]:
    """Say beside a result how long it took, when it is first told: a run that is killed has then said what it knew."""
    category, letter, word = yield
    if isinstance(report, pytest.CollectReport):  # of a module that is left out
        return category, letter, word
    took = TOOK.setdefault(report.nodeid, {})
    if report.when in took or not isinstance(word, str) or not word:
        return category, letter, word
    took[report.when] = report.duration
    return category, letter, f"{word} {sum(took.values()):.2f} s"


def _ended(_number: int, _frame: object) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)  # make hands on what the group has got already
    raise KeyboardInterrupt


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """A process more than there are cores: in some tests one waits for others, or for the disk."""
    return len(os.sched_getaffinity(0)) + 1


def pytest_configure(config: pytest.Config) -> None:
    """Let SIGTERM end a run of several processes as Ctrl-C does, with its failures so far."""
    if config.getoption("dist", "no") != "no":
        signal.signal(signal.SIGTERM, _ended)


def pytest_collection_finish() -> None:
    """Let the collector of garbage look at no test that is loaded again and again: a tenth of the processor time."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session")
def log_of(tmp_path_factory: pytest.TempPathFactory) -> LogOf:
    """Plays the text of a scenario into a candump log; the same text gives the same file.

    The processes of one run share the files: one that is whole gets its name, so it does not matter who made it.
    """
    own = tmp_path_factory.getbasetemp()
    shared = (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "logs"
    shared.mkdir(exist_ok=True)

    def make(text: str) -> Path:
        made = shared / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.log"
        if not made.exists():
            begun = made.with_suffix(f".{os.getpid()}.log")
            play_to_log(read_scenario(parse_toml(text, "test"), "test"), begun)
            begun.rename(made)
        return made

    return make
