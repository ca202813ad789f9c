"""What is driven: a train on its rail, and what its driver asks for."""

from dataclasses import dataclass, field

from sim_ecu.physics.actuators import Actuators
from sim_ecu.play.scenario import Course, Scenario


@dataclass(frozen=True, slots=True)
class DriveScenario:
    """A situation whose torques nobody has fixed.

    train: wheelsets, rail, track, sensors, faults and duration; its drives and held speed are not used. driver: share
    of the full effort over time, traction positive, braking negative. known_before: the rail of the demand was under
    the wheels before it came. stop_m_s: slower than that, the run is over.
    """

    train: Scenario
    driver: Course
    actuators: Actuators = field(default_factory=Actuators)
    known_before: bool = False
    stop_m_s: float = 3.0

    @property
    def axles(self) -> list[int]:
        """The axles' numbers."""
        return [a.number for a in self.train.axles]
