"""A computer's files below a folder, to install into."""

import json
import shutil
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

from wrcd import resources
from wrcd.cli import main as cli
from wrcd.cli.installation.lay_out import LOCAL, lay_out
from wrcd.cli.installation.tree import RECORD

PROGRAM = "/opt/wrcd/bin/wrcd"
UNIT = f"{LOCAL.units}/wrcd@.service"
DATA = resources.DATA / "systemd"


class Lab:
    """Paths are from the root on."""

    def __init__(self, root: Path, capsys: pytest.CaptureFixture[str]) -> None:
        root.mkdir()
        self.root, self._capsys = root, capsys

    def _run(self, *words: str) -> tuple[int, str, str]:
        self._capsys.readouterr()
        status = cli.main(list(words))
        said = self._capsys.readouterr()
        return status, said.out, said.err

    def install(self, *words: str, program: str = PROGRAM, data: Path | None = None) -> str:
        """`wrcd install`; returns what it says. data: unit files of another version."""

        def laid_out(*given: Any, **named: Any) -> Any:
            return lay_out(*given, **{**named, "systemd": data})

        with patch("wrcd.cli.install.lay_out", laid_out):
            status, out, err = self._run("install", "--prefix", str(self.root), "--program", program, *words)
        assert status == 0, err
        return out

    def refused(self, *words: str, program: str = PROGRAM, status: int = 2) -> str:
        """`wrcd install` that ends with 2, or on the way with 1; returns its errors."""
        ended, _, err = self._run("install", "--prefix", str(self.root), "--program", program, *words)
        assert ended == status
        assert ("error: not all of it is installed: " in err) is (status == 1)
        return err

    def uninstall(self, *words: str, status: int = 0) -> str:
        """`wrcd uninstall`; returns what it says."""
        ended, out, err = self._run("uninstall", "--prefix", str(self.root), *words)
        assert ended == status, err
        return out + err

    def path(self, name: str) -> Path:
        return self.root / name

    def read(self, name: str) -> str:
        return self.path(name).read_text()

    def write(self, name: str, text: str) -> None:
        self.path(name).parent.mkdir(parents=True, exist_ok=True)
        self.path(name).write_text(text)

    def edit(self, name: str) -> None:
        """An administrator adds a line."""
        self.write(name, self.read(name) + "# edited\n")

    def link(self, name: str, target: str) -> None:
        self.path(name).parent.mkdir(parents=True, exist_ok=True)
        self.path(name).symlink_to(target)

    def older(self, folder: Path) -> Path:
        """Unit files of another version."""
        data = shutil.copytree(DATA, folder / "older")
        for file in (p for p in data.rglob("*") if p.is_file()):
            file.write_text("# of an older version\n" + file.read_text())
        return data

    def manifest(self) -> dict[str, Any]:
        document: dict[str, Any] = json.loads(self.read(RECORD))
        return document

    def files(self) -> list[str]:
        """All files and links."""
        found = (p for p in self.root.rglob("*") if p.is_symlink() or p.is_file())
        return sorted(str(p.relative_to(self.root)) for p in found)

    def folders(self) -> list[str]:
        found = (p for p in self.root.rglob("*") if p.is_dir() and not p.is_symlink())
        return sorted(str(p.relative_to(self.root)) for p in found)

    def snapshot(self) -> dict[str, tuple[int, bytes | str]]:
        """Time and content of every file."""
        return {
            name: (self.path(name).lstat().st_mtime_ns, str(p.readlink()) if p.is_symlink() else p.read_bytes())
            for name in self.files()
            for p in [self.path(name)]
        }

    @staticmethod
    def words(said: str) -> list[str]:
        """The first word of every line on a file."""
        return [line.split()[0] for line in said.splitlines() if line.startswith("  ") and "user" not in line]
