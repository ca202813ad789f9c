"""`wrcd run`: the daemon."""

import argparse
import faulthandler
import gc
import sys
from typing import TYPE_CHECKING

from wrcd.cli.arguments import add_bus_of_the_daemon, add_config
from wrcd.cli.program import Subcommand
from wrcd.errors import InputError, NotThere

if TYPE_CHECKING:
    from wrcd.bus.link import Link

MAX_WAIT_S = 3600.0


def _add(p: argparse.ArgumentParser) -> None:
    add_config(p)
    add_bus_of_the_daemon(p)
    p.add_argument(
        "--wait", type=float, default=0.0, metavar="S",
        help="wait up to so many seconds for a bus or a file that is not there yet (default: 0)",
    )  # fmt: skip
    p.add_argument("--lock-memory", action="store_true", help="keep all memory in RAM (needs LimitMEMLOCK=infinity)")


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
        from wrcd.config.config import load_config_to_run
        from wrcd.core.core import Core
        from wrcd.recorder.kept import make_kept
        from wrcd.recorder.recorder import make_recorder
        from wrcd.service.journal import log_line
        from wrcd.service.loop import Daemon
        from wrcd.service.notify import Notifier, lock
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
        early.narrow(core.mapped.keys, core.mapped.fd)
        if config.hardware_stamps:
            early.stamp_by_hardware()
        link = early
    else:
        interface, channel = args.interface or config.interface, args.channel or config.channel
        mapped, stamps = core.mapped, config.hardware_stamps
        link = waiting.until(lambda: open_link(interface, channel, mapped.keys, stamps, mapped.fd))
    log_line(
        f"{link.name}, axles {', '.join(str(a.number) for a in config.axles)}, design {config.design.name} "
        f"{config.design.checksum[:12]}"
    )
    for warning in config.warnings:
        log_line(f"warning: {warning}")
    if args.lock_memory and (reason := lock()):
        log_line(f"memory is not locked: {reason}; set LimitMEMLOCK=infinity (realtime.conf)")
    channel = args.channel or config.channel
    kept = make_kept(core, channel, log_line)  # before the recorder, which has what it begins with
    recorder = make_recorder(core, channel, log_line)
    try:
        Daemon(core, link, Notifier(), recorder=recorder, kept=kept).run()
    finally:
        link.close()
    counts = core.counts
    log_line(
        f"stopped; {counts.accepted} frames accepted, rejected: {counts.rejections}; clipped: {counts.clippings}; "
        f"{core.health.overruns} overruns, {counts.late} late frames, {counts.time_steps} steps of time"
    )
    return 0


COMMAND = Subcommand(
    "run",
    "estimate on a bus until SIGTERM",
    (
        ("wrcd run -i socketcan -c vcan0", "estimate on vcan0 with the packaged DBC; Ctrl-C ends it"),
        ("wrcd run --config /etc/wrcd/can0.toml --wait 20", "as the unit does: wait up to 20 s for the interface"),
    ),
    _add,
    _run,
    own_signals=lambda _: True,
)
