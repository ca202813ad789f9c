"""A day on the virtual clock in one core: nothing grows, nothing drifts, every frame is accounted for.

Four axles run over all curves, with faults at random. Every ten minutes memory is looked at, and a core that begins
anew gets the same frames: after a minute without faults both must send the same bytes. Prints a balance sheet; exits 1
if anything in it does not hold.
"""

import argparse
import ctypes
import gc
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

from sim_ecu.play.player import Player
from sim_ecu.play.scenario import read_scenario
from wrcd.bus.batch import FrameBatch
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.config.config import load_config
from wrcd.config.settings import parse_toml
from wrcd.core.core import BACKWARD_STEP_US, FORWARD_STEP_US, Core
from wrcd.progress import Progress

TICK_US, SLOT_US, START_US = 5_000, 20_000, 1_700_000_000_000_000
# Counters count to 15 and the slowest message comes every 20 ms: a loop of a multiple of 300 ms ends where it begins.
LOOP_US, MAX_GROWTH_KB = 24_000_000, 1024.0
EVERY, QUIET, COMPARED = 120_000, 18_000, 6_000  # ticks from look to look, without faults at its end, compared
ADHESION = range(0x091, 0x095)
IDS = [base + a for base in (0x100, 0x110, 0x120) for a in range(1, 5)] + [0x130]
STEPS_S = (-3600.0, -10.0, -0.5, -0.02, 0.5, 59.0, 3600.0)  # further than the window either way, and less
Tick = list[tuple[int, int, bytes]]  # microseconds after the tick's beginning, id, data


def pool() -> list[Tick]:
    """The frames of every tick of a loop: four axles, each over all curves in another order, at changing speed."""
    text = (
        f"duration_s = {LOOP_US / 1e6}\naxles = [1, 2, 3, 4]\nspeed_m_s = [[0, 20], [12, 26], [24, 20]]\n"
        'rail = [{ curve = "A" }]\ndrive = { utilisation = 0.5 }\n'
    )
    for a in range(4):
        rail = ", ".join(f'{{ curve = "{"ABCDEF"[(a + k) % 6]}", from_m = {90 * k} }}' for k in range(6))
        drive = f"{{ utilisation = [[0, 0.5], [{4 + a}, {0.3 + 0.2 * a}], [20, 0.95], [24, 0.5]] }}"
        text += f"[axle.{a + 1}]\nrail = [{rail}]\ndrive = {drive}\n"
    out: list[Tick] = [[] for _ in range(LOOP_US // TICK_US)]
    for f in (f for _, sent in Player(read_scenario(parse_toml(text, "soak"), "soak"), truth=False) for f in sent):
        tick, offset_us = divmod(f.due_us, TICK_US)
        out[tick % len(out)].append((offset_us, f.can_id, f.data))
    return out


def other(d: bytes, can_id: int, payload: bytes, status: int = 0) -> bytes:
    """Another payload or status, under the right CRC and counter."""
    return protect(bytes((0, status << 4 | d[1] & 0x0F)) + payload, can_id, d[1] & 0x0F)


# what becomes of a frame, and for how many ticks at most
FAULTS: dict[str, tuple[Callable[[np.random.Generator, int, bytes], list[bytes]], int]] = {
    "loss": (lambda rng, i, d: [], 400),
    "babbling": (lambda rng, i, d: [d, *(rng.bytes(len(d)) for _ in range(int(rng.integers(1, 40))))], 100),
    "bad CRC": (lambda rng, i, d: [bytes((d[0] ^ int(rng.integers(1, 256)), *d[1:]))], 400),
    "bad value": (lambda rng, i, d: [other(d, i, rng.bytes(len(d) - 2))], 200),
    "sensor error": (lambda rng, i, d: [other(d, i, d[2:], 14)], 400),
    "stuck at 0": (lambda rng, i, d: [other(d, i, bytes(len(d) - 2))], 2_000),
}


class Faults:
    """From time to time something goes wrong with one message or with all of them, for a time; seeded."""

    def __init__(self, seed: int) -> None:
        self._rng, self.happened = np.random.default_rng(seed), Counter[str]()
        self._kind, self._ids, self._left = "", IDS, 0

    def take(self, tick: Tick) -> tuple[Tick, int]:
        """What becomes of a tick's frames, and by how many microseconds the clock steps behind them."""
        rng, self._left = self._rng, self._left - 1
        if self._left < 0 and self._kind:
            self._kind, self._left = "", int(rng.exponential(4_000))
        elif self._left < 0:
            self._kind = str(rng.choice(list(FAULTS)))
            self._ids = IDS if rng.random() < 0.1 else [int(rng.choice(IDS))]
            self._left = int(rng.integers(1, FAULTS[self._kind][1] + 1))
            self.happened[self._kind] += 1
        step_us = round(float(rng.choice(STEPS_S)) * 1e6) if rng.random() < 1 / 40_000 else 0
        self.happened["clock step"] += step_us != 0
        change, ids = (FAULTS[self._kind][0], self._ids) if self._kind else (FAULTS["loss"][0], [])
        return [(at, i, d) for at, i, good in tick for d in (change(rng, i, good) if i in ids else [good])], step_us


def feed(core: Core, tick: Tick, tick_us: int) -> list[tuple[int, int, bytes]]:
    """The Adhesion frames that a core makes of a tick, as the daemon's."""
    out = *core.advance(tick_us), *core.feed(FrameBatch.of([Frame(tick_us + at, i, d) for at, i, d in tick]))
    return [(o.frame.stamp_us, o.frame.can_id, o.frame.data) for o in out if o.frame.can_id in ADHESION]


def main() -> int:
    """Run and print the sheet."""
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description=__doc__)
    parser.add_argument("--hours", type=float, default=24.0, help="simulated hours, in steps of ten minutes")
    looks = max(3, round(parser.parse_args().hours * 6))
    core, beside, faults, loop, progress = Core(load_config(None)), None, Faults(1), pool(), Progress(steps=True)
    tick_us = newest_us = START_US
    fed = made = slots = compared = apart = 0
    memory, objects = list[float](), list[int]()
    for k in range(looks * EVERY):
        left = EVERY - k % EVERY  # until the next look
        tick, step_us = faults.take(loop[k % len(loop)]) if left > QUIET else (loop[k % len(loop)], 0)
        # by the contract: a step of time starts anew, a silence is filled
        if 0 < tick_us - newest_us <= FORWARD_STEP_US:
            slots += tick_us // SLOT_US - newest_us // SLOT_US
        if not -BACKWARD_STEP_US <= tick_us - newest_us <= 0:
            newest_us = tick_us
        sent = feed(core, tick, tick_us)
        fed, made = fed + len(tick), made + len(sent)
        beside = Core(core.config) if left == QUIET else beside
        if beside is not None:
            again = feed(beside, tick, tick_us)
            compared += len(sent) * (left <= COMPARED)
            apart += again != sent and left <= COMPARED
        if left == 1:
            beside = None
            gc.collect()
            ctypes.CDLL(None).malloc_trim(0)  # how much of what was freed malloc keeps is chance
            memory.append(int(Path("/proc/self/statm").read_text().split()[1]) * 4.0)
            objects.append(len(gc.get_objects()))
            progress.at(f"{(k + 1) / EVERY / 6:.1f} h, {memory[-1]:.0f} kB", (k + 1) / EVERY / looks)
        tick_us += TICK_US + step_us
    progress.end()
    c, growth, more = core.counts, max(memory[1:]) - memory[1], max(objects[1:]) - objects[1]
    sheet = [
        (f"{looks / 6:.1f} h, {c.ticks} ticks; faults: {dict(sorted(faults.happened.items()))}", True),
        (f"frames in {fed} = accepted {c.accepted} + rejected {c.rejections}", fed == c.accepted + c.rejected.total()),
        (f"Adhesion frames {made} = 4 axles x {slots} slots of 20 ms", made == 4 * slots),
        (f"memory after 20 minutes {memory[1]:.0f} kB, then at most {growth:.0f} kB more", growth <= MAX_GROWTH_KB),
        (f"objects after 20 minutes {objects[1]}, then at most {more} more", more <= objects[1] // 100),
        (f"ticks whose frames are not those of a core that began anew: {apart} of {compared} frames", apart == 0),
    ]
    print("\n".join(f"{'ok  ' if holds else 'FAIL'}  {text}" for text, holds in sheet))
    return 0 if all(holds for _, holds in sheet) else 1


if __name__ == "__main__":
    sys.exit(main())
