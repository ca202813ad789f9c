"""The unit under a real systemd, installed as the README says; canplayer is the train."""

import os
import signal
import subprocess
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from sim_ecu.cli import main as sim_ecu
from tests.hil.conftest import ROOT, running, wait_for
from tests.scenarios import held
from wrcd.bus.frame import Frame
from wrcd.bus.log import Damage, parse_line, read_log

UNIT = "wrcd@vcan0"


def systemctl(*words: str) -> str:
    return subprocess.run(["systemctl", *words], timeout=60, check=True, capture_output=True, text=True).stdout.strip()


def main_pid() -> int:
    return int(systemctl("show", "-p", "MainPID", "--value", UNIT))


def moment(name: str) -> float:
    """One of the unit's time stamps, in seconds of CLOCK_MONOTONIC."""
    return int(systemctl("show", "-p", f"{name}TimestampMonotonic", "--value", UNIT)) * 1e-6


def newest(log: Path) -> Frame | None:
    """The last Adhesion_A1 frame that candump has written."""
    with log.open("rb") as f:
        f.seek(max(0, log.stat().st_size - 2000))
        lines = [parse_line(line.strip()) for line in f.read().splitlines()[1:]]
    return next((found[0] for found in reversed(lines) if found is not None), None)


def valid_after(log: Path, since_s: float) -> bool:
    frame = newest(log)
    return frame is not None and frame.stamp_us * 1e-6 > since_s and frame.data[1] >> 4 == 1


@pytest.fixture(scope="module")
def bus(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The installed unit, frames of a wet rail that go on and on, and candump's log of Adhesion_A1."""
    assert Path("/run/systemd/system").is_dir(), "this test needs systemd as PID 1: run it with `make test`"
    subprocess.run([ROOT / "tests" / "hil" / "install-unit"], timeout=180, check=True)
    # as systemd/80-wrcd.conf sets it: what arrives while the program starts must fit
    Path("/proc/sys/net/core/rmem_max").write_text("8388608")
    folder = tmp_path_factory.mktemp("unit")
    played, log = folder / "wet.log", folder / "candump.log"
    scenario = folder / "wet.toml"
    scenario.write_text(held("C", 30.0))
    assert sim_ecu(["play", str(scenario), "--fast", "--no-truth", "--log", str(played)]) == 0
    played.write_text(played.read_text().replace(" R\n", "\n"))
    with (
        running("candump", "-L", "vcan0,091:7FF", output=log),
        # a train's sensors do not wait for the daemon's processor: in the guest they share the only one
        running("chrt", "-f", "10", "canplayer", "-I", played, "-l", "i", "vcan0=can0"),
    ):
        yield log
    systemctl("stop", UNIT)


def test_the_unit_starts_and_sends_valid_frames(bus: Path) -> None:
    began = time.time()
    systemctl("start", UNIT)  # returns when READY=1 was said
    assert systemctl("is-active", UNIT) == "active"
    wait_for("a Valid frame", 10, lambda: valid_after(bus, began))


def test_after_kill_nine_it_is_back_with_valid_frames(bus: Path) -> None:
    """Five times; starting a program takes this guest several times as long as its host."""
    systemctl("start", UNIT)
    times = []
    for _ in range(5):
        wait_for("a Valid frame", 10, lambda: valid_after(bus, time.time() - 0.5))
        pid = main_pid()
        assert pid > 1
        killed, monotonic = time.time(), time.monotonic()
        os.kill(pid, signal.SIGKILL)
        time.sleep(6.0)  # no looking meanwhile: it would take the one processor
        wait_for("a Valid frame after kill -9", 20, partial(valid_after, bus, killed + 0.1))
        first = next(
            f.stamp_us * 1e-6
            for f, _ in read_log(bus, Damage())
            if f.stamp_us * 1e-6 > killed + 0.1 and f.data[1] >> 4 == 1
        )
        times.append(first - killed)
        started, ready = (moment(p) - monotonic for p in ("ExecMainStart", "ActiveEnter"))
        print(f"kill -9; started after {started:.2f}, ready {ready:.2f}, Valid {first - killed:.2f} s")
        assert main_pid() not in (0, pid)
    print("\nkill -9 to the first Valid frame, s:", ", ".join(f"{t:.2f}" for t in times))
    assert max(times) <= 4.0


def test_it_is_shut_in(bus: Path) -> None:
    systemctl("start", UNIT)
    status = Path(f"/proc/{main_pid()}/status").read_text()
    fields = dict(line.split(":\t", 1) for line in status.splitlines() if ":\t" in line)
    assert fields["CapEff"].strip() == "0000000000000000"
    assert fields["NoNewPrivs"].strip() == "1"
    assert fields["Seccomp"].strip() == "2"
    assert int(fields["Uid"].split()[0]) >= 61184  # a dynamic user


def test_stopping_says_not_available(bus: Path) -> None:
    systemctl("start", UNIT)
    wait_for("a Valid frame", 10, lambda: valid_after(bus, time.time() - 0.5))
    systemctl("stop", UNIT)
    time.sleep(0.5)
    frame = newest(bus)
    assert frame is not None
    assert frame.data[1] >> 4 == 0
    journal = subprocess.run(
        ["journalctl", "-u", UNIT, "--no-pager"], timeout=60, capture_output=True, text=True, check=True
    )
    assert "wrcd: stopped;" in journal.stdout
    assert "Traceback" not in journal.stdout


def test_a_wrong_configuration_is_not_tried_again(bus: Path) -> None:
    Path("/etc/wrcd").mkdir(exist_ok=True)
    Path("/etc/wrcd/vcan0.toml").write_text("[axles]\n")
    Path("/etc/wrcd/vcan0.env").write_text("WRCD_OPTIONS=--config /etc/wrcd/vcan0.toml\n")
    try:
        subprocess.run(["systemctl", "start", UNIT], timeout=60, check=False)
        wait_for("the failure", 20, lambda: "failed" in systemctl("show", "-p", "ActiveState", "--value", UNIT))
        assert systemctl("show", "-p", "NRestarts", "--value", UNIT) == "0"
        assert systemctl("show", "-p", "ExecMainStatus", "--value", UNIT) == "2"
    finally:
        Path("/etc/wrcd/vcan0.env").unlink()
        systemctl("reset-failed", UNIT)
