"""A train of wheelsets on its rail, advanced sample by sample."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sim_ecu.physics.cleaning import CleanedRail, Cleaning
from sim_ecu.physics.integration import Rides, integrate
from sim_ecu.physics.rail import RAIL_COLUMNS
from sim_ecu.physics.track import SPACING_M, Track
from sim_ecu.physics.wheelset import (
    AXLE_STATES,
    BOGIE_STATES,
    LANES,
    MU_USED,
    ROLLING_START,
    SLIP,
    W_L,
    W_R,
    Bogie,
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

    Axles with the same track meet the same irregularity at the same place, each when it gets there. trailing: the
    second wheelset of its bogie, where the first is not given; see `_in_bogies`.
    """

    rail: FloatArray
    track: Track
    position_m: float = 0.0  # ahead of the train's own distance
    trailing: bool = False


@dataclass(frozen=True, slots=True)
class Samples:
    """n sample intervals: outputs (n, axles, OUTPUTS), speed and distance (n,) at the end of each."""

    outputs: FloatArray
    speed_m_s: FloatArray
    distance_m: FloatArray


SAME_PLACE_M = 0.01


def _in_bogies(axles: Sequence[Axle], bogie: Bogie | None) -> tuple[list[tuple[Axle, int]], list[int]]:
    """What is simulated, bogie by bogie, the leading wheelset first: an axle, and which of the given ones commands it;
    and where the given ones are among them.

    Axles on one track a wheelbase apart share a bogie. One that has no such neighbour is given one that runs on the
    same rail with the same command, and is seen by nobody: behind it, or ahead of it if it is a trailing one.
    """
    if bogie is None:
        return [(a, k) for k, a in enumerate(axles)], list(range(len(axles)))
    lanes: list[tuple[Axle, int]] = []
    places = [-1] * len(axles)
    for k, a in enumerate(axles):
        if places[k] >= 0:
            continue
        pair = [(a, k)]
        for m in range(k + 1, len(axles)):
            apart = abs(axles[m].position_m - a.position_m) - bogie.wheelbase_m
            if places[m] < 0 and axles[m].track is a.track and abs(apart) < SAME_PLACE_M:
                pair.append((axles[m], m))
                break
        else:
            at_m = a.position_m + (bogie.wheelbase_m if a.trailing else -bogie.wheelbase_m)
            a.track.ensure_behind(-at_m)
            pair.append((replace(a, position_m=at_m), k))
        pair.sort(key=lambda lane: -lane[0].position_m)
        for axle, source in pair:
            if axle is axles[source]:
                places[source] = len(lanes)
            lanes.append((axle, source))
    return lanes, places


class Simulation:
    """Equations (1)-(12) in time, of axles alone or in bogies, as the wheelset says. step_scale 2 halves the
    integration step (for the convergence test). cleaning: by the slip of the axles, in step() alone; None for a rail
    that stays as it is."""

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
        bogie = wheelset.bogie
        lanes, self._places = _in_bogies(axles, bogie)
        self._lanes = tuple(axle for axle, _ in lanes)
        self._sources = [source for _, source in lanes]
        self._sample_s = sample_s
        self._step_scale = step_scale
        self._rails = [np.ascontiguousarray(a.rail, dtype=np.float64) for a in self._lanes]
        for rail in self._rails:
            if rail.ndim != 2 or rail.shape[1] != RAIL_COLUMNS or np.any(np.diff(rail[:, 0]) <= 0):
                raise ValueError(f"a rail table needs {RAIL_COLUMNS} columns and growing distances")
        for a in self._lanes:
            if a.position_m < a.track.start_m:
                raise ValueError(f"an axle stands at {a.position_m:g} m, its track begins at {a.track.start_m:g} m")
        n = len(lanes)
        self.state = np.zeros((n, AXLE_STATES))
        self.state[:, W_R] = self.state[:, W_L] = speed_m_s / wheelset.r_0
        self.bogies = np.zeros((n, BOGIE_STATES))
        self.train = np.array([speed_m_s, 0.0])
        self._integral = np.zeros(n)
        # of step(): what it runs on, for how many samples of that it has run, and its command
        self._ride: Rides
        self._ridden = RIDE_SAMPLES
        self._torque, nothing = np.zeros((1, n)), np.full((1, n), math.nan)
        self._brake, self._free = np.zeros((1, n)), np.array([math.nan])
        self._command = Command(self._torque, nothing, nothing, nothing, np.full((1, n), NO_LIMIT))
        # the fastest decay of the contact times speed: r0^2 dF/dcreep / I of the lighter wheel, or the lateral and
        # yaw ones where those are faster (Kalker's slope, the curve's own reduction)
        w, c = wheelset, wheelset.contact
        leading = [bogie is None or k % 2 == 0 for k in range(n)]
        self._numbers = [[*constants(w, first), *c] for first in leading]
        self._leaders = [-1 if bogie is None else k - k % 2 for k in range(n)]
        steepest = [float(np.max(r[:, 4] + r[:, 5])) for r in self._rails]
        self._cleaned: CleanedRail | None = None
        if cleaning is not None:
            steepest.append(cleaning.steepest)
            self._cleaned = CleanedRail(cleaning, self._rails, [a.position_m for a in self._lanes])
        self._load_N = 2 * wheelset.normal_N
        slope = max(steepest) * 2 / np.pi * c.stiffness_N
        self._stiffest = slope * max(w.r_0**2 / min(w.I_L, w.I_R), 2 / w.m_w, 2 * w.L_g**2 / w.I_w)
        self._suspended = 0.0 if bogie is None else fastest_of(w, bogie)

    @property
    def axle_states(self) -> FloatArray:
        """(axles, AXLE_STATES): of the axles that were given, in their order."""
        return self.state[self._places]

    def advance(self, command: Command, held_speed_m_s: FloatArray) -> Samples:
        """Run one sample interval for each row of the command; the state stays for the next call."""
        n = len(self._lanes)
        if n > LANES and np.isnan(held_speed_m_s).any():
            raise ValueError(f"a train that moves freely has up to {LANES} wheelsets, those of its bogies included")
        train = np.tile(self.train, (n, 1))
        out, journey = integrate(
            self.state, self.bogies, train, self._integral, _rides([self], held_speed_m_s), self._of_lanes(command),
            np.zeros((len(held_speed_m_s), n)), held_speed_m_s, self._sample_s, self._step_scale,
        )  # fmt: skip
        self.train = train[0]
        self._ridden = RIDE_SAMPLES
        return Samples(out[:, self._places], journey[:, 0, 0], journey[:, 0, 1])

    def _of_lanes(self, command: Command) -> Command:
        """The command of every wheelset, from that of the given axles; each part lying row by row: what is compiled is
        compiled for one layout."""
        return Command(*(np.ascontiguousarray(c[:, self._sources]) for c in command))

    def step(self, torque_N_m: FloatArray, brake_N_m: FloatArray) -> Samples:
        """One sample interval of a train that moves freely, without limit of creep; arrays (axles,).

        torque_N_m: of the drives, which turn a wheel either way. brake_N_m: what the brakes can hold, no less than 0;
        they oppose the wheel's turning and hold one that stands.
        """
        n = len(self._lanes)
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
        self._torque[0], self._brake[0] = torque_N_m[self._sources], brake_N_m[self._sources]
        out, journey = integrate(
            self.state, self.bogies, train, self._integral, self._ride, self._command, self._brake, self._free,
            self._sample_s, self._step_scale,
        )  # fmt: skip
        self.train = train[0]
        if self._cleaned is not None:
            energy_J = self.slip_energy_J(Samples(out, journey[:, 0, 0], journey[:, 0, 1]))[0]
            self._cleaned.add(energy_J / 1e3, before_m, float(self.train[1]))
        return Samples(out[:, self._places], journey[:, 0, 0], journey[:, 0, 1])

    def slip_energy_J(self, s: Samples) -> FloatArray:
        """Return what both wheels' slip along the rail dissipates in each sample, (samples, axles)."""
        sliding = s.outputs[:, :, SLIP] * np.maximum(s.speed_m_s, ROLLING_START)[:, None]  # m/s, means
        out: FloatArray = np.abs(s.outputs[:, :, MU_USED] * sliding) * (self._load_N * self._sample_s)
        return out


def fastest_of(w: Wheelset, bogie: Bogie) -> float:
    """The fastest (1/s) of the suspension: the largest sum of its stiffnesses over a body's inertia, as a frequency, or
    of its dampers, as a decay; each at most so fast (Gershgorin)."""
    b, a2 = bogie, bogie.semi_wheelbase_m**2

    def most(lateral: float, yaw: float, secondary: float, secondary_yaw: float) -> float:
        return max(
            2 * lateral / w.m_w, 2 * yaw / w.I_w, (4 * lateral + 2 * secondary) / b.frame_mass_kg,
            (4 * (lateral * a2 + yaw) + secondary_yaw) / b.frame_yaw_inertia_kg_m2, 2 * secondary / b.body_mass_kg,
        )  # fmt: skip

    stiff = most(b.primary_lateral_N_m, b.primary_yaw_N_m_rad, b.secondary_lateral_N_m, b.secondary_yaw_N_m_rad)
    damped = most(
        b.primary_lateral_damping_N_s_m, b.primary_yaw_damping_N_m_s_rad, b.secondary_lateral_damping_N_s_m,
        b.secondary_yaw_damping_N_m_s_rad,
    )  # fmt: skip
    return max(math.sqrt(stiff), damped)


def advance_side_by_side(
    simulations: Sequence[Simulation], command: Command, held_speed_m_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """`Simulation.advance` of many trains of one kind in one compiled call; the command's columns are their axles', one
    train after another.

    Returns outputs (samples, n, OUTPUTS) and (samples, n, 2) of v and distance, equal to those of single calls. Fastest
    where neighbours take steps alike: trains of one speed in the order of how stiff their contact is.
    """
    first = simulations[0]
    lanes, axles = len(first._lanes), len(first._places)
    if any((len(s._lanes), len(s._places), s._sample_s) != (lanes, axles, first._sample_s) for s in simulations):
        raise ValueError("trains side by side have as many axles each, and one sample interval")
    if LANES % lanes:
        raise ValueError(f"trains side by side have a number of wheelsets that divides {LANES}, not {lanes}")
    state, bogies, integral = (
        np.concatenate([getattr(s, name) for s in simulations]) for name in ("state", "bogies", "_integral")
    )
    train = np.repeat([s.train for s in simulations], lanes, axis=0)
    sources = np.concatenate([k * axles + np.array(s._sources) for k, s in enumerate(simulations)])
    places = np.concatenate([k * lanes + np.array(s._places) for k, s in enumerate(simulations)])
    out, journey = integrate(
        state, bogies, train, integral, _rides(simulations, held_speed_m_s),
        Command(*(np.ascontiguousarray(c[:, sources]) for c in command)),
        np.zeros((len(held_speed_m_s), len(state))), held_speed_m_s, first._sample_s, first._step_scale,
    )  # fmt: skip
    for i, s in enumerate(simulations):
        own = slice(i * lanes, (i + 1) * lanes)
        s.state, s.bogies, s.train, s._integral = state[own], bogies[own], train[own][0], integral[own]
    return out[:, places], journey[:, places]


def _rides(simulations: Sequence[Simulation], held_speed_m_s: FloatArray) -> Rides:
    """All axles of some simulations, with as much of their tracks as so many samples need."""
    n = len(held_speed_m_s)
    rails, nodes, first_node, before, numbers = [], [], [], [], []
    for s in simulations:
        sample_s, (speed, distance) = s._sample_s, s.train.tolist()
        fastest = max(speed, float(np.nanmax(held_speed_m_s, initial=0.0))) + 10.0 * n * sample_s
        ahead = distance + fastest * n * sample_s + 1.0
        rails += s._rails
        for a in s._lanes:
            reached = a.track.reach(ahead + a.position_m)
            low = max(0, math.floor((distance + a.position_m - a.track.start_m - 1.0) / SPACING_M))
            high = min(len(reached), math.ceil((ahead + a.position_m - a.track.start_m) / SPACING_M) + 2)
            first_node.append(low)
            before.append(high)
            nodes.append(reached[low:high])
        numbers += s._numbers
    axles = [a for s in simulations for a in s._lanes]
    heads = np.cumsum([0, *(len(s._lanes) for s in simulations)])[:-1]
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
        rolls=np.array([a.track.rolls for a in axles]),
        stiffest=np.array([s._stiffest for s in simulations for _ in s._lanes]),
        suspended=np.array([s._suspended for s in simulations for _ in s._lanes]),
        leader=np.array([k if k < 0 else h + k for h, s in zip(heads, simulations, strict=True) for k in s._leaders]),
        head=np.repeat(heads, [len(s._lanes) for s in simulations]),
    )
