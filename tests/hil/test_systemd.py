"""The unit under a real systemd, installed as docs/how-to/install-on-train.md says; canplayer is the train.

However the daemon ends and whatever happens around it: Valid frames come again without a person. Times are printed.
"""

import os
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import pytest

from tests.support.processes import ROOT, wait_for
from tests.support.unit_train import (
    NOT_AVAILABLE,
    UNIT,
    Train,
    dpkg,
    journal,
    main_pid,
    output,
    package,
    prop,
    systemctl,
)
from wrcd.config.config import DEFAULT

CONFIG, ENVIRONMENT = Path("/etc/wrcd/vcan0.toml"), Path("/etc/wrcd/vcan0.env")
DROP_INS = Path(f"/etc/systemd/system/{UNIT}.service.d")


def status() -> dict[str, str]:
    """/proc/PID/status of the daemon."""
    lines = Path(f"/proc/{main_pid()}/status").read_text().splitlines()
    return {name: value.strip() for name, _, value in (line.partition(":\t") for line in lines)}


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Train]:
    assert Path("/run/systemd/system").is_dir(), "this test needs systemd as PID 1: run it with `make test`"
    file = package()
    subprocess.run([*dpkg(tmp_path_factory.mktemp("dpkg"), file), "-i", file], timeout=180, check=True)
    # systemd/80-wrcd.conf: what arrives while the program starts must fit
    assert Path("/proc/sys/net/core/rmem_max").read_text() == "8388608\n"
    train = Train(tmp_path_factory.mktemp("unit"))
    train.connect()
    yield train
    train.disconnect()
    systemctl("stop", UNIT)


@pytest.fixture
def train(installed: Train) -> Train:
    """The unit runs and sends Valid frames."""
    systemctl("start", UNIT)
    installed.wait(time.time() - 0.5)
    return installed


@contextmanager
def configured(text: str) -> Iterator[None]:
    """The unit runs, or is to be started, with a configuration file."""
    CONFIG.write_text(text)
    ENVIRONMENT.write_text(f"WRCD_OPTIONS=--config {CONFIG}\n")
    try:
        yield
    finally:
        ENVIRONMENT.unlink()


def test_killed_daemon_is_back_with_valid_frames(train: Train) -> None:
    """Three times; starting a program takes this guest several times as long as its host."""
    for _ in range(3):
        train.wait(time.time() - 0.5)
        pid = main_pid()
        assert pid > 1
        killed = time.time()
        os.kill(pid, signal.SIGKILL)
        train.back_after("kill -9", killed, 4.0)
        assert main_pid() not in (0, pid)


def test_hung_daemon_is_killed_by_the_watchdog(train: Train) -> None:
    """2 s without a sign of life; the journal then says where it hung."""
    pid, stopped = main_pid(), time.time()
    os.kill(pid, signal.SIGSTOP)
    train.back_after("SIGSTOP", stopped, 5.0)
    assert main_pid() not in (0, pid)
    said = journal(stopped)
    assert "Watchdog timeout" in said
    assert "Fatal Python error: Aborted" in said
    assert "loop.py" in said


def test_out_of_memory_restarts_the_daemon(train: Train) -> None:
    """A leak ends in its own death, not in the train computer's."""
    limited = time.time()
    systemctl("set-property", "--runtime", UNIT, "MemoryMax=12M")
    try:
        wait_for("the kill", 10, lambda: "killed by the OOM killer" in journal(limited))
    finally:
        systemctl("set-property", "--runtime", UNIT, "MemoryMax=256M")
    train.back_after("MemoryMax exceeded, then enough of it again", time.time(), 3.0)
    assert int(prop("NRestarts")) >= 1


def test_restart_takes_over_a_changed_configuration(installed: Train) -> None:
    """There and back: by systemctl, and by SIGHUP, which ends the daemon as SIGTERM does. A reload is refused."""
    with configured(DEFAULT):
        systemctl("restart", UNIT)
        installed.wait(time.time())
        pid = main_pid()
        CONFIG.write_text(DEFAULT + "[limits]\nmin_speed_m_s = 59\n")
        assert subprocess.run(["systemctl", "reload", UNIT], timeout=60, check=False).returncode != 0
        assert main_pid() == pid
        restarted, restarted_s = time.time(), time.monotonic()
        systemctl("restart", UNIT)  # returns when READY=1 was said
        print(f"systemctl restart: {time.monotonic() - restarted_s:.2f} s")
        installed.wait(time.time(), NOT_AVAILABLE)
        installed.wait(time.time() + 2.0, NOT_AVAILABLE)  # longer than a window
        stamps_s = [f.stamp_us * 1e-6 for f in installed.since(restarted)]
        print(f"longest gap between two frames around it: {max(b - a for a, b in pairwise(stamps_s)):.2f} s")

        CONFIG.write_text(DEFAULT)
        pid, killed = main_pid(), time.time()
        systemctl("kill", "--signal=HUP", UNIT)
        installed.back_after("SIGHUP with the old limit", killed, 1.5)
        assert main_pid() not in (0, pid)


@contextmanager
def started_later(unit: str) -> Iterator[None]:
    """A unit whose start is not waited for."""
    systemctl("start", "--no-block", unit)
    try:
        yield
    finally:
        systemctl("stop", unit)
        systemctl("reset-failed")


def active_after(unit: str, since_s: float) -> float:
    """Seconds from a moment of time.monotonic() until a unit said READY=1, as systemd stamped it."""
    time.sleep(2.5)  # no looking meanwhile: it would take the one processor
    wait_for(f"{unit} to run", 20, lambda: prop("ActiveState", unit) == "active")
    return int(prop("ActiveEnterTimestampMonotonic", unit)) * 1e-6 - since_s


def test_missing_interface_is_waited_for_and_used_when_it_comes(installed: Train) -> None:
    """One start in twenty seconds, not one every few hundredths of a second."""
    unit, began, began_s = "wrcd@vcan9", time.time(), time.monotonic()
    with started_later(unit):
        time.sleep(21.0)
        wait_for("the second start", 30, lambda: prop("NRestarts", unit) != "0")
        print(f"started again after {time.monotonic() - began_s:.1f} s without the interface")
        time.sleep(5.0)  # until it has loaded its libraries
        assert prop("ActiveState", unit) == "activating"
        subprocess.run(["ip", "link", "add", "vcan9", "type", "vcan"], timeout=10, check=True)
        took = active_after(unit, time.monotonic())
        print(f"running {took:.2f} s after the interface was made")
        assert prop("NRestarts", unit) == "1"
        said = output("journalctl", "-u", unit, "--no-pager", f"--since=@{began:.3f}")
        assert "CAN interface 'vcan9' cannot be opened: No such device" in said
        assert said.count("; waiting for it, ") == 2
        assert "Traceback" not in said
    subprocess.run(["ip", "link", "del", "vcan9"], timeout=10, check=True)


def test_configuration_on_a_mount_that_comes_later_is_waited_for(installed: Train) -> None:
    systemctl("stop", UNIT)
    with configured(DEFAULT):
        CONFIG.unlink()
        with started_later(UNIT):
            time.sleep(5.0)
            assert prop("ActiveState") == "activating"
            assert prop("NRestarts") == "0"
            CONFIG.write_text(DEFAULT)
            took = active_after(UNIT, time.monotonic())
            print(f"running {took:.2f} s after the configuration was there")


def test_unit_is_sandboxed(train: Train) -> None:
    fields = status()
    assert fields["CapEff"] == "0000000000000000"
    assert fields["NoNewPrivs"] == "1"
    assert fields["Seccomp"] == "2"
    assert int(fields["Uid"].split()[0]) >= 61184  # a dynamic user
    said = output("systemd-analyze", "security", "--no-pager", UNIT)
    print("\n".join(line.rstrip() for line in said.splitlines() if line.startswith("✗") or "Overall" in line))
    exposure = re.search(r"Overall exposure level for \S+: ([0-9.]+)", said)
    assert exposure is not None
    assert float(exposure[1]) <= 1.5


def test_sandboxed_daemon_has_its_rtnetlink_socket(train: Train) -> None:
    """Shut in as it is, it has a socket of rtnetlink's group of links; otherwise it would do without, and be slower."""
    files = Path(f"/proc/{main_pid()}/fd").iterdir()
    sockets = {name.removeprefix("socket:[").removesuffix("]") for name in map(os.readlink, files)}
    listed = [line.split() for line in Path("/proc/net/netlink").read_text().splitlines()]
    _, protocol, _, groups, *_ = next(words for words in listed if words[-1] in sockets)
    assert (protocol, groups) == ("0", "00000001")


def test_drop_ins_give_realtime_priority_and_locked_memory(train: Train) -> None:
    """Realtime priority and locked memory in use. Here is no udev to bring a device: device.conf is only read."""
    DROP_INS.mkdir(exist_ok=True)
    try:
        shutil.copy(ROOT / "systemd/wrcd@.service.d/device.conf", DROP_INS)
        assert output("systemd-analyze", "verify", f"{UNIT}.service") == ""
        systemctl("daemon-reload")
        assert "sys-subsystem-net-devices-vcan0.device" in prop("BindsTo")
        (DROP_INS / "device.conf").unlink()
        shutil.copy(ROOT / "systemd/wrcd@.service.d/realtime.conf", DROP_INS)
        assert output("systemd-analyze", "verify", f"{UNIT}.service") == ""
        systemctl("daemon-reload")
        began = time.time()
        systemctl("restart", UNIT)
        train.back_after("restart with realtime.conf", began, 3.0)
        # the children do not inherit it
        assert os.sched_getscheduler(main_pid()) == os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        fields = status()
        print(f"locked {fields['VmLck']}, resident {fields['VmRSS']}")
        assert int(fields["VmLck"].split()[0]) > 10_000
        assert "memory is not locked" not in journal(began)
        with (DROP_INS / "realtime.conf").open("a") as f:
            f.write("LimitMEMLOCK=64K\n")
        systemctl("daemon-reload")
        began = time.time()
        systemctl("restart", UNIT)
        train.back_after("restart with a limit on locked memory", began, 3.0)
        assert journal(began).count("memory is not locked: ") == 1
    finally:
        shutil.rmtree(DROP_INS)
        systemctl("daemon-reload")
        systemctl("restart", UNIT)


def test_device_deleted_and_made_again_is_used_by_the_same_process(train: Train) -> None:
    """The daemon stays and opens it again; candump and canplayer have to be started anew."""
    gone = time.time()
    subprocess.run(["ip", "link", "del", "vcan0"], timeout=10, check=True)
    train.disconnect()
    time.sleep(1.0)
    subprocess.run(["ip", "link", "add", "vcan0", "mtu", "72", "type", "vcan"], timeout=10, check=True)
    subprocess.run(["ip", "link", "set", "vcan0", "up"], timeout=10, check=True)
    made = time.time()
    train.connect()
    train.back_after("vcan0 made again", made, 1.5)
    said = journal(gone)
    found = [re.findall(rf"\[(\d+)\]: wrcd: the CAN device {what}", said) for what in ("is gone", "was opened again")]
    assert found[0] == found[1], said  # one process; on a busy computer the watchdog may have started another one since
    assert len(found[0]) == 1


def test_stopped_unit_sends_not_available(train: Train) -> None:
    train.wait(time.time())
    stopped = time.time()
    systemctl("stop", UNIT)  # which waits for its end; candump may be behind
    train.wait(stopped, NOT_AVAILABLE)
    said = journal()
    assert "wrcd: stopped;" in said
    assert "Traceback" not in said


def test_invalid_configuration_is_not_restarted(installed: Train) -> None:
    systemctl("stop", UNIT)
    with configured("[axles]\n"):
        subprocess.run(["systemctl", "start", UNIT], timeout=60, check=False)
        wait_for("the failure", 20, lambda: "failed" in prop("ActiveState"))
        assert prop("NRestarts") == "0"
        assert prop("ExecMainStatus") == "2"
    systemctl("reset-failed", UNIT)
