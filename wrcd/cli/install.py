"""`wrcd install`: look, check the configurations, then change; and say what was changed."""

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path

from wrcd import __version__
from wrcd.cli.installation import system
from wrcd.cli.installation.lay_out import CONFIGURATIONS, DEBIAN, GROUPS, LOCAL, lay_out
from wrcd.cli.installation.plan import InstallationPlan, apply, describe, make_plan
from wrcd.cli.installation.tree import Manifest, Tree, read_manifest
from wrcd.cli.installation.upgraded import check_configurations
from wrcd.cli.program import Subcommand
from wrcd.errors import InputError, Status


def add_prefix(p: ArgumentParser) -> None:
    """--prefix and --dry-run, which uninstall has, too."""
    p.add_argument(
        "--prefix", type=Path, metavar="DIR",
        help="work on the files below DIR as if it were /; the running system is left alone (default: /, and "
        "systemd is told)",
    )  # fmt: skip
    p.add_argument("--dry-run", action="store_true", help="say what would be done, and change nothing")


def tree_of(args: Namespace) -> tuple[Tree, bool]:
    """Return the files to work on, and whether they are the running system's. Raises InputError where they may not be
    changed, or where no unit could be started."""
    live, tree = args.prefix is None, Tree(args.prefix or Path("/"))
    tree.require_place()
    if live:
        system.require_systemd()
        if not args.dry_run:
            system.require_root()
    return tree, live


def _add(p: ArgumentParser) -> None:
    add_prefix(p)
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


def _run(args: Namespace) -> int:
    """Install, upgrade, or mend what is installed."""
    tree, live = tree_of(args)
    _check_not_packaged(tree)
    started = system.stated_program(args.program) if args.program else system.own_program()
    old = read_manifest(tree)
    groups = _groups(old, args.with_groups, args.without)
    if "rig" in groups and not args.program:
        system.require_rig()
    plan = make_plan(tree, lay_out(LOCAL, started, groups), old)
    now = Manifest(__version__, str(started), groups)
    same = old is not None and (old.version, old.program) == (now.version, now.program)

    if args.dry_run:
        print("dry run: nothing is changed")
    print(_headline(old, now))
    _check(tree, args.force)
    print("\n".join(describe(plan)))
    if args.dry_run:
        return Status.DONE
    try:
        if old is None or plan.changes or not same or old.groups != groups:
            if live and plan.stop and (stopped := system.stop(plan.stop)):
                print(f"stopped: {', '.join(stopped)}")
            unaffected = old is not None and same and not plan.touches(LOCAL.units)
            now.boot, now.changed_us = (old.boot, old.changed_us) if old and unaffected else _moment(live)
            now.folders = tree.make_folders(f"{CONFIGURATIONS}/any")
            apply(tree, plan, now, old)
        else:
            now = old
        return _tell(plan, now, args.restart) if live else Status.DONE
    except InputError as e:
        print(f"wrcd: error: not all of it is installed: {e}; mend it and install again", file=sys.stderr)
        return Status.STOPPED


def _tell(plan: InstallationPlan, now: Manifest, restart: bool) -> int:
    """Have the running system take the files over, and say what it does not by itself."""
    system.forget()
    system.apply_sysctl()
    if plan.touches(LOCAL.network):
        print("systemd-networkd reads its files at: networkctl reload")
    return _units(now, restart)


def _moment(live: bool) -> tuple[str, int]:
    """When the running units' program changed; of a copy, which the running system knows nothing of, none."""
    return system.now() if live else ("", 0)


def _check_not_packaged(tree: Tree) -> None:
    for name in (f"{DEBIAN.units}/wrcd@.service", "lib/systemd/system/wrcd@.service"):
        if tree.path(name).exists():
            raise InputError(
                "the Debian package wrcd is installed, and brings its own units", file=tree.path(name),
                hint="upgrade it with dpkg -i or apt; or apt remove wrcd first",
            )  # fmt: skip


def _groups(old: Manifest | None, added: Sequence[str], dropped: Sequence[str]) -> list[str]:
    """What is laid out beyond what everybody gets: as before, and as asked for now."""
    before = set(old.groups) if old else set()
    if both := set(added) & set(dropped):
        raise InputError(f"{min(both)} is asked for and not", key="--without")
    return sorted(((before | set(added)) - set(dropped)) & set(GROUPS))


def _headline(old: Manifest | None, now: Manifest) -> str:
    """From which version to which, and which program units start."""
    if old is None:
        what = f"wrcd {now.version}"
    elif old.version == now.version:
        what = f"wrcd {now.version} is installed"
    else:
        what = f"wrcd {old.version} -> {now.version}"
    optional = f"; with {', '.join(now.groups)}" if now.groups else ""
    return f"{what}; units start {now.program}{optional}"


def _check(tree: Tree, force: bool) -> None:
    """Say which configurations hold with this version. Raises InputError if one does not: nothing is changed yet."""
    checked = check_configurations(tree.root)
    for c in checked:
        used = f" ({', '.join(c.units)})" if c.units else ""
        if not c.mistakes:
            print(f"  holds      {c.file}{used}")
        for mistake in c.mistakes:
            print(f"wrcd: {mistake}{used}", file=sys.stderr)
    wrong = [str(c.file) for c in checked if c.mistakes]
    if wrong and not force:
        raise InputError(
            f"does not hold with wrcd {__version__}: {', '.join(wrong)}; nothing was changed",
            hint="mend it and install again; or --force",
        )


def _units(now: Manifest, restart: bool) -> int:
    """Say which units still run what was there before, or restart them."""
    boot, _ = system.now()
    if boot != now.boot:
        return Status.DONE
    late = [r.unit for r in system.running() if r.started_us < now.changed_us]
    if not late:
        return Status.DONE
    if not restart:
        print(system.restart_advice(late))
        return Status.DONE
    try:
        system.systemctl("restart", *late)
    except InputError as e:
        print(f"wrcd: installed, but {e}", file=sys.stderr)
        return Status.STOPPED
    print(f"restarted: {', '.join(late)}")
    return Status.DONE


COMMAND = Subcommand(
    name="install",
    help="install or upgrade units, sysctl, manual pages and completion of this program; configurations and dumps stay",
    examples=(
        ("wrcd install --dry-run", "say what would change, and whether the configurations in /etc/wrcd still hold"),
        ("wrcd install --with realtime --restart", "install or upgrade with SCHED_FIFO, and restart what runs"),
    ),
    add=_add,
    run=_run,
)
