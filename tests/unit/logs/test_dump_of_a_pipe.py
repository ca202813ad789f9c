"""`candump -L vcan0 | wrcd dump -`: line by line, as they come."""

import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from tests.support.processes import ROOT
from wrcd.errors import InputError
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_lines

DUMP = (sys.executable, "-m", "wrcd.cli", "dump", "-")
YAW = b"(1700000000.000000) vcan0 101#0000000000000000\n"
OTHER = b"(1700000000.000100) vcan1 7FF#00\n"
WAIT_S = 30.0


def dump(*arguments: str, given: bytes) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run([*DUMP, *arguments], cwd=ROOT, input=given, timeout=60, capture_output=True, check=False)


@contextmanager
def dumping(*arguments: str) -> Iterator["subprocess.Popen[bytes]"]:
    process = subprocess.Popen(
        [*DUMP, *arguments], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, bufsize=0
    )
    try:
        yield process
    finally:
        if process.poll() is None:
            process.kill()
        process.wait(10)
        for pipe in (process.stdin, process.stdout, process.stderr):
            if pipe is not None:
                pipe.close()


def write(process: "subprocess.Popen[bytes]", line: bytes) -> None:
    assert process.stdin is not None
    process.stdin.write(line)


def read(process: "subprocess.Popen[bytes]") -> bytes:
    """The next whole line; fails if none comes."""
    assert process.stdout is not None
    line = b""
    while not line.endswith(b"\n"):
        ready, _, _ = select.select([process.stdout], [], [], WAIT_S)
        assert ready, f"nothing within {WAIT_S} s"
        line += os.read(process.stdout.fileno(), 4096)
    return line


def test_line_is_shown_before_the_next_one_comes() -> None:
    with dumping() as process:
        for line in (YAW, OTHER, YAW):
            write(process, line)
            shown = read(process)
            assert shown.startswith(line.strip())
            assert shown.count(b"\n") == 1
            assert (b" :: YawRate_A1(" in shown) == (line is YAW)


def test_damaged_line_is_left_out_and_said_at_the_end() -> None:
    done = dump(given=YAW + b"rubbish\n\xff\xfe\n" + OTHER)
    assert [line[:26] for line in done.stdout.splitlines()] == [YAW[:26], OTHER[:26]]
    assert done.stderr == b"wrcd: warning: standard input: 2 damaged lines left out (line 2, 3), after frame 1\n"
    assert done.returncode == 1


def test_line_without_its_end_is_not_shown() -> None:
    done = dump(given=YAW + OTHER[:-3])
    assert done.stdout.count(b"\n") == 1
    assert b"standard input:2: cut off in mid-line; processed up to there, frame 1" in done.stderr
    assert done.returncode == 1


def test_count_ends_it_while_the_writer_goes_on() -> None:
    with dumping("-n", "2") as process:
        write(process, YAW + OTHER + YAW + YAW)
        assert process.wait(WAIT_S) == 0
        assert process.stdout is not None
        assert len(process.stdout.read().splitlines()) == 2


def test_channel_is_chosen() -> None:
    done = dump("-c", "vcan1", given=YAW + OTHER)
    assert done.stdout.splitlines() == [OTHER.strip()]
    assert done.returncode == 0


def test_ctrl_c_is_no_error_and_says_what_was_damaged() -> None:
    with dumping() as process:
        write(process, b"rubbish\n" + YAW)
        assert read(process)
        process.send_signal(signal.SIGINT)
        assert process.wait(WAIT_S) == 130
        assert process.stderr is not None
        assert (
            process.stderr.read() == b"wrcd: warning: standard input: 1 damaged line left out (line 1), after frame 0\n"
        )


def test_reader_that_has_enough_is_no_error() -> None:
    with dumping() as process:
        write(process, YAW)
        assert read(process)
        assert process.stdout is not None
        process.stdout.close()
        end = time.monotonic() + WAIT_S
        while process.poll() is None and time.monotonic() < end:
            try:
                write(process, YAW)
            except BrokenPipeError:
                break
            time.sleep(0.01)
        assert process.wait(WAIT_S) == 0
        assert process.stderr is not None
        assert process.stderr.read() == b""


@pytest.mark.parametrize(
    "line",
    [
        b"  vcan0  101   [8]  00 00 00 00 00 00 00 00\n",
        b"  vcan0  18FEF100   [3]  00 01 02   '...'\n",
        b" (1700000000.000000)  vcan0  101   [2]  00 01\n",
        b" \x1b[0;33m vcan0  \x1b[0m  101  \x1b[2m [2] \x1b[0m 00 01\n",
    ],
)
def test_candump_without_its_option_is_told_to_have_it(line: bytes) -> None:
    with pytest.raises(InputError, match=r"^standard input:1: "):
        list(read_lines([line, line], Damage()))


@pytest.mark.parametrize("given", [b"", b"\n\n", b"rubbish\n"])
def test_input_without_a_frame_is_an_error(given: bytes) -> None:
    done = dump(given=given)
    assert done.stdout == b""
    assert b"wrcd: error: standard input: has not one readable frame" in done.stderr
    assert done.returncode == 2
