"""Checks in real time, on python-can's virtual bus."""

import threading
import time
from collections.abc import Iterator

import can
import pytest

from tests.support.contract import example, judged
from wrcd.bus.pythoncan import from_message
from wrcd.contract import BusSettings, Hearing, Use
from wrcd.contract.benches import BusBench
from wrcd.core.configuration import Config
from wrcd.errors import BusError

QUICK = {"degraded-falls-back", "wrong-crc-is-dropped", "remote-frame-is-dropped", "silence-falls-back"}
SETTINGS = BusSettings("virtual", "contract", None, (1,))


class Listening:
    """A consumer of one's own: it reads the bus in a thread, a tenth of a second late now and then."""

    def __init__(self, consumer: Hearing, pause_s: float = 0.0) -> None:
        self._consumer, self._pause_s = consumer, pause_s
        self._limit: float | None = None
        self._ends = threading.Event()

    def start(self, bus: BusSettings) -> None:
        self._bus = can.Bus(interface=bus.interface, channel=bus.channel)
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def _listen(self) -> None:
        paused = time.monotonic()
        while not self._ends.is_set():
            message = self._bus.recv(0.01)
            if message is not None:  # stamped when it was sent: by its own clock a late reader would begin anew
                self._consumer.hear(from_message(message, round(message.timestamp * 1e6)))
            self._limit = self._consumer.use(1, time.time_ns() // 1000).limit_pct
            if self._pause_s and time.monotonic() - paused > 0.35:
                time.sleep(self._pause_s)
                paused = time.monotonic()

    def use(self, axle: int) -> Use:
        return Use(self._limit, axle)

    def stop(self) -> None:
        self._ends.set()
        self._thread.join(5)
        self._bus.shutdown()


def bench(consumer: Listening) -> BusBench:
    return BusBench(consumer, SETTINGS, (0x091,))


def test_careless_consumer_is_found_in_real_time(config: Config) -> None:
    on_bus = bench(Listening(example("careless_consumer").Careless()))
    broken, _ = judged(on_bus, config, QUICK)
    on_bus.close()
    assert set(broken) == QUICK - {"remote-frame-is-dropped"}


def test_careful_consumer_that_is_late_by_a_tenth_of_a_second_passes(config: Config) -> None:
    on_bus = bench(Listening(example("careful_consumer").Careful(), pause_s=0.1))
    broken, _ = judged(on_bus, config, QUICK | {"repeated-counter-is-dropped", "lost-frames-are-no-fault"})
    on_bus.close()
    assert broken == {}


@pytest.fixture
def daemon() -> Iterator[None]:
    """Somebody else who sends Adhesion_A1."""
    ends = threading.Event()

    def send() -> None:
        with can.Bus(interface="virtual", channel="contract") as bus:
            while not ends.wait(0.02):
                bus.send(can.Message(arbitration_id=0x091, data=bytes(8), is_extended_id=False))

    thread = threading.Thread(target=send, daemon=True)
    thread.start()
    yield
    ends.set()
    thread.join(5)


@pytest.mark.usefixtures("daemon")
def test_bus_with_another_sender_is_refused() -> None:
    with pytest.raises(BusError, match=r"virtual:contract: .*0x91"):
        bench(Listening(example("careless_consumer").Careless()))
