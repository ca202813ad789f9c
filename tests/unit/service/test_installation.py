"""`wrcd check --installation`: of made-up roots, and of this computer."""

import tomllib
from pathlib import Path

import pytest

from wrcd.cli.main import main
from wrcd.config.config import packaged
from wrcd.service import installation
from wrcd.service.installation import InstalledPart, lines, parts, report

SOUND = packaged(2, (0.0, -2.5))


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A computer with vcan0 up, can1 down and can2 in bus-off, a unit, and a configuration that an .env file names."""
    for name, flags, state in (("vcan0", 1, "unknown"), ("can1", 0, "down"), ("can2", 1, "down"), ("eth0", 1, "up")):
        folder = tmp_path / "sys/class/net" / name
        folder.mkdir(parents=True)
        (folder / "type").write_text("1\n" if name == "eth0" else "280\n")
        (folder / "flags").write_text(f"0x{flags:x}\n")
        (folder / "operstate").write_text(f"{state}\n")
    (tmp_path / "sys/class/net/gone").mkdir()
    buffers = tmp_path / "proc/sys/net/core/rmem_max"
    buffers.parent.mkdir(parents=True)
    buffers.write_text("8388608\n")
    unit = tmp_path / "lib/systemd/system/wrcd@.service"
    unit.parent.mkdir(parents=True)
    unit.write_text("")
    (tmp_path / "etc/wrcd").mkdir(parents=True)
    (tmp_path / "etc/wrcd/a.toml").write_text(SOUND)
    (tmp_path / "etc/wrcd/can0.env").write_text("WRCD_OPTIONS=--config a.toml\n")
    return tmp_path


def by_name(root: Path) -> dict[str, list[InstalledPart]]:
    found: dict[str, list[InstalledPart]] = {}
    for part in parts(root):
        found.setdefault(part.name, []).append(part)
    return found


def test_every_part_of_a_whole_computer_is_found(root: Path) -> None:
    found = by_name(root)
    assert [(p.found, p.is_fine) for p in found["CAN interface"]] == [
        ("can1 down", None), ("can2 is up, its controller is not: bus-off?", None), ("vcan0 up", True),
    ]  # fmt: skip
    assert found["CAN interface"][0].mend == "as root: ip link set can1 up"
    for name in ("wrcd", "library in C", "receive buffer", "unit", "configuration"):
        assert [p.is_fine for p in found[name]] == [True], found[name]
    assert found["configuration"][0].found == f"{root}/etc/wrcd/a.toml: axles 1, 2"


def test_what_is_looked_for_is_what_the_project_has() -> None:
    conf = Path("systemd/80-wrcd.conf").read_text()
    assert f"\nnet.core.rmem_max = {installation.RECEIVE_BYTES}\n" in conf
    extras = tomllib.loads(Path("pyproject.toml").read_text())["project"]["optional-dependencies"]
    assert set(installation.EXTRAS) == set(extras) - {"docs", "dev"}  # those are a developer's


def test_real_time_priority_is_that_of_a_drop_in(root: Path) -> None:
    assert [p.is_fine for p in by_name(root)["real-time priority"]] == [None]
    drop_in = root / "etc/systemd/system/wrcd@can0.service.d/realtime.conf"
    drop_in.parent.mkdir(parents=True)
    drop_in.write_text(Path("systemd/wrcd@.service.d/realtime.conf").read_text())
    assert [p.found for p in by_name(root)["real-time priority"]] == [str(drop_in)]


def test_configuration_that_is_refused_says_where(root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    broken = root / "etc/wrcd/b.toml"
    broken.write_text(SOUND + "[limits]\nmin_sped_m_s = 5\n")
    assert [p.is_fine for p in by_name(root)["configuration"]] == [True, False]
    assert not report(root)
    said = capsys.readouterr().out.splitlines()
    at = said.index(f"NO  configuration       {broken} is refused")
    assert said[at + 1] == f"{'':24}wrcd check --config {broken}"
    assert said[at + 2].startswith(f"{'':24}{broken}:")
    assert "limits.min_sped_m_s" in said[at + 2]


def test_configuration_that_no_env_file_names_is_not_used(root: Path) -> None:
    (root / "etc/wrcd/can0.env").unlink()
    assert by_name(root)["configuration"][0].found.endswith("; no .env file names it")


def test_empty_root_names_what_mends_each(tmp_path: Path) -> None:
    found = by_name(tmp_path)
    assert "ip link add vcan0 type vcan" in found["CAN interface"][0].mend
    assert found["receive buffer"][0].found == "its limit cannot be read: No such file or directory"
    assert "make deb" in found["unit"][0].mend
    assert "wrcd init" in found["configuration"][0].mend
    text = list(lines(found["unit"]))
    assert text == ["-   unit                none", f"{'':24}{found['unit'][0].mend}"]


@pytest.mark.parametrize(
    ("link", "words", "mend"),
    [
        ('[{"linkinfo": {"info_kind": "can", "info_data": {"bittiming": {"bitrate": 250000}}}}]', ", 250000 bit/s", ""),
        ('[{"linkinfo": {"info_kind": "can", "info_data": {}}}]', ", no bit rate", " type can bitrate RATE"),
        ('[{"linkinfo": {"info_kind": "vcan"}}]', "", ""),
        ("", "", ""),
    ],
)
def test_bit_rate_is_what_ip_says_and_none_is_proposed(
    link: str, words: str, mend: str, root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ip = root / "ip"
    ip.write_text(f"#!/bin/sh\nprintf '%s' '{link}'\n")
    ip.chmod(0o755)
    monkeypatch.setenv("PATH", str(root), prepend=":")
    down = by_name(root)["CAN interface"][0]
    assert (down.found, down.mend) == (f"can1 down{words}", f"as root: ip link set can1 up{mend}")


def test_ip_that_does_not_answer_is_not_waited_for(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ip = root / "ip"
    ip.write_text("#!/bin/sh\nexec sleep 60\n")
    ip.chmod(0o755)
    monkeypatch.setenv("PATH", str(root), prepend=":")
    monkeypatch.setattr(installation, "ASKED_S", 0.1)
    assert by_name(root)["CAN interface"][2].found == "vcan0 up"


def test_command_ends_by_whether_the_daemon_can_run_here(capsys: pytest.CaptureFixture[str]) -> None:
    status = main(["check", "--installation"])
    assert status == any(line.startswith("NO ") for line in capsys.readouterr().out.splitlines())


@pytest.mark.parametrize("also", [["--config", "a.toml"], ["--log", "a.log"], ["--live", "1"], ["-i", "virtual"]])
def test_it_is_of_the_computer_alone(also: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "--installation", *also]) == 2
    assert "--installation: is of the computer alone" in capsys.readouterr().err
