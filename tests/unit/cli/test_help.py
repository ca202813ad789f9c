"""Every command's help shows two examples, and the program takes them."""

import re
import shlex

import pytest

from sim_ecu.cli.main import SIM_ECU
from sim_ecu.cli.main import main as sim_ecu
from wrcd.cli.main import WRCD
from wrcd.cli.main import main as wrcd
from wrcd.cli.program import Subcommand

PROGRAMS = {"wrcd": (wrcd, WRCD), "sim-ecu": (sim_ecu, SIM_ECU)}
PARSERS = {name: program.parser() for name, (_, program) in PROGRAMS.items()}
COMMANDS = [(name, c) for name, (_, program) in PROGRAMS.items() for c in program.commands()]
EXAMPLES = [(program, c.name, line) for program, c in COMMANDS for line, _ in c.examples]
LENGTH = 88  # of a line of an example's help


def arguments(program: str, line: str) -> list[str]:
    """What the program itself gets: without what is before it or behind it in a pipe, and without a redirection."""
    (ours,) = (part for part in re.split(r"\s[|>]\s|[()]", line) if part.split()[:1] == [program])
    return shlex.split(ours)[1:]


@pytest.mark.parametrize(("program", "command"), COMMANDS, ids=lambda c: getattr(c, "name", c))
def test_help_of_a_command_shows_two_examples_and_what_each_does(
    program: str, command: Subcommand, capsys: pytest.CaptureFixture[str]
) -> None:
    assert len(command.examples) == 2
    assert command.help[0] == command.help[0].lower()
    assert not any(text.endswith(".") for text in (command.help, *(what for _, what in command.examples)))
    with pytest.raises(SystemExit) as ended:
        PROGRAMS[program][0]([command.name, "--help"])
    assert ended.value.code == 0
    said = capsys.readouterr().out
    shown = "".join(f"  {line}\n      {what}\n" for line, what in command.examples)
    assert said.endswith(f"\n\nexamples:\n{shown}")
    assert f"usage: {program} {command.name} " in said
    assert max(map(len, shown.splitlines())) <= LENGTH


@pytest.mark.parametrize(("program", "command", "line"), EXAMPLES, ids=[e[2] for e in EXAMPLES])
def test_example_is_one_that_the_program_takes(program: str, command: str, line: str) -> None:
    assert PARSERS[program].parse_args(arguments(program, line)).command == command


@pytest.mark.parametrize("program", PROGRAMS)
def test_parser_for_one_command_parses_as_the_whole_one_does(program: str) -> None:
    run, ours = PROGRAMS[program]
    for command in ours.commands():
        for line, _ in command.examples:
            given = arguments(program, line)
            assert ours.parser([command]).parse_args(given) == PARSERS[program].parse_args(given)
    with pytest.raises(SystemExit) as ended:
        run(["no-such-command"])
    assert ended.value.code == 2
