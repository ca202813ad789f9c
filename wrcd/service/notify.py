"""What the daemon asks of the system: memory that stays in RAM, and systemd's READY, WATCHDOG, STOPPING."""

import ctypes
import os
import socket


class Notifier:
    """Says nothing where there is no systemd to listen (NOTIFY_SOCKET not set)."""

    def __init__(self, environment: dict[str, str] | None = None) -> None:
        env = os.environ if environment is None else environment
        path = env.get("NOTIFY_SOCKET", "")
        self._socket: socket.socket | None = None
        if path:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
            self._socket.setblocking(False)
            self._address = "\0" + path[1:] if path.startswith("@") else path
        microseconds = env.get("WATCHDOG_USEC", "")
        # half the time-out, as systemd recommends
        self.watchdog_every_us = int(microseconds) // 2 if microseconds.isdigit() else None

    def notify(self, state: str) -> None:
        """Send e.g. READY=1. A systemd that does not listen is not the daemon's problem."""
        if self._socket is not None:
            try:
                self._socket.sendto(state.encode(), self._address)
            except OSError:
                pass

    def close(self) -> None:
        """Let go of the socket."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None


MCL_CURRENT, MCL_FUTURE = 1, 2  # <sys/mman.h>


def lock() -> str:
    """Lock all pages there are and all to come. Returns why that failed, or nothing."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(MCL_CURRENT | MCL_FUTURE) == 0:
        return ""
    return os.strerror(ctypes.get_errno())
