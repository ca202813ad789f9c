"""`wrcd dump`: candump lines, and behind them what they mean."""

import argparse
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wrcd.cli.arguments import add_bus, add_dbc, databases_of
from wrcd.cli.program import Subcommand
from wrcd.errors import InputError, Status

if TYPE_CHECKING:
    from wrcd.bus.dbc import Message
    from wrcd.bus.frame import Frame
    from wrcd.core.configuration import Config

PIPE = Path("-")
EXTENDED_DIGITS = 8  # of an id of 29 bits, as candump writes it

BOLD_GREEN, BOLD_YELLOW, BOLD_RED, PLAIN = "\033[1;32m", "\033[1;33m", "\033[1;31m", "\033[0m"
_COLOURS = {"Valid": BOLD_GREEN, "Degraded": BOLD_YELLOW, "Error": BOLD_RED, "NotAvailable": BOLD_RED}


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument(
        "log",
        nargs="?",
        metavar="LOG",
        type=Path,
        help="a log instead of a bus; -: standard input, lines of candump -L as they come",
    )
    add_bus(p)
    p.add_argument("-n", "--count", type=int, default=0, help="stop after so many frames")
    p.add_argument("--axle", type=int, action="append", metavar="N", help="only its inputs and wrcd's messages of it")
    p.add_argument("--message", action="append", metavar="NAME", help="only this message")
    p.add_argument("--id", action="append", metavar="HEX", help="only this id: 101, or 18FEF1FE of 29 bits")
    add_dbc(p, ", which wins over the configuration's")
    p.add_argument("--config", type=Path, metavar="FILE", help="configuration whose DBC decodes")
    p.add_argument(
        "--state",
        action="store_true",
        help="print the newest state of every axle, and end; of a bus after about a second",
    )


def _run(args: argparse.Namespace) -> int:
    """Print frames of a log, of standard input or of a bus."""
    from wrcd.bus.positions import message_key
    from wrcd.colour import coloured
    from wrcd.config.config import load_config
    from wrcd.logs.damage import Damage
    from wrcd.logs.reader import STANDARD_INPUT, read_lines, read_log
    from wrcd.logs.time_order import on_channel

    config = load_config(args.config)
    if args.state:
        return _state(args, config)
    # of an id that is in several, the first one's: what was named comes before the configuration's
    databases = (*databases_of(args, config), config.database)
    messages = {message_key(m): m for database in reversed(databases) for m in reversed(database.messages)}
    wanted = _wanted(args, config, messages)
    damage = Damage()
    piped = args.log == PIPE
    log = STANDARD_INPUT if piped else args.log
    if log is None:
        frames = _live(args, config)
    else:
        if piped and sys.stdin is None:
            raise InputError("is closed", file=STANDARD_INPUT, hint="candump -L vcan0 | wrcd dump -")
        frames = read_lines(sys.stdin.buffer, damage) if piped else read_log(log, damage)
        if args.channel is not None:
            frames = on_channel(frames, args.channel, log)
    colour, live = coloured(sys.stdout), piped or log is None
    try:
        selected = ((f, channel) for f, channel in frames if wanted is None or (f.key in wanted and not f.error))
        for number, (frame, channel) in enumerate(selected, 1):
            print(line(frame, channel, messages.get(frame.key), colour), flush=live)
            if number == args.count:
                break
    finally:  # Ctrl-C, too
        for warning in damage.warnings(log or Path()):
            print(f"wrcd: warning: {warning}", file=sys.stderr)
    return Status.DONE if damage.whole else Status.STOPPED


def _state(args: argparse.Namespace, config: "Config") -> int:
    """Print the newest state of a log's or a bus's axles. Raises InputError."""
    import shutil

    from wrcd.colour import coloured
    from wrcd.logs.bus_of import bus_of
    from wrcd.logs.statistics import BIT_RATE
    from wrcd.monitor.bus_model import BusModel
    from wrcd.monitor.sources import FrameSource, NoMore, model_of_log, open_source
    from wrcd.monitor.state_text import listen, state_lines

    if args.log == PIPE or args.axle or args.message or args.id or args.count:
        raise InputError("takes a log or a bus, and all of it", key="--state", hint="leave out the others")
    databases = databases_of(args, config)
    if args.log is None:
        source: FrameSource = open_source(config, *bus_of(args, config))
        model, warnings = BusModel(config, databases), list[str]()
    else:
        model, warnings = model_of_log(args.log, config, databases, args.channel, BIT_RATE)
        source = NoMore(args.log.name)
    try:
        if args.log is None:
            listen(model, source)
        width = shutil.get_terminal_size((120, 24)).columns
        print("\n".join(state_lines(model, source.state(), max(width, 80), coloured(sys.stdout))))
    finally:
        source.close()
    for warning in warnings:
        print(f"wrcd: warning: {warning}", file=sys.stderr)
    return Status.DONE if model.is_whole else Status.STOPPED


def _wanted(args: argparse.Namespace, config: "Config", messages: Mapping[int, "Message"]) -> frozenset[int] | None:
    """The keys of the frames that are asked for; None: all. Raises InputError for an axle, a message, an id that there
    is not."""
    from wrcd.bus.frame import EXTENDED, ID_BITS, STANDARD_BITS
    from wrcd.config.section import suggest
    from wrcd.logs.decoder import sent_messages

    if not (args.axle or args.message or args.id):
        return None
    keys = {m.name: key for key, m in messages.items()}
    numbers = [a.number for a in config.axles]
    names: list[str] = list(args.message or ())
    for name in names:
        if name not in keys:
            raise InputError(f"no DBC has a message {name}", key="--message", hint=suggest(name, list(keys)))
    for axle in args.axle or ():
        if axle not in numbers:
            known = ", ".join(map(str, numbers))
            raise InputError(f"the configuration has no axle {axle}", key="--axle", hint=f"it has {known}")
        names += [i.source.message for i in config.inputs if numbers.index(axle) in i.source.axles]
        names += [output.message for _, number, output in sent_messages(config) if number == axle]
    found = {keys[name] for name in names}
    for text in args.id or ():
        digits = text.lower().removeprefix("0x")
        number = int(digits, 16) if digits and set(digits) <= set("0123456789abcdef") else ID_BITS + 1
        if number > ID_BITS:
            raise InputError(f"{text!r} is no id", key="--id", hint="hexadecimal: 101, or 18FEF1FE of 29 bits")
        found.add(number | EXTENDED if number > STANDARD_BITS or len(digits) == EXTENDED_DIGITS else number)
    return frozenset(found)


def _live(args: argparse.Namespace, config: "Config") -> Iterator[tuple["Frame", str]]:
    import time

    from wrcd.logs.bus_of import open_bus_of

    link, channel = open_bus_of(args, config, None)
    try:
        while True:
            for frame in link.receive(time.time_ns() // 1000):
                yield frame, channel
            time.sleep(0.01)
    finally:
        link.close()


def line(frame: "Frame", channel: str, message: "Message | None", colour: bool) -> str:
    """One frame as a line. Adhesion stands out on a terminal, in the colour of its validity."""
    from wrcd.bus.candump import format_line

    text = format_line(frame, channel)
    if frame.error:
        return f"{text} :: error frame"
    if message is None:
        return text
    if frame.remote:
        return f"{text} :: {message.name}: remote frame"
    try:
        values: Any = message.decode(frame.data)
    except Exception as e:  # too short, or raw values the DBC does not know: say so and go on
        return f"{text} :: {message.name}: cannot be decoded ({e})"
    units = {s.name: f" {s.unit}" if s.unit else "" for s in message.signals}
    shown = ", ".join(f"{k}: {_text(v)}{'' if _named(v) else units[k]}" for k, v in values.items())
    marked = f"{text} :: {message.name}({shown})"
    if colour and message.name.startswith("Adhesion_"):
        return f"{_COLOURS.get(str(values.get('Validity')), '')}{marked}{PLAIN}"
    return marked


def _named(value: Any) -> bool:
    return hasattr(value, "name")


def _text(value: Any) -> str:
    return f"{value:.9g}" if isinstance(value, float) else str(value)


COMMAND = Subcommand(
    "dump",
    "candump lines with the decoded values behind them",
    (
        ("candump -L vcan0 | wrcd dump -", "what a bus carries, through candump's filters, until Ctrl-C"),
        ("wrcd dump -i socketcan -c vcan0 --state", "the newest state of every axle of a bus, after a second"),
    ),
    _add,
    _run,
    streams=True,
)
