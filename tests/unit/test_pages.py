"""The shell blocks of README, tutorial and how-tos do what the pages say: they run, and end with status 0.

A page is one bash, which takes its blocks in order, in a folder of its own with dbc/ and examples/ in it. What a block
leaves in the background goes on to the end of the page, and is ended there. `<!-- skip: REASON -->` above a block
leaves it out. Two programs on one bus have a network of their own: vcan0 where the kernel has vcan, else python-can's
udp_multicast on the loopback device, put in the place of BUS by its words.
"""

import contextlib
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from sim_ecu.cli.main import main as rig
from tests.support.own_network import BUS, own_network
from tests.support.pages import ROOT, Block, blocks, pages
from tests.support.processes import BIN
from tests.support.tools import missing
from wrcd.cli.main import main

TIMEOUT_S = 300  # of a page, on a busy computer
END_S = 10  # for what it leaves in the background
FOLDERS = ("README.md", "docs/tutorial/", "docs/how-to/")
NAMES = [p.relative_to(ROOT).as_posix() for p in pages()]
# What has ended in the background must have ended well. bash forgets what it has not been asked to remember.
BACKGROUND = re.compile(r"(?<!&)&[ \t]*$", re.MULTILINE)
REMEMBER = '& jobs="$jobs $!"'
CHECK = """check() {
    local job left=
    for job in $jobs; do if kill -0 "$job" 2>/dev/null; then left="$left $job"; else wait "$job"; fi; done
    jobs=$left
}"""


def to_run(page: str) -> list[Block]:
    """The blocks of a page that are run."""
    return [b for b in blocks(ROOT / page) if b.skip is None]


# Of the slowest, other tests have the commands: tests/unit/campaign, loop/test_processes.py and tests/unit/logs.
SLOWEST = {
    "docs/how-to/judge-a-fleets-logs.md", "docs/how-to/find-low-rail.md", "docs/how-to/run-a-campaign.md",
    "docs/how-to/close-the-loop.md", "docs/how-to/why-it-fell.md",
}  # fmt: skip
PAGES = [n for n in NAMES if n.startswith(FOLDERS) and to_run(n)]


def script(steps: list[Block]) -> tuple[list[str], str]:
    """What runs bash, and what bash runs: each block after a line that names it."""
    lines = ["set -euo pipefail", "jobs=", CHECK]
    network, bus = own_network() if any(BUS in step.body for step in steps) else ([], BUS)
    for step in steps:
        body = step.body.replace(BUS, bus)
        lines += [f"echo {shlex.quote(f'-- {step.name}')}", BACKGROUND.sub(REMEMBER, body), "check"]
    return network, "\n".join(lines)


def furnish(folder: Path) -> None:
    """Put dbc/ and examples/ into a folder, and .venv, where the programs are."""
    for name in ("dbc", "examples"):
        (folder / name).symlink_to(ROOT / name)
    (folder / ".venv").symlink_to(sys.prefix)


def alive(group: int) -> bool:
    """Whether a process of a group runs; one that has ended and that nobody has asked after does not."""
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            state, _, of = stat.read_text().rpartition(")")[2].split()[:3]
            if int(of) == group and state != "Z":
                return True
    return False


def end(group: int) -> None:
    """End what a page has left in the background: asked first, then killed."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(group, number)
        until = time.monotonic() + END_S
        while alive(group) and time.monotonic() < until:
            time.sleep(0.1)


def run(steps: list[Block], folder: Path) -> None:
    """Run the blocks of a page. Raises AssertionError with page, line, block and output where one fails."""
    if any("make -C" in step.body for step in steps) and (lacks := missing("gcc")):
        pytest.skip(lacks)
    furnish(folder)
    network, text = script(steps)
    env = {k: v for k, v in os.environ.items() if not k.startswith("CAN_")}
    env |= {"PATH": f"{BIN}:{os.environ['PATH']}", "PYTHONUNBUFFERED": "1", "OPENBLAS_NUM_THREADS": "1"}
    output = folder / ".output"
    with output.open("wb") as out:
        process = subprocess.Popen(
            [*network, "bash", "-c", text], cwd=folder, env=env, stdin=subprocess.DEVNULL, stdout=out, stderr=out,
            start_new_session=True,
        )  # fmt: skip
    try:
        status = process.wait(TIMEOUT_S)
        why = f"ended with {status}"
    except subprocess.TimeoutExpired:
        status, why = -1, f"not done in {TIMEOUT_S} s"
    finally:
        end(process.pid)
        process.wait()
    if status:
        said = output.read_text(encoding="utf-8", errors="replace")
        at = next(s for s in reversed(steps) if f"-- {s.name}\n" in said or s is steps[0])
        raise AssertionError(f"{at.name}: {why}\n{at.body}\nsays\n{said.rpartition(f'-- {at.name}')[2][-4000:]}")


@pytest.mark.parametrize("page", [pytest.param(p, marks=pytest.mark.night if p in SLOWEST else ()) for p in PAGES])
def test_shell_blocks_of_a_page_run(page: str, tmp_path: Path) -> None:
    run(to_run(page), tmp_path)


def a_page(folder: Path, *bodies: str) -> list[Block]:
    """Blocks of a page of a test's own."""
    page = ROOT / "docs/how-to/page.md"
    return [Block(page, number, f"{body}\n", None) for number, body in enumerate(bodies, 1)]


@pytest.mark.parametrize(
    ("bodies", "line"),
    [
        (("true", "false\ntrue"), 2),
        (("false | true",), 1),
        (("false &\nsleep 0.5", "true"), 1),
        (("sleep 99 &", "false"), 2),
        (("echo $UNSET",), 1),
    ],
)
def test_page_that_fails_names_its_line(bodies: tuple[str, ...], line: int, tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match=rf"^docs/how-to/page\.md:{line}: ended with [1-9]"):
        run(a_page(tmp_path, *bodies), tmp_path)


def test_background_of_a_page_is_ended(tmp_path: Path) -> None:
    run(a_page(tmp_path, "sleep 99 &\necho $! >pid", "kill -0 $(cat pid)"), tmp_path)
    with contextlib.suppress(FileNotFoundError):  # a zombie may be left: its parent is gone
        state = Path("/proc", (tmp_path / "pid").read_text().strip(), "stat").read_text().rpartition(")")[2].split()[0]
        assert state == "Z"


REASONS = {
    "it needs the dump of your train", "it needs a terminal", "it needs root, and CAN in the kernel",
    "it sets up a tree of its own", "it asks a package index", "it is all tests",
    "it would overwrite a golden file", "minutes",
}  # fmt: skip


def test_block_that_is_left_out_is_run_by_the_test_that_it_names_or_has_a_reason_that_is_known() -> None:
    for page in NAMES:
        for block in blocks(ROOT / page):
            if block.skip is None or block.skip in REASONS:
                continue
            file = re.fullmatch(r"(tests/\S+\.py) runs it", block.skip)
            assert file, f"{block.name}: {block.skip}"
            assert page in (ROOT / file[1]).read_text(encoding="utf-8"), f"{file[1]} does not read {page}"


def test_no_comment_in_a_page_speaks_to_a_program_but_skip() -> None:
    for name in NAMES:
        comments = re.findall(r"<!-- (.+?) -->", (ROOT / name).read_text(encoding="utf-8"), re.DOTALL)
        assert [c for c in comments if not c.startswith("skip: ")] == [], name


def test_page_on_falls_shows_what_the_command_prints(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of `wrcd why` the first lines."""
    page = (ROOT / "docs/how-to/why-it-fell.md").read_text()
    block = r"^(sim-ecu play .*fell\.log)\n(wrcd why fell\.log .*)\n```\n\n```text\n(.*?)^```$"
    shown = re.search(block, page, re.MULTILINE | re.DOTALL)
    assert shown
    play, why = (words.replace("fell.log", str(tmp_path / "fell.log")).split()[1:] for words in shown.groups()[:2])
    assert rig(play) == 0
    capsys.readouterr()
    assert main(why) == 0
    assert capsys.readouterr().out.startswith(shown[3])
