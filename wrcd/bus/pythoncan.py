"""Every other interface, through python-can."""

from collections import deque
from typing import Any

import can

from wrcd.bus import opening_hints
from wrcd.bus.frame import GROUP, Frame, mask_of
from wrcd.bus.link import MAX_FRAMES, Link, LinkHealth
from wrcd.errors import BusError

# A stamp further than this from the wall clock is in the interface's own time: the time of reception replaces it.
FOREIGN_CLOCK_US = 100_000
# Interfaces that hand back what was sent here, like a frame of somebody else's; and how many may be on their way.
ECHOING, MAX_ECHOES = {"udp_multicast"}, 256


def from_message(m: can.Message, stamp_us: int) -> Frame:
    """python-can's message as a frame."""
    extra = m.bitrate_switch | m.error_state_indicator << 1 if m.is_fd else m.dlc if m.is_remote_frame else 0
    return Frame(
        stamp_us, m.arbitration_id, bytes(m.data), m.is_extended_id, m.is_remote_frame, m.is_error_frame, m.is_fd, extra
    )


def open_bus(interface: str, channel: str, *, user_settings: bool = False, **options: Any) -> can.BusABC:
    """A bus by python-can's names.

    user_settings: for a tool: CAN_CONFIG, CAN_BITRATE, ~/.canrc and the like add what is not given here. To the daemon
    they say nothing: what it opens is its configuration's alone.
    Raises InputError for an interface that python-can does not know, BusError for one that cannot be opened.
    """
    opening_hints.check_interface(interface, can.VALID_INTERFACES)
    try:
        # python-can makes a number of a channel that is one where it reads settings: its drivers count on it
        number = int(channel) if channel.isdecimal() else channel
        return can.Bus(interface=interface, channel=number, ignore_config=not user_settings, **options)
    except (can.CanError, OSError, ValueError, ImportError, NotImplementedError, AttributeError, TypeError) as e:
        reason = e.strerror if isinstance(e, OSError) and e.strerror else e
        hint = opening_hints.for_python_can(interface, channel, e, user_settings)
        raise BusError(f"{interface}:{channel} cannot be opened: {reason}", key="channel", hint=hint) from None


class PythonCanLink(Link):
    """A python-can bus, read without its threads.

    Its messages are chosen here: where python-can filters by itself, a frame of another id ends a look that does not
    wait, and each look takes one such frame. Some hundred of them a second would keep the sensors' waiting for ever.
    """

    def __init__(
        self,
        interface: str,
        channel: str,
        keys: tuple[int, ...] | None,
        *,
        user_settings: bool = False,
        **options: Any,
    ) -> None:
        self.name = f"{interface}:{channel}"
        self.health = LinkHealth()
        self._keys = None if keys is None else frozenset(keys)
        self._groups = [key for key in keys or () if key & GROUP]
        self._own: set[int] = set()  # keys of the frames sent here
        self._echoes = deque[tuple[int, bytes]](maxlen=MAX_ECHOES if interface in ECHOING else 0)
        self._bus = open_bus(interface, channel, user_settings=user_settings, **options)

    def receive(self, now_us: int) -> list[Frame]:
        """What is there, MAX_FRAMES at the most, those of other ids and error frames among them."""
        frames = []
        for _ in range(MAX_FRAMES):
            message = self._get()
            if message is None:
                break
            if message.is_error_frame:
                self.health.error_frames += 1
                continue
            stamp_us = round(message.timestamp * 1e6)
            frame = from_message(message, stamp_us if abs(stamp_us - now_us) <= FOREIGN_CLOCK_US else now_us)
            if frame.key in self._own and not frame.remote:
                if not message.is_rx or self._is_echo(frame):  # our own, come back
                    continue
                self.health.foreign(frame.key)
            elif self._keys is not None and frame.key not in self._keys and not self._is_of_group(frame.key):
                continue
            frames.append(frame)
        return frames

    def _is_of_group(self, key: int) -> bool:
        return any(not (key ^ group) & mask_of(group) for group in self._groups)

    def _is_echo(self, frame: Frame) -> bool:
        if (sent := (frame.key, frame.data)) not in self._echoes:
            return False
        self._echoes.remove(sent)
        return True

    def _get(self) -> can.Message | None:
        try:
            message = self._bus.recv(0.0)
        except (can.CanError, OSError):
            self.health.state = "Down"
            return None
        if message is not None:
            self.health.state = "Up"
        return message

    def send(self, frame: Frame) -> bool:
        """Send at once or drop and count."""
        message = can.Message(arbitration_id=frame.can_id, data=frame.data, is_extended_id=frame.extended, is_rx=False)
        try:
            self._bus.send(message, timeout=0)
        except (can.CanError, OSError):
            self.health.unsent += 1
            return False
        self._own.add(frame.key)
        self._echoes.append((frame.key, frame.data))
        return True

    def close(self) -> None:
        """Let go of the bus."""
        self._bus.shutdown()
