"""`wrcd reload PID`: what came of a reload is heard, and becomes an exit status."""

import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.support.processes import ROOT, wait_for
from wrcd.cli.main import main
from wrcd.config.config import DEFAULT
from wrcd.errors import InputError
from wrcd.service import reload_request

WRCD = (sys.executable, "-m", "wrcd.cli")


class Running:
    """`wrcd run` on python-can's virtual bus, and its configuration."""

    def __init__(self, process: "subprocess.Popen[str]", config: Path, log: Path) -> None:
        self.process, self._config, self._log = process, config, log

    def write(self, more: str) -> None:
        self._config.write_text(DEFAULT + more)

    def reload(self, *options: str) -> tuple[int, str, str]:
        """Exit status, output and errors of `wrcd reload`."""
        done = subprocess.run(
            [*WRCD, "reload", *options, str(self.process.pid)],
            cwd=ROOT, timeout=30, capture_output=True, text=True, check=False,
        )  # fmt: skip
        return done.returncode, done.stdout, done.stderr

    def log(self) -> str:
        return self._log.read_text()


@contextmanager
def daemon(folder: Path, stdin: int = subprocess.DEVNULL) -> Iterator[Running]:
    config, log = folder / "train.toml", folder / "log"
    config.write_text(DEFAULT)
    with log.open("w") as out:
        process = subprocess.Popen(
            [*WRCD, "run", "-i", "virtual", "-c", "asked", "--config", str(config)],
            cwd=ROOT, text=True, stdin=stdin, stderr=out,
        )  # fmt: skip
    try:
        wait_for("the daemon", 30, lambda: "axles 1" in log.read_text())
        wait_for("its signals", 10, lambda: _handles(process.pid, signal.SIGHUP))
        yield Running(process, config, log)
    finally:
        process.terminate()
        process.wait(10)


def _handles(pid: int, number: int) -> bool:
    caught = next(x for x in Path(f"/proc/{pid}/status").read_text().splitlines() if x.startswith("SigCgt"))
    return bool(int(caught.split()[1], 16) >> (number - 1) & 1)


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Running]:
    with daemon(tmp_path_factory.mktemp("asked")) as found:
        yield found


@pytest.mark.parametrize(
    ("more", "status", "out", "err"),
    [
        ("[limits]\nmin_speed_m_s = 4\n", 0, "reload: limits.min_speed_m_s 3 -> 4\n", ""),
        ("", 0, "reload: nothing has changed\n", ""),
        ("[limits]\nmin_sped_m_s = 4\n", 1, "", "reload: nothing taken over: .*did you mean 'min_speed_m_s'[?]"),
        ('[bus]\nchannel = "can7"\n', 1, "", "reload: nothing taken over; needs a restart: bus.channel\n$"),
        (
            '[bus]\nchannel = "can7"\n[limits]\nmin_speed_m_s = 5\n',
            0,
            "reload: limits.min_speed_m_s 3 -> 5; needs a restart: bus.channel\n",
            "",
        ),
    ],
    ids=["a limit", "nothing", "a mistake", "all needs a restart", "a part does"],
)
def test_what_came_of_it_is_printed_and_a_status(running: Running, more: str, status: int, out: str, err: str) -> None:
    running.write(more)
    if status:
        assert running.reload("--quiet") == (status, "", "")
    found = running.reload()
    assert found[:2] == (status, out)
    assert re.match(f"wrcd: error: {err}" if err else "$", found[2], re.DOTALL)
    assert running.process.poll() is None
    running.write("")
    assert running.reload("--quiet") == (0, "", "")
    assert ("limits" not in out) or "wrcd: " + out.partition(";")[0].strip() in running.log()


def test_two_at_once_are_not_mixed_up(running: Running) -> None:
    """Who comes second is refused; a datagram of another process is not taken for the daemon's."""
    pid = running.process.pid
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as s:
        s.bind(reload_request._address(pid))
        status, _, err = running.reload()
        assert (status, err) == (1, f"wrcd: error: process {pid}: is being asked already — try again\n")


def test_answer_of_another_process_is_not_believed(running: Running, monkeypatch: pytest.MonkeyPatch) -> None:
    pid = running.process.pid
    running.write("[limits\n")

    def lie() -> None:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as s:
            s.sendto(b"1 reload: all is well", reload_request._address(pid))

    kill = os.kill

    def after_a_lie(to: int, number: int) -> None:
        if number == signal.SIGHUP:
            lie()
        kill(to, number)

    monkeypatch.setattr(os, "kill", after_a_lie)
    with pytest.raises(reload_request.Unanswered, match=r"nothing taken over: .*not valid TOML"):
        reload_request.ask(pid)
    running.write("")


def test_daemon_that_hangs_is_status_1(running: Running) -> None:
    pid = running.process.pid
    os.kill(pid, signal.SIGSTOP)
    try:
        with pytest.raises(reload_request.Unanswered, match=r"did not answer within 0.3 s") as caught:
            reload_request.ask(pid, 0.3)
        assert caught.value.status == 1
    finally:
        os.kill(pid, signal.SIGCONT)
    wait_for("the reload", 10, lambda: "reload: " in running.log().splitlines()[-1])


def test_answer_without_anybody_to_hear_it_is_no_error() -> None:
    reload_request.answer(True, "reload: nothing has changed")


@pytest.mark.parametrize(
    ("pid", "message"),
    [
        (0, "process 0: is not there"),
        (-1, "process -1: is not there"),
        (2**22 + 1, f"process {2**22 + 1}: is not there"),
        (os.getpid(), f"process {os.getpid()}: is no `wrcd run`"),
    ],
    ids=["0", "-1", "beyond the last", "this one"],
)
def test_other_process_is_refused_and_gets_no_signal(
    pid: int, message: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    kill = os.kill
    monkeypatch.setattr(os, "kill", lambda to, number: kill(to, number) if number == 0 else pytest.fail("a signal"))
    assert main(["reload", "--", str(pid)]) == 2
    assert capsys.readouterr().err == f"wrcd: error: {message} — see systemctl show -p MainPID\n"


def test_process_of_another_user_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refused(*_: int) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "kill", refused)
    assert main(["reload", "1"]) == 2
    expected = "wrcd: error: process 1: is another user's — ask as its user, or as root\n"
    assert capsys.readouterr().err == expected


def test_daemon_of_a_terminal_is_not_ended(tmp_path: Path) -> None:
    """There SIGHUP means that the terminal is gone."""
    leader, follower = os.openpty()
    try:
        with daemon(tmp_path, stdin=follower) as running:
            with pytest.raises(InputError, match="runs on a terminal: SIGHUP would end it") as caught:
                reload_request.ask(running.process.pid)
            assert caught.value.status == 2
            assert running.process.poll() is None
    finally:
        os.close(leader)
        os.close(follower)
