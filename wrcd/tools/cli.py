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

from wrcd.errors import InputError, NotThere, Status
from wrcd.tools.install.command import COMMANDS as INSTALLING
from wrcd.tools.version import Version

if TYPE_CHECKING:
    from wrcd.bus.link import Link


MAX_WAIT_S = 3600.0


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point. Returns the exit status: see Status."""
    args = _parser().parse_args(argv)
    _one_thread()
    # nothing tries a replay again: there NOT_THERE has another meaning
    return guarded("wrcd", lambda: _COMMANDS[args.command](args), retried=args.command != "replay")


def guarded(name: str, command: Callable[[], int], *, retried: bool = True) -> int:
    """Run a command: an InputError is one line and its exit status, Ctrl-C exit 130, a closed pipe no error.

    retried: whether a bus or a file that is not there has a status of its own.
    """
    try:
        status = command()
        sys.stdout.flush()
        return status
    except InputError as e:
        print(f"{name}: error: {e}", file=sys.stderr)
        return e.status if retried or e.status != Status.NOT_THERE else Status.BAD_INPUT
    except KeyboardInterrupt:
        return Status.INTERRUPTED
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
    p.add_argument("--version", action=Version, help="print versions of package, design and formats, and end")
    commands = p.add_subparsers(dest="command", required=True, metavar="COMMAND")
    config = argparse.ArgumentParser(add_help=False)
    config.add_argument(
        "--config", type=Path, metavar="FILE", help="configuration (TOML); default: the packaged DBC, four axles"
    )

    run = commands.add_parser("run", parents=[config], help="estimate on a bus until SIGTERM")
    add_bus(run)
    run.add_argument(
        "--wait", type=float, default=0.0, metavar="S",
        help="wait up to so many seconds for a bus or a file that is not there yet (default: 0)",
    )  # fmt: skip
    run.add_argument("--lock-memory", action="store_true", help="keep all memory in RAM (needs LimitMEMLOCK=infinity)")

    reload = commands.add_parser(
        "reload", help="have a running daemon read its configuration again, and fail if it takes nothing over"
    )
    reload.add_argument("pid", type=int, metavar="PID", help="process id of `wrcd run`; systemd's $MAINPID")
    reload.add_argument("-q", "--quiet", action="store_true", help="print nothing: the daemon's log has it")

    check = commands.add_parser(
        "check", parents=[config], help="say what a configuration would run, or what a log or a bus gives it"
    )
    check.add_argument(
        "--speed", action="store_true", help="measure what the core costs on this computer: ten seconds, no bus"
    )
    check.add_argument(
        "--log", type=Path, metavar="LOG",
        help="what a log says of each mapped signal, and what would stop Valid: exit 1 if anything, 3 if no frame fits",
    )  # fmt: skip
    check.add_argument("--live", type=float, metavar="S", help="the same of a bus, listened to for so many seconds")
    add_bus(check)

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
        help="write one row per Adhesion frame (default, without -o and --events: to the screen); of several logs a "
        "folder of them",
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
        "--events", type=Path, metavar="OUT.csv",
        help="write one row per change of an axle's Validity, with its cause, input and figures (-: to the screen); of "
        "several logs a folder of them",
    )  # fmt: skip
    replay.add_argument(
        "--explain", action="store_true", help="rows also name the winning model and the dominant rule of the moment"
    )
    replay.add_argument(
        "--jobs", type=int, default=1, metavar="N", help="of several logs, so many at once (default: 1)"
    )
    _add_dbc_commands(commands)
    for c in INSTALLING:
        c.add(commands.add_parser(c.name, help=c.help))
    return p


def _seconds(text: str) -> float:
    """A finite number, for argparse."""
    seconds = float(text)
    if not math.isfinite(seconds):
        raise ValueError
    return seconds


def _add_dbc_commands(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """`wrcd init` and `wrcd lint`: what a DBC needs before there is a configuration."""
    init = commands.add_parser("init", help="propose a configuration for a train's DBC, with what a person must settle")
    init.add_argument("dbc", type=Path, metavar="DBC")
    init.add_argument("-o", "--output", type=Path, metavar="MY.toml", help="write it there (default: to the screen)")
    init.add_argument("--force", action="store_true", help="overwrite a file that is there")
    lint = commands.add_parser("lint", help="what a DBC says that loading lets pass and that costs frames or values")
    lint.add_argument("dbc", type=Path, metavar="DBC")
    lint.add_argument("--json", action="store_true", help="for a program: a record for each finding")


def _one_thread() -> None:
    """Keep the arithmetic to one thread: the bank's products are a few hundred numbers. Call before numpy's import."""
    for library in ("OPENBLAS", "OMP", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")


def _run(args: argparse.Namespace) -> int:
    faulthandler.enable(sys.__stderr__ or 2)  # when the watchdog aborts a daemon that hangs, the log says where
    # Started on SocketCAN by name, the bus is opened before the slow imports, and the kernel keeps what it
    # carries meanwhile: after a crash the window is full as soon as the program is there.
    early = None
    if not 0.0 <= args.wait <= MAX_WAIT_S:
        raise InputError(f"takes seconds from 0 to {MAX_WAIT_S:g}, not {args.wait:g}", key="--wait")
    if args.interface == "socketcan" and args.channel:
        from wrcd.bus.socketcan import SocketCanLink

        try:
            early = SocketCanLink(args.channel, None)
        except NotThere:
            if not args.wait:
                raise
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
        from wrcd.service.waiting import Waiting

        # no garbage among what the imports made: the collector need not look through it while the DBC is parsed
        gc.freeze()
        waiting = Waiting(args.wait)
        config = waiting.until(lambda: load_config_to_run(args.config))
        core = Core(config)
    except BaseException:
        if early is not None:
            early.close()
        raise
    if early is not None:
        early.narrow(core.receiver.keys, core.receiver.fd)
        if config.hardware_stamps:
            early.stamp_by_hardware()
        link = early
    else:
        interface, channel = args.interface or config.interface, args.channel or config.channel
        receiver, stamps = core.receiver, config.hardware_stamps
        link = waiting.until(lambda: open_link(interface, channel, receiver.keys, stamps, receiver.fd))
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


def _reload(args: argparse.Namespace) -> int:
    from wrcd.service.asking import Unanswered, ask

    try:
        line = ask(args.pid)
    except Unanswered as e:
        if args.quiet:
            return e.status
        raise
    if not args.quiet:
        print(line)
    return Status.DONE


def _check(args: argparse.Namespace) -> int:
    if args.speed:
        return _speed(args)
    if args.log is not None or args.live is not None:
        return _check_bus(args)
    from wrcd.config import load_config
    from wrcd.tools.check import describe

    print("\n".join(describe(load_config(args.config))))
    return 0


def _check_bus(args: argparse.Namespace) -> int:
    from wrcd.tools.bus_check.run import check_live, check_log

    if args.log is not None and args.live is not None:
        raise InputError("a log or a bus, not both", key="--live", hint="leave out --log or --live")
    if args.log is not None:
        return check_log(args.log, args.config, args.channel)
    return check_live(args.live, args.config, args.interface, args.channel)


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
        return replay(args.logs[0], args.config, args.output, args.csv, args.explain, args.events, selection=selection)
    return replays(
        args.logs, args.config, args.output, args.csv, args.explain, args.jobs, args.events, selection=selection
    )


def _init(args: argparse.Namespace) -> int:
    from wrcd.tools.init import init

    return init(args.dbc, args.output, args.force)


def _lint(args: argparse.Namespace) -> int:
    from wrcd.tools.lint.run import lint

    return lint(args.dbc, args.json)


_COMMANDS = {
    "run": _run, "reload": _reload, "init": _init, "lint": _lint, "check": _check, "dump": _dump, "replay": _replay,
    **{c.name: c.run for c in INSTALLING},
}  # fmt: skip
