"""What both programs are made of: a record of each command, the parser made from them, errors and exit statuses.

Every start of the daemon imports this: what only `--version` needs is imported for it.
"""

import argparse
import contextlib
import errno
import os
import signal
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from wrcd.errors import InputError, Status

# of what is written: no mistake of the program's, and nothing that its input tells
NOT_WRITTEN = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS)
NAMES = ("candump", "python-can", "python-can's", "sim-ecu", "systemd", "wrcd", "wrcd's")  # keep their small letter
LIBRARIES = ("numpy", "cantools", "python-can")


@dataclass(frozen=True, slots=True)
class Subcommand:
    """A command, from which parser and help are made.

    add gives a parser its arguments; run gets what was parsed and returns the exit status. It imports the modules that
    the command needs: the daemon starts without them.
    """

    name: str
    help: str  # one line, in lower case, without a full stop
    examples: tuple[tuple[str, str], ...]  # command lines, and what each does
    add: Callable[[ArgumentParser], None]
    run: Callable[[Namespace], int]
    # whether a bus or a file that is not there has a status of its own: the command is tried again by a unit
    retried: bool = True
    # whether its output is all that is asked of it: a reader that closes the pipe has enough, and that is 0
    streams: bool = False
    # whether it has a handler of SIGINT of its own, with these arguments
    own_signals: Callable[[Namespace], bool] = lambda _: False


def no_arguments(_p: ArgumentParser) -> None:
    """For a command that takes none."""


@dataclass(frozen=True, slots=True)
class Program:
    """A program: what its help says it is, and its commands, each the COMMAND of a module of a package."""

    name: str
    description: str
    package: str
    names: tuple[str, ...]  # of the commands, in the order of the help

    def commands(self) -> tuple[Subcommand, ...]:
        """Return every command; imports all their modules."""
        return tuple(map(self._command, self.names))

    def _command(self, name: str) -> Subcommand:
        command: Subcommand = import_module(f"{self.package}.{name}").COMMAND
        return command

    def parser(self, commands: Iterable[Subcommand] | None = None) -> ArgumentParser:
        """Return a parser with these commands, or with all."""
        return self._parsers(commands)[0]

    def _parsers(self, commands: Iterable[Subcommand] | None) -> tuple[ArgumentParser, dict[str, ArgumentParser]]:
        """With those of the commands."""
        p = ArgumentParser(prog=self.name, description=self.description)
        p.add_argument("--version", action=Version, help="print versions of package, design and formats, and end")
        parsers = p.add_subparsers(dest="command", required=True, metavar="COMMAND")
        for command in self.commands() if commands is None else commands:
            examples = [f"  {line}\n      {what}" for line, what in command.examples]
            added = parsers.add_parser(
                command.name,
                help=command.help,
                description=sentence(command.help),
                epilog="\n".join(["examples:", *examples]),
                formatter_class=argparse.RawDescriptionHelpFormatter,
            )
            command.add(added)
        return p, parsers.choices

    def run(self, argv: Sequence[str] | None, around: Callable[[Callable[[], int]], int] = lambda run: run()) -> int:
        """Run the command that argv names, within around. Returns the exit status: see Status."""
        argv = sys.argv[1:] if argv is None else list(argv)
        # a daemon's bus is not open yet: it starts without the modules of the other commands
        commands = (self._command(argv[0]),) if argv and argv[0] in self.names else self.commands()
        parser, of_command = self._parsers(commands)
        args, unknown = parser.parse_known_args(argv)
        if unknown:  # the usage that helps is the command's
            parser = of_command[args.command]
            is_config = any(word.endswith(".toml") for word in unknown) and "--config" in parser.format_usage()
            hint = " — a configuration is given with --config" * is_config
            parser.error(f"unrecognized arguments: {' '.join(unknown)}{hint}")
        command = next(c for c in commands if c.name == args.command)
        own_signals = command.own_signals(args)
        return guarded(
            self.name, lambda: around(lambda: command.run(args)), retried=command.retried, streams=command.streams,
            own_signals=own_signals,
        )  # fmt: skip


def sentence(text: str) -> str:
    """One line of help as a sentence. A program's name stays as it is, and so does a value before a colon."""
    first = text.partition(" ")[0]
    begin = text[:1] if first in NAMES or first.endswith(":") or "`" in first else text[:1].upper()
    end = "" if text.endswith((".", "!", "?", "…")) else "."
    return f"{begin}{text[1:]}{end}" if text else ""


class Version(argparse.Action):
    """An option that prints the lines of version_lines() and ends."""

    def __init__(self, option_strings: Sequence[str], dest: str, **kwargs: Any) -> None:
        super().__init__(option_strings, argparse.SUPPRESS, nargs=0, default=argparse.SUPPRESS, **kwargs)

    def __call__(self, parser: ArgumentParser, *_: object, **__: object) -> None:
        """Print and end."""

        def told() -> int:
            print("\n".join(version_lines(parser.prog)))
            return Status.DONE

        parser.exit(guarded(parser.prog, told))


def version_lines(program: str) -> list[str]:
    """Program and version; the default design, the formats of files, and what it runs with."""
    import json
    import platform

    from wrcd import __version__, native, resources

    design = json.loads(resources.DESIGN.read_text(encoding="utf-8"))
    found = ", ".join(f"{name} {_installed(name)}" for name in LIBRARIES)
    return [
        f"{program} {__version__}",
        f"design  {design['name']} {design['checksum'][:12]}, {design['format']}",
        "log     candump -L",
        f"library C11, compiled by {native.compiler()}",
        f"with    Python {platform.python_version()}, {found}, {platform.system()} {platform.release()}",
    ]


def _installed(name: str) -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(name)
    except PackageNotFoundError:
        return "missing"


def guarded(
    name: str, command: Callable[[], int], *, retried: bool = True, streams: bool = False, own_signals: bool = False
) -> int:
    """Run a command: an InputError is one line and its exit status, Ctrl-C exit 130. A full disk, and whatever else
    cannot be written to its end, is one line and STOPPED. A pipe that its reader closes says nothing; the status is the
    command's own where it has come to one, else PIPE_CLOSED.

    retried: whether a bus or a file that is not there has a status of its own. streams: whether a closed pipe is 0.
    own_signals: whether the command has a handler of SIGINT of its own.
    """
    status = int(Status.DONE if streams else Status.PIPE_CLOSED)
    try:
        with _system_interrupt() if own_signals else contextlib.nullcontext():
            status = command()
        sys.stdout.flush()
        return status
    except InputError as e:
        print(f"{name}: error: {e}", file=sys.stderr)
        return e.status if retried or e.status != Status.NOT_THERE else Status.BAD_INPUT
    except KeyboardInterrupt:
        return Status.INTERRUPTED
    except BrokenPipeError:  # whoever reads us has enough
        _silence()
        return status
    except OSError as e:
        if e.errno not in NOT_WRITTEN:
            raise
        _silence()
        where = f"{e.filename}: " if e.filename else ""
        reason = f"{where}the output cannot be written to its end: {e.strerror}"
        with contextlib.suppress(OSError):  # standard error may lie on the same disk
            print(f"{name}: error: {reason} — what is there is not whole; make room and try again", file=sys.stderr)
        return Status.STOPPED


@contextlib.contextmanager
def _system_interrupt() -> Iterator[None]:
    """Ctrl-C ends the process as the system does, until the command has its own handler. About one in a hundred
    exceptions that Python makes of it during a start is lost in an import: the program would run on."""
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.default_int_handler:  # ignored, as in the background of a script
        yield
        return
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _silence() -> None:
    """Keep the interpreter from complaining at exit of what standard output does not take any more."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
