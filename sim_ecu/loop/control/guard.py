"""The time guard of wheel-slide protection: no axle stays without brake for longer than a stated time.

What a safety timer is to a WSP on a train. Whatever the wheels say, a sensor that tells of a slide which is none must
not keep the brake off.
"""

WITHOUT_SHARE = 0.02  # of the full brake: an axle that is given less has no brake
MAX_WITHOUT_S = 3.0
APPLIED_S = 0.5  # then it has what the driver asks for so long
MAX_WITHOUT_ROLLING = 2  # interventions; then the axle's protection is off
ROLLED_M_S = 0.5  # a wheel without brake that has gained so much rolls


class Guard:
    """The guard of one axle. interventions: how often it took the brake out of the protection's hands.

    off: the wheel never rolled up between interventions, so its speed tells nothing. The axle has what the driver asks
    until the protection would give it too, or the effort ends.
    """

    def __init__(self) -> None:
        self.interventions = 0
        self.off = False
        self._without_rolling = 0
        self._lowest_m_s: float | None = None
        self._with_us: int | None = None
        self._until_us = 0

    def begin(self, now_us: int) -> None:
        """Count the time without brake from now on."""
        self._with_us = now_us

    def reset(self) -> None:
        """Forget the effort that has ended."""
        self.off, self._without_rolling, self._lowest_m_s = False, 0, None

    def step(self, now_us: int, wheel_m_s: float, torque_N_m: float, asked_N_m: float, full_N_m: float) -> float:
        """|torque| of a cycle when braking, from what the protection gives and what the driver asks."""
        if now_us < self._until_us:
            return asked_N_m
        without = torque_N_m < WITHOUT_SHARE * full_N_m <= asked_N_m
        if not without or self._rolls(wheel_m_s):
            self._without_rolling = 0
        self.off = self.off and torque_N_m < asked_N_m and not self._rolls(wheel_m_s)
        if self.off:
            return asked_N_m
        if self._with_us is None or not without:
            self._with_us, self._lowest_m_s = now_us, wheel_m_s
        elif now_us - self._with_us >= MAX_WITHOUT_S * 1e6:
            self.interventions += 1
            self._without_rolling += 1
            self.off = self._without_rolling >= MAX_WITHOUT_ROLLING
            self._with_us, self._lowest_m_s, self._until_us = None, None, now_us + round(APPLIED_S * 1e6)
            return asked_N_m
        return torque_N_m

    def _rolls(self, wheel_m_s: float) -> bool:
        """Whether the wheel has gained speed since the newest intervention."""
        self._lowest_m_s = wheel_m_s if self._lowest_m_s is None else min(self._lowest_m_s, wheel_m_s)
        return wheel_m_s - self._lowest_m_s > ROLLED_M_S
