"""What a bench script reads of an axle: what is true, what its sensors say, what the daemon says."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Truth:
    """What is true of an axle after a step. Torque and adhesion in use are means of the step, signed as driven."""

    mu_available: float
    mu_used: float
    slip_m_s: float  # wheel less ground
    wheel_m_s: float
    speed_m_s: float  # of the train over ground
    torque_N_m: float  # all together: traction, electric and friction brake
    pressure_bar: float


@dataclass(frozen=True, slots=True)
class Sensors:
    """What the newest frames of an axle and its train say, with noise and faults; None: none has come yet."""

    yaw_rate_rad_s: float | None
    lateral_acceleration_m_s2: float | None
    torque_N_m: float | None
    vehicle_speed_m_s: float | None
    wheel_speed_m_s: float | None
    pressure_bar: float | None


@dataclass(frozen=True, slots=True)
class Adhesion:
    """The newest Adhesion frame of an axle. Words and numbers are None where the configuration does not send them.

    validity: "Valid", "Degraded", "NotAvailable" or "Error". half_width: of the 90 % interval around mu_available; None
    if it is wider than any that the frame can state. age_s: since the frame, not of its inputs.
    """

    validity: str | None
    mu_available: float | None
    mu_used: float | None
    half_width: float | None
    surface: str | None
    contact_state: str | None
    age_s: float
    max_age_s: float

    @property
    def valid(self) -> bool:
        """Whether it may be used: Valid, with a number, and no older than its time-out."""
        return self.validity == "Valid" and self.mu_available is not None and self.age_s <= self.max_age_s
