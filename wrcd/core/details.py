"""A cause in figures: the input (in words, and Message.Signal of the configuration), what it is, and the limit.

Every function gives a text for a person; units are those that the field uses.
"""

import math
from collections.abc import Callable, Sequence

from wrcd.core.causes import Cause
from wrcd.core.configuration import Config
from wrcd.core.estimator import PairHealth
from wrcd.core.inputs import BRAKE, LAT, LOAD, QUANTITIES, RADIUS, SPEED, TORQUE, YAW, Inputs, TickInputs, rows_of
from wrcd.core.records import Estimate, Outliers
from wrcd.core.terms import HARSH_SHARE, MAX_JUMP, MIN_FIRING, MIN_M, MODELS, EstimateDoubt, PairState
from wrcd.core.validity import LOAD_SHARES, RADIUS_SHARES, ValidityMonitor

MAX_INPUTS = 2  # that a text names; of more the number


class Details:
    """Texts for one configuration's axles and inputs."""

    def __init__(self, config: Config) -> None:
        self._config, self._design = config, config.design
        self._quantity, rows = rows_of(config)
        self._signals: dict[tuple[int, int], str] = {}  # by row and axle
        for i, row in zip(config.inputs, rows, strict=True):
            for axle in i.source.axles:
                self._signals[row, axle] = f"{i.source.message}.{i.source.signal}"

    def name(self, quantity: int, axle: int) -> str:
        """An input: its quantity in words, and its signal, or signals where several add up."""
        rows = [row for row, q in enumerate(self._quantity) if q == quantity and (row, axle) in self._signals]
        if len(rows) == 1:
            return self.signal(rows[0], axle)
        signals = " + ".join(self._signals[row, axle] for row in rows)
        return f"{_words(quantity)} {signals or '(not mapped)'}"

    def signal(self, row: int, axle: int) -> str:
        """The same of one of its signals."""
        return f"{_words(self._quantity[row])} {self._signals[row, axle]}"

    def tick(self, cause: Cause, axle: int, inputs: Inputs, tick: TickInputs, end_us: int) -> str:
        """What speaks against a tick."""
        of: dict[Cause, Callable[[], str]] = {
            Cause.INPUT_STALE: lambda: self._overdue(axle, inputs, end_us, silent=False),
            Cause.TWO_SENDERS: lambda: self._contested(axle, inputs),
            Cause.SENSOR_DEGRADED: lambda: self._degraded(axle, inputs),
            Cause.UNCHANGED: lambda: self._unchanged(axle, inputs, end_us),
            Cause.SPEED_OUT_OF_RANGE: lambda: self._speed(axle, tick.speed_m_s),
            Cause.FRICTION_SHARE_UNKNOWN: lambda: self._friction(axle, inputs),
            Cause.LOAD_BEYOND: lambda: self._load(axle, inputs),
            Cause.RADIUS_BEYOND: lambda: self._radius(axle, inputs),
            Cause.TORQUES_CONTRADICT: lambda: self._against(axle, inputs),
        }
        return of[cause]() if cause in of else cause.words

    def unavailable(self, cause: Cause, axle: int, inputs: Inputs, validity: ValidityMonitor, end_us: int) -> str:
        """Why there is no estimate at the end of the newest tick."""
        if cause is Cause.INPUT_SILENT:
            return self._overdue(axle, inputs, end_us, silent=True)
        if cause is Cause.STANDSTILL:
            return f"{self.name(SPEED, axle)} {inputs.speed_m_s:.2f} m/s, limit {self._config.min_speed_m_s:g}"
        if cause is Cause.WARMING_UP:
            seen = validity.fresh_ticks(axle) * self._design.tick_s
            return f"{seen:.2f} s of the window's {self._design.window_s:g} s"
        return cause.words

    def jumped(self, axle: int, speed_m_s: float) -> str:
        """Why an axle was started anew: the speed."""
        return f"{self.name(SPEED, axle)} jumped to {speed_m_s:.2f} m/s"

    def outliers(self, axle: int, o: Outliers, wait_s: float) -> str:
        """The same: measurements that stay outliers."""
        far = [
            f"{self.name(channel, axle)} off by {_times(times)} the usual innovation, limit {limit:g}"
            for channel, times, limit in zip((YAW, LAT), o.times_usual, o.limits, strict=True)
            if not times <= limit
        ]
        if o.jump_rad_s > MAX_JUMP:
            far = [f"{self.name(YAW, axle)} jumped by {o.jump_rad_s:.3f} rad/s, limit {MAX_JUMP:g}"]
        first = f"{self.name(YAW, axle)} or {self.name(LAT, axle)} stood out among its first samples"
        return ("; ".join(far) or first) + (f"; waits {wait_s:g} s" if wait_s else "")

    def pair(self, axle: int, health: PairHealth) -> str:
        """What speaks against gyro and accelerometer."""
        f = health.figures(axle)
        yaw, lat = self.name(YAW, axle), self.name(LAT, axle)
        lead = f"{PairState(f.state).words} {f.probability:.2f}, sound {f.sound:.2f}"
        levels = f"{yaw} {f.yaw_rms:.1f}, {lat} {f.lat_rms:.1f} times the sensor's noise"
        return f"{lead}; {levels}; correlation {f.low:.2f} below 1.5 Hz, {f.middle:.2f} in 3 to 10 Hz"

    def estimate(self, cause: Cause, axle: int, e: Estimate) -> str:
        """What an estimate says against itself."""
        mu, window_s = float(e.mu_available_pct[axle]), float(e.window_s[axle])
        if cause is Cause.HARSH:
            share = 100 * float(e.live_share[axle])
            return f"{share:.0f} % of {window_s:.2f} s are far from pulses, limit {100 * HARSH_SHARE:g} %"
        if cause is Cause.BEYOND_TRAINING:
            return self._beyond(axle, e)
        if cause is Cause.NO_RULE:
            return f"the rules fire with {e.firing[axle]:.3f} in all, limit {MIN_FIRING:g}"
        if cause is Cause.CONTRADICTION:
            return (
                f"{self.name(TORQUE, axle)}: {e.used_pct[axle]:.2f} % in use, the rules say "
                f"{e.mu_from_rules_pct[axle]:.2f} %"
            )
        if e.doubt[axle] == EstimateDoubt.GAPS:
            share = 100 * float(e.live_share[axle])
            return f"{share:.0f} % of {window_s:.2f} s hold measurements on end, limit {100 * HARSH_SHARE:g} %"
        if not math.isfinite(mu):
            return f"{window_s:.2f} s of measurements are no estimate"
        return f"{window_s:.2f} s of track are less than {MIN_M:g} m"

    def _overdue(self, axle: int, inputs: Inputs, end_us: int, silent: bool) -> str:
        texts = []
        for row, age_us, limit_us, refused in inputs.overdue(axle, end_us, silent):
            if age_us is None:
                text = f"{self.signal(row, axle)} has not come"
            else:
                text = f"{self.signal(row, axle)} {age_us / 1000:.1f} ms old, limit {limit_us / 1000:g}"
            texts.append(text + (f" (refused since: {refused})" if refused else ""))
        return _listed(texts)

    def _contested(self, axle: int, inputs: Inputs) -> str:
        texts = []
        for row, refused in inputs.flagged(inputs.contested, axle):
            text = f"{self.signal(row, axle)}: two sequences of counters"
            texts.append(text + (f" (refused since: {refused})" if refused else ""))
        return _listed(texts)

    def _degraded(self, axle: int, inputs: Inputs) -> str:
        named = [self.signal(row, axle) for row, _ in inputs.flagged(inputs.degraded, axle)]
        return f"{_listed(named)}: the status says Degraded"

    def _unchanged(self, axle: int, inputs: Inputs, end_us: int) -> str:
        texts = []
        for quantity in sorted(inputs.quantities(inputs.unchanged(end_us), axle)):
            value, run = inputs.stuck_at(quantity, axle)
            unit = QUANTITIES[quantity].unit
            texts.append(f"{self.name(quantity, axle)} has been {value:.6g} {unit} in {run + 1} frames on end")
        return _listed(texts)

    def _speed(self, axle: int, speed_m_s: float) -> str:
        low, high = self._design.speeds_m_s[0], self._design.speeds_m_s[-1]
        return f"{self.name(SPEED, axle)} {speed_m_s:.2f} m/s, design {low:g} to {high:g}"

    def _friction(self, axle: int, inputs: Inputs) -> str:
        torque = inputs.value(TORQUE, axle)
        return f"{self.name(TORQUE, axle)} {torque / 1000:.2f} kN m is no traction; {self.name(BRAKE, axle)}"

    def _against(self, axle: int, inputs: Inputs) -> str:
        torques = inputs.torques(axle)
        named = [f"{self.signal(row, axle)} {torque / 1000:.2f} kN m" for row, torque in torques.items()]
        return " against ".join(named)

    def _load(self, axle: int, inputs: Inputs) -> str:
        load, design = inputs.value(LOAD, axle), 2 * self._design.normal_N
        low, high = LOAD_SHARES
        return f"{self.name(LOAD, axle)} {load / 1000:.1f} kN, design {design / 1000:.1f} kN ({low:g} to {high:g})"

    def _radius(self, axle: int, inputs: Inputs) -> str:
        radius, design = inputs.value(RADIUS, axle), self._design.r_0
        low, high = RADIUS_SHARES
        return f"{self.name(RADIUS, axle)} {1000 * radius:.0f} mm, design {1000 * design:.0f} mm ({low:g} to {high:g})"

    def _beyond(self, axle: int, e: Estimate) -> str:
        d = self._design
        seen = e.inputs[axle, :MODELS]
        spans = [max(float(high - low), 1e-9) for low, high in zip(d.low[:MODELS], d.high[:MODELS], strict=True)]
        outside = [max(float(d.low[m] - seen[m]), float(seen[m] - d.high[m])) / spans[m] for m in range(MODELS)]
        far = max(range(MODELS), key=outside.__getitem__)
        return (
            f"residuals unlike the design's wheelset: no. {far + 1} by {outside[far]:.2f} of its range outside, "
            f"limit {d.beyond:g}"
        )


def _words(quantity: int) -> str:
    return QUANTITIES[quantity].words


def _listed(texts: Sequence[str]) -> str:
    rest = len(texts) - MAX_INPUTS
    return "; ".join(texts[:MAX_INPUTS]) + (f"; and {rest} more" if rest > 0 else "")


def _times(x: float) -> str:
    return f"{x:.1f} times" if math.isfinite(x) else "infinite times"
