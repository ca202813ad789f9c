"""Good frames of all curves that loop without a break, and what goes wrong with frames."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from sim_ecu.play.player import Player
from sim_ecu.play.scenario import read_scenario
from wrcd.bus.e2e import COUNTER_MODULO, protect
from wrcd.config.settings import parse_toml

TICK_US = 5_000
# Counters count to 15 and the slowest message comes every 20 ms: a loop of a multiple of 300 ms ends where it begins.
LOOP_US = 24_000_000
assert LOOP_US % (COUNTER_MODULO * 20_000) == 0
CURVES = "ABCDEF"
METRES_ON_EACH = 90

Frames = list[tuple[int, int, bytes]]  # microseconds after the tick's beginning, id, data


def pool() -> list[Frames]:
    """The frames of every tick of a loop: four axles, each over all curves in another order, at changing speed."""
    axles = "".join(
        f"[axle.{a + 1}]\nrail = [{_rail(CURVES[a:] + CURVES[:a])}]\n"
        f"drive = {{ utilisation = [[0, 0.5], [{4 + a}, {0.3 + 0.2 * a}], [20, 0.95], [24, 0.5]] }}\n"
        for a in range(4)
    )
    text = (
        f"duration_s = {LOOP_US / 1e6}\naxles = [1, 2, 3, 4]\nspeed_m_s = [[0, 20], [12, 26], [24, 20]]\n"
        f'rail = [{{ curve = "A" }}]\ndrive = {{ utilisation = 0.5 }}\n{axles}'
    )
    out: list[Frames] = [[] for _ in range(LOOP_US // TICK_US)]
    for _, sent in Player(read_scenario(parse_toml(text, "soak"), "soak"), truth=False):
        for f in sent:
            tick, offset_us = divmod(f.due_us, TICK_US)
            out[tick % len(out)].append((offset_us, f.can_id, f.data))
    return out


def _rail(order: str) -> str:
    return ", ".join(f'{{ curve = "{c}", from_m = {k * METRES_ON_EACH} }}' for k, c in enumerate(order))


Change = Callable[[np.random.Generator, int, bytes], list[bytes]]


def _lost(_rng: np.random.Generator, _can_id: int, _data: bytes) -> list[bytes]:
    return []


def _burst(rng: np.random.Generator, _can_id: int, data: bytes) -> list[bytes]:
    """The frame and a babbling node's rubbish under its id."""
    return [data, *(rng.bytes(len(data)) for _ in range(int(rng.integers(1, 40))))]


def _bad_crc(rng: np.random.Generator, _can_id: int, data: bytes) -> list[bytes]:
    out = bytearray(data)
    for bit in rng.integers(0, 8 * len(data), int(rng.integers(1, 9))):
        out[bit // 8] ^= 1 << int(bit) % 8
    return [bytes(out)]


def _bad_value(rng: np.random.Generator, can_id: int, data: bytes) -> list[bytes]:
    """Any payload under a right CRC and counter."""
    return [protect(data[:2] + rng.bytes(len(data) - 2), can_id, data[1] & 0x0F)]


def _error(_rng: np.random.Generator, can_id: int, data: bytes) -> list[bytes]:
    return [protect(bytes((0, 0xE0)) + data[2:], can_id, data[1] & 0x0F)]


def _zero(_rng: np.random.Generator, can_id: int, data: bytes) -> list[bytes]:
    """A speed of 0, a sensor that stands still."""
    return [protect(bytes(len(data)), can_id, data[1] & 0x0F)]


@dataclass(slots=True)
class Faults:
    """At random times something goes wrong with one message or with all of them, for a time; seeded."""

    rng: np.random.Generator
    every_ticks: float = 4_000.0  # from the end of one fault to the beginning of the next, on average
    happened: dict[str, int] = field(default_factory=dict)
    _kind: str = ""
    _ids: frozenset[int] = frozenset()
    _left: int = 0  # ticks until the fault ends, or begins

    KINDS = (
        ("loss", _lost, 0x000, 400), ("burst", _burst, 0x000, 100), ("bad CRC", _bad_crc, 0x000, 400),
        ("bad value", _bad_value, 0x000, 200), ("sensor error", _error, 0x000, 400), ("stuck", _zero, 0x000, 400),
        ("standstill", _zero, 0x130, 2_000), ("bus silent", _lost, -1, 200), ("one lost", _lost, 0x000, 1),
    )  # fmt: skip
    IDS = tuple(base + a for base in (0x100, 0x110, 0x120) for a in range(1, 5)) + (0x130,)
    # further than the window either way, and less
    STEPS_S = (-3600.0, -10.0, -0.5, -0.02, 0.5, 59.0, 3600.0)

    def step_us(self) -> int:
        """By how much the clock steps at this tick: mostly not at all."""
        if self.rng.random() > 1 / (10 * self.every_ticks):
            return 0
        self.happened["clock step"] = self.happened.get("clock step", 0) + 1
        return round(float(self.rng.choice(self.STEPS_S)) * 1e6)

    def take(self, frames: Frames) -> Frames:
        """What becomes of a tick's frames."""
        self._left -= 1
        if self._left < 0:
            self._next()
        if not self._kind:
            return frames
        change = next(c for name, c, _, _ in self.KINDS if name == self._kind)
        return [
            (at, i, data)
            for at, i, good in frames
            for data in (change(self.rng, i, good) if i in self._ids else [good])
        ]

    def _next(self) -> None:
        if self._kind:
            self._kind, self._left = "", int(self.rng.exponential(self.every_ticks))
            return
        self._kind, _, which, most = self.KINDS[self.rng.integers(len(self.KINDS))]
        self._left = int(self.rng.integers(1, most + 1))
        self._ids = frozenset(self.IDS if which < 0 else (which or int(self.rng.choice(self.IDS)),))
        self.happened[self._kind] = self.happened.get(self._kind, 0) + 1


def endless(loop: list[Frames], faults: Faults, start_us: int) -> Iterator[tuple[int, Frames]]:
    """For ever: the time at which a tick begins, and its frames after what goes wrong."""
    tick_us = start_us
    while True:
        for frames in loop:
            yield tick_us, faults.take(frames)
            tick_us += TICK_US + faults.step_us()
