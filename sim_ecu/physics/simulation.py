"""A train of wheelsets on its rail, advanced sample by sample."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim_ecu.physics.cleaning import CleanedRail, Cleaning
from sim_ecu.physics.integration import Rides, integrate
from sim_ecu.physics.rail import RAIL_COLUMNS
from sim_ecu.physics.track import SPACING_M, Track
from sim_ecu.physics.wheelset import (
    AXLE_STATES,
    LANES,
    MU_USED,
    ROLLING_START,
    SLIP,
    W_L,
    W_R,
    Command,
    FloatArray,
    Wheelset,
    constants,
)

RIDE_SAMPLES = 200  # that step() runs on one piece of track
NO_LIMIT = 1e3  # of creep, of the peak's


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
    """Equations (1)-(12) in time. step_scale 2 halves the integration step (for the convergence test). cleaning: by the
    slip of the axles, in step() alone; None for a rail that stays as it is."""

    def __init__(
        self,
        wheelset: Wheelset,
        axles: Sequence[Axle],
        speed_m_s: float,
        sample_s: float = 0.005,
        step_scale: float = 1.0,
        cleaning: Cleaning | None = None,
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
        # of step(): what it runs on, for how many samples of that it has run, and its command
        self._ride: Rides
        self._ridden = RIDE_SAMPLES
        self._torque, nothing = np.zeros((1, len(axles))), np.full((1, len(axles)), math.nan)
        self._brake, self._free = np.zeros((1, len(axles))), np.array([math.nan])
        self._command = Command(self._torque, nothing, nothing, nothing, np.full((1, len(axles)), NO_LIMIT))
        # the fastest decay of the contact times speed: r0^2 dF/dcreep / I of the lighter wheel, or the lateral and
        # yaw ones where those are faster (Kalker's slope, the curve's own reduction)
        w, c = wheelset, wheelset.contact
        self._numbers = [*constants(w), *c]
        steepest = [float(np.max(r[:, 4] + r[:, 5])) for r in self._rails]
        self._cleaned: CleanedRail | None = None
        if cleaning is not None:
            steepest.append(cleaning.steepest)
            self._cleaned = CleanedRail(cleaning, self._rails, [a.position_m for a in axles])
        self._load_N = 2 * wheelset.normal_N
        slope = max(steepest) * 2 / np.pi * c.stiffness_N
        self._stiffest = slope * max(w.r_0**2 / min(w.I_L, w.I_R), 2 / w.m_w, 2 * w.L_g**2 / w.I_w)

    def advance(self, command: Command, held_speed_m_s: FloatArray) -> Samples:
        """Run one sample interval for each row of the command; the state stays for the next call."""
        train = np.tile(self.train, (len(self._axles), 1))
        out, journey = integrate(
            self.state, train, self._integral, _rides([self], held_speed_m_s), _whole(command),
            np.zeros(command.torque.shape), held_speed_m_s, self._sample_s, self._step_scale, True,
        )  # fmt: skip
        self.train = train[0]
        self._ridden = RIDE_SAMPLES
        return Samples(out, journey[:, 0, 0], journey[:, 0, 1])

    def step(self, torque_N_m: FloatArray, brake_N_m: FloatArray) -> Samples:
        """One sample interval of a train that moves freely, without limit of creep; arrays (axles,).

        torque_N_m: of the drives, which turn a wheel either way. brake_N_m: what the brakes can hold, no less than 0;
        they oppose the wheel's turning and hold one that stands.
        """
        n = len(self._axles)
        if self._ridden == RIDE_SAMPLES:
            self._ride = _rides([self], np.full(RIDE_SAMPLES, math.nan))
            self._ridden = 0
        self._ridden += 1
        train = np.empty((n, 2))
        train[:] = self.train
        before_m = float(self.train[1])
        if self._cleaned is not None:
            tables = self._cleaned.tables(before_m, float(self.train[0]) * self._sample_s)
            self._ride = self._ride._replace(
                rails=np.concatenate(tables), first_rail=np.cumsum([0, *(len(t) for t in tables)])
            )
        self._torque[0], self._brake[0] = torque_N_m, brake_N_m
        out, journey = integrate(
            self.state, train, self._integral, self._ride, self._command, self._brake, self._free, self._sample_s,
            self._step_scale, True,
        )  # fmt: skip
        self.train = train[0]
        samples = Samples(out, journey[:, 0, 0], journey[:, 0, 1])
        if self._cleaned is not None:
            self._cleaned.add(self.slip_energy_J(samples)[0], before_m, float(self.train[1]))
        return samples

    def slip_energy_J(self, s: Samples) -> FloatArray:
        """Return what both wheels' slip along the rail dissipates in each sample, (samples, axles)."""
        sliding = s.outputs[:, :, SLIP] * np.maximum(s.speed_m_s, ROLLING_START)[:, None]  # m/s, means
        out: FloatArray = np.abs(s.outputs[:, :, MU_USED] * sliding) * (self._load_N * self._sample_s)
        return out


def advance_side_by_side(
    simulations: Sequence[Simulation], command: Command, held_speed_m_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """`Simulation.advance` of many vehicles of one axle in one compiled call; column i of the command is the i-th's.

    Returns outputs (samples, n, OUTPUTS) and (samples, n, 2) of v and distance, equal to those of single calls. Fastest
    where neighbours take steps alike: vehicles of one speed in the order of how stiff their contact is.
    """
    first = simulations[0]
    if any(len(s._axles) != 1 or s._sample_s != first._sample_s for s in simulations):
        raise ValueError("vehicles side by side have one axle each, and one sample interval")
    state = np.concatenate([s.state for s in simulations])
    train = np.array([s.train for s in simulations])
    integral = np.concatenate([s._integral for s in simulations])
    out, journey = integrate(
        state, train, integral, _rides(simulations, held_speed_m_s), _whole(command),
        np.zeros(command.torque.shape), held_speed_m_s, first._sample_s, first._step_scale, False,
    )  # fmt: skip
    for i, s in enumerate(simulations):
        s.state, s.train, s._integral = state[i : i + 1], train[i], integral[i : i + 1]
    return out, journey


def _whole(command: Command) -> Command:
    """Return the command with each part lying row by row: what is compiled is compiled for one layout."""
    return Command(*(np.ascontiguousarray(c) for c in command))


def _rides(simulations: Sequence[Simulation], held_speed_m_s: FloatArray) -> Rides:
    """All axles of some simulations, with as much of their tracks as so many samples need."""
    n = len(held_speed_m_s)
    rails, nodes, first_node, before, numbers = [], [], [], [], []
    for s in simulations:
        sample_s, (speed, distance) = s._sample_s, s.train.tolist()
        fastest = max(speed, float(np.nanmax(held_speed_m_s, initial=0.0))) + 10.0 * n * sample_s
        ahead = distance + fastest * n * sample_s + 1.0
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
