"""A cause in figures: the input (in words, and Message.Signal of the configuration), what it is, and the limit.

Texts for a person, made of the core's events (WRCD_EVENT in wrcd/core/c/wrcd.h); units are those that the field uses.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

from wrcd.bus.mapping import Mapped
from wrcd.bus.reasons import Reason
from wrcd.core.causes import OF_PAIR, Cause
from wrcd.core.configuration import LOAD_SHARES, RADIUS_SHARES, Config
from wrcd.core.tables import BRAKE, LAT, LOAD, QUANTITIES, RADIUS, SPEED, TORQUE, YAW, silent_us
from wrcd.core.terms import GAPS_SHARE, HARSH_SHARE, MAX_JUMP, MIN_FIRING, MIN_M, MODELS, EstimateDoubt, PairState

MAX_INPUTS = 2  # that a text names; of more the number
NEVER = -(1 << 60)
_OWN, _KNOWN, _ESTIMATE = range(3)  # whose figures a change has
_CAUSES = tuple(Cause)  # by their number
_REASONS = ("", *(r.value for r in Reason))
Event = Any  # a record


class Details:
    """Texts for one configuration's axles and inputs."""

    def __init__(self, config: Config, mapped: Mapped) -> None:
        self._config, self._design = config, config.design
        self._sources = [s.source for s in mapped.signals]
        self._steps = [abs(s.scale * s.factor) for s in mapped.signals]
        self._of_tick: dict[Cause, Callable[[Event], str]] = {
            Cause.INPUT_STALE: self._overdue, Cause.INPUT_SILENT: self._overdue, Cause.TWO_SENDERS: self._contested,
            Cause.SENSOR_DEGRADED: self._degraded, Cause.UNCHANGED: self._unchanged,
            Cause.SPEED_OUT_OF_RANGE: self._speed, Cause.FRICTION_SHARE_UNKNOWN: self._friction,
            Cause.LOAD_BEYOND: self._load, Cause.RADIUS_BEYOND: self._radius, Cause.TORQUES_CONTRADICT: self._against,
            Cause.STANDSTILL: self._standstill, Cause.WARMING_UP: self._warming_up, Cause.RESTARTED: self._restarted,
            **dict.fromkeys(OF_PAIR, self._pair),
        }  # fmt: skip

    def of(self, change: Event, known: Event | None) -> str:
        """What a change of Validity has come from; known: how its cause was as it began."""
        cause = _CAUSES[change["cause"]]
        if change["figures"] == _ESTIMATE and cause:
            return self._estimate(cause, change)
        event = known if change["figures"] == _KNOWN else change
        if event is None or not cause:
            return str(cause.words)
        return self._of_tick[cause](event) if cause in self._of_tick else str(cause.words)

    def _name(self, quantity: int, event: Event) -> str:
        """An input of the event's axle: its quantity in words, and its signal, or signals where several add up."""
        of = [s for s in self._sources if s.quantity is QUANTITIES[quantity] and event["axle"] in s.axles]
        signals = " + ".join(f"{s.message}.{s.signal}" for s in sorted(of, key=lambda s: s.part))
        return f"{QUANTITIES[quantity].words} {signals or '(not mapped)'}"

    def _signal(self, number: int) -> str:
        """The same of one signal."""
        s = self._sources[number]
        return f"{s.quantity.words} {s.message}.{s.signal}"

    def _listed(self, event: Event, text: Callable[[int, int], str]) -> str:
        """The inputs that are concerned; text of the place among these and the input."""
        texts = [text(k, int(event["input"][k])) for k in range(min(int(event["listed"]), MAX_INPUTS))]
        rest = int(event["listed"]) - MAX_INPUTS
        return "; ".join(texts) + (f"; and {rest} more" if rest > 0 else "")

    def _standstill(self, e: Event) -> str:
        return f"{self._name(SPEED, e)} {e['number'][0]:.2f} m/s, limit {self._config.min_speed_m_s:g}"

    def _warming_up(self, e: Event) -> str:
        return f"{e['number'][0] * self._design.tick_s:.2f} s of the window's {self._design.window_s:g} s"

    def _restarted(self, e: Event) -> str:
        """Why an axle was started anew: the speed, or measurements that stay outliers."""
        if e["listed"]:
            return f"{self._name(SPEED, e)} jumped to {e['number'][0]:.2f} m/s"
        *of_channels, jump_rad_s, wait_s = e["number"][:6].tolist()
        far = [
            f"{self._name(channel, e)} off by {_times(times)} the usual innovation, limit {limit:g}"
            for channel, times, limit in zip((YAW, LAT), of_channels[:2], of_channels[2:], strict=True)
            if not times <= limit
        ]
        if jump_rad_s > MAX_JUMP:
            far = [f"{self._name(YAW, e)} jumped by {jump_rad_s:.3f} rad/s, limit {MAX_JUMP:g}"]
        first = f"{self._name(YAW, e)} or {self._name(LAT, e)} stood out among its first samples"
        return ("; ".join(far) or first) + (f"; waits {wait_s:g} s" if wait_s else "")

    def _pair(self, e: Event) -> str:
        """What speaks against gyro and accelerometer."""
        state, low, middle, yaw_rms, lat_rms, probability, sound = e["number"][:7].tolist()
        lead = f"{PairState(int(state)).words} {probability:.2f}, sound {sound:.2f}"
        levels = f"{self._name(YAW, e)} {yaw_rms:.1f}, {self._name(LAT, e)} {lat_rms:.1f} times the sensor's noise"
        return f"{lead}; {levels}; correlation {low:.2f} below 1.5 Hz, {middle:.2f} in 3 to 10 Hz"

    def _estimate(self, cause: Cause, e: Event) -> str:
        """What an estimate says against itself."""
        if cause is Cause.BEYOND_TRAINING:
            return self._beyond(e["number"][:MODELS].tolist())
        live_share, window_s, doubt, mu, firing, used_pct, from_rules_pct, _ = e["number"].tolist()
        if cause is Cause.HARSH:
            limit = f"limit {100 * HARSH_SHARE:g} %" if live_share < HARSH_SHARE else "too few"
            return f"{100 * live_share:.0f} % of {window_s:.2f} s are far from pulses, {limit}"
        if cause is Cause.NO_RULE:
            return f"no rule matches well enough ({firing:.3f} of {MIN_FIRING:g})"
        if cause is Cause.CONTRADICTION:
            return f"{self._name(TORQUE, e)}: {used_pct:.2f} % in use, the rules say {from_rules_pct:.2f} %"
        if doubt == EstimateDoubt.GAPS:
            share = f"{100 * live_share:.0f} % of {window_s:.2f} s"
            limit = f"limit {100 * GAPS_SHARE:g} %" if live_share < GAPS_SHARE else "too few"
            return f"{share} hold consecutive measurements, {limit}"
        if not math.isfinite(mu):
            return f"{window_s:.2f} s of measurements are no estimate"
        return f"{window_s:.2f} s of track are less than {MIN_M:g} m"

    def _overdue(self, e: Event) -> str:
        def text(k: int, number: int) -> str:
            age_us, of = int(e["age_us"][k]), self._config.inputs[self._number(number)]
            limit_us = of.timeout_us if e["cause"] == Cause.INPUT_STALE else silent_us(self._config, of)
            age = "has not come" if age_us == NEVER else f"{age_us / 1000:.1f} ms old, limit {limit_us / 1000:g}"
            return f"{self._signal(number)} {age}{_refused(e, k)}"

        return self._listed(e, text)

    def _number(self, number: int) -> int:
        """The place of an input in the configuration."""
        return next(k for k, i in enumerate(self._config.inputs) if i.source is self._sources[number])

    def _contested(self, e: Event) -> str:
        return self._listed(e, lambda k, number: f"{self._signal(number)}: two sequences of counters{_refused(e, k)}")

    def _degraded(self, e: Event) -> str:
        return f"{self._listed(e, lambda k, number: self._signal(number))}: the status says Degraded"

    def _unchanged(self, e: Event) -> str:
        def text(k: int, number: int) -> str:
            value, run = e["number"][2 * k], int(e["number"][2 * k + 1])
            of, step = self._sources[number].quantity, self._steps[number]
            noise = float(self._design.noise_rms[QUANTITIES.index(of)])
            coarse = f" (step {step:.2g}, the design's noise {noise:.2g}: too coarse?)" if step > 0.5 * noise else ""
            named = self._name(QUANTITIES.index(of), e)
            return f"{named} repeated {value:.6g} {of.unit} in {run + 1} consecutive frames{coarse}"

        return self._listed(e, text)

    def _speed(self, e: Event) -> str:
        of = self._design.speeds_m_s
        return f"{self._name(SPEED, e)} {e['number'][0]:.2f} m/s, design {of[0]:g} to {of[-1]:g}"

    def _friction(self, e: Event) -> str:
        return f"{self._name(TORQUE, e)} {e['number'][0] / 1000:.2f} kN m is no traction; {self._name(BRAKE, e)}"

    def _against(self, e: Event) -> str:
        of = [
            s for quantity in (TORQUE, BRAKE)
            for s in sorted(self._sources, key=lambda s: s.part)
            if s.quantity is QUANTITIES[quantity] and e["axle"] in s.axles
        ]  # fmt: skip
        torques = zip(of, e["number"][: int(e["listed"])].tolist(), strict=False)
        return " against ".join(f"{s.quantity.words} {s.message}.{s.signal} {x / 1000:.2f} kN m" for s, x in torques)

    def _load(self, e: Event) -> str:
        design, (low, high) = 2 * self._design.normal_N / 1000, LOAD_SHARES
        return f"{self._name(LOAD, e)} {e['number'][0] / 1000:.1f} kN, design {design:.1f} kN ({low:g} to {high:g})"

    def _radius(self, e: Event) -> str:
        design, (low, high) = 1000 * self._design.r_0, RADIUS_SHARES
        return f"{self._name(RADIUS, e)} {1000 * e['number'][0]:.0f} mm, design {design:.0f} mm ({low:g} to {high:g})"

    def _beyond(self, seen: Sequence[float]) -> str:
        d = self._design
        spans = [max(float(high - low), 1e-9) for low, high in zip(d.low[:MODELS], d.high[:MODELS], strict=True)]
        outside = [max(float(d.low[m] - seen[m]), float(seen[m] - d.high[m])) / spans[m] for m in range(MODELS)]
        far = max(range(MODELS), key=outside.__getitem__)
        return (
            f"residuals unlike the design's wheelset: no. {far + 1} by {outside[far]:.2f} of its range outside, "
            f"limit {d.beyond:g}"
        )


def _refused(e: Event, k: int) -> str:
    """What was refused since an input's newest good frame: what was most first."""
    order, refused = (e[name].reshape(2, -1)[k].tolist() for name in ("order", "refused"))
    counts = sorted(((refused[reason], reason) for reason in order[: int(e["refusals"][k])]), key=lambda of: -of[0])
    listed = ", ".join(f"{count} {_REASONS[reason]}" for count, reason in counts)
    return f" (refused since: {listed})" if listed else ""


def _times(x: float) -> str:
    return f"{x:.1f} times" if math.isfinite(x) else "infinite times"
