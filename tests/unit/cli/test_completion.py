"""Completion: the packaged scripts are those of the parsers, and both shells complete by them."""

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from sim_ecu.play.faults import KINDS
from sim_ecu.play.scenario import packaged
from sim_ecu.play.vehicles import packaged_vehicles
from tests.support.completion import PROGRAMS, script
from tests.support.page_commands import TERMINAL
from wrcd import resources
from wrcd.cli.completion import FILES
from wrcd.cli.program import Program
from wrcd.config import declared
from wrcd.config.packaged_designs import packaged_designs

# Completes the words that it is given, the last of which is being typed, and prints what readline would offer.
SCRIPT = """
set -u
source "$1"
function=$(complete -p "$2" | sed 's/.*-F \\([^ ]*\\) .*/\\1/')
COMP_WORDS=("${@:2}")
COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
COMPREPLY=()
"$function" # its status says nothing: compopt has no completion to set here
((${#COMPREPLY[@]})) && printf '%s\\n' "${COMPREPLY[@]}"
exit 0
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("a.toml", "b c.toml", "a.log", "a.log.gz", "x.dbc", "x.json", "notes.txt"):
        (tmp_path / name).touch()
    (tmp_path / "logs").mkdir()
    return tmp_path


def complete(*words: str, folder: Path) -> list[str]:
    """What bash offers for the last word."""
    done = subprocess.run(
        ["bash", "--norc", "-c", SCRIPT, "bash", str(resources.COMPLETION / f"{words[0]}.bash"), *words],
        cwd=folder, capture_output=True, text=True, timeout=30, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.splitlines()


@pytest.mark.parametrize("shell", FILES)
@pytest.mark.parametrize("program", PROGRAMS, ids=lambda p: p.name)
def test_command_prints_the_packaged_script_which_is_that_of_the_parser(
    program: Program, shell: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert program.run(["completion", shell]) == 0
    packaged = (resources.COMPLETION / FILES[shell].format(program.name)).read_text(encoding="utf-8")
    assert capsys.readouterr().out == packaged
    assert script(program, shell) == packaged, "python -m tests.support.completion"


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda p: p.name)
def test_commands_and_options_of_each_are_completed(program: Program, folder: Path) -> None:
    assert complete(program.name, "", folder=folder) == list(program.names)
    assert complete(program.name, "--v", folder=folder) == ["--version"]
    parser = program.parser()
    subs = next(a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    for command, p in subs.choices.items():
        every = [o for a in p._actions for o in a.option_strings]
        assert complete(program.name, command, "-", folder=folder) == every


LOGS = ["a.log", "a.log.gz", "logs"]


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("wrcd run --config ", ["a.toml", "b c.toml", "logs"]),
        ("wrcd run --wait ", []),
        ("wrcd run ", []),
        ("wrcd run -i socket", ["socketcan", "socketcand"]),
        ("wrcd run -i virtual -c x --config a", ["a.toml"]),
        ("wrcd dump ", LOGS),
        ("wrcd dump -n 3 ", LOGS),
        ("wrcd dump a.log ", []),
        ("wrcd dump --dbc ", ["logs", "x.dbc"]),
        ("wrcd dump --dbc x.dbc ", LOGS),
        ("wrcd replay a.log a.l", ["a.log", "a.log.gz"]),
        ("wrcd replay a.log -o ", ["a.log", "logs"]),
        ("wrcd lint ", ["logs", "x.dbc"]),
        ("wrcd completion ", ["bash", "zsh"]),
        ("sim-ecu play le", ["leaf-patch"]),
        ("sim-ecu play a", [*(s for s in packaged() if s.startswith("a")), "a.toml"]),
        ("sim-ecu play dry ", []),
        ("sim-ecu inject dry --fault c", [f"{kind}:" for kind in KINDS if kind.startswith("c")]),
        ("sim-ecu design --config m", [v for v in packaged_vehicles() if v.startswith("m")]),
        ("sim-ecu design --form ", ["wrcd", "paper"]),
        ("sim-ecu design --explain x", ["x.json"]),
        ("wrcd replay --design ", [*packaged_designs(), "x.json", "logs"]),
        ("sim-ecu demo -o ", ["logs"]),
        ("sim-ecu figures --output l", ["logs"]),
    ],
)
def test_word_is_completed_by_what_it_may_be(line: str, expected: list[str], folder: Path) -> None:
    assert sorted(complete(*line.split(" "), folder=folder)) == sorted(expected)


def test_interfaces_are_those_of_the_configuration(folder: Path) -> None:
    assert tuple(complete("wrcd", "dump", "-i", "", folder=folder)) == declared.INTERFACES


def test_channels_are_the_can_interfaces_of_the_computer(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, kind in (("can0", 280), ("eth0", 1), ("vcan0", 280)):
        (tmp_path / "net" / name).mkdir(parents=True)
        (tmp_path / "net" / name / "type").write_text(f"{kind}\n")
    monkeypatch.setenv("_wrcd_net", str(tmp_path / "net"))
    assert complete("wrcd", "run", "-c", "", folder=folder) == ["can0", "vcan0"]
    assert complete("wrcd", "run", "-c", "v", folder=folder) == ["vcan0"]


@pytest.mark.skipif(shutil.which("zsh") is None, reason="needs zsh")
@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("wrcd repl\t", "replay"),
        ("wrcd dump --db\t", "dump --dbc"),
        ("wrcd dump --dbc x.d\t", "dump --dbc x.dbc"),
        ("wrcd run --config a\t", "run --config a.toml"),
        ("wrcd dump a.log.\t", "dump a.log.gz"),
        ("sim-ecu play leaf-\t", "play leaf-patch"),
        ("sim-ecu design --form pa\t", "design --form paper"),
    ],
)
def test_zsh_itself_completes(line: str, expected: str, folder: Path, tmp_path: Path) -> None:
    programs = "\n".join(f'{name}() {{ print -r -- "got <${{(j: :)@}}>" }}' for name in ("wrcd", "sim-ecu"))
    (tmp_path / ".zshrc").write_text(
        f"fpath=({resources.COMPLETION} $fpath)\nautoload -Uz compinit\ncompinit -u -D\n{programs}\nPS1='ready '\n"
    )
    done = subprocess.run(
        [sys.executable, TERMINAL, "ready ", f"{line}\rexit\r", "exec zsh -d -i"],
        cwd=folder, env={**os.environ, "ZDOTDIR": str(tmp_path), "TERM": "dumb"}, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    assert f"got <{expected}>" in done.stdout
