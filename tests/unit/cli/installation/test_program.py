"""The program that units start: all of it must be where their sandbox sees it."""

import os
import sysconfig
from pathlib import Path

import pytest

from sim_ecu.cli.main import MODULES
from tests.unit.cli.installation.lab import UNIT, Lab
from wrcd.cli import main as cli
from wrcd.cli.installation import system
from wrcd.errors import InputError


@pytest.fixture
def venv(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A virtual environment in a place that is shown. `home` beside it is hidden."""
    scripts = tmp_path / "opt/bin"
    for folder in (scripts, tmp_path / "home", tmp_path / "usr"):
        folder.mkdir(parents=True)
        (folder / "python3").touch()
    (scripts / "wrcd").touch()
    monkeypatch.setattr(sysconfig, "get_path", lambda _: str(scripts))
    monkeypatch.setattr(system, "HIDDEN", (str(tmp_path / "home"),))
    monkeypatch.setattr(system, "readable", lambda _: None)  # a test's folder is not for others
    return scripts


@pytest.mark.parametrize("place", ["usr", "home"])
def test_interpreter_below_home_is_refused(venv: Path, place: str, monkeypatch: pytest.MonkeyPatch) -> None:
    (venv / "python").symlink_to(f"../../{place}/python3")
    monkeypatch.setattr("sys.executable", str(venv / "python"))
    if place == "usr":
        assert str(system.own_program()) == str(venv / "wrcd")
        return
    with pytest.raises(InputError, match=r"the unit's sandbox hides .*/home"):
        system.own_program()


def test_library_of_the_interpreter_below_home_is_refused(venv: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.executable", str(venv / "python3"))
    monkeypatch.setattr(os, "__file__", str(venv.parents[1] / "home/os.py"))
    with pytest.raises(InputError, match=r"the unit's sandbox hides .*/home"):
        system.own_program()


def test_file_that_others_cannot_read_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "wrcd"
    file.touch(0o600)
    with pytest.raises(InputError, match=r"other users cannot read it.*--program"):
        system.readable(file)


def test_packages_of_the_rig_are_those_of_its_extra() -> None:
    assert set(system.RIG) == {module for module, (extra, _) in MODULES.items() if extra == "bench"}


@pytest.mark.parametrize("missing", [None, "scipy"])
def test_rig_is_installed_only_where_its_packages_are(
    missing: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lab = Lab(tmp_path / "root", capsys)
    monkeypatch.setattr(system, "own_program", lambda: system.stated_program("/opt/wrcd/bin/wrcd"))
    monkeypatch.setattr(system, "find_spec", lambda name: None if name == missing else "there")
    assert cli.main(["install", "--prefix", str(lab.root), "--with", "rig"]) == (2 if missing else 0)
    assert lab.path(UNIT).exists() is (missing is None)
    error = capsys.readouterr().err
    assert ("the package scipy is missing — pip install 'wrcd[bench]'" in error) is (missing is not None)
    lab.install()
    assert cli.main(["install", "--prefix", str(lab.root), "--without", "rig"]) == 0
