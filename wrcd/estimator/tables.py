"""Tables over the speed."""

from bisect import bisect_left

from wrcd.estimator.design import FloatArray


class SpeedTable:
    """A table (v, …), linear between the speeds (v,), held at its ends."""

    def __init__(self, table: FloatArray, speeds_m_s: FloatArray) -> None:
        self._table, self._speeds = table, [float(v) for v in speeds_m_s]

    def at(self, speed_m_s: float) -> FloatArray:
        """The row at a speed."""
        speeds = self._speeds
        v = min(max(speed_m_s, speeds[0]), speeds[-1])
        i = min(max(bisect_left(speeds, v) - 1, 0), len(speeds) - 2)
        t = (v - speeds[i]) / (speeds[i + 1] - speeds[i])
        out: FloatArray = (1.0 - t) * self._table[i] + t * self._table[i + 1]
        return out
