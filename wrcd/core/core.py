"""frame -> sample -> bank step -> residual RMS -> fuzzy -> adhesion -> frame, on the frames' own time stamps.

The core reads no clock. Live, the loop tells it how far time has come (advance); in a replay the next frame does.
Tick k owns the frames stamped in [k P, (k + 1) P); of two measurements one may wait for the next tick (arrivals.py),
of every other signal the newest counts. Frames of a slot are made when the tick that ends it is closed.

A stamp contradicts the clock if it is more than a second ahead of the open tick, which the clock drives, or behind the
newest stamp: a step of time. It is counted, nothing that was known before it holds, and no slot between is made. A
silence is none: its ticks are closed as the clock tells of them. But after a second of it nothing holds either, so that
silence and step leave the same behind them, and whoever cannot tell them apart, as a replay, goes on alike.
"""

import numpy as np

from wrcd.bus.codec import Receiver, Value
from wrcd.bus.frame import Frame
from wrcd.bus.reasons import Reason
from wrcd.core.backoff import Backoff
from wrcd.core.causes import Cause
from wrcd.core.configuration import Config
from wrcd.core.counts import Counts, Health
from wrcd.core.inputs import Inputs
from wrcd.core.jitter_buffer import NEVER
from wrcd.core.outbox import Outbox, Outgoing
from wrcd.core.report import Report, Validity, confidence, nan_to_none, surface
from wrcd.core.validity import ValidityMonitor, against
from wrcd.core.values import NAMES, explanation, plausibility
from wrcd.estimator.estimator import Estimate, Estimator, Tick

FORWARD_STEP_US = 1_000_000  # a stamp, or the clock, further ahead of the open tick than this is a step of time
BACKWARD_STEP_US = 10_000  # out of order by less than this is jitter between queues, by more a step of the clock
SILENCE_US = 1_000_000  # without a mapped frame: longer, and nothing that was known before holds


class Core:
    """One bus, all its axles."""

    STATE = (
        "counts", "health", "estimator", "receiver", "_open", "_stamp_us", "_inputs", "_validity", "_is_reset",
        "_outbox", "_outlier_us", "_backoff",
    )  # fmt: skip
    TRANSIENT = ("reports",)

    def __init__(self, config: Config, estimator: Estimator | None = None) -> None:
        self.config = config
        self.counts = Counts()
        self.health = Health()
        self.estimator = estimator or Estimator(config.design, len(config.axles))
        self.receiver = Receiver(config.database, [i.source for i in config.inputs])
        n = len(config.axles)
        self._n = n
        self._period_us = round(config.design.tick_s * 1e6)
        self._open: int | None = None  # number of the tick that gathers frames
        self._stamp_us = NEVER  # newest stamp taken
        self._inputs = Inputs(config)
        self._validity = ValidityMonitor(config.design.window_ticks, n)
        self._is_reset = [True] * n
        self._outbox = Outbox(config)
        self._outlier_us = [NEVER] * n
        self._backoff = Backoff(n, config.design.tick_s)
        self.reports: list[Report] = []  # of the newest slot
        self.muted = False  # make no frames: nobody would send them

    @property
    def below_min_speed(self) -> bool:
        """Whether the train is known to be slower than an estimate needs."""
        return self._inputs.speed_m_s < self.config.min_speed_m_s

    @property
    def time_us(self) -> int | None:
        """Begin of the open tick: every tick before it is closed. None before the first frame."""
        return None if self._open is None else self._open * self._period_us

    @property
    def waits(self) -> int:
        """How often an axle that was reset again and again had to wait."""
        return self._backoff.waits

    def reconfigure(self, config: Config) -> None:
        """Go on with other limits from the next tick on; everything else in config must be as it was."""
        self.config = config
        self._inputs.apply_limits(config)

    def feed(self, frame: Frame) -> list[Outgoing]:
        """Take a received frame. Returns what was due before its stamp. Frames that are not mapped change nothing."""
        if not self.receiver.maps(frame):
            return []
        out = self._move_to(frame.stamp_us)
        got = self.receiver.read(frame)
        assert got is not None
        if not isinstance(got, Reason):
            got = self._inputs.check(got, frame.stamp_us) or got
        if isinstance(got, Reason):
            sources = self.receiver.sources(frame.can_id)
            self.counts.reject(sources[0].message, got)
            self._inputs.reject(sources, frame.stamp_us, got)
            return out
        self.counts.accepted += 1
        assert self._open is not None
        if frame.stamp_us < self._open * self._period_us:
            self.counts.late += 1
        for sample in got:
            self._inputs.take(sample, frame.stamp_us)
        return out

    def advance(self, now_us: int) -> list[Outgoing]:
        """Time has come to now_us and every frame stamped before it has been fed: close the ticks that are over.

        A time before the open tick, or more than a second after its begin, means that the clock has stepped.
        """
        target = now_us // self._period_us
        if self._open is None:
            self._open = target
        begin_us = self._open * self._period_us
        if target * self._period_us - begin_us > FORWARD_STEP_US or begin_us - now_us > BACKWARD_STEP_US:
            self._step_to(target)
        return self._close_up_to(target)

    def _move_to(self, stamp_us: int) -> list[Outgoing]:
        """Close the ticks before a stamp; a step of time starts anew."""
        target = stamp_us // self._period_us
        if self._open is None:
            self._open = target
        begin_us = self._open * self._period_us
        newest_us = begin_us if self._stamp_us == NEVER else self._stamp_us
        if stamp_us - begin_us > FORWARD_STEP_US or newest_us - stamp_us > BACKWARD_STEP_US:
            self._step_to(target)
        out = self._close_up_to(target)
        self._stamp_us = max(self._stamp_us, stamp_us)
        return out

    def _step_to(self, tick: int) -> None:
        """A step of time: go on at a tick, with nothing from before."""
        self.counts.time_steps += 1
        self._open = tick
        self._reset_all()

    def _reset_all(self) -> None:
        """Nothing that was known before holds."""
        self._stamp_us = NEVER
        self._outlier_us = [NEVER] * self._n
        self._inputs.reset()
        self.receiver.reset()
        self._backoff.reset()
        for axle in range(self._n):
            self._reset_axle(axle, Cause.WARMING_UP)

    def _reset_axle(self, axle: int, why: Cause) -> None:
        if not self._is_reset[axle]:
            self.estimator.reset(axle)
        self._is_reset[axle] = True
        self._validity.reset(axle, why)

    def _close_up_to(self, target: int) -> list[Outgoing]:
        assert self._open is not None
        out: list[Outgoing] = []
        while self._open < target:
            self._close_tick(self._open)
            self._open += 1
            if not self.muted:
                out += self._due(self._open * self._period_us)
        return out

    def _close_tick(self, number: int) -> None:
        """ValidityMonitor the inputs at the tick's end, and run the bank on what it brought."""
        self.counts.ticks += 1
        i, end_us = self._inputs, (number + 1) * self._period_us
        if self._stamp_us != NEVER and end_us - self._stamp_us > SILENCE_US:
            self._reset_all()
        i.close(end_us)
        # no train's speed jumps: what was known before was known of another one
        jumped, i.speed_jumped = i.speed_jumped, False
        running = np.logical_and(~i.unavailable, not jumped and i.speed_m_s >= self.config.min_speed_m_s)
        waiting = np.array([self._backoff.waiting(axle, number) for axle in range(self._n)])
        running &= ~waiting
        causes = against(i)
        for axle in range(self._n):
            if jumped and not self._is_reset[axle]:
                self._count_reset(axle, number)
            if running[axle]:
                self._is_reset[axle] = False
                self._validity.update(axle, causes[axle])
                if self._validity.window_full[axle]:
                    self._backoff.recovered(axle)
            else:
                silent, again = bool(i.unavailable[axle]), jumped or bool(waiting[axle])
                self._reset_axle(axle, Cause.INPUT_SILENT if silent else Cause.RESTARTED if again else Cause.STANDSTILL)
        if running.any():
            self.estimator.step(Tick(number, i.z, i.present & running, i.torque_ratio, i.speed_m_s))
            for axle in range(self._n):
                if self.estimator.outlier[axle]:
                    self._outlier_us[axle] = end_us
                if self.estimator.upset[axle]:
                    self._count_reset(axle, number)
                    self._reset_axle(axle, Cause.RESTARTED)

    def _count_reset(self, axle: int, number: int) -> None:
        self.counts.restarts += 1
        self._backoff.was_reset(axle, number)

    def _due(self, end_us: int) -> list[Outgoing]:
        """The frames whose slot begins with this tick's end."""
        c = self.config
        before = end_us - self._period_us
        adhesion, detail, status = (
            end_us // cycle != before // cycle for cycle in (c.adhesion_cycle_us, c.detail_cycle_us, c.status_cycle_us)
        )
        out: list[Outgoing] = []
        if adhesion or detail:
            estimate = self.estimator.estimate() if any(self._validity.window_full) else None
            self.reports = [self._report(axle, end_us, estimate) for axle in range(self._n)]
        if adhesion:
            out += self._outbox.adhesion(end_us, self.reports, estimate)
        if detail:
            warm = [estimate if w else None for w in self._validity.window_full]
            out += self._outbox.detail(
                end_us,
                [
                    explanation(e, axle, self._inputs.stale[:, axle], self.reports[axle].cause)
                    for axle, e in enumerate(warm)
                ],
                [self._input_values(e, axle, end_us) for axle, e in enumerate(warm)],
            )
        if status:
            out += self._outbox.status(end_us, self.counts, self.health, self.estimator.outliers)
        return out

    def _report(self, axle: int, end_us: int, estimate: Estimate | None) -> Report:
        age_ms = self._inputs.age_ms(axle, end_us)
        used = nan_to_none(min(100.0 * float(self._inputs.torque_ratio[axle]), 100.0))
        validity, cause = self._validity.verdict(axle, estimate, int(self.estimator.identity.doubt[axle]))
        if validity is Validity.NOT_AVAILABLE or estimate is None:
            return Report(validity, None, used, age_ms, "Unknown", "Unknown", "None", cause)
        mu = nan_to_none(float(estimate.mu_available_pct[axle]))
        sure = validity is Validity.VALID and mu is not None
        if sure and used is not None and mu is not None:
            # what the newest torque is beyond the newest part's mean turns the wheel, or is its sensor's noise
            used = min(used, mu)
        contact = "Unknown" if mu is None else "Saturated" if estimate.saturated[axle] else "Adhering"
        width = nan_to_none(float(estimate.half_width_pp[axle])) if sure else None
        return Report(validity, mu, used, age_ms, surface(mu), contact, confidence(width), cause)

    def _input_values(self, estimate: Estimate | None, axle: int, end_us: int) -> dict[str, Value]:
        values: dict[str, Value] = {
            "Plausibility": plausibility(estimate, axle),
            "Outlier": float(end_us - self._outlier_us[axle] <= self.config.detail_cycle_us),
            "Unchanged": float(self._inputs.unchanged[:, axle].any()),
        }
        for q, name in NAMES.items():
            register, refused = self._inputs.reach.read(q, axle, end_us)
            values |= {f"Reach{name}": float(register), f"Refused{name}": refused}
        return values

    def shutdown_frames(self, now_us: int) -> list[Frame]:
        """The last frames: every axle NotAvailable, the daemon stopping."""
        self.health.state = "Stopping"
        return list(self._outbox.shutdown_frames(now_us, self.counts, self.health))
