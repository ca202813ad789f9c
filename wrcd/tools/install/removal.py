"""`wrcd uninstall`: remove what was installed, and nothing else."""

import shutil
from argparse import Namespace
from pathlib import Path

from wrcd.errors import InputError, Status
from wrcd.tools.install import manifest, system
from wrcd.tools.install.files import CONFIGURATIONS, LOCAL
from wrcd.tools.install.links import enabled_links
from wrcd.tools.install.manifest import Manifest
from wrcd.tools.install.plan import SAVED
from wrcd.tools.install.said import line
from wrcd.tools.install.tree import Tree

# StateDirectory= and CacheDirectory= of the units: DynamicUser= puts the folders below private, and links to them
STATE = ("var/lib/wrcd", "var/lib/private/wrcd")
CACHE = ("var/cache/sim-ecu", "var/cache/private/sim-ecu")


def uninstall(args: Namespace) -> int:
    """Stop our units, remove our files and the folders made for them. With --purge configurations and dumps, too."""
    live = args.prefix is None
    tree = Tree(args.prefix or Path("/"))
    if live:
        system.require_systemd()
        if not args.dry_run:
            system.require_root()
    record = manifest.read(tree)
    if record is None:
        raise InputError(
            "nothing was installed by `wrcd install`", file=tree.path(manifest.PATH),
            hint="a Debian package: apt remove wrcd; copies of 0.1.0 made by hand: `wrcd install` takes them over",
        )  # fmt: skip
    if args.dry_run:
        print("dry run: nothing is changed")
    elif live and (stopped := system.stop_all()):
        print(f"stopped: {', '.join(stopped)}")
    emptied = _disable(tree, record, args.dry_run)
    _remove_files(tree, record, args.dry_run, args.purge)
    _state(tree, args.dry_run, args.purge)
    if not args.dry_run:
        tree.remove(manifest.PATH)
        tree.remove_empty(emptied)
        for folder in tree.remove_empty(record.folders):
            if folder != CONFIGURATIONS:
                print(line("left", folder, "has files in it"))
        if live:
            system.forget()
    print(f"the program itself is left: {Path(record.program).parents[1]}")
    return Status.DONE


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
        if record.owns(path, there) or purge:
            removed += 1
            if not dry_run:
                tree.remove(path)
        else:
            print(line("saved", path, f"edited here: renamed to {path.rpartition('/')[2]}{SAVED}"))
            if not dry_run:
                tree.rename(path, path + SAVED)
    print(f"  removed    {removed} files of wrcd {record.version}")


def _state(tree: Tree, dry_run: bool, purge: bool) -> None:
    """Remove configurations and dumps if asked to; else folders of dumps only where there are none. A cache goes."""
    for names in ((CONFIGURATIONS,), STATE, CACHE):
        there = [name for name in names if tree.path(name).is_dir() or tree.path(name).is_symlink()]
        filled = any(_has_files(tree.path(name)) for name in there)
        if filled and not purge and names is not CACHE:
            for name in there:
                print(line("kept", name, "yours; --purge removes it"))
        elif purge or names[0] != CONFIGURATIONS:
            for name in there:
                if filled:
                    print(line("purged", name))
                if not dry_run:
                    _remove(tree.path(name))


def _remove(folder: Path) -> None:
    if folder.is_symlink():
        folder.unlink()
    else:
        shutil.rmtree(folder)


def _has_files(folder: Path) -> bool:
    """Whether there is more in a folder than folders, and links to folders."""
    return any(not p.is_dir() for p in folder.rglob("*"))
