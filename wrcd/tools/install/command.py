"""`wrcd install` and `wrcd uninstall` on the command line."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from wrcd.tools.command import Command
from wrcd.tools.install.groups import GROUPS


def _add_both(p: ArgumentParser) -> None:
    p.add_argument(
        "--prefix", type=Path, metavar="DIR",
        help="work on the files below DIR as if it were /; the running system is left alone (default: /, and "
        "systemd is told)",
    )  # fmt: skip
    p.add_argument("--dry-run", action="store_true", help="say what would be done, and change nothing")


def _add_install(p: ArgumentParser) -> None:
    _add_both(p)
    p.add_argument(
        "--with", dest="with_groups", action="append", default=[], choices=GROUPS, metavar="WHAT",
        help="install this too, and with every later version: "
        + "; ".join(f"{name}: {what}" for name, what in GROUPS.items()) + "; may be repeated",
    )  # fmt: skip
    p.add_argument(
        "--without", action="append", default=[], choices=GROUPS, metavar="WHAT", help="remove that again"
    )  # fmt: skip
    p.add_argument("--restart", action="store_true", help="restart the units that run what was there before")
    p.add_argument("--force", action="store_true", help="install though a configuration in /etc/wrcd does not hold")
    p.add_argument(
        "--program", metavar="PATH", help="what units start, e.g. in an image (default: the wrcd that is installing)"
    )


def _add_uninstall(p: ArgumentParser) -> None:
    _add_both(p)
    p.add_argument("--purge", action="store_true", help="remove configurations, dumps and edited files, too")


def _install(args: Namespace) -> int:
    from wrcd.tools.install.run import install

    return install(args)


def _uninstall(args: Namespace) -> int:
    from wrcd.tools.install.removal import uninstall

    return uninstall(args)


INSTALL = Command(
    name="install",
    help="install or upgrade units, sysctl, manual pages and completion of this program; configurations and dumps stay",
    examples=(
        ("wrcd install --dry-run", "say what would change, and whether the configurations in /etc/wrcd still hold"),
        ("wrcd install --with realtime --restart", "install or upgrade with SCHED_FIFO, and restart what runs"),
    ),
    add=_add_install,
    run=_install,
)
UNINSTALL = Command(
    name="uninstall",
    help="stop the units, and remove what `wrcd install` installed; configurations and dumps stay",
    examples=(
        ("wrcd uninstall --dry-run", "say what would be removed"),
        ("wrcd uninstall --purge", "remove it with configurations, dumps and edited files"),
    ),
    add=_add_uninstall,
    run=_uninstall,
)
COMMANDS = (INSTALL, UNINSTALL)
