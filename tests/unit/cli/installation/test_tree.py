"""Links in a copy below --prefix: none leads out of it."""

import os
from pathlib import Path

import pytest

from tests.unit.cli.installation.lab import UNIT, Lab
from wrcd.cli import main as cli
from wrcd.cli.installation.tree import RECORD, Tree

DUMP = "wrcd/can0/2026.log"


@pytest.fixture
def outside(tmp_path: Path) -> Path:
    """A folder of the computer that the copy is made on."""
    (tmp_path / "outside/wrcd/can0").mkdir(parents=True)
    (tmp_path / "outside" / DUMP).write_text("a dump")
    return tmp_path / "outside"


@pytest.mark.parametrize("climbs", [False, True])
def test_link_of_an_image_is_followed_inside_it(lab: Lab, outside: Path, climbs: bool) -> None:
    inside = lab.path("outside" if climbs else str(outside).lstrip("/"))
    inside.mkdir(parents=True)
    lab.link("usr/local", "../../../../../outside" if climbs else str(outside))
    lab.install()
    assert [str(p.relative_to(outside)) for p in outside.rglob("*") if p.is_file()] == [DUMP]
    assert (inside / RECORD.removeprefix("usr/local/")).exists()
    lab.uninstall()
    assert lab.files() == ["usr/local"]


def test_link_to_what_an_image_lacks_is_refused(lab: Lab, outside: Path) -> None:
    lab.link("usr/local", str(outside))
    lab.refused(status=1)
    assert [str(p.relative_to(outside)) for p in outside.rglob("*") if p.is_file()] == [DUMP]


@pytest.mark.parametrize("name", ["var/lib", "var"])
def test_purge_does_not_follow_a_link_out_of_the_image(lab: Lab, outside: Path, name: str) -> None:
    lab.install()
    (outside / "lib/wrcd").mkdir(parents=True)
    (outside / "lib/wrcd/other.log").write_text("a dump")
    lab.link(name, str(outside))
    lab.uninstall("--purge")
    assert (outside / DUMP).exists()
    assert (outside / "lib/wrcd/other.log").exists()


def test_links_in_a_circle_are_refused(lab: Lab) -> None:
    lab.link("usr", "usr")
    assert "too many symbolic links" in lab.refused()


def test_path_of_this_computer_is_the_kernels(tmp_path: Path) -> None:
    (tmp_path / "a/b").mkdir(parents=True)
    (tmp_path / "c").symlink_to("a/b/../b")
    (tmp_path / "d").symlink_to(tmp_path / "c")
    (tmp_path / "a/b/file").symlink_to("nowhere")
    name = str(tmp_path / "d/file").lstrip("/")
    assert Tree(Path("/")).path(name) == Path(os.path.realpath(tmp_path / "d")) / "file"


@pytest.mark.parametrize("command", ["install", "uninstall"])
def test_prefix_below_what_is_no_folder_is_refused(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    program = ["--program", "/opt/wrcd/bin/wrcd"] if command == "install" else []
    assert cli.main([command, "--prefix", "/dev/null/x", *program]) == 2
    assert "wrcd: error: /dev/null: --prefix: is no folder" in capsys.readouterr().err


def test_file_where_a_folder_is_needed_ends_with_1_and_the_next_installation_completes_it(lab: Lab) -> None:
    lab.write("usr/local/share", "")
    assert f"{lab.path('usr/local/share')}" in lab.refused(status=1)
    lab.path("usr/local/share").unlink()
    lab.install()
    assert lab.path(UNIT).exists()
    lab.uninstall()
    assert lab.files() == []
