"""The words of messages: an example of each kind, whole, in tests/data/messages.txt.

Other tests ask for an error's exit status and for the file, line or key in it; its words are kept here. Those of a
configuration's mistakes are in mistakes.txt, of verdicts, proposals and hints in files of their own beside it. A block
begins with one of these lines:

    % NAME      a file, with its lines below; `% NAME +` is the packaged configuration with these lines behind it
    $ COMMAND   what it says on standard error, and its exit status; `$ COMMAND |` says what it prints, too
    > CALL      the error that it raises

To add a message write its first line; to accept other words:

    .venv/bin/python -m tests.unit.cli.test_messages --write
"""

import contextlib
import io
import json
import shlex
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from sim_ecu.bench import Bench, scenario
from sim_ecu.cli import main as rig
from tests.support.processes import ROOT
from wrcd.checksum import checksum
from wrcd.cli import main as daemon
from wrcd.config.config import DEFAULT
from wrcd.errors import InputError, need
from wrcd.resources import DBC, DESIGN

SNAPSHOT = ROOT / "tests/data/messages.txt"
MAINS: dict[str, Callable[[list[str]], int]] = {"wrcd": daemon.main, "sim-ecu": rig.main}
CALLS = {"Bench": Bench, "scenario": scenario, "need": need}
HEADS = "%$>"


class Block(NamedTuple):
    """A line that begins with one of HEADS, and what follows it."""

    head: str
    lines: list[str]


def read() -> list[Block]:
    blocks: list[Block] = []
    for line in SNAPSHOT.read_text(encoding="utf-8").splitlines():
        if line[:1] in HEADS and line[1:2] == " ":
            blocks.append(Block(line, []))
        else:
            blocks[-1].lines.append(line)
    return blocks


def make(folder: Path, blocks: list[Block]) -> None:
    """The files that the commands read."""
    for head, lines in blocks:
        if head.startswith("% "):
            name, _, added = head[2:].partition(" ")
            (folder / name).write_text(DEFAULT * bool(added) + "\n".join(lines).rstrip("\n") + "\n")
    (folder / "words.bin").write_bytes(b"\xff\n")
    (folder / "empty.log").touch()
    (folder / "cut.log").write_text("(1700000000.000000) can0 7FF#00\n(1700000000.000100) can0 7F")
    (folder / "deep.toml").write_text("a = " + "[" * 3000)
    (folder / "latin.dbc").write_bytes(b'VERSION ""\nCM_ "Z\xfcrich";\n')
    (folder / "strange").mkdir()
    (folder / "strange/Makefile").touch()
    (folder / "former").mkdir()
    (folder / "former/journal.jsonl").touch()
    for file in (DBC, *(ROOT / "tests/data/dbc").iterdir()):
        shutil.copy(file, folder)
    shutil.copy(ROOT / "examples/own-dbc/train.dbc", folder / "own.dbc")
    golden = (ROOT / "tests/golden/leaf-film.log").read_text().splitlines(keepends=True)
    (folder / "golden.log").write_text("".join(golden))
    for name, silent in {"yaw-rate": "101#", "speed": "130#"}.items():  # from 2 s on, for 0.3 s
        kept = (line for k, line in enumerate(golden) if silent not in line or not 1200 < k < 1380)
        (folder / f"silent-{name}.log").write_text("".join(kept))
    design(folder / "format.json", lambda d: d.update(format="none"))
    design(folder / "changed.json", lambda d: d.update(window_s=2.0), sign=False)
    design(folder / "lacks.json", lambda d: d["fuzzy"].pop("rules"))
    design(folder / "shape.json", lambda d: d["bank"].update(noise_rms=[1.0]))
    design(folder / "range.json", lambda d: d.update(window_s=600.0))
    design(folder / "rules.json", lambda d: d["fuzzy"].update(rules=[[99] * 6]))
    design(folder / "another.json", lambda d: d["inputs"]["wheelset"].update(r_0=0.5))


def design(file: Path, edit: Callable[[Any], object], sign: bool = True) -> None:
    """The packaged one with a mistake."""
    document = json.loads(DESIGN.read_text(encoding="utf-8"))
    edit(document)
    if sign:
        document["checksum"] = checksum(document)
    file.write_text(json.dumps(document))


def said(block: Block) -> list[str]:
    """What comes of it in the folder where it runs."""
    kind, _, text = block.head.partition(" ")
    if kind == ">":
        try:
            eval(text, dict(CALLS))
        except InputError as e:
            return [*str(e).splitlines(), ""]
        raise AssertionError(f"{text} raises nothing")
    out, err = io.StringIO(), io.StringIO()
    program, *arguments = shlex.split(text.removesuffix(" |"))
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            status = MAINS[program](arguments)
        except SystemExit as e:  # of the parser of arguments
            status = int(e.code or 0)
    printed = out.getvalue().splitlines() if text.endswith(" |") else []
    found = "\n".join((*printed, *err.getvalue().splitlines(), f"[{status}]", ""))
    return found.replace(f"{Path.cwd()}/", "").replace(f"{ROOT}/", "").split("\n")


@contextlib.contextmanager
def at(folder: Path) -> Iterator[list[Block]]:
    """The blocks, with their files in the folder that commands run in."""
    blocks = read()
    make(folder, blocks)
    with contextlib.chdir(folder):
        yield blocks


@pytest.fixture(scope="module")
def _folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    with at(tmp_path_factory.mktemp("messages")):
        yield


@pytest.mark.usefixtures("_folder")
@pytest.mark.parametrize("block", [b for b in read() if b.head[0] != "%"], ids=lambda b: b.head[2:])
def test_message_has_its_words(block: Block) -> None:
    assert said(block) == block.lines


def write() -> None:
    """Say all of it anew."""
    with tempfile.TemporaryDirectory() as folder, at(Path(folder)) as blocks:
        lines = [[b.head, *(b.lines if b.head[0] == "%" else said(b))] for b in blocks]
    SNAPSHOT.write_text("\n".join(line for block in lines for line in block) + "\n", encoding="utf-8")


if __name__ == "__main__":
    if sys.argv[1:] != ["--write"]:
        sys.exit("usage: python -m tests.unit.cli.test_messages --write")
    write()
