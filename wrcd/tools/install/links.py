"""The links by which systemctl enable starts units with the computer."""

from collections.abc import Collection, Iterable
from pathlib import Path

from wrcd.tools.install.tree import Tree

ENABLED = "etc/systemd/system"
FOLDERS = ("*.wants", "*.requires")


def enabled_links(tree: Tree, targets: Collection[str]) -> list[str]:
    """Paths of the enabled units whose links point to one of these files, or relatively to their names."""
    names = {target.rpartition("/")[2] for target in targets}
    found: list[str] = []
    for pattern in FOLDERS:
        for folder in sorted(f for f in tree.folder(ENABLED).glob(pattern) if f.is_dir()):
            links = (link for link in sorted(folder.iterdir()) if link.is_symlink())
            found += [str(link.relative_to(tree.root)) for link in links if _points_to(link, targets, names)]
    return found


def _points_to(link: Path, targets: Collection[str], names: Iterable[str]) -> bool:
    target = str(link.readlink())
    return target in targets or (not target.startswith("/") and target.rpartition("/")[2] in names)
