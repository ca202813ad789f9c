"""Time stamps that the controller itself makes."""


class HardwareClock:
    """Lays a controller's own clock, which counts from anywhere and drifts, on the kernel's.

    A frame is never stamped by the kernel before the controller has it, so the least difference of the two that was
    seen lately is the offset between the clocks. Lately is 10 to 20 s: a drift of 50 ppm is a millisecond in that time.
    """

    KEPT_US = 10_000_000
    # So many frames in a row that seem to be late by more than that: the kernel's clock has been set forwards.
    MAX_LATE_US, MAX_LATE_FRAMES = 5_000, 50

    def __init__(self) -> None:
        self._since_us = 0
        self._min_offset_us: int | None = None
        self._previous_min_offset_us: int | None = None
        self._late = 0

    def to_kernel_time(self, raw_us: int, kernel_us: int) -> int:
        """Return the controller's stamp on the kernel's clock, in µs, never later than the kernel's own.

        raw_us is 0 for a frame that the controller has not stamped: the kernel's stamp is returned.
        """
        if not raw_us:
            return kernel_us
        difference = kernel_us - raw_us
        known = [d for d in (self._min_offset_us, self._previous_min_offset_us) if d is not None]
        self._late = self._late + 1 if known and difference - min(known) > self.MAX_LATE_US else 0
        if not known or abs(difference - min(known)) > 1_000_000 or self._late > self.MAX_LATE_FRAMES:  # it has stepped
            self._late = 0
            self._min_offset_us = self._previous_min_offset_us = difference
            self._since_us = kernel_us
        elif kernel_us - self._since_us > self.KEPT_US:
            self._previous_min_offset_us, self._min_offset_us = self._min_offset_us, difference
            self._since_us = kernel_us
        self._min_offset_us = difference if self._min_offset_us is None else min(self._min_offset_us, difference)
        return raw_us + min(d for d in (self._min_offset_us, self._previous_min_offset_us) if d is not None)
