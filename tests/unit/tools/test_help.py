"""Every command's help shows two examples, and the program takes them."""

import argparse
import re
import shlex
from collections.abc import Callable
from pathlib import Path

import pytest

from sim_ecu import cli as rig_cli
from sim_ecu.cli import main as sim_ecu
from tests.support.scenarios import LogOf, held
from wrcd import resources
from wrcd.config import DEFAULT
from wrcd.tools import cli
from wrcd.tools.cli import main as wrcd
from wrcd.tools.command import Command
from wrcd.tools.commands import listed

PROGRAMS: dict[str, tuple[Callable[[list[str]], int], tuple[Command, ...], argparse.ArgumentParser]] = {
    "wrcd": (wrcd, listed.COMMANDS, cli._parser()),
    "sim-ecu": (sim_ecu, rig_cli.COMMANDS, rig_cli._parser()),
}
COMMANDS = [(program, c) for program, (_, commands, _) in PROGRAMS.items() for c in commands]
EXAMPLES = [(program, c.name, line) for program, c in COMMANDS for line, _ in c.examples]
# Those that take a second and neither a bus nor a process that runs.
RUN = {
    "wrcd check --config train.toml", "wrcd check --config train.toml --log ride.log",
    "wrcd dump ride.log --dbc train.dbc -n 100", "wrcd replay ride.log --csv adhesion.csv --relative",
    "wrcd replay ride.log --events -", "wrcd init train.dbc -o train.toml", "wrcd init train.dbc",
    "wrcd report ride.log -o report.html", "wrcd plot ride.log -o ride.png", "wrcd why ride.log 2.5",
    "wrcd kit -o receiver", "wrcd kit --config train.toml -o receiver",
    "wrcd lint train.dbc", "wrcd lint --json train.dbc", "sim-ecu list", "sim-ecu list | grep axle-box",
    "sim-ecu inject --list", "sim-ecu design --explain", "sim-ecu verify ride.log",
    "sim-ecu verify ride.log --config train.toml", "sim-ecu fmu brake-greasy -o greasy.fmu",
}  # fmt: skip
LENGTH = 88  # of a line of an example's help


def arguments(program: str, line: str) -> list[str]:
    """What the program itself gets: without what is before it or behind it in a pipe, and without a redirection."""
    (ours,) = (part for part in re.split(r"\s[|>]\s|[()]", line) if part.split()[:1] == [program])
    return shlex.split(ours)[1:]


@pytest.mark.parametrize(("program", "command"), COMMANDS, ids=lambda c: getattr(c, "name", c))
def test_help_of_a_command_shows_two_examples_and_what_each_does(
    program: str, command: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    assert len(command.examples) == 2
    with pytest.raises(SystemExit) as ended:
        PROGRAMS[program][0]([command.name, "--help"])
    assert ended.value.code == 0
    said = capsys.readouterr().out
    shown = "".join(f"  {line}\n      {what}\n" for line, what in command.examples)
    assert said.endswith(f"\n\nexamples:\n{shown}")
    assert f"usage: {program} {command.name} " in said
    assert max(map(len, shown.splitlines())) <= LENGTH


@pytest.mark.parametrize(("program", "command"), COMMANDS, ids=lambda c: getattr(c, "name", c))
def test_help_of_a_command_is_one_line_in_lower_case(program: str, command: Command) -> None:
    assert command.help[0] == command.help[0].lower()
    assert not command.help.endswith(".")
    for _, what in command.examples:
        assert not what.endswith(".")


@pytest.mark.parametrize(("program", "command", "line"), EXAMPLES, ids=[e[2] for e in EXAMPLES])
def test_example_is_one_that_the_program_takes(program: str, command: str, line: str) -> None:
    assert PROGRAMS[program][2].parse_args(arguments(program, line)).command == command


@pytest.mark.parametrize(("program", "line"), [(e[0], e[2]) for e in EXAMPLES if e[2] in RUN], ids=lambda a: a)
def test_example_without_a_bus_runs(
    program: str, line: str, log_of: LogOf, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ride = log_of(held("F")).read_bytes()
    monkeypatch.chdir(tmp_path)
    Path("ride.log").write_bytes(ride)
    Path("train.dbc").write_bytes(resources.DBC.read_bytes())
    if "-o train.toml" not in line:
        Path("train.toml").write_text(DEFAULT)
    # 1: a log of four seconds has something that would stop Valid
    assert PROGRAMS[program][0](arguments(program, line)) in ((0, 1) if " --log " in line else (0,))


def test_examples_that_run_are_examples() -> None:
    assert {line for _, _, line in EXAMPLES} >= RUN


@pytest.mark.parametrize("program", PROGRAMS)
def test_parser_for_one_command_parses_as_the_whole_one_does(program: str) -> None:
    run, commands, whole = PROGRAMS[program]
    part = (cli if program == "wrcd" else rig_cli)._parser
    for command in commands:
        for line, _ in command.examples:
            given = arguments(program, line)
            assert part([command]).parse_args(given) == whole.parse_args(given)
    with pytest.raises(SystemExit) as ended:
        run(["no-such-command"])
    assert ended.value.code == 2
