"""The speed that a train without a radar sends: a reference made from its wheels."""

from sim_ecu.loop.scenario import DriveScenario
from sim_ecu.physics.wheelset import FloatArray

MARGIN = 1.2  # over what full effort gives on a rail that carries it; our choice
MORE_M_S2 = 0.3  # beside it: resistance, slope; our choice


class TrainSpeed:
    """Braked wheels are no faster than the train, driven ones no slower: the fastest or the slowest is believed.

    Where all of them slip, the reference follows no faster than the train can brake or accelerate on a good rail. It
    errs then, as such a reference does.
    """

    def __init__(self, scenario: DriveScenario, step_s: float) -> None:
        w, a = scenario.train.wheelset, scenario.actuators
        per_torque = MARGIN / (w.r_0 * w.M_v)
        self._fall = step_s * (a.full_brake_N_m * per_torque + MORE_M_S2)
        self._rise = step_s * (a.drive.max_traction_N_m * per_torque + MORE_M_S2)
        self._m_s: float | None = None

    def step(self, wheel_m_s: FloatArray, share: float) -> float:
        """The reference (m/s) after one step, from the wheels (axles,) and what the driver asks (signed share)."""
        if share < 0.0:
            told = float(wheel_m_s.max())
            self._m_s = told if self._m_s is None else max(told, self._m_s - self._fall)
        elif share > 0.0:
            told = float(wheel_m_s.min())
            self._m_s = told if self._m_s is None else min(told, self._m_s + self._rise)
        else:
            self._m_s = float(wheel_m_s.mean())
        return max(self._m_s, 0.0)
