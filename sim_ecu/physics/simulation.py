"""A train of wheelsets on its rail, advanced sample by sample."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim_ecu.physics.rail import RAIL_COLUMNS
from sim_ecu.physics.track import Track
from sim_ecu.physics.wheelset import (
    W_L,
    W_R,
    Command,
    FloatArray,
    Wheelset,
    constants,
    simulate,
)


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
        self._axles = tuple(axles)
        self._p = constants(wheelset)
        self._c = wheelset.contact
        self._sample_s = sample_s
        self._step_scale = step_scale
        self._rails = tuple(np.ascontiguousarray(a.rail, dtype=np.float64) for a in axles)
        for rail in self._rails:
            if rail.ndim != 2 or rail.shape[1] != RAIL_COLUMNS or np.any(np.diff(rail[:, 0]) <= 0):
                raise ValueError(f"a rail table needs {RAIL_COLUMNS} columns and growing distances")
        for a in axles:
            if a.position_m < a.track.start_m:
                raise ValueError(f"an axle stands at {a.position_m:g} m, its track begins at {a.track.start_m:g} m")
        self._offset = np.array([a.position_m for a in axles])
        self._start = np.array([a.track.start_m for a in axles])
        self.state = np.zeros((len(axles), 7))
        self.state[:, W_R] = self.state[:, W_L] = speed_m_s / wheelset.r_0
        self.train = np.array([speed_m_s, 0.0])
        self._integral = np.zeros(len(axles))
        # the fastest decay of the contact times speed: r0^2 dF/dcreep / I of the lighter wheel, or the lateral and
        # yaw ones where those are faster (Kalker's slope, the curve's own reduction)
        w = wheelset
        slope = max(float(np.max(r[:, 4] + r[:, 5])) for r in self._rails) * 2 / np.pi * self._c.stiffness_N
        self._stiffest = slope * max(w.r_0**2 / min(w.I_L, w.I_R), 2 / w.m_w, 2 * w.L_g**2 / w.I_w)

    def advance(self, command: Command, held_speed_m_s: FloatArray) -> Samples:
        """Run one sample interval for each row of the command; the state stays for the next call."""
        n = len(held_speed_m_s)
        fastest = max(float(self.train[0]), float(np.nanmax(held_speed_m_s, initial=0.0))) + 10.0 * n * self._sample_s
        ahead = float(self.train[1]) + fastest * n * self._sample_s + 1.0
        nodes = tuple(a.track.reach(ahead + a.position_m) for a in self._axles)
        out, journey = simulate(
            self.state, self.train, self._integral, self._offset, self._start, nodes, self._rails,
            command, held_speed_m_s, self._sample_s, self._step_scale, self._p, self._c, self._stiffest,
        )  # fmt: skip
        return Samples(out, journey[:, 0], journey[:, 1])
