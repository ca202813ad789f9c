"""Links in a copy below --prefix: none leads out of it."""

import os
from pathlib import Path

import pytest

from tests.unit.tools.install.lab import MANIFEST, UNIT, Lab
from wrcd.tools import cli
from wrcd.tools.install.tree import Tree

DUMP = "wrcd/can0/2026.log"


@pytest.fixture
def lab(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Lab:
    return Lab(tmp_path / "root", capsys)


@pytest.fixture
def outside(tmp_path: Path) -> Path:
    """A folder of the computer that the copy is made on."""
    (tmp_path / "outside/wrcd/can0").mkdir(parents=True)
    (tmp_path / "outside" / DUMP).write_text("a dump")
    return tmp_path / "outside"


def test_absolute_link_of_an_image_is_followed_inside_it(lab: Lab, outside: Path) -> None:
    lab.path(str(outside).lstrip("/")).mkdir(parents=True)
    lab.link("usr/local", str(outside))
    lab.install()
    assert [str(p.relative_to(outside)) for p in outside.rglob("*") if p.is_file()] == [DUMP]
    inside = lab.root / str(outside).lstrip("/")
    assert (inside / MANIFEST.removeprefix("usr/local/")).exists()
    lab.uninstall()
    assert lab.files() == ["usr/local"]


def test_relative_link_of_an_image_that_climbs_out_stays_inside(lab: Lab, outside: Path) -> None:
    lab.path("outside").mkdir()
    lab.link("usr/local", "../../../../../outside")
    lab.install()
    assert lab.path("outside/lib/systemd/system/wrcd@.service").exists()
    assert [str(p.relative_to(outside)) for p in outside.rglob("*") if p.is_file()] == [DUMP]


def test_link_to_what_an_image_lacks_is_refused(lab: Lab, outside: Path) -> None:
    lab.link("usr/local", str(outside))
    lab.failed()
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
    assert f"{lab.path('usr/local/share')}" in lab.failed()
    lab.path("usr/local/share").unlink()
    lab.install()
    assert lab.path(UNIT).exists()
    lab.uninstall()
    assert lab.files() == []
