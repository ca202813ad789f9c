"""A train of wheelsets on its rail, advanced sample by sample."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim_ecu.physics.integration import Rides, integrate
from sim_ecu.physics.rail import RAIL_COLUMNS
from sim_ecu.physics.track import SPACING_M, Track
from sim_ecu.physics.wheelset import AXLE_STATES, LANES, W_L, W_R, Command, FloatArray, Wheelset, constants

WINDOW_SAMPLES = 100  # for so many the tracks are cut out at once


@dataclass(frozen=True, slots=True)
class Axle:
    """Where an axle runs: its rail table (n, RAIL_COLUMNS), its lateral irregularity, and its place in the train.

    Axles with the same track meet the same irregularity at the same place, each when it gets there.
    """

    rail: FloatArray
    track: Track
    position_m: float = 0.0  # ahead of the train's own distance


@dataclass(frozen=True, slots=True)
class Samples:
    """n sample intervals: outputs (n, axles, OUTPUTS), speed and distance (n,) at the end of each."""

    outputs: FloatArray
    speed_m_s: FloatArray
    distance_m: FloatArray


class Simulation:
    """Equations (1)-(12) in time. step_scale 2 halves the integration step (for the convergence test)."""

    def __init__(
        self,
        wheelset: Wheelset,
        axles: Sequence[Axle],
        speed_m_s: float,
        sample_s: float = 0.005,
        step_scale: float = 1.0,
    ) -> None:
        if not 1 <= len(axles) <= LANES:
            raise ValueError(f"a train has one to {LANES} axles here, not {len(axles)}")
        self._axles = tuple(axles)
        self._sample_s = sample_s
        self._step_scale = step_scale
        self._rails = [np.ascontiguousarray(a.rail, dtype=np.float64) for a in axles]
        for rail in self._rails:
            if rail.ndim != 2 or rail.shape[1] != RAIL_COLUMNS or np.any(np.diff(rail[:, 0]) <= 0):
                raise ValueError(f"a rail table needs {RAIL_COLUMNS} columns and growing distances")
        for a in axles:
            if a.position_m < a.track.start_m:
                raise ValueError(f"an axle stands at {a.position_m:g} m, its track begins at {a.track.start_m:g} m")
        self.state = np.zeros((len(axles), AXLE_STATES))
        self.state[:, W_R] = self.state[:, W_L] = speed_m_s / wheelset.r_0
        self.train = np.array([speed_m_s, 0.0])
        self._integral = np.zeros(len(axles))
        self._kept: tuple[float, float, Rides] | None = None  # from where to where (m), and the tracks there
        # the fastest decay of the contact times speed: r0^2 dF/dcreep / I of the lighter wheel, or the lateral and
        # yaw ones where those are faster (Kalker's slope, the curve's own reduction)
        w, c = wheelset, wheelset.contact
        self._numbers = [*constants(w), *c]
        slope = max(float(np.max(r[:, 4] + r[:, 5])) for r in self._rails) * 2 / np.pi * c.stiffness_N
        self._stiffest = slope * max(w.r_0**2 / min(w.I_L, w.I_R), 2 / w.m_w, 2 * w.L_g**2 / w.I_w)

    @property
    def stiffness(self) -> float:
        """How fast the contact decays, times the speed (m/s2): what the number of integration steps follows."""
        return float(self._stiffest)

    def advance(self, command: Command, held_speed_m_s: FloatArray) -> Samples:
        """Run one sample interval for each row of the command; the state stays for the next call."""
        train = np.tile(self.train, (len(self._axles), 1))
        out, journey = integrate(
            self.state, train, self._integral, self._window(held_speed_m_s), _whole(command), held_speed_m_s,
            self._sample_s, self._step_scale, True,
        )  # fmt: skip
        self.train = train[0]
        return Samples(out, journey[:, 0, 0], journey[:, 0, 1])

    def _window(self, held_speed_m_s: FloatArray) -> Rides:
        """`_rides` of this one. Where few samples are asked for, with tracks for many: they are cut out once for all of
        them, and more of a track than is reached changes nothing."""
        n = len(held_speed_m_s)
        if n >= WINDOW_SAMPLES:
            return _rides([self], held_speed_m_s)
        begin = float(self.train[1])
        end = _ahead(self, held_speed_m_s, n)
        if self._kept is None or not (self._kept[0] <= begin and end <= self._kept[1]):
            rides = _rides([self], held_speed_m_s, WINDOW_SAMPLES)
            self._kept = begin, _ahead(self, held_speed_m_s, WINDOW_SAMPLES), rides
        return self._kept[2]


def advance_side_by_side(
    simulations: Sequence[Simulation], command: Command, held_speed_m_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """`Simulation.advance` of many vehicles of one axle in one compiled call; column i of the command is the i-th's.

    Returns outputs (samples, n, OUTPUTS) and (samples, n, 2) of v and distance, equal to those of single calls. Fastest
    where neighbours take steps alike: vehicles of one speed in the order of their `stiffness`.
    """
    first = simulations[0]
    if any(len(s._axles) != 1 or s._sample_s != first._sample_s for s in simulations):
        raise ValueError("vehicles side by side have one axle each, and one sample interval")
    state = np.concatenate([s.state for s in simulations])
    train = np.array([s.train for s in simulations])
    integral = np.concatenate([s._integral for s in simulations])
    out, journey = integrate(
        state, train, integral, _rides(simulations, held_speed_m_s), _whole(command), held_speed_m_s,
        first._sample_s, first._step_scale, False,
    )  # fmt: skip
    for i, s in enumerate(simulations):
        s.state, s.train, s._integral = state[i : i + 1], train[i], integral[i : i + 1]
    return out, journey


def _whole(command: Command) -> Command:
    """The same, each part lying row by row: what is compiled is compiled for one layout."""
    return Command(*(np.ascontiguousarray(c) for c in command))


def _ahead(s: Simulation, held_speed_m_s: FloatArray, samples: int) -> float:
    """How far (m) a simulation may come in so many samples, and a metre."""
    speed, distance = s.train.tolist()
    fastest = max(speed, float(np.fmax.reduce(held_speed_m_s, initial=0.0))) + 10.0 * samples * s._sample_s
    return float(distance + fastest * samples * s._sample_s + 1.0)


def _rides(simulations: Sequence[Simulation], held_speed_m_s: FloatArray, samples: int = 0) -> Rides:
    """All axles of some simulations, with as much of their tracks as the samples of the held speeds need, or more."""
    n = samples or len(held_speed_m_s)
    rails, nodes, first_node, before, numbers = [], [], [], [], []
    for s in simulations:
        distance = float(s.train[1])
        ahead = _ahead(s, held_speed_m_s, n)
        rails += s._rails
        for a in s._axles:
            reached = a.track.reach(ahead + a.position_m)
            low = max(0, math.floor((distance + a.position_m - a.track.start_m - 1.0) / SPACING_M))
            high = min(len(reached), math.ceil((ahead + a.position_m - a.track.start_m) / SPACING_M) + 2)
            first_node.append(low)
            before.append(high)
            nodes.append(reached[low:high])
            numbers.append(s._numbers)
    axles = [a for s in simulations for a in s._axles]
    begins = np.cumsum([0, *(len(part) for part in nodes)])[:-1]
    return Rides(
        position=np.array([a.position_m for a in axles]),
        rails=np.concatenate(rails),
        first_rail=np.cumsum([0, *(len(r) for r in rails)]),
        nodes=np.concatenate(nodes),
        base=begins - np.array(first_node),
        first_node=np.array(first_node),
        before=np.array(before),
        start=np.array([a.track.start_m for a in axles]),
        numbers=np.array(numbers),
        stiffest=np.array([s._stiffest for s in simulations for _ in s._axles]),
    )
