"""A controller's own clock, laid on the kernel's."""

import ctypes
import random
import socket
import struct

import pytest

from tests.support.can_socket import control_of
from wrcd.bus import rawcan
from wrcd.bus.rawcan import SO_RXQ_OVFL, SO_TIMESTAMPING, SO_TIMESTAMPNS
from wrcd.native import library

START = 1_700_000_000_000_000


class HardwareClock(rawcan.HardwareClock):
    """Asked for one stamp after another."""

    def to_kernel_time(self, raw_us: int, kernel_us: int) -> int:
        to_kernel_time = library()["wrcd_to_kernel_time"]
        to_kernel_time.restype = ctypes.c_int64
        return int(to_kernel_time(ctypes.byref(self), ctypes.c_int64(raw_us), ctypes.c_int64(kernel_us)))


def beside(now_us: int, *of: tuple[int, int, bytes]) -> tuple[int, ...]:
    """The kernel's stamp, the controller's and the frames lost, of what recvmsg gives beside a frame."""
    control = control_of(*of)
    found = (ctypes.c_int64 * 3)(now_us)
    library()["wrcd_look_beside"](control, ctypes.c_size_t(len(control)), found)
    return tuple(found)


@pytest.mark.parametrize("ppm", [-50, 0, 50])
def test_late_kernel_stamps_are_corrected_under_drift(ppm: int) -> None:
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


def test_large_clock_step_is_followed_at_once() -> None:
    clock = HardwareClock()
    for k in range(100):
        clock.to_kernel_time(5000 * k, START + 5000 * k)
    assert clock.to_kernel_time(10, START + 2_500_100) == START + 2_500_100  # the controller's
    assert clock.to_kernel_time(5010, START + 3_602_505_100) == START + 3_602_505_100  # the kernel's


@pytest.mark.parametrize("step_us", [20_000, 400_000, 900_000])
def test_small_forward_step_is_followed_within_a_second(step_us: int) -> None:
    clock = HardwareClock()
    stamps = [clock.to_kernel_time(5000 * k, START + 5000 * k + (step_us if k >= 500 else 0)) for k in range(700)]
    assert stamps[499] == START + 5000 * 499
    assert stamps[600] == START + 5000 * 600 + step_us


def stamps(*times: float) -> bytes:
    return b"".join(struct.pack("@ll", int(t), round(t % 1 * 1e9)) for t in times)


def test_ancillary_data_give_kernel_stamp_controller_stamp_and_losses() -> None:
    kernel = (socket.SOL_SOCKET, SO_TIMESTAMPNS, stamps(12.25))
    both = (socket.SOL_SOCKET, SO_TIMESTAMPING, stamps(100.0, 0.0, 7.5))
    kernel_alone = (socket.SOL_SOCKET, SO_TIMESTAMPING, stamps(100.5, 0.0, 0.0))
    lost = (socket.SOL_SOCKET, SO_RXQ_OVFL, struct.pack("=I", 0xFFFFFFFF))
    assert beside(5) == (5, 0, 0)
    assert beside(5, kernel) == (12_250_000, 0, 0)
    assert beside(5, (99, SO_TIMESTAMPNS, stamps(12.25))) == (5, 0, 0)  # of another level
    assert beside(5, both) == (100_000_000, 7_500_000, 0)
    assert beside(5, kernel_alone) == (100_500_000, 0, 0)
    assert beside(5, lost, kernel) == (12_250_000, 0, 0xFFFFFFFF)


def test_controller_stamp_is_mapped_to_kernel_time() -> None:
    clock = HardwareClock()
    assert clock.to_kernel_time(7_500_000, 100_000_000) == 100_000_000
    assert clock.to_kernel_time(7_505_000, 100_007_500) == 100_005_000  # the kernel was late by 2.5 ms


def test_frame_without_a_controller_stamp_keeps_the_kernel_stamp() -> None:
    clock = HardwareClock()
    clock.to_kernel_time(7_500_000, 100_000_000)
    assert clock.to_kernel_time(0, 100_500_000) == 100_500_000
    assert clock.to_kernel_time(8_005_000, 100_507_500) == 100_505_000  # and leaves the offset as it was
