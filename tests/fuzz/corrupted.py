"""A bus of four axles on which more frames are corrupted than good."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.typing import NDArray

from sim_ecu.play.player import Player
from sim_ecu.play.scenario import read_scenario
from tests.support.scenarios import FOUR_AXLES
from wrcd.bus.dbc import Database, Message
from wrcd.bus.e2e import COUNTER_MODULO, protect
from wrcd.bus.frame import Frame
from wrcd.bus.words import degraded, usable
from wrcd.config.settings import parse_toml

TICK_US = 5_000
START_US = 1_700_000_000_000_000
CREEP_REACHED_US = 1_000_000  # of FOUR_AXLES
MAX_LOST = 2  # counts that may be missing between two frames
CHUNK = 4_096

Good = list[tuple[int, int, bytes]]  # microseconds after the tick's beginning, id, data


@dataclass(frozen=True, slots=True)
class Arrived:
    """A frame, and whether it is one that somebody sent."""

    frame: Frame
    good: bool


def loop() -> list[Good]:
    """The good frames of the rig's four axles at their peaks, tick by tick."""
    out: dict[int, Good] = {}
    for _, sent in Player(read_scenario(parse_toml(FOUR_AXLES, "four axles"), "four axles"), truth=False):
        for f in sent:
            if f.due_us >= CREEP_REACHED_US:
                out.setdefault(f.due_us // TICK_US, []).append((f.due_us % TICK_US, f.can_id, f.data))
    return [out[tick] for tick in sorted(out)][:-1]


def bus(frames: int, per_tick: int, seed: int) -> Iterator[list[Arrived]]:
    """Tick by tick, the good frames with counters that go on, and among them corrupted ones, `frames` in all: in turn
    random bytes under a mapped id, and a good frame of the tick with 1 to all of its bits flipped."""
    rng = np.random.default_rng(seed)
    ticks = loop()
    counters: dict[int, int] = {}
    lengths = {can_id: len(data) for tick in ticks for _, can_id, data in tick}
    ids = sorted(lengths)
    masks = {length: _masks(rng, length) for length in set(lengths.values())}
    made = number = 0
    while made < frames:
        begin_us = START_US + number * TICK_US
        good: Good = []
        for at, can_id, data in ticks[number % len(ticks)]:
            counter = counters[can_id] = (counters.get(can_id, -1) + 1) % COUNTER_MODULO
            good.append((at, can_id, protect(data, can_id, counter)))
        out = [Arrived(Frame(begin_us + at, can_id, data), True) for at, can_id, data in good]
        for at in sorted(rng.integers(0, TICK_US, min(per_tick, frames - made)).tolist()):
            made += 1
            if made % 2:
                can_id = ids[int(rng.integers(len(ids)))]
                data = rng.bytes(lengths[can_id])
            else:
                _, can_id, data = good[int(rng.integers(len(good)))]
                flips = int.from_bytes(next(masks[len(data)]), "big")
                data = (int.from_bytes(data, "big") ^ flips).to_bytes(len(data), "big")
            out.append(Arrived(Frame(begin_us + at, can_id, data), False))
        yield sorted(out, key=lambda a: a.frame.stamp_us)
        number += 1


def _masks(rng: np.random.Generator, length: int) -> Iterator[bytes]:
    """Which bits to flip: how many is drawn first, 1 to all, then which."""
    bits = 8 * length
    while True:
        rank = rng.random((CHUNK, bits)).argsort(axis=1).argsort(axis=1)
        flips: NDArray[np.bool_] = rank < rng.integers(1, bits + 1, (CHUNK, 1))
        for row in np.packbits(flips, axis=1):
            yield row.tobytes()


def let_through(database: Database) -> float:
    """The share of the corrupted frames of `bus` that CRC, counter, status and range let through: see test_million."""
    parts = []
    for m in (m for m in database.messages if m.name.startswith(("YawRate", "LatAccel", "Torque", "VehicleSpeed"))):
        usable = _usable(m)
        counters = (MAX_LOST + 1) / 16
        parts.append(counters * len(usable) / 16 * _in_range(m))
    random = sum(parts) / len(parts)
    # of the good frames that are flipped most are from the 5-byte messages; the 4-byte one differs in the third digit
    flipped = sum(_header_fits(40, k) for k in range(1, 41)) / 40
    return 0.5 * (random + flipped) / 256


def _usable(m: Message) -> list[int]:
    status: Mapping[int, object] = m.get_signal_by_name("Status").choices or {}
    return [int(raw) for raw, label in status.items() if usable(label) or degraded(label)]


def _in_range(m: Message) -> float:
    (s,) = (s for s in m.signals if s.name not in ("Crc", "Counter", "Status"))
    assert s.minimum is not None
    assert s.maximum is not None
    return min((float(s.maximum) - float(s.minimum)) / float(s.scale) / (1 << s.length), 1.0)


def _header_fits(bits: int, flipped: int) -> float:
    """How likely so many flips leave counter and status usable: the frame's own counter is the one in turn or, as for
    half of them, the one just used; two flips or fewer are always found by the CRC."""
    if flipped < 3:
        return 0.0
    total = 0.0
    for counter in range(COUNTER_MODULO):
        for ahead in (0, 1):
            wanted = {(counter - ahead + step) % COUNTER_MODULO for step in range(1, MAX_LOST + 2)}
            for new in wanted:
                for status in (0, 1):
                    changed = (counter ^ new).bit_count() + status
                    if changed <= flipped:
                        total += comb(bits - 8, flipped - changed) / comb(bits, flipped)
    return total / (2 * COUNTER_MODULO)
