"""`wrcd install`: look, check the configurations, then change; and say what was changed."""

import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path

from wrcd import __version__
from wrcd.errors import InputError, Status
from wrcd.tools.install import configurations, manifest, previous, program, system
from wrcd.tools.install.files import CONFIGURATIONS, DEBIAN, LOCAL, lay_out
from wrcd.tools.install.groups import GROUPS
from wrcd.tools.install.manifest import Manifest
from wrcd.tools.install.plan import Plan, apply, make_plan
from wrcd.tools.install.said import describe
from wrcd.tools.install.tree import Tree


def install(args: Namespace) -> int:
    """Install, upgrade, or mend what is installed."""
    live = args.prefix is None
    tree = Tree(args.prefix or Path("/"))
    _may_change(tree, live, args.dry_run)
    started = program.stated(args.program) if args.program else program.own()
    old = manifest.read(tree)
    groups = _groups(tree, old, args.with_groups, args.without)
    if "rig" in groups and not args.program:
        program.require_rig()
    plan = make_plan(tree, lay_out(LOCAL, started, groups), old)
    now = Manifest(__version__, str(started), groups)
    same = old is not None and (old.version, old.program) == (now.version, now.program)

    if args.dry_run:
        print("dry run: nothing is changed")
    print(_headline(tree, old, now))
    _check_configurations(tree, args.force)
    print("\n".join(describe(plan)))
    if args.dry_run:
        return Status.DONE
    try:
        if old is None or plan.changes or not same or old.groups != groups:
            if live and plan.stop and (stopped := system.stop(plan.stop)):
                print(f"stopped: {', '.join(stopped)}")
            unaffected = old is not None and same and not plan.touches(LOCAL.units, previous.UNITS)
            now.boot, now.changed_us = (old.boot, old.changed_us) if old and unaffected else _moment(live)
            now.folders = tree.make_folders(f"{CONFIGURATIONS}/any")
            apply(tree, plan, now, old)
        else:
            now = old
        return _tell(plan, now, args.restart) if live else Status.DONE
    except InputError as e:
        print(f"wrcd: error: not all of it is installed: {e}; mend it and install again", file=sys.stderr)
        return Status.STOPPED


def _tell(plan: Plan, now: Manifest, restart: bool) -> int:
    """Have the running system take the files over, and say what it does not by itself."""
    system.forget()
    system.apply_sysctl()
    if plan.touches(LOCAL.network):
        print("systemd-networkd reads its files at: networkctl reload")
    return _units(now, restart)


def _moment(live: bool) -> tuple[str, int]:
    """When the running units' program changed; of a copy, which the running system knows nothing of, none."""
    return system.now() if live else ("", 0)


def _may_change(tree: Tree, live: bool, dry_run: bool) -> None:
    """Raise InputError where an installation could do harm, or could do nothing."""
    tree.require_place()
    if live:
        system.require_systemd()
        if not dry_run:
            system.require_root()
    for name in (f"{DEBIAN.units}/wrcd@.service", "lib/systemd/system/wrcd@.service"):
        if tree.path(name).exists():
            raise InputError(
                "the Debian package wrcd is installed, and brings its own units", file=tree.path(name),
                hint="upgrade it with dpkg -i or apt; or apt remove wrcd first",
            )  # fmt: skip


def _groups(tree: Tree, old: Manifest | None, added: Sequence[str], dropped: Sequence[str]) -> list[str]:
    """What is laid out beyond what everybody gets: as before, and as asked for now."""
    before = set(old.groups) if old else set()
    if old is None:
        for path, group in previous.GROUP_OF.items():
            there = tree.checksum(path)
            if there is not None and previous.is_unmodified(path, there):
                before.add(group)
    if both := set(added) & set(dropped):
        raise InputError(f"{min(both)} is asked for and not", key="--without")
    return sorted(((before | set(added)) - set(dropped)) & set(GROUPS))


def _headline(tree: Tree, old: Manifest | None, now: Manifest) -> str:
    """From which version to which, and which program units start."""
    if old is not None:
        before = old.version
    else:
        by_hand = any(tree.checksum(path) is not None for path in previous.BY_HAND)
        before = "0.1.0, laid out by hand" if by_hand else ""
    if before == now.version:
        what = f"wrcd {now.version} is installed"
    else:
        what = f"wrcd {before} -> {now.version}" if before else f"wrcd {now.version}"
    optional = f"; with {', '.join(now.groups)}" if now.groups else ""
    return f"{what}; units start {now.program}{optional}"


def _check_configurations(tree: Tree, force: bool) -> None:
    """Say which configurations hold with this version. Raises InputError if one does not: nothing is changed yet."""
    checked = configurations.check(tree.root)
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
