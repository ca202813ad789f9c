"""What is said of running units, with systemctl's answers in its place."""

from pathlib import Path

import pytest

from tests.unit.cli.installation.lab import PROGRAM, UNIT, Lab
from wrcd import __version__
from wrcd.cli import install as run
from wrcd.cli import main as cli
from wrcd.cli.installation import system, upgraded
from wrcd.cli.installation.tree import Manifest, Tree
from wrcd.config.config import DEFAULT
from wrcd.errors import InputError


@pytest.fixture
def called(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, ...]]:
    """What systemctl was asked. Two units run: can0's process since 5 s after the boot, can1's since 9 s."""
    words_of: list[tuple[str, ...]] = []
    started = {"wrcd@can0.service": "5000000\n", "wrcd@can1.service": "9000000\n"}

    def systemctl(*words: str) -> str:
        words_of.append(words)
        if words[0] == "list-units":
            return "".join(f"{unit} loaded active running Wheel-rail condition daemon\n" for unit in started)
        return started[words[-1]] if words[0] == "show" else ""

    monkeypatch.setattr(system, "systemctl", systemctl)
    monkeypatch.setattr(system, "now", lambda: ("this boot", 10_000_000))
    return words_of


def record(changed_us: int, boot: str = "this boot") -> Manifest:
    return Manifest(__version__, "/opt/wrcd/bin/wrcd", [], boot=boot, changed_us=changed_us)


@pytest.fixture
def copy(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Lab:
    """A computer's files, that are worked on as if they were the running system's."""
    lab = Lab(tmp_path / "root", capsys)
    monkeypatch.setattr(system, "BOOTED", tmp_path)
    monkeypatch.setattr(system, "SYSCTL", ())
    monkeypatch.setattr(system, "require_root", lambda: None)
    monkeypatch.setattr(run, "Tree", lambda _: Tree(lab.root))
    return lab


def test_running_rig_is_stopped_before_its_unit_is_removed(called: list[tuple[str, ...]], copy: Lab) -> None:
    copy.install("--with", "rig")
    assert cli.main(["install", "--program", PROGRAM, "--without", "rig"]) == 0
    words = [words[0] for words in called]
    listed = next(w for w in called if w[0] == "list-units")
    assert listed[-1] == "sim-ecu@*.service"
    assert words.index("stop") < words.index("daemon-reload")
    called.clear()
    assert cli.main(["install", "--program", PROGRAM]) == 0
    assert "stop" not in {words[0] for words in called}


@pytest.mark.usefixtures("called")
def test_daemon_reload_that_fails_is_said_and_ends_with_1(
    copy: Lab, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def failing(*words: str) -> str:
        raise InputError(f"systemctl {words[0]} failed: no answer")

    monkeypatch.setattr(system, "systemctl", failing)
    assert cli.main(["install", "--program", PROGRAM]) == 1
    assert copy.path(UNIT).exists()
    assert "not all of it is installed: systemctl daemon-reload failed: no answer" in capsys.readouterr().err


def test_uninstallation_whose_daemon_reload_fails_is_completed_by_the_next(
    called: list[tuple[str, ...]], copy: Lab, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    copy.install()
    asked, fails = system.systemctl, True

    def failing(*words: str) -> str:
        if words[0] == "daemon-reload" and fails:
            raise InputError("systemctl daemon-reload failed: no answer")
        return asked(*words)

    monkeypatch.setattr(system, "systemctl", failing)
    monkeypatch.setattr("wrcd.cli.uninstall.Tree", lambda _: Tree(copy.root))
    assert cli.main(["uninstall"]) == 1
    assert "not all of it is removed: systemctl daemon-reload failed" in capsys.readouterr().err
    fails = False
    assert cli.main(["uninstall"]) == 0
    assert copy.files() == []
    assert "stop" in {words[0] for words in called}


@pytest.mark.parametrize(
    ("changed_us", "boot", "late"),
    [
        (10_000_000, "this boot", "wrcd@can0 wrcd@can1"),
        (7_000_000, "this boot", "wrcd@can0"),
        (4_000_000, "this boot", ""),
        (10_000_000, "the boot before", ""),
        (0, "", ""),
    ],
)
def test_units_that_were_started_before_the_change_are_named(
    called: list[tuple[str, ...]], changed_us: int, boot: str, late: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run._units(record(changed_us, boot), restart=False) == 0
    expected = f"these run what was there before, until: systemctl restart {late}\n" if late else ""
    assert capsys.readouterr().out == expected
    assert "restart" not in {words[0] for words in called}


@pytest.mark.parametrize(("fails", "status"), [(False, 0), (True, 1)])
def test_only_late_units_are_restarted_and_a_failure_is_said(
    called: list[tuple[str, ...]], fails: bool, status: int, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    asked = system.systemctl

    def answer(*words: str) -> str:
        if fails and words[0] == "restart":
            raise InputError("systemctl restart wrcd@can0 failed: Job failed")
        return asked(*words)

    monkeypatch.setattr(system, "systemctl", answer)
    assert run._units(record(7_000_000), restart=True) == status
    said = capsys.readouterr()
    if fails:
        assert said.err == "wrcd: installed, but systemctl restart wrcd@can0 failed: Job failed\n"
    else:
        assert said.out == "restarted: wrcd@can0\n"
        assert ("restart", "wrcd@can0") in called


def test_package_managers_upgrade_is_told_on(
    called: list[tuple[str, ...]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "etc/wrcd"
    folder.mkdir(parents=True)
    (folder / "can0.toml").write_text("[axles]\n")
    (folder / "can1.toml").write_text(DEFAULT)
    assert upgraded.main(tmp_path) == 0
    said = capsys.readouterr()
    assert said.out == "these run what was there before, until: systemctl restart wrcd@can0 wrcd@can1\n"
    assert f"does not hold with wrcd {__version__}: {folder / 'can0.toml'}" in said.err
    assert "can1.toml" not in said.err


def test_systemctl_that_fails_is_an_error_with_its_words(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "systemctl").write_text("#!/bin/sh\necho no such unit >&2\nexit 4\n")
    (tmp_path / "systemctl").chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    with pytest.raises(InputError, match="systemctl stop wrcd@can0 failed: no such unit"):
        system.systemctl("stop", "wrcd@can0")
