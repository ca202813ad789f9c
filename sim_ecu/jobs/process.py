"""A process that works on one job after another, and can be ended in the middle of one.

It is started as a command of its own, not forked: a thread of any program may own one, a Dask worker's too, whose
processes may have no children of the kind that Python's own pools make.
"""

import contextlib
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any

from sim_ecu.jobs.job import Ending
from wrcd.errors import InputError

STOPPED = "it was stopped"
ORPHAN_S = 0.5  # how often it looks whether who started it is still there
ENDS_S = 5.0  # after its pipe ended, before it is killed
BEGINS_S = 600.0  # from handing a job out to its begin: a process that is new imports what the job needs
# Threads of the linear algebra would wait for each other: there is a process for each core.
ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")


class NotDone(Exception):
    """The job was not done: TOO_LONG, and the process was ended; DIED, it ended by itself or was killed; or FAILED, the
    job raised an error: its text, after its class where it is none that is written for a person."""

    def __init__(self, ending: Ending, text: str) -> None:
        super().__init__(text)
        self.ending = ending


class Process:
    """A process. `run` one job at a time; after TOO_LONG or DIED the next `run` starts another one.

    One thread runs jobs; another one may only `stop` it. What a job writes stands where our standard error does.
    """

    def __init__(self) -> None:
        self._running: _Running | None = None
        self._stopped = False
        self._starting = threading.Lock()  # none is started that nobody stops

    @property
    def pid(self) -> int | None:
        """The process's id; None before the first job and after it ended."""
        return None if self._running is None else self._running.process.pid

    def run(self, function: Callable[[Any], Any], argument: Any, limit_s: float | None = None) -> Any:
        """Return what function(argument) returns there. Both are pickled. Raises NotDone.

        limit_s: of wall time, from the call of the function on, which is imported by then.
        """
        request = pickle.dumps((function, argument), pickle.HIGHEST_PROTOCOL)
        running = self._started()
        try:
            running.pipe.send_bytes(request)
            answer = _answer_of(running.pipe, limit_s)
        except (EOFError, BrokenPipeError, ConnectionResetError):
            raise NotDone(Ending.DIED, self._how_it_ended()) from None
        except BaseException:
            self._end()  # too late, or the pipe is in an unknown state: what it works on is nobody's any more
            raise
        done, value = pickle.loads(answer)
        if not done:
            raise NotDone(Ending.FAILED, value)
        return value

    def stop(self) -> None:
        """Kill the process, and start no other: from another thread than that which runs jobs, or at the very end."""
        with self._starting:
            self._stopped = True
            if self._running is not None:
                self._running.process.kill()  # who runs a job in it sees its end

    def close(self) -> None:
        """Let an idle process end by itself."""
        running = self._taken()
        if running is not None:
            running.reap()

    def _end(self) -> None:
        running = self._taken()
        if running is not None:
            running.process.kill()
            running.reap()

    def _taken(self) -> "_Running | None":
        with self._starting:
            running, self._running = self._running, None
        return running

    def _started(self) -> "_Running":
        with self._starting:
            if self._stopped:
                raise NotDone(Ending.DIED, STOPPED)
            if self._running is None:
                self._running = _process()
            return self._running

    def _how_it_ended(self) -> str:
        running = self._taken()
        assert running is not None  # nobody else takes it while a job runs
        running.reap()
        if self._stopped:
            return STOPPED
        status = running.process.returncode
        if status < 0:
            return f"its process was ended by {_signal(-status)}"
        return f"its process ended with status {status}"


@dataclass(frozen=True, slots=True)
class _Running:
    """A process, and our end of the pipe to it."""

    process: subprocess.Popen[bytes]
    pipe: "Connection[bytes, bytes]"

    def reap(self) -> None:
        """Wait for its end, which follows that of its pipe."""
        self.pipe.close()
        try:
            self.process.wait(ENDS_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def _answer_of(pipe: "Connection[bytes, bytes]", limit_s: float | None) -> bytes:
    """Return the process's answer to a job, after the empty one with which the job begins."""
    if not pipe.poll(BEGINS_S):
        raise NotDone(Ending.DIED, f"its process did not begin within {BEGINS_S:g} s")
    if answer := pipe.recv_bytes():
        return answer
    if not pipe.poll(limit_s):
        raise NotDone(Ending.TOO_LONG, f"not done within {limit_s:g} s")
    return pipe.recv_bytes()


def _process() -> _Running:
    """One that runs `work`: it finds modules where this one does, and in no other folder."""
    paths = os.pathsep.join(p or os.getcwd() for p in sys.path)
    ours, its = Pipe()
    # a session of its own: Ctrl-C at a terminal is for who started it; what it prints is no answer
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", "from sim_ecu.jobs.process import work; work()", str(os.getpid()),
         str(its.fileno())],
        stdin=subprocess.DEVNULL, stdout=2, start_new_session=True, pass_fds=[its.fileno()],
        env=os.environ | ONE_THREAD | {"PYTHONPATH": paths},
    )  # fmt: skip
    its.close()
    return _Running(process, ours)


def _signal(number: int) -> str:
    """Its name; real-time signals have none."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def work() -> None:
    """Run jobs that come by the pipe, in the process: the parent's id and the pipe's number are its arguments."""
    parent, fd = map(int, sys.argv[1:])
    threading.Thread(target=_ends_with, args=(parent,), daemon=True).start()
    os.set_inheritable(fd, False)  # what a job starts must not hold it open
    pipe: Connection[bytes, bytes] = Connection(fd)
    with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError):
        while True:
            pipe.send_bytes(_answer(pipe.recv_bytes(), pipe))


def _answer(request: bytes, pipe: "Connection[bytes, bytes]") -> bytes:
    try:
        function, argument = pickle.loads(request)
    except Exception as e:
        return pickle.dumps((False, _error_text(e)))
    pipe.send_bytes(b"")  # from now on it is the job that takes time
    try:
        return pickle.dumps((True, function(argument)), pickle.HIGHEST_PROTOCOL)
    except Exception as e:
        return pickle.dumps((False, _error_text(e)))


def _error_text(e: Exception) -> str:
    """An error that is written for a person stands for itself."""
    return str(e) if isinstance(e, InputError) else f"{type(e).__name__}: {e}"


def _ends_with(parent: int) -> None:
    """Whoever started this process may be killed: nothing goes on for nobody."""
    while os.getppid() == parent:
        time.sleep(ORPHAN_S)
    os._exit(1)
