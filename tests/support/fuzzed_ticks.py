"""Ticks of a train to which everything happens, to compare the estimator with its oracle, and for sanitizers.

python -m tests.support.fuzzed_ticks TICKS      the estimator, through all it can do
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from sim_ecu import resources as rig
from tests.support.stepped import SteppedEstimator, Tick, health_figures, pair_states
from wrcd import native, resources
from wrcd.core.design import Design, FloatArray, load_design
from wrcd.core.terms import MAX_AXLES

MAX_SIGNAL = np.array([[8.388606], [83.88606]])  # yaw rate, lateral acceleration


def designs() -> dict[str, Design]:
    """The packaged ones, the paper's form, and one that judges no sensors and has no interval."""
    names = ("multiple-unit", "lone-wheelset")
    found = {name: load_design(resources.DATA / f"designs/{name}.design.json") for name in names}
    bare = replace(found["multiple-unit"], health=None, interval=None)
    return {**found, "paper": load_design(rig.PAPER_DESIGN), "bare": bare}


@dataclass(frozen=True, slots=True)
class Step:
    """A tick, and the axles that are reset after it, whatever it showed."""

    tick: Tick
    resets: tuple[int, ...] = ()


class Train:
    """Axles on coloured noise whose size, torque and speed change, with pulses, absurd values, gaps and resets.

    No value is beyond what the packaged DBC can say, MAX_SIGNAL; wild: some are, by orders of magnitude.
    """

    def __init__(self, axles: int, seed: int, wild: bool = False) -> None:
        self._absurd = (50.0, 1e6, 1e300) if wild else (0.5, 5.0, 50.0)
        self._most = np.inf if wild else MAX_SIGNAL
        self._n, self._chance = axles, np.random.default_rng(seed)
        self._number = int(self._chance.integers(1 << 40))
        self._state, self._size = np.zeros((3, axles)), np.ones(axles)
        self._ratio, self._speed, self._gap = np.full(axles, 0.05), 20.0, np.zeros(axles, dtype=int)
        self._twin = False

    def steps(self, count: int) -> Iterator[Step]:
        """The next ones."""
        for _ in range(count):
            yield self._step()

    def _step(self) -> Step:
        c, n = self._chance, self._n
        noise = c.normal(size=(6, n))
        self._state = 0.97 * self._state + noise[:3]
        if self._twin:  # the second axle of a bogie runs over what the first did, with no way between them
            self._state[:, 1::2] = self._state[:, : n // 2 * 2 : 2]
        yaw = 0.002 * self._state[0] * self._size + 0.001 * noise[3]
        lateral = 0.15 * (self._state[1] + 0.7 * self._state[0]) * self._size + 0.1 * noise[4]
        z, ratio = np.array([yaw, lateral]), self._ratio + 0.002 * noise[5]
        resets: tuple[int, ...] = ()
        happens = c.random(14)
        axle = int(c.integers(n))
        if happens[0] < 0.003:
            self._size = np.exp(0.7 * c.normal(size=n))
        if happens[1] < 0.003:
            self._ratio = np.abs(c.normal(size=n)) * c.choice([0.0, 0.02, 0.08, 0.3])
        if happens[2] < 0.01:  # a joint
            z[1, axle] += 5.0 * c.normal()
        if happens[3] < 0.001:  # absurd
            z[c.integers(2), axle] += c.choice(self._absurd) * c.normal()
        if happens[4] < 0.003:
            z[0, axle] += 0.2
        if happens[5] < 0.01:
            ratio[axle] = np.nan
        self._speed = min(max(self._speed + 0.03 * c.normal(), 1.0), 95.0)
        if happens[6] < 0.001:
            self._speed = float(c.uniform(1.0, 95.0))
        z = np.clip(z, -self._most, self._most)
        present = np.ones((2, n), dtype=bool)
        if happens[7] < 0.004:
            self._gap[axle] = int(c.choice([1, 3, 30, 400]))
        present[:, self._gap > 0] = False
        self._gap = np.maximum(self._gap - 1, 0)
        if happens[8] < 0.01:
            present[c.integers(2), axle] = False
        if happens[9] < 0.001:
            resets = (axle,)
        self._number += 1
        if happens[10] < 0.0003:  # a step of time: the core starts every axle anew
            resets = tuple(range(n))
        if happens[11] < 0.001:
            self._twin = not self._twin
        if happens[12] < 0.001:  # a sensor that says nothing, or the other's
            z[:, axle] = z[::-1, axle] if happens[13] < 0.5 else 0.0
        number = self._number
        if len(resets) == n:
            self._number += int(c.integers(1, 5000))
        return Step(Tick(number, np.where(present, z, np.nan), present, ratio, self._speed), resets)


def answers(e: SteppedEstimator) -> Iterator[FloatArray]:
    """All that the estimator is asked beside its estimate."""
    now = e.torque_now()
    yield now
    yield e.inputs_of(np.repeat(np.array([3, 17, 60]), e.axles), now)
    yield e.steps()
    yield e.features()
    yield np.asarray(pair_states(e), dtype=np.float64)
    yield np.array([health_figures(e, axle) for axle in range(e.axles)])


def main(ticks: str) -> int:
    """Drive every design with every number of axles; what is wrong ends the process."""
    done = 0
    for design in designs().values():
        for axles in range(1, MAX_AXLES + 1):
            e = SteppedEstimator(design, axles)
            for step in Train(axles, axles, wild=True).steps(int(ticks)):
                result = e.step(step.tick)
                needs_reset = np.flatnonzero(result.needs_reset).tolist()
                for axle in needs_reset:
                    e.why_reset(result, step.tick.z[0], axle)
                for axle in {*step.resets, *needs_reset}:
                    e.reset(axle)
                if done % 50 == 0:
                    e.estimate()
                    list(answers(e))
                done += 1
    print(f"{done} ticks, {native.compiler()}")
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
