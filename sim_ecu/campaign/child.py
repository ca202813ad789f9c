"""A process that works on one job after another, and can be ended in the middle of one.

It is started as a command of its own, not forked: a thread of any program may own one, a Dask worker's too, whose
processes may have no children of the kind that Python's own pools make.
"""

import math
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
from typing import IO, Any

from wrcd.errors import InputError

STOPPED = "it was stopped"
LENGTH = struct.Struct("<Q")
ORPHAN_S = 0.5  # how often it looks whether who started it is still there
ENDS_S = 5.0  # after its input ended, before it is killed
BEGINS_S = 600.0  # from handing a job out to its begin: a process that is new imports what the job needs
# Threads of the linear algebra would wait for each other: there is a process for each core.
ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")


class TookTooLong(Exception):
    """The job was not done within its limit; the process was ended."""


class Died(Exception):
    """The process ended by itself or was killed."""


class Failed(Exception):
    """The job raised an error: its text, after its class where it is none that is written for a person."""


class Child:
    """A process. `run` one job at a time; after TookTooLong or Died the next `run` starts another one.

    One thread runs jobs; another one may only `stop` it. What a job writes on standard error stands where ours does.
    """

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._stopped = False
        self._starting = threading.Lock()  # none is started that nobody stops

    @property
    def pid(self) -> int | None:
        """Of the process; None before the first job and after it ended."""
        return None if self._process is None else self._process.pid

    def run(self, function: Callable[[Any], Any], argument: Any, limit_s: float | None = None) -> Any:
        """What function(argument) returns there. Both are pickled. Raises TookTooLong, Died, Failed.

        limit_s: of wall time, from the call of the function on, which is imported by then.
        """
        request = pickle.dumps((function, argument), pickle.HIGHEST_PROTOCOL)
        process = self._started()
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            _send(process.stdin, request)
            answer = self._answer(process.stdout.fileno(), limit_s)
        except (BrokenPipeError, EOFError):
            raise Died(self._how_it_ended()) from None
        except BaseException:
            self._end()  # too late, or the pipe is in an unknown state: what it works on is nobody's any more
            raise
        done, value = pickle.loads(answer)
        if not done:
            raise Failed(value)
        return value

    def stop(self) -> None:
        """Kill the process, and start no other: from another thread than that which runs jobs, or at the very end."""
        with self._starting:
            self._stopped = True
            if self._process is not None:
                self._process.kill()  # who runs a job in it sees its end

    def close(self) -> None:
        """Let an idle process end by itself."""
        process = self._taken()
        if process is not None:
            _reap(process)

    def _end(self) -> None:
        process = self._taken()
        if process is not None:
            process.kill()
            _reap(process)

    def _taken(self) -> subprocess.Popen[bytes] | None:
        with self._starting:
            process, self._process = self._process, None
        return process

    def _started(self) -> subprocess.Popen[bytes]:
        with self._starting:
            if self._stopped:
                raise Died(STOPPED)
            if self._process is None:
                self._process = _process()
            return self._process

    def _answer(self, fd: int, limit_s: float | None) -> bytes:
        """Its answer to a job, after the empty one that says that the job begins."""
        try:
            told = _receive(fd, time.monotonic() + BEGINS_S)
        except TimeoutError:
            raise Died(f"its process did not begin within {BEGINS_S:g} s") from None
        if told:
            return told
        try:
            return _receive(fd, None if limit_s is None else time.monotonic() + limit_s)
        except TimeoutError:
            raise TookTooLong(f"not done within {limit_s:g} s") from None

    def _how_it_ended(self) -> str:
        process = self._taken()
        assert process is not None  # nobody else takes it while a job runs
        _reap(process)
        if self._stopped:
            return STOPPED
        status = process.returncode
        if status < 0:
            return f"its process was ended by {_signal(-status)}"
        return f"its process ended with status {status}"


def _process() -> subprocess.Popen[bytes]:
    """One that runs `work`: it finds modules where this one does, and in no other folder."""
    paths = os.pathsep.join(p or os.getcwd() for p in sys.path)
    # a session of its own: Ctrl-C at a terminal is for who started it
    return subprocess.Popen(
        [sys.executable, "-P", "-c", "from sim_ecu.campaign.child import work; work()", str(os.getpid())],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True,
        env=os.environ | ONE_THREAD | {"PYTHONPATH": paths},
    )  # fmt: skip


def _signal(number: int) -> str:
    """Its name; real-time signals have none."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


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


def _send(pipe: IO[bytes], data: bytes) -> None:
    pipe.write(LENGTH.pack(len(data)))
    pipe.write(data)
    pipe.flush()


def _receive(fd: int, ends: float | None) -> bytes:
    """A message. Raises TimeoutError at `ends` (monotonic), EOFError where there is no more."""
    (length,) = LENGTH.unpack(_exactly(fd, LENGTH.size, ends))
    return _exactly(fd, length, ends)


def _exactly(fd: int, count: int, ends: float | None) -> bytes:
    found = bytearray()
    waiting = select.poll()  # unlike select, of any descriptor
    waiting.register(fd, select.POLLIN)
    while len(found) < count:
        if not waiting.poll(None if ends is None else math.ceil(1e3 * max(ends - time.monotonic(), 0.0))):
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
            _send(answers, _answer(request, answers))
        except BrokenPipeError:
            return


def _answer(request: bytes, answers: IO[bytes]) -> bytes:
    try:
        function, argument = pickle.loads(request)
    except Exception as e:
        return pickle.dumps((False, _told(e)))
    _send(answers, b"")  # from now on it is the job that takes time
    try:
        return pickle.dumps((True, function(argument)), pickle.HIGHEST_PROTOCOL)
    except Exception as e:
        return pickle.dumps((False, _told(e)))


def _told(e: Exception) -> str:
    """An error that is written for a person stands for itself."""
    return str(e) if isinstance(e, InputError) else f"{type(e).__name__}: {e}"


def _ends_with(parent: int) -> None:
    """Whoever started this process may be killed: nothing goes on for nobody."""
    while os.getppid() == parent:
        time.sleep(ORPHAN_S)
    os._exit(1)
