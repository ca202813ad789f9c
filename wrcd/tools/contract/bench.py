"""Where a consumer is tested: on virtual time, or on a bus in real time. Times are whole microseconds."""

import time
from typing import Protocol

import can

from wrcd.bus.frame import Frame
from wrcd.bus.pythoncan import open_bus
from wrcd.errors import BusError
from wrcd.tools.contract.consumer import BusSettings, Consumer, ObjectConsumer, Use

POLL_US = 5_000
START_US = 1_700_000_000_000_000  # of virtual time
# After a change the consumer is not judged for so long. On a bus it may be late, and so may who reads its decisions: on
# a busy computer each of them by a tenth of a second.
VIRTUAL_GUARD_US, BUS_GUARD_US = 20_000, 250_000
PATIENCE_US, START_PATIENCE_US = 5_000_000, 30_000_000  # a process may take its time to start
LISTEN_S = 0.2  # for another sender, before anything is sent


class Bench(Protocol):
    """Sends frames, lets time pass and asks the consumer.

    strict: nothing is late but the consumer, and every moment outside the guard counts. patience_us: for so long may
    Valid frames come before the consumer uses one. fd: whether it sends CAN FD frames.
    """

    strict: bool
    fd: bool
    guard_us: int
    patience_us: int

    def start(self) -> None:
        """Before each check."""

    def now_us(self) -> int:
        """The time."""

    def wait(self, until_us: int) -> None:
        """Let time pass."""

    def send(self, frame: Frame) -> None:
        """Send a frame now."""

    def use(self, axle: int) -> Use:
        """What the consumer uses now."""


class VirtualBench:
    """A Python object on virtual time: nothing waits, nothing is late. A new object for every check."""

    strict = fd = True
    guard_us = VIRTUAL_GUARD_US
    patience_us = PATIENCE_US

    def __init__(self, consumer: ObjectConsumer, settings: BusSettings) -> None:
        self._consumer, self._settings = consumer, settings
        self._now_us = START_US

    def start(self) -> None:
        """Make a new object."""
        self._consumer.stop()
        self._consumer.start(self._settings)

    def now_us(self) -> int:
        """Virtual time."""
        return self._now_us

    def wait(self, until_us: int) -> None:
        """Move virtual time on."""
        self._now_us = max(self._now_us, until_us)

    def send(self, frame: Frame) -> None:
        """Hand a frame over."""
        frame.stamp_us = self._now_us
        self._consumer.hear(frame)

    def use(self, axle: int) -> Use:
        """Ask the object."""
        return self._consumer.use_at(axle, self._now_us)

    def close(self) -> None:
        """Let go of the object."""
        self._consumer.stop()


class BusBench:
    """A consumer that reads a bus, in real time. It is started once: in each check it knows what it heard before."""

    strict = fd = False
    guard_us = BUS_GUARD_US
    patience_us = START_PATIENCE_US

    def __init__(self, consumer: Consumer, settings: BusSettings, silent: tuple[int, ...]) -> None:
        """Open the bus and start the consumer. Raises BusError: also where somebody else sends one of the messages
        (silent: their Frame.key)."""
        self._consumer, self._settings = consumer, settings
        self._bus = open_bus(settings.interface, settings.channel, user_settings=True)
        try:
            self._refuse_company(silent)
            consumer.start(settings)
        except BaseException:
            self._bus.shutdown()
            raise

    def _refuse_company(self, silent: tuple[int, ...]) -> None:
        end = time.monotonic() + LISTEN_S
        while (left := end - time.monotonic()) > 0:
            heard = self._bus.recv(left)
            if heard is None or heard.is_error_frame:
                continue
            key = Frame(0, heard.arbitration_id, b"", heard.is_extended_id).key
            if key in silent:
                where = f"{self._settings.interface}:{self._settings.channel}"
                raise BusError(
                    f"{where}: somebody else sends 0x{heard.arbitration_id:X}, which the test plays",
                    hint="end wrcd, or test on a bus of its own",
                )

    def start(self) -> None:
        """The consumer goes on."""

    def now_us(self) -> int:
        """A clock that no one sets."""
        return time.monotonic_ns() // 1000

    def wait(self, until_us: int) -> None:
        """Sleep."""
        time.sleep(max(0.0, 1e-6 * (until_us - self.now_us())))

    def send(self, frame: Frame) -> None:
        """Send a frame. Raises BusError if the bus does not take it."""
        message = can.Message(
            arbitration_id=frame.can_id,
            data=None if frame.remote else frame.data,
            is_extended_id=frame.extended,
            is_remote_frame=frame.remote,
            dlc=frame.extra if frame.remote else len(frame.data),
        )
        try:
            self._bus.send(message, timeout=1.0)
        except (can.CanError, OSError) as e:
            where = f"{self._settings.interface}:{self._settings.channel}"
            raise BusError(
                f"{where} takes no frame: {e}", hint="is it up, and does another node acknowledge?"
            ) from None

    def use(self, axle: int) -> Use:
        """Ask the consumer."""
        return self._consumer.use(axle)

    def close(self) -> None:
        """End the consumer and let go of the bus."""
        try:
            self._consumer.stop()
        finally:
            self._bus.shutdown()
