"""`wrcd uninstall`: remove what was installed, and nothing else."""

import glob
import shutil
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Iterable
from pathlib import Path, PurePosixPath

from wrcd.cli.install import add_prefix, tree_of
from wrcd.cli.installation import system
from wrcd.cli.installation.lay_out import BUILT_FOR, CONFIGURATIONS, DEBIAN, GROUPS, LOCAL, lay_out
from wrcd.cli.installation.plan import SAVED, line, saved
from wrcd.cli.installation.tree import NO_FILE, RECORD, Manifest, Tree, enabled_links, read_manifest
from wrcd.cli.program import Subcommand
from wrcd.errors import InputError, Status

# StateDirectory= and CacheDirectory= of the units: DynamicUser= puts the folders below private, and links to them
STATE = ("var/lib/wrcd", "var/lib/private/wrcd")
CACHE = ("var/cache/sim-ecu", "var/cache/private/sim-ecu")


def _add(p: ArgumentParser) -> None:
    add_prefix(p)
    p.add_argument("--purge", action="store_true", help="remove configurations, dumps and edited files, too")


def _run(args: Namespace) -> int:
    """Stop our units, remove our files and the folders made for them. With --purge configurations and dumps, too."""
    tree, live = tree_of(args)
    record = read_manifest(tree)
    if record is None:
        packaged = tree.path(f"{DEBIAN.units}/wrcd@.service").exists()
        kept = _kept(tree) if args.purge and not packaged else []
        raise InputError(
            "nothing was installed by `wrcd install`", file=tree.path(RECORD),
            hint=f"what an earlier uninstall has kept is removed by: rm -r {' '.join(kept)}" if kept else
            "a Debian package: apt remove wrcd",
        )  # fmt: skip
    try:
        _remove_all(tree, record, live, args)
    except InputError as e:
        if args.dry_run:
            raise
        print(f"wrcd: error: not all of it is removed: {e}; mend it and uninstall again", file=sys.stderr)
        return Status.STOPPED
    print(f"the program itself is left: {_place(tree, record.program)}")
    return Status.DONE


def _place(tree: Tree, program: str) -> PurePosixPath:
    """The virtual environment of a program, or the program itself if it lies in none."""
    path = PurePosixPath(program)
    home = path.parent.parent
    return home if tree.path(str(home / "pyvenv.cfg").lstrip("/")).exists() else path


def _remove_all(tree: Tree, record: Manifest, live: bool, args: Namespace) -> None:
    if args.dry_run:
        print("dry run: nothing is changed")
    elif live and (stopped := system.stop()):
        print(f"stopped: {', '.join(stopped)}")
    emptied = _disable(tree, record, args.dry_run)
    _remove_files(tree, record, args.dry_run, args.purge)
    _state(tree, args.dry_run, args.purge)
    if not args.dry_run:
        if live:
            system.forget()
        tree.remove(RECORD)  # last: by it the next one completes what failed
        tree.remove_empty(emptied)
        for folder in tree.remove_empty(record.folders):
            if folder != CONFIGURATIONS:
                print(line("left", folder, "has files in it"))


def _disable(tree: Tree, record: Manifest, dry_run: bool) -> list[str]:
    """Remove the links by which units were enabled. Return their folders: as systemctl does, no empty one is left."""
    links = enabled_links(tree, {f"/{path}" for path in record.files if path.startswith(LOCAL.units)})
    for path in links:
        print(line("disabled", path))
        if not dry_run:
            tree.remove(path)
    return sorted({path.rpartition("/")[0] for path in links})


def _remove_files(tree: Tree, record: Manifest, dry_run: bool, purge: bool) -> None:
    """Remove files that are as they were installed."""
    removed = 0
    for path in sorted((*record.files, *record.beside)):
        there = tree.checksum(path)
        if there is None:
            continue
        if record.owns(path, there) or (purge and there != NO_FILE):
            removed += 1
            if not dry_run:
                tree.remove(path)
        else:
            to = saved(tree, path)
            print(line("saved", path, f"edited here: renamed to {to.rpartition('/')[2]}"))
            if not dry_run:
                tree.rename(path, to)
    print(f"  removed    {removed} files of wrcd {record.version}")
    for path in _saved_before(tree, record.files) if purge else ():
        print(line("purged", path))
        if not dry_run:
            tree.remove(path)


def _saved_before(tree: Tree, known: Iterable[str]) -> list[str]:
    """Edited files that were renamed, of these paths and of all that can be installed."""
    paths = {*known, *lay_out(LOCAL, PurePosixPath(BUILT_FOR) / "wrcd", GROUPS)}
    found: list[str] = []
    for path in sorted(paths):
        folder, _, name = path.rpartition("/")
        there = sorted(p.name for p in tree.folder(folder).glob(f"{glob.escape(name)}{SAVED}*") if not p.is_dir())
        found += [f"{folder}/{n}" for n in there]
    return found


def _kept(tree: Tree) -> list[str]:
    """What is there of configurations, dumps and edited files."""
    folders = [name for name in (CONFIGURATIONS, *STATE) if _is_there(tree, name)]
    return [str(tree.path(name)) for name in (*folders, *_saved_before(tree, ()))]


def _is_there(tree: Tree, name: str) -> bool:
    return tree.path(name).is_dir() or tree.path(name).is_symlink()


def _state(tree: Tree, dry_run: bool, purge: bool) -> None:
    """Remove configurations and dumps if asked to; else folders of dumps only where there are none. A cache goes."""
    for names in ((CONFIGURATIONS,), STATE, CACHE):
        there = [name for name in names if _is_there(tree, name)]
        filled = any(_has_files(tree.path(name)) for name in there)
        if filled and not purge and names is not CACHE:
            for name in there:
                print(line("kept", name, "yours"))
        elif purge or names[0] != CONFIGURATIONS:
            for name in there:
                if filled:
                    print(line("purged", name))
                if not dry_run:
                    _remove(tree.path(name))


def _remove(folder: Path) -> None:
    try:
        if folder.is_symlink():
            folder.unlink()
        else:
            shutil.rmtree(folder)
    except OSError as e:
        raise InputError(f"cannot be removed: {e.strerror}", file=folder) from None


def _has_files(folder: Path) -> bool:
    """Whether there is more in a folder than folders, and links to folders."""
    return any(not p.is_dir() for p in folder.rglob("*"))


COMMAND = Subcommand(
    name="uninstall",
    help="stop the units, and remove what `wrcd install` installed; configurations and dumps stay",
    examples=(
        ("wrcd uninstall --dry-run", "say what would be removed"),
        ("wrcd uninstall --purge", "remove it with configurations, dumps and edited files"),
    ),
    add=_add,
    run=_run,
)
