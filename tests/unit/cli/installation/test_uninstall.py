"""`wrcd uninstall` below a folder: what it removes, and what it leaves."""

import os
import shlex
import subprocess
from pathlib import Path

import pytest

from tests.unit.cli.installation.lab import UNIT, Lab
from wrcd.cli import main as cli
from wrcd.cli.installation import system
from wrcd.cli.installation.lay_out import GROUPS, LOCAL
from wrcd.cli.installation.tree import RECORD, Tree
from wrcd.errors import InputError

SYSCTL = "etc/sysctl.d/80-wrcd.conf"
DUMP = "var/lib/private/wrcd/can0/2026.log"


def test_nothing_is_left_of_what_was_installed(lab: Lab) -> None:
    """Files, folders made for them, and enabled units; what was there before stays."""
    lab.write("usr/local/bin/other", "")
    lab.path("etc/sysctl.d").mkdir(parents=True)
    before = lab.files(), lab.folders()
    lab.install(*(word for group in GROUPS for word in ("--with", group)))
    lab.link("etc/systemd/system/sys-subsystem-net-devices-can0.device.wants/wrcd@can0.service", f"/{UNIT}")
    lab.uninstall()
    lab.path("etc/systemd/system").rmdir()
    lab.path("etc/systemd").rmdir()
    assert (lab.files(), lab.folders()) == before


def test_configurations_and_dumps_stay_unless_purged(lab: Lab) -> None:
    lab.install()
    lab.write("etc/wrcd/design.txt", "mine")
    lab.write(DUMP, "a dump")
    lab.link("var/lib/wrcd/can0", "../private/wrcd/can0")
    said = lab.uninstall()
    assert "kept       /etc/wrcd: yours\n" in said
    assert "kept       /var/lib/private/wrcd: yours" in said
    assert lab.files() == ["etc/wrcd/design.txt", DUMP, "var/lib/wrcd/can0"]
    lab.install()
    assert "purged     /etc/wrcd" in lab.uninstall("--purge")
    assert lab.files() == []


def test_edited_file_is_not_lost_though_it_was_saved_before(lab: Lab) -> None:
    """An edited unit would be left without its program: it is renamed to what systemd does not read."""
    for edit, saved in (("first", ".wrcd-saved"), ("second", ".wrcd-saved-2")):
        lab.install()
        lab.write(UNIT, edit)
        said = lab.uninstall()
        assert f"saved      /{UNIT}: edited here: renamed to wrcd@.service{saved}" in said
        assert (f"left       /{LOCAL.units}: has files in it" in said) is (edit == "first")
        assert lab.read(f"{UNIT}{saved}") == edit
    assert lab.files() == [f"{UNIT}.wrcd-saved", f"{UNIT}.wrcd-saved-2"]


def test_files_of_others_beside_ours_stay(lab: Lab) -> None:
    lab.install()
    lab.write(f"{LOCAL.examples}/mine.txt", "mine")
    said = lab.uninstall()
    assert f"left       /{LOCAL.examples}: has files in it" in said
    assert lab.files() == [f"{LOCAL.examples}/mine.txt"]


def test_dry_run_removes_nothing(lab: Lab) -> None:
    lab.install()
    lab.write("etc/wrcd/mine.txt", "mine")
    before = lab.snapshot()
    said = lab.uninstall("--dry-run", "--purge")
    assert said.startswith("dry run: nothing is changed\n")
    assert "purged     /etc/wrcd\n" in said
    assert lab.snapshot() == before


def test_without_a_record_nothing_is_removed(lab: Lab) -> None:
    lab.write(UNIT, "mine")
    before = lab.snapshot()
    assert "nothing was installed by `wrcd install`" in lab.uninstall(status=2)
    assert lab.snapshot() == before
    assert not lab.path(RECORD).exists()


@pytest.mark.parametrize("command", ["install", "uninstall"])
def test_live_command_needs_systemd_and_root(
    command: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(system, "BOOTED", tmp_path / "never")
    assert cli.main([command]) == 2
    assert "systemd does not run here" in capsys.readouterr().err
    monkeypatch.setattr(system, "BOOTED", tmp_path)
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    assert cli.main([command]) == 2
    assert "needs root — sudo, or --dry-run" in capsys.readouterr().err


def test_purge_removes_files_that_were_saved_before_and_new_ones_beside_edited_ones(lab: Lab, tmp_path: Path) -> None:
    network = "etc/systemd/network/80-can0.network"
    lab.install("--with", "can0", data=lab.older(tmp_path))
    for path in (network, UNIT, SYSCTL):
        lab.edit(path)
    lab.install("--without", "can0")
    assert lab.path(f"{SYSCTL}.wrcd-new").exists()
    said = lab.uninstall("--purge")
    assert f"purged     /{network}.wrcd-saved\n" in said
    assert (lab.files(), lab.folders()) == ([], [])


def test_purge_after_an_uninstallation_says_how_what_was_kept_is_removed(lab: Lab) -> None:
    lab.install()
    lab.edit(UNIT)
    lab.write("etc/wrcd/design.txt", "mine")
    lab.write(DUMP, "a dump")
    lab.uninstall()
    before = lab.snapshot()
    said = lab.uninstall("--purge", status=2)
    assert lab.snapshot() == before
    subprocess.run(shlex.split(said.partition("removed by: ")[2]), check=True)
    assert lab.files() == []


def test_purge_without_a_record_names_nothing_of_the_debian_package(lab: Lab) -> None:
    lab.write("usr/lib/systemd/system/wrcd@.service", "")
    lab.write("etc/wrcd/can0.toml", "")
    said = lab.uninstall("--purge", status=2)
    assert "apt remove wrcd" in said
    assert "rm -r" not in said


def test_program_in_the_root_folder_is_uninstalled(lab: Lab) -> None:
    lab.install(program="/wrcd")
    assert "\nExecStart=/wrcd run " in lab.read(UNIT)
    assert "the program itself is left: /wrcd\n" in lab.uninstall()
    assert lab.files() == []


def test_removal_that_fails_on_the_way_ends_with_1_and_is_completed_by_the_next(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    lab.install()
    remove = Tree.remove

    def failing(tree: Tree, name: str) -> None:
        if name == UNIT:
            raise InputError("cannot be changed: Read-only file system")
        remove(tree, name)

    monkeypatch.setattr(Tree, "remove", failing)
    assert "wrcd: error: not all of it is removed: cannot be changed: Read-only" in lab.uninstall(status=1)
    monkeypatch.setattr(Tree, "remove", remove)
    lab.uninstall()
    assert lab.files() == []
