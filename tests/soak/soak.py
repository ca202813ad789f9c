"""A day on the virtual clock in one core: nothing grows, nothing drifts, every frame is accounted for.

    python -m tests.soak.soak --hours 24

Prints a balance sheet; exits 1 if anything in it does not hold.
"""

import argparse
import ctypes
import gc
import sys
from collections import deque
from copy import deepcopy
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np

from tests.soak.pool import LOOP_US, TICK_US, Faults, endless, pool
from tests.support.core_state import parts
from wrcd.bus.frame import Frame
from wrcd.config.config import load_config
from wrcd.core.configuration import Config
from wrcd.core.core import BACKWARD_STEP_US, FORWARD_STEP_US, Core
from wrcd.estimator.design import CHANNELS, Design, FloatArray
from wrcd.estimator.estimator import Estimator
from wrcd.estimator.records import Estimate, StepResult, Tick
from wrcd.estimator.trust.health import PairHealth
from wrcd.progress import Progress

START_US = 1_700_000_000_000_000
MAX_GROWTH_KB = 1024.0
MAX_DRIFT = 1e-6  # of a number's own size
KEPT_TICKS, SNAPSHOT_TICKS = 10_000, 2_000  # the offsets remember 400 ticks: what came before counts 1e-11
# every speed of the loop has its matrices, every list its length; and what is kept here is full, so that computing it
# afresh takes as much memory at each look
MIN_WARM_US = max(2 * LOOP_US, (KEPT_TICKS + SNAPSHOT_TICKS) * TICK_US)
EVERY_US = 600_000_000  # between looks at memory and drift
SLOT_US = 20_000


class Kept(Estimator):
    """The very estimator, which also keeps what it was given, so that all of it can be computed afresh.

    The filters' slowest pole remembers for minutes, and what is known of the wires stays across gaps, so the states of
    both are taken over every SNAPSHOT_TICKS, but for the newest ones. They cannot drift: filters contract, and evidence
    is of the last ten seconds. Everything else is computed from nothing.
    """

    def __init__(self, design: Design, axles: int) -> None:
        super().__init__(design, axles)
        n = KEPT_TICKS
        self._z, self._there = np.zeros((n, CHANNELS, axles)), np.zeros((n, CHANNELS, axles), dtype=bool)
        self._ratio, self._speeds, self._number = np.zeros((n, axles)), np.zeros(n), np.zeros(n, dtype=np.int64)
        self._restarted = np.zeros((n, axles), dtype=bool)  # before the tick
        self._to_restart = np.zeros(axles, dtype=bool)
        # (tick, filters' states, health), the oldest first
        self._snapshots: deque[tuple[int, FloatArray, PairHealth]] = deque(maxlen=n // SNAPSHOT_TICKS + 1)
        self._ticks = 0

    def step(self, tick: Tick) -> StepResult:
        if not self._snapshots or self._ticks - self._snapshots[-1][0] >= SNAPSHOT_TICKS:
            self._snapshots.append((self._ticks, self._bank.x, deepcopy(self.health)))
        at = self._ticks % KEPT_TICKS
        self._z[at], self._there[at], self._ratio[at] = tick.z, tick.present, tick.torque_ratio
        self._speeds[at], self._number[at] = tick.speed_m_s, tick.number
        self._restarted[at] = self._to_restart
        self._to_restart[:] = False
        self._ticks += 1
        return super().step(tick)

    def reset(self, axle: int) -> None:
        self._to_restart[axle] = True
        super().reset(axle)

    def afresh(self) -> Estimator:
        """A new estimator after what was kept, tick by tick."""
        out = Estimator(self.design, self.axles)
        snapshots = {tick: (x, health) for tick, x, health in self._snapshots}
        needs_reset = np.zeros(self.axles, dtype=bool)
        for tick in range(max(self._ticks - KEPT_TICKS, 0), self._ticks):
            at = tick % KEPT_TICKS
            for axle in np.flatnonzero(self._restarted[at] | needs_reset):
                out.reset(int(axle))
            if tick in snapshots and tick < self._ticks - SNAPSHOT_TICKS:
                x, health = snapshots[tick]
                out._bank.x, out.health = x.copy(), deepcopy(health)
            result = out.step(
                Tick(int(self._number[at]), self._z[at], self._there[at], self._ratio[at], float(self._speeds[at]))
            )
            needs_reset = result.needs_reset
        for axle in np.flatnonzero(self._to_restart):
            out.reset(int(axle))
        return out


def numbers(thing: object, like: object, name: str) -> dict[str, FloatArray]:
    """Every array of floats that an estimator is made of, by its path; of what one like it has."""
    if isinstance(thing, np.ndarray):
        return {name: thing} if thing.dtype.kind == "f" else {}
    out: dict[str, FloatArray] = {}
    for part, value in parts(like).items():
        out |= numbers(getattr(thing, part), value, f"{name}.{part}")
    return out


def drift(kept: Kept) -> tuple[float, str]:
    """The largest difference between the estimator and one computed afresh, as a share of the number, and where."""
    fresh = kept.afresh()
    a, b = numbers(kept, fresh, "state"), numbers(fresh, fresh, "state")
    now, then = kept.estimate(), fresh.estimate()
    for f in fields(Estimate):
        a[f.name], b[f.name] = np.asarray(getattr(now, f.name), float), np.asarray(getattr(then, f.name), float)
    worst, where = 0.0, ""
    for key, x in a.items():
        y = b[key]
        if not np.array_equal(np.isnan(x), np.isnan(y)):
            return float("inf"), f"{key}: known in one only"
        scale = max(float(np.nanmax(np.abs(x), initial=0.0)), 1e-9)
        difference = float(np.nanmax(np.abs(x - y), initial=0.0)) / scale
        if difference > worst:
            worst, where = difference, key
    return worst, where


def rss_kb() -> float:
    """Resident memory of this process. What it has freed is given back first: how much of it malloc keeps is chance."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4.0


@dataclass(slots=True)
class Balance:
    """What went in, what came out, what it took."""

    simulated_us: int = 0
    fed: int = 0
    slots: int = 0  # of Adhesion, by the stamps alone
    made: int = 0  # Adhesion frames of all axles
    rss_kb: list[float] = field(default_factory=list)
    objects: list[int] = field(default_factory=list)
    drifts: list[tuple[float, str]] = field(default_factory=list)

    def lines(self, core: Core, faults: Faults) -> list[tuple[str, bool]]:
        """The sheet: each line and whether it holds."""
        c = core.counts
        growth = max(self.rss_kb) - self.rss_kb[0]
        objects = max(self.objects) - self.objects[0]
        worst, where = max(self.drifts)
        return [
            (f"simulated {self.simulated_us / 3.6e9:.2f} h, {c.ticks} ticks, {c.time_steps} time steps", True),
            ("faults: " + ", ".join(f"{n} {kind}" for kind, n in sorted(faults.happened.items())), True),
            (f"frames in {self.fed} = accepted {c.accepted} + rejected {c.rejected.total()}", self.fed == c.seen),
            (f"rejected: {c.rejections}; axles started anew {c.restarts}", True),
            (
                f"Adhesion frames {self.made} = {len(core.config.axles)} axles x {self.slots} slots of 20 ms",
                self.made == self.slots * len(core.config.axles),
            ),
            (
                f"memory after warm-up: {self.rss_kb[0]:.0f} kB, at most {growth:.0f} kB more",
                growth <= MAX_GROWTH_KB,
            ),
            (f"objects after warm-up: {self.objects[0]}, at most {objects} more", objects <= self.objects[0] // 100),
            (
                f"state against the same computed afresh, {len(self.drifts)} times: at most {worst:.1e} of a number"
                f" ({where or 'nowhere'})",
                worst <= MAX_DRIFT,
            ),
        ]


class Slots:
    """How many slots of 20 ms the clock passes, by the contract: a step of time starts anew, a silence is filled."""

    def __init__(self) -> None:
        self.passed = 0
        self._newest: int | None = None

    def at(self, stamp_us: int) -> None:
        """The clock says so."""
        newest = self._newest
        if newest is not None and -BACKWARD_STEP_US <= stamp_us - newest <= 0:
            return
        if newest is not None and 0 < stamp_us - newest <= FORWARD_STEP_US:
            self.passed += _slot(stamp_us) - _slot(newest)
        self._newest = stamp_us


def _slot(stamp_us: int) -> int:
    return stamp_us // TICK_US * TICK_US // SLOT_US


def soak(config: Config, hours: float, seed: int) -> tuple[Core, Faults, Balance]:
    """Run it."""
    core = Core(config, kept := Kept(config.design, len(config.axles)))
    faults = Faults(np.random.default_rng(seed))
    balance, slots, progress = Balance(), Slots(), Progress(steps=True)
    adhesion = {m.frame_id for m in config.database.messages if m.name in {a.adhesion.message for a in config.axles}}
    whole_us = round(hours * 3.6e9)
    warm_us = max(round(0.05 * whole_us), MIN_WARM_US)
    look_us = warm_us
    for tick_us, frames in endless(pool(), faults, START_US):
        slots.at(tick_us)
        made = core.advance(tick_us)
        for at_us, can_id, data in frames:
            made += core.feed(Frame(tick_us + at_us, can_id, data))
        balance.made += sum(o.frame.can_id in adhesion for o in made)
        balance.fed += len(frames)
        balance.simulated_us += TICK_US
        done = balance.simulated_us >= whole_us
        if balance.simulated_us >= look_us or done:
            look_us += EVERY_US
            balance.drifts.append(drift(kept))
            balance.rss_kb.append(rss_kb())
            balance.objects.append(len(gc.get_objects()))
            text = (
                f"{balance.simulated_us / 3.6e9:.2f} h, {balance.rss_kb[-1]:.0f} kB, drift {balance.drifts[-1][0]:.0e}"
            )
            progress.at(text, balance.simulated_us / whole_us)
        if done:
            break
    progress.end()
    balance.slots = slots.passed
    return core, faults, balance


def main() -> int:
    """Run and print the sheet."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=24.0, help="simulated hours")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    core, faults, balance = soak(load_config(None), arguments.hours, arguments.seed)
    sheet = balance.lines(core, faults)
    for text, holds in sheet:
        print(("ok    " if holds else "FAIL  ") + text)
    return 0 if all(holds for _, holds in sheet) else 1


if __name__ == "__main__":
    sys.exit(main())
