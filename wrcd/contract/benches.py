"""Where a consumer is tested: on virtual time, or on a bus in real time. Times are whole microseconds.

strict: nothing is late but the consumer, and every moment outside the guard counts. fd: whether CAN FD is sent.
guard_us: after a change the consumer is not judged for so long. patience_us: for so long may Valid frames come before
the consumer uses one.
"""

import time

import can

from wrcd.bus.frame import Frame
from wrcd.bus.pythoncan import open_bus
from wrcd.contract.consumers import BusSettings, Consumer, ObjectConsumer, Use
from wrcd.errors import BusError

POLL_US = 5_000
START_US = 1_700_000_000_000_000  # of virtual time
PATIENCE_US = 5_000_000
LISTEN_S = 0.2  # for another sender, before anything is sent


class VirtualBench:
    """A Python object on virtual time: nothing waits, nothing is late."""

    strict = fd = True
    guard_us, patience_us = 20_000, PATIENCE_US

    def __init__(self, consumer: ObjectConsumer) -> None:
        self._make, self._now_us = consumer.make, START_US
        self.start()

    def start(self) -> None:
        """Make a new object: every check has its own."""
        self._object = self._make()

    def now_us(self) -> int:
        """Return virtual time."""
        return self._now_us

    def wait(self, until_us: int) -> None:
        """Move virtual time on."""
        self._now_us = max(self._now_us, until_us)

    def send(self, frame: Frame) -> None:
        """Hand a frame over."""
        frame.stamp_us = self._now_us
        self._object.hear(frame)

    def use(self, axle: int) -> Use:
        """Return what the object uses of an axle."""
        return self._object.use(axle, self._now_us)

    def close(self) -> None:
        """There is nothing to let go of."""


class BusBench:
    """A consumer that reads a bus, in real time. It is started once: in each check it knows what came before.

    It may be late, and so may who reads its decisions: on a busy computer each of them by a tenth of a second.
    """

    strict = fd = False
    guard_us, patience_us = 250_000, 30_000_000  # a process may take its time to start

    def __init__(self, consumer: Consumer, settings: BusSettings, silent: tuple[int, ...]) -> None:
        """Open the bus and start the consumer. Raises BusError: also where somebody else sends one of the messages
        (silent: their Frame.key)."""
        self._consumer, self._place = consumer, f"{settings.interface}:{settings.channel}"
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
            got = self._bus.recv(left)
            if got is None or got.is_error_frame:
                continue
            if Frame(0, got.arbitration_id, b"", got.is_extended_id).key in silent:
                raise BusError(
                    f"{self._place}: somebody else sends 0x{got.arbitration_id:X}, which the test plays",
                    hint="end wrcd, or test on a bus of its own",
                )

    def start(self) -> None:
        """The consumer goes on."""

    def now_us(self) -> int:
        """Return the time of a clock that no one sets."""
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
            hint = "is it up, and does another node acknowledge?"
            raise BusError(f"{self._place} takes no frame: {e}", hint=hint) from None

    def use(self, axle: int) -> Use:
        """Return what the consumer uses of an axle."""
        return self._consumer.use(axle)

    def close(self) -> None:
        """End the consumer and let go of the bus."""
        try:
            self._consumer.stop()
        finally:
            self._bus.shutdown()


Bench = VirtualBench | BusBench
