"""`wrcd check --installation`: of made-up roots, and of this computer."""

from pathlib import Path

import pytest

from wrcd.cli.main import main
from wrcd.config.config import packaged
from wrcd.service import installation
from wrcd.service.installation import InstalledPart, lines, parts, report


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A computer with vcan0 up and can1 down, a unit, one sound and one broken configuration."""
    for name, state in (("vcan0", "unknown"), ("can1", "down"), ("eth0", "up")):
        folder = tmp_path / "sys/class/net" / name
        folder.mkdir(parents=True)
        (folder / "type").write_text("1\n" if name == "eth0" else "280\n")
        (folder / "operstate").write_text(f"{state}\n")
    buffers = tmp_path / "proc/sys/net/core/rmem_max"
    buffers.parent.mkdir(parents=True)
    buffers.write_text("8388608\n")
    unit = tmp_path / "lib/systemd/system/wrcd@.service"
    unit.parent.mkdir(parents=True)
    unit.write_text("")
    (tmp_path / "etc/wrcd").mkdir(parents=True)
    (tmp_path / "etc/wrcd/a.toml").write_text(packaged(2, (0.0, -2.5)))
    return tmp_path


def by_name(root: Path) -> dict[str, list[InstalledPart]]:
    found: dict[str, list[InstalledPart]] = {}
    for part in parts(root):
        found.setdefault(part.name, []).append(part)
    return found


def test_every_part_of_a_whole_computer_is_found(root: Path) -> None:
    found = by_name(root)
    assert [(p.found, p.is_fine) for p in found["CAN interface"]] == [("can1 down", None), ("vcan0 up", True)]
    assert found["CAN interface"][0].mend == "as root: ip link set can1 up"
    for name in ("wrcd", "library in C", "receive buffer", "unit", "configuration"):
        assert [p.is_fine for p in found[name]] == [True], found[name]
    assert "a.toml: axles 1, 2" in found["configuration"][0].found


def test_broken_configuration_is_missing_and_says_where(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (root / "etc/wrcd/b.toml").write_text(packaged(2, (0.0, -2.5)) + "[limits]\nmin_sped_m_s = 5\n")
    assert [p.is_fine for p in by_name(root)["configuration"]] == [True, False]
    assert not report(root)
    said = capsys.readouterr().out
    assert f"MISSING configuration      {root}/etc/wrcd/b.toml does not hold" in said
    assert "limits.min_sped_m_s" in said


def test_empty_root_names_what_mends_each(tmp_path: Path) -> None:
    found = by_name(tmp_path)
    assert "ip link add vcan0 type vcan" in found["CAN interface"][0].mend
    assert found["receive buffer"][0].found == "0 bytes at most"
    assert "make deb" in found["unit"][0].mend
    assert "wrcd init" in found["configuration"][0].mend
    text = list(lines(found["unit"]))
    assert text[0].startswith("-       unit               none")
    assert text[1].strip() == found["unit"][0].mend


@pytest.mark.parametrize(
    ("link", "words"),
    [
        ('[{"linkinfo": {"info_kind": "can", "info_data": {"bittiming": {"bitrate": 500000}}}}]', ", 500000 bit/s"),
        ('[{"linkinfo": {"info_kind": "can", "info_data": {}}}]', ", no bit rate"),
        ('[{"linkinfo": {"info_kind": "vcan"}}]', None),
        ("", None),
    ],
)
def test_bit_rate_is_what_ip_says(
    link: str, words: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ip = tmp_path / "ip"
    ip.write_text(f"#!/bin/sh\nprintf '%s' '{link}'\n")
    ip.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path), prepend=":")
    assert installation._bit_rate("can0") == words


def test_command_ends_by_whether_the_daemon_can_run_here(capsys: pytest.CaptureFixture[str]) -> None:
    status = main(["check", "--installation"])
    assert status == ("MISSING" in capsys.readouterr().out)
