"""`wrcd reload`."""

import argparse

from wrcd.cli.program import Subcommand
from wrcd.errors import Status


def _add(p: argparse.ArgumentParser) -> None:
    p.add_argument("pid", type=int, metavar="PID", help="process id of `wrcd run`; systemd's $MAINPID")
    p.add_argument("-q", "--quiet", action="store_true", help="print nothing: the daemon's log has it")


def _run(args: argparse.Namespace) -> int:
    from wrcd.service.reload_request import Unanswered, ask

    try:
        line = ask(args.pid)
    except Unanswered as e:
        if args.quiet:
            return e.status
        raise
    if not args.quiet:
        print(line)
    return Status.DONE


COMMAND = Subcommand(
    "reload",
    "have a running daemon read its configuration again, and fail if it takes nothing over",
    (
        ("wrcd reload 4711", "the daemon with this process id reads its file again and says what it took over"),
        ("wrcd reload --quiet 4711", "the same for a script: the exit status alone"),
    ),
    _add,
    _run,
)
