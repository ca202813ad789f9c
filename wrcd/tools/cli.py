"""The wrcd command."""

import argparse
import faulthandler
import gc
import math
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from wrcd import __version__
from wrcd.errors import InputError

if TYPE_CHECKING:
    from wrcd.bus.link import Link


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point. 0 done, 1 stopped on the way, 2 bad input."""
    args = _parser().parse_args(argv)
    _one_thread()
    return guarded("wrcd", lambda: _COMMANDS[args.command](args))


def guarded(name: str, command: Callable[[], int]) -> int:
    """Run a command: bad input is one line and exit 2, Ctrl-C exit 130, a closed pipe no error."""
    try:
        status = command()
        sys.stdout.flush()
        return status
    except InputError as e:
        print(f"{name}: error: {e}", file=sys.stderr)
        return e.status
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:
        # whoever reads us has enough; keep the interpreter from complaining at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


def add_bus(p: argparse.ArgumentParser) -> None:
    """-i and -c, python-can's own words, everywhere the same."""
    p.add_argument("-i", "--interface", help="python-can interface (default: the configuration's, socketcan)")
    p.add_argument("-c", "--channel", help="its channel (default: the configuration's, can0)")


def _parser() -> argparse.ArgumentParser:
    p = argparse.ArgumentParser(
        prog="wrcd",
        description="The wheel-rail condition daemon: adhesion from yaw rate, lateral acceleration, torque.",
    )
    p.add_argument("--version", action="version", version=f"%(prog)s {__version__}", help="print the version and end")
    commands = p.add_subparsers(dest="command", required=True, metavar="COMMAND")
    config = argparse.ArgumentParser(add_help=False)
    config.add_argument(
        "--config", type=Path, metavar="FILE", help="configuration (TOML); default: the packaged DBC, four axles"
    )

    run = commands.add_parser("run", parents=[config], help="estimate on a bus until SIGTERM")
    add_bus(run)
    run.add_argument("--lock-memory", action="store_true", help="keep all memory in RAM (needs LimitMEMLOCK=infinity)")

    check = commands.add_parser("check", parents=[config], help="say what a configuration would run; opens no bus")
    check.add_argument(
        "--speed", action="store_true", help="measure what the core costs on this computer: ten seconds, no bus"
    )

    dump = commands.add_parser("dump", help="candump lines with the decoded values behind them")
    dump.add_argument("log", nargs="?", type=Path, help="a log instead of a bus")
    add_bus(dump)
    dump.add_argument("-n", "--count", type=int, default=0, help="stop after so many frames")
    dump.add_argument(
        "--dbc",
        type=Path,
        action="append",
        default=[],
        metavar="FILE",
        help="another DBC, which wins over the configuration's; may be repeated",
    )
    dump.add_argument("--config", type=Path, metavar="FILE", help="configuration whose DBC decodes")

    replay = commands.add_parser("replay", parents=[config], help="estimate over a log, byte for byte as on the bus")
    replay.add_argument(
        "logs", type=Path, metavar="LOG", nargs="+", help="candump log, or any that python-can reads; one or several"
    )
    replay.add_argument(
        "-o", "--output", type=Path, metavar="OUT.log",
        help="write the frames sent as a candump log; of several logs a folder of them",
    )  # fmt: skip
    replay.add_argument(
        "--csv",
        type=Path,
        metavar="OUT.csv",
        help="write one row per Adhesion frame (default, without -o: to the screen); of several logs a folder of them",
    )
    replay.add_argument(
        "--from", dest="begin", type=_seconds, metavar="S",
        help="write what comes from then on: seconds since 1970, or of the log with --relative",
    )  # fmt: skip
    replay.add_argument("--to", dest="end", type=_seconds, metavar="S", help="… and what comes before then")
    replay.add_argument(
        "--relative", action="store_true", help="times, in rows too, are seconds from the log's first frame"
    )
    replay.add_argument(
        "--axle", type=int, action="append", default=[], metavar="N", help="write this axle only; may be repeated"
    )
    replay.add_argument("--channel", metavar="CH", help="read this channel only; of a log of several one must be named")
    replay.add_argument(
        "--explain", action="store_true", help="rows also name the winning model and the dominant rule of the moment"
    )
    replay.add_argument(
        "--jobs", type=int, default=1, metavar="N", help="of several logs, so many at once (default: 1)"
    )
    return p


def _seconds(text: str) -> float:
    """A finite number, for argparse."""
    seconds = float(text)
    if not math.isfinite(seconds):
        raise ValueError
    return seconds


def _one_thread() -> None:
    """Keep the arithmetic to one thread: the bank's products are a few hundred numbers. Call before numpy's import."""
    for library in ("OPENBLAS", "OMP", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")


def _run(args: argparse.Namespace) -> int:
    faulthandler.enable(sys.__stderr__ or 2)  # when the watchdog aborts a daemon that hangs, the log says where
    # Started on SocketCAN by name, the bus is opened before the slow imports, and the kernel keeps what it
    # carries meanwhile: after a crash the window is full as soon as the program is there.
    early = None
    if args.interface == "socketcan" and args.channel:
        from wrcd.bus.socketcan import SocketCanLink

        early = SocketCanLink(args.channel, None)
    link: Link
    try:
        from wrcd.bus.opening import open_link
        from wrcd.config import load_config_to_run
        from wrcd.core.core import Core
        from wrcd.recorder.recorder import make_recorder
        from wrcd.service.journal import log_line
        from wrcd.service.loop import Daemon
        from wrcd.service.memory import lock
        from wrcd.service.notify import Notifier
        from wrcd.service.reload import Reload

        # no garbage among what the imports made: the collector need not look through it while the DBC is parsed
        gc.freeze()
        config = load_config_to_run(args.config)
        core = Core(config)
    except BaseException:
        if early is not None:
            early.close()
        raise
    if early is not None:
        early.narrow(core.receiver.keys)
        if config.hardware_stamps:
            early.stamp_by_hardware()
        link = early
    else:
        interface, channel = args.interface or config.interface, args.channel or config.channel
        link = open_link(interface, channel, core.receiver.keys, config.hardware_stamps)
    log_line(
        f"{link.name}, axles {', '.join(str(a.number) for a in config.axles)}, design {config.design.name} "
        f"{config.design.checksum[:12]}"
    )
    if args.lock_memory and (reason := lock()):
        log_line(f"memory is not locked: {reason}; set LimitMEMLOCK=infinity (realtime.conf)")
    # On a terminal SIGHUP means that the terminal is gone, to a service that its configuration is to be read again.
    terminal = sys.stdin is not None and sys.stdin.isatty()
    reload = None if terminal else Reload(args.config, config)
    recorder = make_recorder(core, args.channel or config.channel, log_line)
    try:
        Daemon(core, link, Notifier(), reload=reload, recorder=recorder).run()
    finally:
        link.close()
    counts = core.counts
    log_line(
        f"stopped; {counts.accepted} frames accepted, rejected: {counts.rejections}; "
        f"{core.health.overruns} overruns, {counts.late} late frames, {counts.time_steps} steps of time"
    )
    return 0


def _check(args: argparse.Namespace) -> int:
    if args.speed:
        return _speed(args)
    from wrcd.config import load_config
    from wrcd.tools.check import describe

    print("\n".join(describe(load_config(args.config))))
    return 0


def _speed(args: argparse.Namespace) -> int:
    _one_thread()
    from wrcd.config import load_config
    from wrcd.tools.speed import speed

    return speed(load_config(args.config))


def _dump(args: argparse.Namespace) -> int:
    from wrcd.tools.dump import dump

    return dump(args)


def _replay(args: argparse.Namespace) -> int:
    from wrcd.tools.replay import replay
    from wrcd.tools.replays import replays
    from wrcd.tools.selection import Selection

    selection = Selection(args.begin, args.end, args.relative, tuple(args.axle), args.channel)
    if len(args.logs) == 1:
        return replay(args.logs[0], args.config, args.output, args.csv, args.explain, selection=selection)
    return replays(args.logs, args.config, args.output, args.csv, args.explain, args.jobs, selection=selection)


_COMMANDS = {"run": _run, "check": _check, "dump": _dump, "replay": _replay}
