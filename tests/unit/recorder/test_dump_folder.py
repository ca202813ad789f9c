"""Where dumps go: bounded, whole, through no link, by a process that disturbs nobody."""

import errno
import os
import signal
import stat
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from tests.support.recorded_train import RecordedTrain
from wrcd.core.configuration import Config
from wrcd.recorder.dump_folder import ERRNO, write_dump
from wrcd.recorder.writer import OVERWRITTEN, PAUSE_LINES, Child, chunks

SUFFIXES = (".log", ".events.csv", ".state.json")


def names(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


def test_bound_of_the_folder_removes_the_oldest_dumps(tmp_path: Path) -> None:
    strangers = {"notes.txt", "wrcd-can0-20251121T000000Z-asked.log.gz", "wrcd-can0-20251121T000000Z-asked.txt"}
    for name in strangers:
        (tmp_path / name).write_text("mine")
    for i in range(5):
        write_dump(tmp_path, f"wrcd-can0-2026112{9 - i}T000000Z-asked", [b"l" * 600], b"e" * 400, b"", 3, 10**6)
        assert len(list(tmp_path.glob("wrcd-*.log"))) <= 3
    kept = {f"wrcd-can0-2026112{9 - i}T000000Z-asked{s}" for i in (2, 3, 4) for s in SUFFIXES}
    assert set(names(tmp_path)) == {*kept, *strangers}  # by when they were written, not by what a clock said
    write_dump(tmp_path, "wrcd-can1-20261130T000000Z-asked", [b"l" * 600], b"e" * 400, b"", 3, 2500)
    assert len(list(tmp_path.glob("wrcd-*.log"))) == 2
    with pytest.raises(OSError, match="too large"):
        write_dump(tmp_path, "wrcd-can1-20261131T000000Z-asked", [b"l" * 1000] * 3, b"", b"", 3, 2500)
    assert len(list(tmp_path.glob("wrcd-*.log"))) == 2
    assert not [n for n in names(tmp_path) if n.endswith(".part")]
    assert strangers < set(names(tmp_path))


def test_full_disk_costs_the_oldest_dumps_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk of 2500 bytes, which the folder's bound does not know; something else has a part of it."""
    (tmp_path / "notes.txt").write_text("n" * 700)
    write = os.write

    def onto_the_disk(fd: int, data: memoryview) -> int:
        used = sum(f.stat().st_size for f in tmp_path.iterdir())
        if used >= 2500:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(fd, data[: 2500 - used])

    monkeypatch.setattr(os, "write", onto_the_disk)
    dumps = [f"wrcd-can0-2026112{i}T000000Z-asked" for i in range(5)]
    for name in dumps:
        write_dump(tmp_path, name, [b"l" * 300] * 2, b"e" * 100, b"", 20, 10**6)
    assert set(names(tmp_path)) == {*(name + suffix for name in dumps[-2:] for suffix in SUFFIXES), "notes.txt"}
    assert (tmp_path / f"{dumps[-1]}.log").read_bytes() == b"l" * 600
    with pytest.raises(OSError, match="No space left"):
        write_dump(tmp_path, "wrcd-can0-20261130T000000Z-asked", [b"l" * 2000], b"", b"", 20, 10**6)
    assert names(tmp_path) == ["notes.txt"]


def test_dump_that_cannot_get_its_name_leaves_nothing(tmp_path: Path) -> None:
    name = "wrcd-can0-20261121T172446Z-asked"
    (tmp_path / f"{name}.log").mkdir()
    (tmp_path / ".wrcd-can0-x.part").mkdir()
    with pytest.raises(IsADirectoryError):
        write_dump(tmp_path, name, [b"log"], b"events", b"", 9, 10**6)
    assert names(tmp_path) == [".wrcd-can0-x.part", f"{name}.log"]


def test_symbolic_link_is_not_followed(tmp_path: Path) -> None:
    folder, victim = tmp_path / "dumps", tmp_path / "victim"
    folder.mkdir()
    victim.write_text("precious")
    name = "wrcd-can0-20261121T172446Z-asked"
    for planted in (f".{name}.log.part", f".{name}.events.csv.part", f"{name}.log", f"{name}.events.csv"):
        (folder / planted).symlink_to(victim)
    (folder / "wrcd-can0-20251121T172446Z-asked.log").symlink_to(victim)
    write_dump(folder, name, [b"log"], b"events", b"state", 1, 10**6)
    assert victim.read_text() == "precious"
    for suffix, text in zip(SUFFIXES, ("log", "events", "state"), strict=True):
        made = (folder / (name + suffix)).lstat()
        assert stat.S_ISREG(made.st_mode)
        assert stat.S_IMODE(made.st_mode) == 0o600
        assert (folder / (name + suffix)).read_text() == text
    assert not [n for n in names(folder) if n.endswith(".part")]


def test_partial_file_of_a_killed_process_is_removed(tmp_path: Path) -> None:
    (tmp_path / ".wrcd-can0-20261120T000000Z-asked.log.part").write_text("half")
    (tmp_path / ".wrcd-can1-20261120T000000Z-asked.log.part").write_text("another daemon is writing this")
    write_dump(tmp_path, "wrcd-can0-20261121T172446Z-asked", [b"log"], b"events", b"", 1000, 1 << 30)
    assert [n for n in names(tmp_path) if n.endswith(".part")] == [".wrcd-can1-20261120T000000Z-asked.log.part"]


def test_unwritable_folder_is_logged_once_and_tried_again(config: Config, tmp_path: Path) -> None:
    """Meanwhile the loop sends as ever."""
    folder = tmp_path / "file"
    folder.write_text("not a folder")
    train = RecordedTrain(config, folder)
    for _ in range(3):
        train.recorder.ask()
        train.run(2200)
        time.sleep(0.3)
    for _ in range(200):  # the writer is a process of its own: on a busy machine it takes its time
        train.run(100)
        if train.said:
            break
        time.sleep(0.1)
    assert len(train.said) == 1
    assert "not written: Not a directory" in train.said[0]
    folder.unlink()  # and when it is good again, it goes on
    train.recorder.ask()
    train.run(2200)
    assert len(train.dumps(2)) == 1


def test_full_disk_leaves_no_file(tmp_path: Path) -> None:
    """A limit of the file size stands for the end of the disk: what is written fails in the middle."""
    program = (
        "import resource, signal, sys\n"
        "from pathlib import Path\n"
        "from wrcd.recorder.dump_folder import write_dump\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "sys.dont_write_bytecode = True\n"  # half a module would break later programs
        "resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))\n"
        "try:\n"
        "    write_dump(Path(sys.argv[1]), 'wrcd-c-20261121T172446Z-asked', [b'l' * 9999], b'e', b's', 9, 99999)\n"
        "except OSError as e:\n"
        f"    sys.exit({ERRNO} + e.errno)\n"
    )
    assert Child([sys.executable, "-c", program, str(tmp_path)]).wait(10) == "File too large"
    assert names(tmp_path) == []


def test_hanging_process_is_killed() -> None:
    child = Child([sys.executable, "-c", "import time; time.sleep(60)"], most_s=0.1)
    begin = time.monotonic()
    while (said := child.finished()) is None:
        assert time.monotonic() - begin < 60
        time.sleep(0.01)
    assert said == "it took too long"
    with pytest.raises(ProcessLookupError):
        os.kill(child._process.pid, 0)


def test_process_inherits_no_socket_and_blocks_signals(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NOTIFY_SOCKET", "/nowhere")
    given = os.memfd_create("given")
    reader, writer = os.pipe()
    program = (
        "import os, signal\n"
        "os.kill(os.getpid(), signal.SIGTERM)\n"  # as systemd does to all of a unit
        f"assert os.pread({given}, 9, 0) == b'hello'\n"
        f"for fd in ({reader}, {writer}):\n"
        "    try:\n"
        "        os.fstat(fd)\n"
        "    except OSError:\n"
        "        continue\n"
        "    os._exit(1)\n"
        "os._exit('NOTIFY_SOCKET' in os.environ)\n"
    )
    os.pwrite(given, b"hello", 0)
    assert Child([sys.executable, "-c", program], (given,)).wait(10) == ""
    assert not os.get_inheritable(given)
    for fd in (given, reader, writer):
        os.close(fd)


def test_process_that_is_waited_for_is_told_to_hurry(monkeypatch: pytest.MonkeyPatch) -> None:
    assert Child([sys.executable, "-c", "import signal; signal.sigwait({signal.SIGTERM})"]).wait(60) == ""
    pauses = list[float]()
    monkeypatch.setattr(time, "sleep", pauses.append)
    log = [f"{k}\n" for k in range(3 * PAUSE_LINES)]
    assert b"".join(chunks(iter(log))) == "".join(log).encode()
    assert len(pauses) == 3
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
    try:
        signal.pthread_kill(threading.get_ident(), signal.SIGTERM)
        assert b"".join(chunks(iter(log))) == "".join(log).encode()
        assert signal.sigwait({signal.SIGTERM}) == signal.SIGTERM
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
    assert len(pauses) == 3


def test_daemon_of_another_version_is_told_that_its_dump_is_not_written() -> None:
    with os.fdopen(os.memfd_create("request"), "wb") as request:
        request.write(b'{"folder": ".", "position": 7, "state": true}')
        request.flush()
        command = [sys.executable, "-m", "wrcd.recorder.writer", "0", str(request.fileno())]
        done = subprocess.run(command, pass_fds=(request.fileno(),), stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == errno.EPROTO
    assert "a daemon of another version" in done.stderr
    assert "Traceback" not in done.stderr


def test_failure_of_a_process_is_named_by_its_exit_status() -> None:
    named = ((ERRNO + 28, "No space left on device"), (ERRNO + 1, "Operation not permitted"), (1, "failed"))
    for status, says in (*named, (OVERWRITTEN, "its frames were overwritten meanwhile")):
        assert Child([sys.executable, "-c", f"import os; os._exit({status})"]).wait(10) == says
    with pytest.raises(OSError, match="No such file"):
        Child(["/nowhere/python"])
