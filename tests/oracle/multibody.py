"""A bogie under half a car body in a multibody code of others (exudyn): rigid bodies and spring-dampers are its own,
the contact is a user function that is written here. No code in common with the rig's equations."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from sim_ecu.physics.contact import CreepCurve
from sim_ecu.physics.wheelset import Bogie, Wheelset
from tests.support.tools import missing

if LACKS := missing("libGL.so.1"):
    pytest.skip(LACKS, allow_module_level=True)

import exudyn
from exudyn.itemInterface import (
    MarkerBodyPosition,
    MarkerBodyRigid,
    MarkerNodeCoordinate,
    Node1D,
    NodePoint2D,
    NodeRigidBody2D,
    ObjectConnectorCartesianSpringDamper,
    ObjectConnectorCoordinateSpringDamper,
    ObjectConnectorTorsionalSpringDamper,
    ObjectGenericODE2,
    ObjectGround,
    ObjectMassPoint2D,
    ObjectRigidBody2D,
    ObjectRotationalMass1D,
    SensorUserFunction,
)

FloatArray = NDArray[np.float64]
COORDINATES = 5  # of a wheelset: along the track, lateral, yaw, and how far its right and left wheel have turned


@dataclass(frozen=True, slots=True)
class Ride:
    """n moments: wheelsets (n, 2, 7) with y, y', psi, psi', w_R, w_L, theta; vehicle (n, 6) with y, y', psi, psi' of
    the frame and y, y' of the half body."""

    wheelsets: FloatArray
    vehicle: FloatArray


def ride(
    w: Wheelset, b: Bogie, curve: CreepCurve, speed_m_s: float, torque_N_m: float, y_t: Callable[[float], float],
    samples: int, sample_s: float, steps_per_sample: int = 10,
) -> Ride:  # fmt: skip
    """Run both wheelsets with a torque at a held speed on straight track, from rest across the track.

    y_t(x) is the track's irregularity (m); the leading wheelset begins at the bogie's wheelbase, the trailing one at 0.
    Runge-Kutta of order 6 in steps of equal length. Their model has no flange.
    """
    container = exudyn.SystemContainer()
    mbs = container.AddSystem()
    ground = mbs.AddObject(ObjectGround())
    frame_node = mbs.AddNode(NodeRigidBody2D(referenceCoordinates=[0.0, 0.0, 0.0]))
    frame = mbs.AddObject(
        ObjectRigidBody2D(mass=b.frame_mass_kg, inertia=b.frame_yaw_inertia_kg_m2, nodeNumber=frame_node)
    )
    body_node = mbs.AddNode(NodePoint2D(referenceCoordinates=[0.0, 0.0]))
    body = mbs.AddObject(ObjectMassPoint2D(mass=b.body_mass_kg, nodeNumber=body_node))

    def on(which: Any, ahead_m: float = 0.0) -> Any:
        return mbs.AddMarker(MarkerBodyRigid(bodyNumber=which, localPosition=[ahead_m, 0.0, 0.0]))

    def across(markers: list[Any], stiffness: float, damping: float) -> None:
        mbs.AddObject(
            ObjectConnectorCartesianSpringDamper(
                markerNumbers=markers, stiffness=[0.0, stiffness, 0.0], damping=[0.0, damping, 0.0]
            )
        )

    def about(markers: list[Any], stiffness: float, damping: float) -> None:
        mbs.AddObject(ObjectConnectorTorsionalSpringDamper(markerNumbers=markers, stiffness=stiffness, damping=damping))

    across(
        [on(frame), mbs.AddMarker(MarkerBodyPosition(bodyNumber=body))],
        b.secondary_lateral_N_m,
        b.secondary_lateral_damping_N_s_m,
    )
    about([on(ground), on(frame)], b.secondary_yaw_N_m_rad, b.secondary_yaw_damping_N_m_s_rad)
    nodes: list[Any] = []
    for ahead_m in (b.semi_wheelbase_m, -b.semi_wheelbase_m):
        node = mbs.AddNode(NodeRigidBody2D(referenceCoordinates=[ahead_m, 0.0, 0.0]))
        wheelset = mbs.AddObject(ObjectRigidBody2D(mass=w.m_w, inertia=w.I_w, nodeNumber=node))
        held = [on(frame, ahead_m), on(wheelset)]
        across(held, b.primary_lateral_N_m, b.primary_lateral_damping_N_s_m)
        about(held, b.primary_yaw_N_m_rad, b.primary_yaw_damping_N_m_s_rad)
        wheels = [
            mbs.AddNode(Node1D(referenceCoordinates=[0.0], initialVelocities=[speed_m_s / w.r_0])) for _ in range(2)
        ]
        for wheel, inertia in zip(wheels, (w.I_R, w.I_L), strict=True):
            mbs.AddObject(ObjectRotationalMass1D(inertia=inertia, nodeNumber=wheel))
        ends = [mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=wheel, coordinate=0)) for wheel in wheels]
        mbs.AddObject(ObjectConnectorCoordinateSpringDamper(markerNumbers=ends, stiffness=w.k_s, damping=w.C_s))
        nodes += [node, *wheels]
    stiffness_N = w.contact.stiffness_N

    def of_rails(_mbs: Any, t: float, _item: int, q: list[float], q_t: list[float]) -> list[float]:
        """Forces of rails and drive on the coordinates of both wheelsets."""
        out: list[float] = []
        for j, at in enumerate((speed_m_s * t + b.wheelbase_m, speed_m_s * t)):
            _, y, psi, _, _ = q[j * COORDINATES : (j + 1) * COORDINATES]
            _, y_dot, psi_dot, w_R, w_L = q_t[j * COORDINATES : (j + 1) * COORDINATES]
            from_middle = y - y_t(at)
            turned = w.L_g * psi_dot / speed_m_s + w.gamma * from_middle / w.r_0
            across_creep = y_dot / speed_m_s - psi
            right = w.r_0 * w_R / speed_m_s - 1.0 - turned
            left = w.r_0 * w_L / speed_m_s - 1.0 + turned
            F_xR, F_yR = rail_force(right, across_creep, speed_m_s, curve, w.normal_N, stiffness_N)
            F_xL, F_yL = rail_force(left, across_creep, speed_m_s, curve, w.normal_N, stiffness_N)
            centring = 2.0 * w.normal_N * w.gamma / w.L_g * from_middle
            out += [0.0, -F_yR - F_yL - centring, (F_xR - F_xL) * w.L_g, torque_N_m - w.r_0 * F_xR, -w.r_0 * F_xL]
        return out

    none = np.zeros((2 * COORDINATES, 2 * COORDINATES))
    mbs.AddObject(ObjectGenericODE2(nodeNumbers=nodes, massMatrix=none, forceUserFunction=of_rails))

    def state(mbs: Any, _t: float, _sensors: Any, _factors: Any, _configuration: Any) -> FloatArray:
        """All coordinates, then how fast they change: of frame (3), body (2), wheelsets."""
        return np.concatenate([mbs.systemData.GetODE2Coordinates(), mbs.systemData.GetODE2Coordinates_t()])

    sensor = mbs.AddSensor(SensorUserFunction(sensorUserFunction=state, storeInternal=True, writeToFile=False))
    mbs.Assemble()
    settings = exudyn.SimulationSettings()
    settings.timeIntegration.endTime = samples * sample_s
    settings.timeIntegration.numberOfSteps = samples * steps_per_sample
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = sample_s
    mbs.SolveDynamic(settings, solverType=exudyn.DynamicSolverType.RK67)
    stored = np.asarray(mbs.GetSensorStoredData(sensor))[1:, 1:]
    x, v = np.split(stored, 2, axis=1)
    first = COORDINATES  # those of frame and body come first
    wheelsets = np.empty((len(stored), 2, 7))
    for j in range(2):
        c = first + j * COORDINATES
        wheelsets[:, j] = np.column_stack(
            [x[:, c + 1], v[:, c + 1], x[:, c + 2], v[:, c + 2], v[:, c + 3], v[:, c + 4], x[:, c + 3] - x[:, c + 4]]
        )
    return Ride(wheelsets, np.column_stack([x[:, 1], v[:, 1], x[:, 2], v[:, 2], x[:, 4], v[:, 4]]))


def rail_force(
    along: float, across: float, speed_m_s: float, c: CreepCurve, normal_N: float, stiffness_N: float
) -> tuple[float, float]:
    """The force of a wheel on its rail along and across the track (N), from its creepages (no unit): Polach's law,
    Wear 258:992-1000 (2005)."""
    creep = math.hypot(along, across)
    if creep == 0.0:
        return 0.0, 0.0
    friction = c.mu_0 * ((1.0 - c.A) * math.exp(-c.B * creep * speed_m_s) + c.A)
    gradient = stiffness_N * creep / (normal_N * friction)
    adhesion = c.k_A * gradient / (1.0 + (c.k_A * gradient) ** 2)
    force = 2.0 * normal_N * friction / math.pi * (adhesion + math.atan(c.k_S * gradient))
    return force * along / creep, force * across / creep
