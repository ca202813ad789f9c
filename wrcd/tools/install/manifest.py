"""What was installed: the record by which an upgrade and `wrcd uninstall` tell their own files from others."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from wrcd.errors import InputError
from wrcd.tools.install.files import Laid
from wrcd.tools.install.tree import Tree

PATH = "usr/local/lib/wrcd/installed.json"
FORMAT = "wrcd-installed/1"


@dataclass(slots=True)
class Manifest:
    """Paths are from the root on. A file has several checksums while an installation goes on: any of them is ours."""

    version: str
    program: str
    groups: list[str]
    files: dict[str, list[str]] = field(default_factory=dict)
    beside: dict[str, list[str]] = field(default_factory=dict)  # new files that wait beside edited ones
    folders: list[str] = field(default_factory=list)  # that were made
    boot: str = ""  # the kernel's id of the start during which something last changed ...
    changed_us: int = 0  # ... and CLOCK_MONOTONIC then

    def owns(self, path: str, checksum: str | None) -> bool:
        """Whether a file is as it was installed."""
        return checksum in self.files.get(path, ()) or checksum in self.beside.get(path, ())


def read(tree: Tree) -> Manifest | None:
    """Return the record, or None if nothing was installed. Raises InputError for one that cannot be used."""
    path = tree.path(PATH)
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        return None
    except (OSError, ValueError) as e:
        raise InputError(f"cannot be read: {e}", file=path, hint=_hint(path)) from None
    return _manifest(document, path)


def write(tree: Tree, manifest: Manifest) -> None:
    """Write the record, and note the folders made for it in it."""
    manifest.folders = sorted({*manifest.folders, *tree.make_folders(PATH)})
    document = {"format": FORMAT} | {name: getattr(manifest, name) for name in manifest.__slots__}
    tree.write(PATH, Laid((json.dumps(document, indent=1, sort_keys=True) + "\n").encode()))


def _manifest(document: Any, path: Path) -> Manifest:
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise InputError(f"is not in the format {FORMAT}", file=path, hint=_hint(path))
    try:
        manifest = Manifest(**{name: value for name, value in document.items() if name != "format"})
        paths = [*manifest.files, *manifest.beside, *manifest.folders]
    except TypeError as e:
        raise InputError(f"has other keys: {e}", file=path, hint=_hint(path)) from None
    if wrong := [p for p in paths if p.startswith("/") or ".." in p.split("/")]:
        raise InputError(f"names a path that is none below the root: {wrong[0]}", file=path, hint=_hint(path))
    return manifest


def _hint(path: Path) -> str:
    return f"a newer version may have written it: use that one; or move {path.name} away and install again"
