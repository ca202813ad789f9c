"""`wrcd reload PID`: sends SIGHUP to a daemon and receives what came of it, which a signal alone does not give.

The daemon answers every reload with one datagram to a socket that is named after its process id. Nobody listens there
but for the moment of a reload.
"""

import contextlib
import os
import signal
import socket
import struct
from pathlib import Path

from wrcd.errors import InputError, Status

ANSWER_S = 10.0  # the daemon looks for signals once a tick, and reads a file then
MAX_BYTES = 1 << 16
_CREDENTIALS = struct.Struct("=iII")  # struct ucred: process, user, group


class Unanswered(InputError):
    """The daemon did not answer, or took nothing over."""

    status = Status.STOPPED


def _address(pid: int) -> str:
    """Of the abstract namespace: no file is left behind."""
    return f"\0wrcd-reload-{pid}"


def answer(took: bool, line: str) -> None:
    """Tell whoever asked this process; usually nobody did."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as s, contextlib.suppress(OSError):
        s.setblocking(False)
        s.sendto(f"{int(took)} {line}".encode()[:MAX_BYTES], _address(os.getpid()))


def ask(pid: int, seconds: float = ANSWER_S) -> str:
    """Have a daemon read its configuration again; return its line on what it took over.

    Raises InputError for a process that is no daemon with a configuration to read again, Unanswered when nothing was
    taken over.
    """
    _check(pid)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as s:
        s.setsockopt(socket.SOL_SOCKET, socket.SO_PASSCRED, 1)
        s.settimeout(seconds)
        try:
            s.bind(_address(pid))
        except OSError:
            raise Unanswered("is being asked already", key=f"process {pid}", hint="try again") from None
        os.kill(pid, signal.SIGHUP)
        while True:
            try:
                data, extra, _, _ = s.recvmsg(MAX_BYTES, socket.CMSG_SPACE(_CREDENTIALS.size))
            except TimeoutError:
                raise Unanswered(
                    f"did not answer within {seconds:g} s", key=f"process {pid}", hint="see its log: does it run?"
                ) from None
            if any(_CREDENTIALS.unpack_from(value)[0] == pid for _, _, value in extra):
                break
    took, _, line = data.decode().partition(" ")
    if took != "1":
        raise Unanswered(line)
    return line


def _check(pid: int) -> None:
    """SIGHUP ends most processes: only a `wrcd run` that is no terminal's is asked. Raises InputError.

    In the unit's sandbox nothing of the daemon but its number can be seen: there systemd has confirmed it.
    """
    try:
        if pid < 1:
            raise ProcessLookupError
        os.kill(pid, 0)
        words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
    except ProcessLookupError:
        raise InputError("is not there", key=f"process {pid}", hint="see systemctl show -p MainPID") from None
    except PermissionError:
        raise InputError("is another user's", key=f"process {pid}", hint="ask as its user, or as root") from None
    except OSError:
        return
    if b"run" not in words or not any(b"wrcd" in w for w in words):
        raise InputError("is no `wrcd run`", key=f"process {pid}", hint="see systemctl show -p MainPID")
    with contextlib.suppress(OSError):
        if os.readlink(f"/proc/{pid}/fd/0").startswith(("/dev/pts/", "/dev/tty")):
            raise InputError("runs on a terminal: SIGHUP would end it", key=f"process {pid}", hint="start it anew")
