"""What may stand where on the command line of both programs, read from their parsers."""

import argparse
import re
from dataclasses import dataclass
from pathlib import Path

import sim_ecu
from sim_ecu import cli as rig_cli
from sim_ecu.play.faults import KINDS
from sim_ecu.play.scenario import packaged
from wrcd import declared
from wrcd.tools import cli

PROGRAMS = {"wrcd": cli._parser, "sim-ecu": rig_cli._parser}
WHEELSETS = tuple(sorted(p.stem for p in (Path(sim_ecu.__file__).parent / "design/wheelsets").glob("*.toml")))
LOGS = (".log", ".gz", ".asc", ".blf", ".trc", ".csv", ".db", ".mf4")
SUFFIXES = {"config": (".toml",), "dbc": (".dbc",), "design": (".json",), "baselines": (".json",)}  # by name


@dataclass(frozen=True, slots=True)
class Values:
    """What may stand for an argument: words and files, channels of this computer; nothing of it: any text."""

    words: tuple[str, ...] = ()
    suffixes: tuple[str, ...] | None = None  # of files; (): any file
    folders: bool = False
    channels: bool = False
    prefixes: bool = False  # the words are not whole: more follows


@dataclass(frozen=True, slots=True)
class Argument:
    """An option with its names, or a positional without one."""

    names: tuple[str, ...]
    takes: bool  # a value
    optional: bool  # the value, or the positional
    again: bool  # may come several times
    values: Values
    label: str
    help: str


@dataclass(frozen=True, slots=True)
class Words:
    """A command, or the program itself before its command."""

    name: str
    help: str
    arguments: tuple[Argument, ...]

    @property
    def options(self) -> tuple[Argument, ...]:
        """Those with a name."""
        return tuple(a for a in self.arguments if a.names)

    @property
    def positionals(self) -> tuple[Argument, ...]:
        """Those without."""
        return tuple(a for a in self.arguments if not a.names)


def values(action: argparse.Action) -> Values:
    """What an argument's name, type and metavar say of its values."""
    if action.choices:
        return Values(words=tuple(map(str, action.choices)))
    if action.dest == "interface":
        return Values(words=declared.INTERFACES)
    if action.dest == "channel":
        return Values(channels=True)
    if action.dest == "scenario":
        return Values(words=tuple(packaged()), suffixes=(".toml",))
    if action.dest == "fault":
        return Values(words=tuple(f"{kind}:" for kind in KINDS), prefixes=True)
    if action.type is not Path:
        return Values()
    metavar = str(action.metavar or "")
    if metavar == "DIR":
        return Values(folders=True)
    if metavar == "RIG.toml":
        return Values(words=WHEELSETS, suffixes=(".toml",))
    if action.dest in SUFFIXES:
        return Values(suffixes=SUFFIXES[action.dest])
    if re.fullmatch(r"LOG\d?", metavar):
        return Values(suffixes=LOGS)
    named = re.search(r"\.\w+$", metavar)
    return Values(suffixes=(named[0],) if named else ())


def arguments(parser: argparse.ArgumentParser) -> tuple[Argument, ...]:
    """Those of a parser, in its order, but for its commands."""
    return tuple(
        Argument(
            tuple(a.option_strings),
            a.nargs != 0,
            a.nargs == "?",
            isinstance(a, argparse._AppendAction) or a.nargs in ("+", "*"),
            values(a),
            str(a.metavar or a.dest),
            re.sub(r"\s+", " ", a.help or ""),
        )
        for a in parser._actions
        if not isinstance(a, argparse._SubParsersAction)
    )


def program(name: str) -> list[Words]:
    """The program itself, and each of its commands."""
    parser = PROGRAMS[name]()
    subs = next(a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    helps = {c.dest: c.help or "" for c in subs._choices_actions}
    return [
        Words(name, "", arguments(parser)),
        *(Words(command, helps[command], arguments(p)) for command, p in subs.choices.items()),
    ]
