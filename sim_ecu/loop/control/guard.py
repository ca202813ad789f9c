"""The time guard of wheel-slide protection: no axle stays without brake for longer than a stated time.

What a safety timer is to a WSP on a train. Whatever the wheels say, a sensor that tells of a slide which is none must
not keep the brake off.
"""

WITHOUT_SHARE = 0.02  # of the full brake: an axle that is given less has no brake
MAX_WITHOUT_S = 3.0
APPLIED_S = 0.5  # then it has what the driver asks for so long


class Guard:
    """The guard of one axle. interventions: how often it took the brake out of the protection's hands."""

    def __init__(self) -> None:
        self.interventions = 0
        self._with_us: int | None = None
        self._until_us = 0

    def step(self, now_us: int, torque_N_m: float, asked_N_m: float, full_N_m: float) -> float:
        """|torque| of a cycle when braking, from what the protection gives and what the driver asks."""
        if now_us < self._until_us:
            return asked_N_m
        without = torque_N_m < WITHOUT_SHARE * full_N_m <= asked_N_m
        if self._with_us is None or not without:
            self._with_us = now_us
        elif now_us - self._with_us >= MAX_WITHOUT_S * 1e6:
            self.interventions += 1
            self._with_us, self._until_us = None, now_us + round(APPLIED_S * 1e6)
            return asked_N_m
        return torque_N_m
