"""Keeping the daemon's memory in RAM: a page that has to come from disk is a tick that comes late."""

import ctypes
import os

MCL_CURRENT, MCL_FUTURE = 1, 2  # <sys/mman.h>


def lock() -> str:
    """Lock all pages there are and all to come. Returns why that failed, or nothing."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(MCL_CURRENT | MCL_FUTURE) == 0:
        return ""
    return os.strerror(ctypes.get_errno())
