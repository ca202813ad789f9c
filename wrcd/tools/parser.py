"""The parser of a program, made from the records of its commands."""

import argparse
from collections.abc import Iterable

from wrcd.tools.command import Command
from wrcd.tools.version import Version

NAMES = ("candump", "python-can", "python-can's", "sim-ecu", "systemd", "wrcd", "wrcd's")


def make_parser(program: str, description: str, commands: Iterable[Command]) -> argparse.ArgumentParser:
    """A parser with a command each."""
    p = argparse.ArgumentParser(prog=program, description=description)
    p.add_argument("--version", action=Version, help="print versions of package, design and formats, and end")
    parsers = p.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for command in commands:
        added = parsers.add_parser(
            command.name,
            help=command.help,
            description=sentence(command.help),
            epilog=examples(command),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        command.add(added)
    return p


def sentence(text: str) -> str:
    """One line of help as a sentence. A program's name stays as it is, and so does a value before a colon."""
    first = text.partition(" ")[0]
    begin = text[:1] if first in NAMES or first.endswith(":") or "`" in first else text[:1].upper()
    end = "" if text.endswith((".", "!", "?", "…")) else "."
    return f"{begin}{text[1:]}{end}" if text else ""


def examples(command: Command) -> str:
    """The examples of a command, below its help."""
    lines = [f"  {line}\n      {what}" for line, what in command.examples]
    return "\n".join(["examples:", *lines])
