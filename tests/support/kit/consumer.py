"""The receiver of a kit as a consumer under the contract's test: KIT_LIBRARY is adhesion.c as a shared library.

What stays the controller's is here: a rise is followed after two seconds, and a limit that is too wide changes nothing.
"""

import ctypes
import os
from collections import deque

from wrcd.tools.contract import Frame, Use

RISE_US, RECEIVER_BYTES = 2_000_000, 1 << 16


class _Use(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_int) for name in ("state", "reason", "limit")),
        *(
            (name, ctypes.c_uint16)
            for name in ("mu_available", "half_width", "lower_end", "mu_used", "mu_shown", "sample_age_ms")
        ),
        *((name, ctypes.c_int) for name in ("surface", "contact")),
    )


class Receiver:
    """All axles."""

    def __init__(self) -> None:
        self._library = ctypes.CDLL(os.environ["KIT_LIBRARY"])
        self._library.adhesion_poll.restype = _Use
        self._library.adhesion_is_accepted.restype = ctypes.c_bool
        self._receiver = ctypes.create_string_buffer(RECEIVER_BYTES)
        self._library.adhesion_init(self._receiver, None)
        self._lower: dict[int, deque[tuple[int, int]]] = {}

    def hear(self, frame: Frame) -> None:
        """Take a frame of the bus."""
        flags = frame.extended | frame.fd << 1 | frame.remote << 2 | frame.error << 3
        self._library.adhesion_feed(
            self._receiver, ctypes.c_uint32(frame.can_id), ctypes.c_uint8(flags), ctypes.c_uint8(len(frame.data)),
            frame.data, ctypes.c_uint64(frame.stamp_us),
        )  # fmt: skip
        axle = self._library.adhesion_axle_of(ctypes.c_uint32(frame.can_id), ctypes.c_uint8(flags))
        use = self._poll(axle, frame.stamp_us)
        if use.state and use.limit:
            lower = self._lower.setdefault(axle, deque())
            lower.append((frame.stamp_us, use.lower_end))
            while lower[0][0] < frame.stamp_us - RISE_US:
                lower.popleft()

    def use(self, axle: int, now_us: int) -> Use:
        """What is used of an axle now."""
        lower = self._lower.get(axle)
        if not self._poll(axle, now_us).state or not lower:
            return Use(None, axle)
        return Use(min(value for _, value in lower) / 100, axle)

    def _poll(self, axle: int, now_us: int) -> _Use:
        use = self._library.adhesion_poll(self._receiver, ctypes.c_uint8(axle), ctypes.c_uint64(now_us))
        assert isinstance(use, _Use)
        return use
