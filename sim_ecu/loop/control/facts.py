"""What a controller knows of its train: nominal data, as a project engineer would enter it."""

from dataclasses import dataclass, field

from sim_ecu.loop.scenario import DriveScenario
from sim_ecu.physics.actuators import Actuators
from sim_ecu.physics.wheelset import Wheelset


@dataclass(frozen=True, slots=True)
class Facts:
    """A train of like wheelsets. inertia_kg_m2: of a wheelset with its drive; mass_kg: the train's, per wheelset."""

    axles: tuple[int, ...]
    radius_m: float
    inertia_kg_m2: float
    mass_kg: float
    unit_adhesion_N_m: float  # 2 N r_0: torque that takes an adhesion of 1
    actuators: Actuators = field(default_factory=Actuators)

    @classmethod
    def of(cls, scenario: DriveScenario) -> "Facts":
        """The facts of a scenario's train."""
        return cls.of_wheelset(tuple(scenario.axles), scenario.train.wheelset, scenario.actuators)

    @classmethod
    def of_wheelset(cls, axles: tuple[int, ...], wheelset: Wheelset, actuators: Actuators) -> "Facts":
        """The facts of a train of such wheelsets."""
        w = wheelset
        return cls(axles, w.r_0, w.I_R + w.I_L, w.M_v, 2.0 * w.normal_N * w.r_0, actuators)

    @property
    def full_traction_N_m(self) -> float:
        """What the driver asks of a wheelset at a traction share of 1."""
        return self.actuators.drive.max_traction_N_m

    @property
    def full_brake_N_m(self) -> float:
        """What the driver asks of a wheelset at a brake share of 1, both brakes together."""
        return self.actuators.full_brake_N_m

    def asked_N_m(self, share: float, braking: bool) -> float:
        """|torque| that a share (0 ... 1) of the full effort asks of a wheelset."""
        return share * (self.full_brake_N_m if braking else self.full_traction_N_m)

    def electric_N_m(self, share: float, speed_m_s: float) -> float:
        """What the electric brake takes of a share of the full brake; it fades at low speed."""
        return self.actuators.electric_N_m(share, speed_m_s)
