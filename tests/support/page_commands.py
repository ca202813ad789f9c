"""The commands of the pages, and how a test runs them.

Every fence of kind `sh` is run, block by block in a page's order, in a fresh folder that looks like the repository's.
Each block is a bash script of its own; what it leaves running in the background ends with the page. The blocks that
need a bus are run apart from the others, in the guest: neither needs what the other leaves behind. A comment right
above the fence says what is not so:

    <!-- given: COMMANDS -->          first, in the place of what a reader has: his log, his DBC
    <!-- run: vcan -->                it needs vcan0
    <!-- run: guest -->               it needs root and a kernel to throw away
    <!-- run: stop after 3 s -->      its last command goes on until Ctrl-C, which comes then
    <!-- run: stop 2 s after its first line -->   the same, for one that takes its time until it says something
    <!-- run: q at "q quit" -->       its last command has a terminal, and q is pressed when that stands there
    <!-- run: exit 1 -->              its last command ends with that status, or `exit 0 or 1`; otherwise 0 is demanded
    <!-- file: NAME -->              above a fence of any kind: the reader has it as that file, from the start
    <!-- run by: FILE -->             that test runs it: it has the commands, or takes them by run_by()
    <!-- not run: REASON -->          nobody does, for one of the reasons that tests/unit/test_docs_commands.py lists

Several of a `run` are parted by commas.
"""

import contextlib
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.support.pages import ROOT, pages
from tests.support.processes import BIN

FENCE = re.compile(
    r"(?P<marks>(?:^ *<!-- (?:given|run|run by|not run): (?:(?!-->).)+-->\n)*)"
    r"^(?P<indent> *)```sh\n(?P<body>.*?)^(?P=indent)```$",
    re.MULTILINE | re.DOTALL,
)
FILE = re.compile(r"^<!-- file: ([\w.-]+) -->\n```\w+\n(.*?)^```$", re.MULTILINE | re.DOTALL)
MARK = re.compile(r"<!-- (given|run by|run|not run): (.+?) -->", re.DOTALL)
NEEDS = frozenset({"vcan", "guest"})
TERMINAL = Path(__file__).with_name("on_terminal.py")
TIMEOUT_S = 150  # of a block
FIRST_LINE_S = 60
INTERRUPTED = 130
# What a reader has in the folder in which he works; build/ is his own.
KEPT = ("dbc", "docs", "examples", "sim_ecu", "systemd", "tests", "wrcd", "*.md", "*.lock", "pyproject.toml")
BACKGROUND = re.compile(r"^(.*[^&\s])\s*&\s*(?:#.*)?$")


@dataclass(frozen=True, slots=True)
class Stop:
    """When Ctrl-C comes to a last command: so long after its start, or after its first line."""

    after_s: int
    of_first_line: bool

    def around(self, command: str) -> str:
        """Return it as bash that ends with the command's status."""
        quoted = shlex.quote(f"set -o pipefail; {command}")
        if not self.of_first_line:
            return f"timeout --preserve-status -s INT -k 10 {self.after_s} bash -c {quoted}"
        # in a process group of its own, where Ctrl-C is not ignored as it is in the background
        return "\n".join(
            [
                "set -m",
                f"bash -c {quoted} >.said 2>&1 &",
                "pid=$!; trap 'kill -KILL -- -$pid 2>/dev/null' EXIT",
                f"for _ in {{1..{FIRST_LINE_S * 10}}}; do [ ! -s .said ] && kill -0 $pid && sleep .1 || break; done",
                f"sleep {self.after_s}; kill -INT -- -$pid; status=0; wait $pid || status=$?; cat .said",
                "(exit $status)",
            ]
        )


@dataclass(frozen=True, slots=True)
class Press:
    """What a last command's terminal says when `q` is pressed there."""

    at: str

    def around(self, command: str) -> str:
        """Return it as bash that ends with the command's status."""
        return shlex.join([sys.executable, str(TERMINAL), self.at, "q", command])


@dataclass(frozen=True, slots=True)
class Step:
    """One fence: its page and line, the commands, and what is said above it."""

    page: Path
    line: int
    body: str
    given: str
    needs: frozenset[str]
    stop: Stop | Press | None
    statuses: tuple[int, ...]
    run_by: str | None
    not_run: str | None

    @property
    def name(self) -> str:
        """For a person."""
        return f"{self.page.relative_to(ROOT)}:{self.line}"

    @property
    def commands(self) -> list[str]:
        """Each as one types it: without comments."""
        joined = self.body.replace("\\\n", " ").splitlines()
        return [words for line in joined if (words := re.sub(r"(?:^|\s+)#.*", "", line).strip())]

    def script(self) -> str:
        """Return it as bash: each command must succeed, and the last one end as is said."""
        *before, last = _commands(self.body)
        if self.stop is not None:
            last = self.stop.around(last)
        expected = " ".join(map(str, self.statuses if not isinstance(self.stop, Stop) else (0, INTERRUPTED)))
        return "\n".join(
            [
                "set -euo pipefail",
                *_commands(self.given),
                *before,
                "set +e",
                last,
                "status=$?",
                f'for s in {expected}; do [ $status != "$s" ] || exit 0; done',
                f'echo "ended with $status, not with {expected}" >&2; exit 1',
            ]
        )


def steps(page: Path) -> list[Step]:
    """Every fence of commands of a page, in order. Raises ValueError for a mark that means nothing."""
    text = page.read_text(encoding="utf-8")
    return [_step(page, text.count("\n", 0, m.start("body")), m) for m in FENCE.finditer(text)]


def pages_with_steps() -> list[Path]:
    """The pages that have commands."""
    return [p for p in pages() if steps(p)]


def run_by(file: str, page: str) -> list[Step]:
    """The steps of a page that a test runs instead of this module, in order; both names are below the repository."""
    return [s for s in steps(ROOT / page) if s.run_by == file]


def _step(page: Path, line: int, fence: re.Match[str]) -> Step:
    given, reason, by = "", None, None
    stop: Stop | Press | None = None
    needs: set[str] = set()
    statuses: tuple[int, ...] = (0,)
    for kind, said in MARK.findall(fence["marks"]):
        if kind == "given":
            given += said.strip() + "\n"
        elif kind == "not run":
            reason = said
        elif kind == "run by":
            by = said
        else:
            for word in said.split(", "):
                if word in NEEDS:
                    needs.add(word)
                elif m := re.fullmatch(r"stop (?:after (\d+) s|(\d+) s after its first line)", word):
                    stop = Stop(int(m[1] or m[2]), m[2] is not None)
                elif m := re.fullmatch(r'q at "([^"]+)"', word):
                    stop = Press(m[1])
                elif m := re.fullmatch(r"exit (\d+)(?: or (\d+))?", word):
                    statuses = tuple(int(s) for s in m.groups() if s)
                else:
                    raise ValueError(f"{page}:{line}: {word} means nothing")
    body = re.sub(rf"^{fence['indent']}", "", fence["body"], flags=re.MULTILINE)
    return Step(page, line, body, given, frozenset(needs), stop, statuses, by, reason)


def _commands(body: str) -> Iterator[str]:
    """Each command of a fence; what goes to the background leaves its status, where it ends by itself."""
    joined = ""
    for line in body.splitlines():
        joined += line
        if line.endswith("\\"):
            joined += "\n"
            continue
        if m := BACKGROUND.match(joined):
            joined = f"{{ status=0; {m[1]} || status=$?; echo $status >.background-$BASHPID; }} &"
        if joined.strip():
            yield joined
        joined = ""


def _furnish(folder: Path) -> None:
    """Give a folder what the repository has, by links, but no build/; and .venv, where the programs are."""
    for pattern in KEPT:
        for path in ROOT.glob(pattern):
            (folder / path.name).symlink_to(path)
    (folder / ".venv").symlink_to(sys.prefix)


def to_run(page: Path, has: frozenset[str]) -> list[Step]:
    """The steps of a page for a place that has this, in order: without anything those that need nothing, else those
    that need some of it and no more."""
    return [s for s in steps(page) if not (s.not_run or s.run_by) and s.needs <= has and bool(s.needs) == bool(has)]


def run_page(page: Path, folder: Path, has: frozenset[str]) -> None:
    """Run a page's steps for a place that has this. Raises AssertionError.

    What they started is stopped by its process group, asked first.
    """
    env = {k: v for k, v in os.environ.items() if not k.startswith("CAN_")}
    env |= {"PATH": f"{BIN}:{os.environ['PATH']}", "VIRTUAL_ENV": sys.prefix, "PYTHONUNBUFFERED": "1"}
    groups: list[int] = []
    _furnish(folder)
    for name, text in FILE.findall(page.read_text(encoding="utf-8")):
        (folder / name).write_text(text, encoding="utf-8")
    try:
        for step in to_run(page, has):
            _run(step, folder, env, groups)
        _judge_background(page, folder)
    finally:
        _stop(groups)


def _run(step: Step, folder: Path, env: dict[str, str], groups: list[int]) -> None:
    output = folder / f".output-{step.line}"
    with output.open("wb") as out:
        process = subprocess.Popen(
            ["bash", "-c", step.script()],
            cwd=folder,
            env=env,
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=out,
            start_new_session=True,
        )
        groups.append(process.pid)
        try:
            status = process.wait(TIMEOUT_S)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"{step.name}: not done in {TIMEOUT_S} s; it says\n{_said(folder)}") from None
    assert status == 0, f"{step.name}:\n{step.body}\nsays\n{_said(folder)}"
    _judge_background(step.page, folder)


def _judge_background(page: Path, folder: Path) -> None:
    """What went to the background and has ended by itself must have ended well."""
    for ended in folder.glob(".background-*"):
        assert ended.read_text() == "0\n", f"{page}: a command in the background failed; it says\n{_said(folder)}"


def _said(folder: Path) -> str:
    """The end of what each block of a page has said so far."""
    lines = []
    for output in sorted(folder.glob(".output-*"), key=lambda p: int(p.name.rpartition("-")[2])):
        said = output.read_text(encoding="utf-8", errors="replace").splitlines()[-20:]
        lines += [f"-- line {output.name.rpartition('-')[2]}", *said]
    return "\n".join(lines)


def _stop(groups: list[int]) -> None:
    for how, wait_s in ((signal.SIGTERM, 10.0), (signal.SIGKILL, 5.0)):
        groups = [g for g in groups if _alive(g)]
        for group in groups:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(group, how)
        end = time.monotonic() + wait_s
        while any(map(_alive, groups)) and time.monotonic() < end:
            time.sleep(0.1)


def _alive(group: int) -> bool:
    """Whether a process of the group runs; one that has ended and that nobody has asked after does not."""
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            state, _, of = stat.read_text().rpartition(")")[2].split()[:3]
            if int(of) == group and state != "Z":
                return True
    return False
