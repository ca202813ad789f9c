"""A controller's own clock, laid on the kernel's."""

import random
import socket
import struct

import pytest

from wrcd.bus.controller import Controller
from wrcd.bus.hardwareclock import HardwareClock
from wrcd.bus.link import LinkHealth
from wrcd.bus.rawcan import SO_TIMESTAMPING, SO_TIMESTAMPNS
from wrcd.bus.socketcan import SocketCanLink

START = 1_700_000_000_000_000


@pytest.mark.parametrize("ppm", [-50, 0, 50])
def test_late_kernel_stamps_are_mended_and_drift_is_followed(ppm: int) -> None:
    """The kernel is late by up to 3 ms, exponentially; the controller's clock counts from its own start and drifts."""
    rng, clock = random.Random(3), HardwareClock()
    worst = 0
    for k in range(12_000):  # a minute at 200 Hz
        true_us = START + 5000 * k
        kernel_us = true_us + min(int(rng.expovariate(1 / 300)), 3000)
        raw_us = 777 + int(5000 * k * (1 + ppm * 1e-6))
        stamp = clock.to_kernel_time(raw_us, kernel_us)
        assert stamp <= kernel_us
        if k > 200:
            worst = max(worst, abs(stamp - true_us))
    assert worst <= 1200


def test_a_clock_that_steps_is_taken_up_at_once() -> None:
    clock = HardwareClock()
    for k in range(100):
        clock.to_kernel_time(5000 * k, START + 5000 * k)
    assert clock.to_kernel_time(10, START + 2_500_100) == START + 2_500_100  # the controller's
    assert clock.to_kernel_time(5010, START + 3_602_505_100) == START + 3_602_505_100  # the kernel's


@pytest.mark.parametrize("step_us", [20_000, 400_000, 900_000])
def test_a_small_step_forwards_is_taken_up_within_a_second(step_us: int) -> None:
    clock = HardwareClock()
    stamps = [clock.to_kernel_time(5000 * k, START + 5000 * k + (step_us if k >= 500 else 0)) for k in range(700)]
    assert stamps[499] == START + 5000 * 499
    assert stamps[600] == START + 5000 * 600 + step_us


def stamps(*times: float) -> bytes:
    return b"".join(struct.pack("@ll", int(t), round(t % 1 * 1e9)) for t in times)


def test_what_the_kernel_sends_along() -> None:
    link = SocketCanLink.__new__(SocketCanLink)
    link._hardware, link._dropped_before = None, 0
    data = struct.pack("=IB3x8s", 0x101, 1, b"\x07")
    link._down, link._controller = False, Controller(LinkHealth())
    assert link._take(data, [(socket.SOL_SOCKET, SO_TIMESTAMPNS, stamps(12.25))], 5).stamp_us == 12_250_000
    assert link._take(data, [(99, SO_TIMESTAMPNS, stamps(12.25))], 5).stamp_us == 5
    three = [(socket.SOL_SOCKET, SO_TIMESTAMPING, stamps(100.0, 0.0, 7.5))]
    assert link._take(data, three, 5).stamp_us == 100_000_000
    link._hardware = HardwareClock()
    assert link._take(data, three, 5).stamp_us == 100_000_000
    late = [(socket.SOL_SOCKET, SO_TIMESTAMPING, stamps(100.0075, 0.0, 7.505))]
    assert link._take(data, late, 5).stamp_us == 100_005_000
    none = [(socket.SOL_SOCKET, SO_TIMESTAMPING, stamps(100.5, 0.0, 0.0))]
    assert link._take(data, none, 5).stamp_us == 100_500_000
