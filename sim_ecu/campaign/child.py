"""A process that works on one job after another, and can be ended in the middle of one.

It is started as a command of its own, not forked: a thread of any program may own one, a Dask worker's too, whose
processes may have no children of the kind that Python's own pools make.
"""

import io
import os
import pickle
import select
import signal
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, BinaryIO

LENGTH = struct.Struct("<Q")
ORPHAN_S = 0.5  # how often it looks whether who started it is still there
ENDS_S = 5.0  # after its input ended, before it is killed
# Threads of the linear algebra would wait for each other: there is a process for each core.
ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")


class TookTooLong(Exception):
    """The job was not done within its limit; the process was ended."""


class Died(Exception):
    """The process ended by itself or was killed."""


class Failed(Exception):
    """The job raised an error: its text, and whether it says what a person can mend."""


class Child:
    """A process. `run` one job at a time; after TookTooLong or Died the next `run` starts another one."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._stopped = False

    @property
    def pid(self) -> int | None:
        """Of the process; None before the first job and after it ended."""
        return None if self._process is None else self._process.pid

    def run(self, function: Callable[[Any], Any], argument: Any, limit_s: float | None = None) -> Any:
        """What function(argument) returns there. Both are pickled. Raises TookTooLong, Died, Failed."""
        request = pickle.dumps((function, argument), pickle.HIGHEST_PROTOCOL)
        process = self._started()
        assert process.stdin is not None
        assert process.stdout is not None
        ends = None if limit_s is None else time.monotonic() + limit_s
        try:
            _send(process.stdin, request)
            answer = _receive(process.stdout.fileno(), ends)
        except TimeoutError:
            self.end()
            raise TookTooLong(f"not done within {limit_s:g} s") from None
        except (BrokenPipeError, EOFError):
            raise Died(self._how_it_ended()) from None
        except BaseException:
            self.end()  # Ctrl-C: what it works on is nobody's any more
            raise
        done, value = pickle.loads(answer)
        if not done:
            raise Failed(value)
        return value

    def stop(self) -> None:
        """Kill the process, and start no other: from another thread than that which runs jobs."""
        self._stopped = True
        self.end()

    def end(self) -> None:
        """Kill the process, if there is one."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            _reap(process)

    def close(self) -> None:
        """Let an idle process end by itself."""
        process, self._process = self._process, None
        if process is not None:
            _reap(process)

    def _started(self) -> subprocess.Popen[bytes]:
        if self._stopped:
            raise Died("it was stopped")
        if self._process is None:
            command = [sys.executable, "-c", "from sim_ecu.campaign.child import work; work()", str(os.getpid())]
            paths = os.pathsep.join(p or os.getcwd() for p in sys.path)
            # a session of its own: Ctrl-C at a terminal is for who started it
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True,
                env=os.environ | ONE_THREAD | {"PYTHONPATH": paths},
            )  # fmt: skip
        return self._process

    def _how_it_ended(self) -> str:
        process, self._process = self._process, None
        if process is None:
            return "it was stopped"
        _reap(process)
        status = process.returncode
        if status < 0:
            return f"its process was ended by {signal.Signals(-status).name}"
        return f"its process ended with status {status}"


def _reap(process: subprocess.Popen[bytes]) -> None:
    for pipe in (process.stdin, process.stdout):
        assert pipe is not None
        try:
            pipe.close()
        except BrokenPipeError:
            pass  # what was not sent yet is for nobody
    try:
        process.wait(ENDS_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _send(pipe: BinaryIO | io.BufferedWriter | Any, data: bytes) -> None:
    pipe.write(LENGTH.pack(len(data)))
    pipe.write(data)
    pipe.flush()


def _receive(fd: int, ends: float | None) -> bytes:
    """A message. Raises TimeoutError at `ends` (monotonic), EOFError where there is no more."""
    (length,) = LENGTH.unpack(_exactly(fd, LENGTH.size, ends))
    return _exactly(fd, length, ends)


def _exactly(fd: int, count: int, ends: float | None) -> bytes:
    found = bytearray()
    while len(found) < count:
        left = None if ends is None else max(ends - time.monotonic(), 0.0)
        if not select.select([fd], [], [], left)[0]:
            raise TimeoutError
        part = os.read(fd, min(count - len(found), 1 << 20))
        if not part:
            raise EOFError
        found += part
    return bytes(found)


def work() -> None:
    """The process: jobs come on standard input, answers go out on what was standard output when it began."""
    parent = int(sys.argv[1])
    threading.Thread(target=_ends_with, args=(parent,), daemon=True).start()
    requests, answers = os.dup(0), os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(2, 1)  # what a job prints must not get between the answers
    while True:
        try:
            request = _receive(requests, None)
        except EOFError:
            return
        try:
            _send(answers, _answer(request))
        except BrokenPipeError:
            return


def _answer(request: bytes) -> bytes:
    try:
        function, argument = pickle.loads(request)
        return pickle.dumps((True, function(argument)), pickle.HIGHEST_PROTOCOL)
    except Exception as e:
        return pickle.dumps((False, f"{type(e).__name__}: {e}"))


def _ends_with(parent: int) -> None:
    """Whoever started this process may be killed: nothing goes on for nobody."""
    while os.getppid() == parent:
        time.sleep(ORPHAN_S)
    os._exit(1)
