"""wrcd(1) and sim-ecu(1), made from the parsers, the examples and the tables of exit statuses."""

import argparse
import re
from collections.abc import Mapping
from dataclasses import dataclass

from sim_ecu import cli as rig_cli
from sim_ecu.commands.statuses import STATUSES as RIG
from tests.support.roff import bold, escaped, italic, item, page, paragraph, verbatim
from wrcd.errors import Status
from wrcd.tools import cli
from wrcd.tools.command import Command
from wrcd.tools.commands import listed
from wrcd.tools.parser import sentence
from wrcd.tools.statuses import STATUSES as WRCD

SETTINGS = (
    ("CAN_INTERFACE, CAN_CHANNEL, CAN_BITRATE, CAN_CONFIG",
     "python-can's settings of a bus. The tools take them, and those of its files, where neither options nor the "
     "configuration name one. `wrcd run` never does."),
    ("NO_COLOR", "With any value: no colours."),
    ("FORCE_COLOR, CLICOLOR_FORCE", "With any value but 0: colours in a pipe, too."),
    ("TERM", "`dumb`: no colours, and no line that is written anew."),
)  # fmt: skip
MAX_CHOICES = 4  # that stand in the synopsis
CONFIGURATION_FILES = (("~/can.conf, /etc/can.conf, ~/.can, ~/.canrc", "python-can's settings, as above."),)


@dataclass(frozen=True, slots=True)
class Program:
    """A program, and what no parser knows of it."""

    name: str
    does: str
    description: str
    parser: argparse.ArgumentParser
    commands: tuple[Command, ...]
    statuses: Mapping[str, Mapping[Status, str]]
    signals: tuple[tuple[str, str], ...]
    environment: tuple[tuple[str, str], ...]
    files: tuple[tuple[str, str], ...]
    see_also: str


PROGRAMS = {
    "wrcd": Program(
        "wrcd",
        "available adhesion on the CAN bus, before the wheel slips",
        "A daemon estimates the available adhesion of each axle from yaw rate, lateral acceleration, torque and speed "
        "on the CAN bus, and sends it there fifty times a second. Tools check its configuration, decode what a bus "
        "carries, and run the same estimator over logs. All accuracy is against simulation; nothing has run on a "
        "train.",
        cli._parser(),
        listed.COMMANDS,
        WRCD,
        (
            ("SIGTERM, SIGINT", "The daemon sends its last frames, which say NotAvailable, writes a last dump, ends."),
            ("SIGHUP", "It reads its configuration again; on a terminal it ends."),
            ("SIGUSR1", "It writes a recorder's dump."),
        ),
        (
            *SETTINGS,
            ("NOTIFY_SOCKET, WATCHDOG_USEC", "systemd's: the daemon says when it is ready, and that it is alive."),
            ("STATE_DIRECTORY", "systemd's: where the recorder writes, if the configuration does not say."),
        ),
        (
            ("/etc/wrcd/INTERFACE.env", "Options of the unit `wrcd@INTERFACE`: WRCD_OPTIONS=--config …"),
            ("/etc/wrcd/INTERFACE.toml", "Its configuration, by custom. See `wrcd.toml`(5)."),
            *CONFIGURATION_FILES,
        ),
        "`sim-ecu`(1), `wrcd.toml`(5), `wrcd-frames`(7), `candump`(1), `systemctl`(1)",
    ),
    "sim-ecu": Program(
        "sim-ecu",
        "the rig: nonlinear wheelsets on a CAN bus",
        "Plays simulated wheelsets, with faults where they are asked for, onto a bus or into a log; makes the design "
        "file of the estimator, and measures how good it is. It is not for a train.",
        rig_cli._parser(),
        rig_cli.COMMANDS,
        RIG,
        (("SIGTERM, SIGINT", "Playing ends; what was played is said."),),
        (
            *SETTINGS,
            ("NUMBA_CACHE_DIR", "Where the compiled wheelset is kept. Default: beside the program."),
            ("MPLCONFIGDIR", "The same for the fonts of the pictures."),
        ),
        (("/etc/wrcd/sim-ecu-INTERFACE.env", "The scenario of the unit `sim-ecu@INTERFACE`."), *CONFIGURATION_FILES),
        "`wrcd`(1), `wrcd.toml`(5), `wrcd-frames`(7)",
    ),
}


def manual(program: str) -> str:
    """The page of a program."""
    p = PROGRAMS[program]
    subs = next(a for a in p.parser._actions if isinstance(a, argparse._SubParsersAction)).choices
    body = [".SH NAME", f"{p.name} \\- {p.does}", ".SH SYNOPSIS"]
    for c in p.commands:
        body += [f".SY {escaped(p.name)}", bold(c.name), *_synopsis(subs[c.name]), ".YS"]
    body += [".SH DESCRIPTION", *paragraph(p.description), ".SH OPTIONS", *_arguments(p.parser)]
    body += item(f"{bold('-h')}, {bold('--help')}", paragraph("Print help of the program or of a command, and end."))
    body += [".SH COMMANDS"]
    for c in p.commands:
        body += [f".SS {escaped(p.name)} {escaped(c.name)}", *paragraph(sentence(c.help)), *_arguments(subs[c.name])]
        body += [".PP", "Examples:"]
        for line, what in c.examples:
            body += [".PP", *verbatim([bold(line)])]
            body += [".RS 8", *paragraph(sentence(what)), ".RE"]
        body += [".PP", "Exit status:"]
        for status, meaning in sorted(p.statuses[c.name].items()):
            body += item(bold(str(int(status))), paragraph(sentence(meaning)))
    body += [".SH EXIT STATUS", *paragraph(f"A wrong option is {Status.BAD_INPUT:d}, with the usage; Ctrl-C is 130.")]
    body += paragraph("A pipe that its reader has closed is no error.")
    for title, rows in (("SIGNALS", p.signals), ("ENVIRONMENT", p.environment), ("FILES", p.files)):
        body += [f".SH {title}"]
        for name, what in rows:
            body += item(bold(name), paragraph(what))
    body += [".SH SEE ALSO", *paragraph(p.see_also)]
    return page(p.name, 1, body)


def _synopsis(parser: argparse.ArgumentParser) -> list[str]:
    """A macro for each argument, so that a line ends between them."""
    lines = []
    for a in _listed(parser):
        value = _value(a)
        if not a.option_strings:
            dots = f" {escaped('…')}" if a.nargs in ("+", "*") else ""
            lines.append(f"[{value}{dots}]" if a.nargs in ("?", "*") else f"{value}{dots}")
            continue
        name = escaped(a.option_strings[-1])
        dots = f" {escaped('…')}" if isinstance(a, argparse._AppendAction) else ""
        shown = f"\\fB{name}\\fR" + (f"\\~{value}" if value else "")
        lines.append((shown if a.required else f"[{shown}]") + dots)
    return lines


def _arguments(parser: argparse.ArgumentParser) -> list[str]:
    out = []
    for a in _listed(parser):
        value = _value(a)
        tag = ", ".join(map(bold, a.option_strings)) + (f" {value}" if value and a.option_strings else value)
        help_lines = paragraph(sentence(re.sub(r"\s+", " ", a.help or "")))
        if a.choices and len(list(a.choices)) > MAX_CHOICES:
            help_lines += paragraph(f"One of {', '.join(f'`{c}`' for c in a.choices)}.")
        out += item(tag, help_lines)
    return out


def _listed(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    """Arguments but --help, which is that of all, and the commands."""
    return [a for a in parser._actions if a.dest != "help" and not isinstance(a, argparse._SubParsersAction)]


def _value(a: argparse.Action) -> str:
    """What stands for a value; empty for a flag."""
    if a.nargs == 0:
        return ""
    if a.choices and len(list(a.choices)) <= MAX_CHOICES:
        words = "|".join(map(bold, map(str, a.choices)))
        return words if a.nargs != "?" or not a.option_strings else f"[{words}]"
    name = italic(str(a.metavar or (a.dest.upper() if a.option_strings else a.dest)))
    return f"[{name}]" if a.nargs == "?" and a.option_strings else name
