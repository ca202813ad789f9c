"""frame -> sample -> bank step -> residual RMS -> fuzzy -> adhesion -> frame, on the frames' own time stamps.

The core reads no clock. Live, the loop tells it how far time has come (advance); in a replay the next frame does.
Tick k owns the frames stamped in [k P, (k + 1) P); of two measurements one may wait for the next tick (arrivals.py),
of every other signal the newest counts. Frames of a slot are made when the tick that ends it is closed.
"""

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from wrcd.bus.codec import Receiver, Value, Writer
from wrcd.bus.dbc import find_message
from wrcd.bus.frame import Frame
from wrcd.bus.link import LinkHealth
from wrcd.bus.reasons import Reason
from wrcd.daemon.arrivals import NEVER
from wrcd.daemon.config import Config
from wrcd.daemon.inputs import LAT, SPEED, TORQUE, YAW, Inputs
from wrcd.daemon.report import Report, Validity, confidence, known, surface
from wrcd.estimator.bank import BoolArray
from wrcd.estimator.estimator import Estimate, Estimator, Tick

NAMES = {YAW: "YawRate", LAT: "LatAccel", TORQUE: "Torque", SPEED: "Speed"}  # as the DBC's signals end

FORWARD_STEP_US = 1_000_000  # a stamp further ahead than this re-initialises
BACKWARD_STEP_US = 10_000  # out of order by less than this is jitter between queues, by more a step of the clock
MOST_FILLED_US = 60_000_000  # a replay fills a silence with frames up to this long; longer is a step of time


@dataclass(slots=True)
class Counts:
    """What happened so far. Every mapped frame is in accepted or in rejected under its reason."""

    STATE = ("accepted", "rejected", "late", "time_steps", "restarts", "ticks")
    PASSING = ("blamed",)

    accepted: int = 0
    rejected: Counter[Reason] = field(default_factory=Counter)
    blamed: Counter[tuple[str, Reason]] = field(default_factory=Counter)  # the same by message, for the log
    late: int = 0  # arrived after their tick was closed: used in the tick that was open
    time_steps: int = 0
    restarts: int = 0  # axles started anew because what they said was absurd for too long
    ticks: int = 0

    @property
    def refusals(self) -> str:
        """The rejections by reason, for a person."""
        return ", ".join(f"{n} {reason}" for reason, n in sorted(self.rejected.items())) or "none"

    @property
    def seen(self) -> int:
        """All mapped frames."""
        return self.accepted + self.rejected.total()


@dataclass(frozen=True, slots=True)
class Outgoing:
    """A frame to send, and the length of its slot: after the slot it is worthless."""

    frame: Frame
    cycle_us: int
    why: Estimate | None = None  # what the frame was made from


@dataclass(slots=True)
class Health:
    """What the loop knows and the core sends in WrcdStatus and WrcdLink."""

    STATE = ("state", "overruns", "link")

    state: str = "Running"
    overruns: int = 0
    link: LinkHealth = field(default_factory=LinkHealth)


class Core:
    """One bus, all its axles."""

    STATE = (
        "counts", "health", "estimator", "receiver", "_open", "_stamp_us", "_inputs", "_good_ticks", "_warm", "_blank",
        "_last_reason", "_rejected_before", "_outlier_us",
    )  # fmt: skip
    PASSING = ("reports",)

    def __init__(self, config: Config, estimator: Estimator | None = None) -> None:
        self.config = config
        self.counts = Counts()
        self.health = Health()
        self.estimator = estimator or Estimator(config.design, len(config.axles))
        self.receiver = Receiver(config.database, [i.source for i in config.inputs])
        n = len(config.axles)
        self._n = n
        self._period_us = round(config.design.tick_s * 1e6)
        self._window = config.design.window_ticks
        self._open: int | None = None  # number of the tick that gathers frames
        self._stamp_us = NEVER  # newest stamp taken
        self._inputs = Inputs(config)
        self._good_ticks = [0] * n
        self._warm = [False] * n  # whether a full window of good ticks has been seen since it was blank
        self._blank = [True] * n
        db = config.database
        self._adhesion = [Writer(find_message(db, a.adhesion), ()) for a in config.axles]
        self._detail = [Writer(find_message(db, a.detail), ()) if a.detail else None for a in config.axles]
        self._inputs_of = [Writer(find_message(db, a.inputs), ()) if a.inputs else None for a in config.axles]
        self._status, self._rejects, self._link = (
            Writer(find_message(db, name), ()) if name else None
            for name in (config.status, config.rejects, config.link)
        )
        self._last_reason = "None"
        self._rejected_before: Counter[Reason] = Counter()  # at the newest WrcdRejects
        self._outlier_us = [NEVER] * n
        self.reports: list[Report] = []  # of the newest slot
        self.muted = False  # make no frames: nobody would send them

    def reconfigure(self, config: Config) -> None:
        """Go on with other limits from the next tick on; everything else in config must be as it was."""
        self.config = config
        self._inputs.relimit(config)

    def feed(self, frame: Frame) -> list[Outgoing]:
        """Take a received frame. Returns what was due before its stamp. Frames that are not mapped change nothing."""
        got = self.receiver.read(frame)
        if got is None:
            return []
        out = self._move_to(frame.stamp_us)
        if not isinstance(got, Reason):
            got = self._inputs.judge(got, frame.stamp_us) or got
        if isinstance(got, Reason):
            self.counts.rejected[got] += 1
            self._last_reason = got.label
            sources = self.receiver.sources(frame.can_id)
            self.counts.blamed[sources[0].message, got] += 1
            self._inputs.refuse(sources, frame.stamp_us, got)
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

        A time before the open tick means that the clock has stepped back.
        """
        target = now_us // self._period_us
        if self._open is None:
            self._open = target
        period = self._period_us
        behind_us = self._open * period - now_us
        if (target - self._open) * period > FORWARD_STEP_US or behind_us > BACKWARD_STEP_US:
            self._restart(target)
        return self._close_up_to(target)

    def _move_to(self, stamp_us: int) -> list[Outgoing]:
        """Close the ticks before a stamp; a step of time starts anew."""
        target = stamp_us // self._period_us
        out: list[Outgoing] = []
        if self._open is None:
            self._open = target
        step = stamp_us - (self._open * self._period_us if self._stamp_us == NEVER else self._stamp_us)
        if step > FORWARD_STEP_US or step < -BACKWARD_STEP_US:
            if 0 < step <= MOST_FILLED_US:
                out = self._close_up_to(target)
            self._restart(target)
        else:
            out = self._close_up_to(target)
        self._stamp_us = max(self._stamp_us, stamp_us) if step > -BACKWARD_STEP_US else stamp_us
        return out

    def _restart(self, tick: int) -> None:
        """A step of time: nothing that was known before holds."""
        self.counts.time_steps += 1
        self._open = tick
        self._inputs.forget()
        self.receiver.forget()
        for axle in range(self._n):
            self._forget(axle)

    def _forget(self, axle: int) -> None:
        if not self._blank[axle]:
            self.estimator.reset(axle)
        self._blank[axle] = True
        self._good_ticks[axle] = 0
        self._warm[axle] = False

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
        """Judge the inputs at the tick's end, and run the bank on what it brought."""
        self.counts.ticks += 1
        i = self._inputs
        i.close((number + 1) * self._period_us)
        running = np.logical_and(~i.dead, i.speed_m_s >= self.config.min_speed_m_s)
        for axle in range(self._n):
            if not running[axle]:
                self._forget(axle)
                continue
            self._blank[axle] = False
            if i.stale[:, axle].any():
                self._good_ticks[axle] = 0
            else:
                self._good_ticks[axle] += 1
                self._warm[axle] |= self._good_ticks[axle] >= self._window
        if running.any():
            present = i.present & running
            self.estimator.step(Tick(number, i.z, present, i.torque_ratio, i.speed_m_s))
            left_out: BoolArray = np.any(present & ~self.estimator.present, axis=0)
            for axle in range(self._n):
                if left_out[axle]:
                    self._outlier_us[axle] = (number + 1) * self._period_us
                if self.estimator.upset[axle]:
                    self.counts.restarts += 1
                    self._forget(axle)

    def _due(self, end_us: int) -> list[Outgoing]:
        """The frames whose slot begins with this tick's end."""
        c = self.config
        before = end_us - self._period_us
        adhesion, detail, status = (
            end_us // cycle != before // cycle for cycle in (c.adhesion_cycle_us, c.detail_cycle_us, c.status_cycle_us)
        )
        out = []
        if adhesion or detail:
            estimate = self.estimator.estimate() if any(self._warm) else None
            self.reports = [self._report(axle, end_us, estimate) for axle in range(self._n)]
        if adhesion:
            for w, report in zip(self._adhesion, self.reports, strict=True):
                out.append(_outgoing(w, end_us, c.adhesion_cycle_us, report.values(), estimate))
        if detail:
            for axle, writer in enumerate(self._detail):
                if writer:
                    out.append(_outgoing(writer, end_us, c.detail_cycle_us, self._explain(axle, estimate)))
            for axle, writer in enumerate(self._inputs_of):
                if writer:
                    out.append(_outgoing(writer, end_us, c.detail_cycle_us, self._input_values(axle, end_us, estimate)))
        if status:
            out += self._status_frames(end_us)
        return out

    def _status_frames(self, end_us: int) -> Iterator[Outgoing]:
        for writer, values in (
            (self._status, self._health_values),
            (self._rejects, self._reject_values),
            (self._link, self._link_values),
        ):
            if writer:
                yield _outgoing(writer, end_us, self.config.status_cycle_us, values())

    def _report(self, axle: int, end_us: int, estimate: Estimate | None) -> Report:
        age_ms = self._inputs.age_ms(axle, end_us)
        used = known(min(100.0 * float(self._inputs.torque_ratio[axle]), 100.0))
        if not self._warm[axle] or estimate is None:
            return Report(Validity.NOT_AVAILABLE, None, used, age_ms, "Unknown", "Unknown", "None")
        mu = known(float(estimate.mu_available_pct[axle]))
        sure = (
            mu is not None
            and self._good_ticks[axle] >= self._window
            and self._inputs.sound(axle)
            and not estimate.contradicted[axle]
        )
        contact = "Unknown" if mu is None else "Saturated" if estimate.saturated[axle] else "Adhering"
        return Report(
            Validity.VALID if sure else Validity.DEGRADED,
            mu,
            used,
            age_ms,
            surface(mu),
            contact,
            confidence(known(float(estimate.half_width_pp[axle])) if mu is not None else None),
        )

    def _explain(self, axle: int, estimate: Estimate | None) -> dict[str, Value]:
        warm = self._warm[axle] and estimate is not None
        values: dict[str, Value] = {f"Stale{name}": float(self._inputs.stale[q, axle]) for q, name in NAMES.items()}
        values["WinningModel"] = float(estimate.winner[axle]) if warm and estimate else 0.0
        values["DominantRule"] = float(estimate.rule[axle]) if warm and estimate else None
        for m in range(4):
            r = float(estimate.residuals[axle, m]) if warm and estimate else math.nan
            values[f"Residual{m + 1}"] = 20 * math.log10(r) if math.isfinite(r) else None
        return values

    def _input_values(self, axle: int, end_us: int, estimate: Estimate | None) -> dict[str, Value]:
        values: dict[str, Value] = {
            "Plausibility": self._plausibility(axle, estimate),
            "Outlier": float(end_us - self._outlier_us[axle] <= self.config.detail_cycle_us),
            "Unchanged": float(self._inputs.unchanged[:, axle].any()),
        }
        for q, name in NAMES.items():
            register, refused = self._inputs.reach.read(q, axle, end_us)
            values |= {f"Reach{name}": float(register), f"Refused{name}": refused}
        return values

    def _plausibility(self, axle: int, estimate: Estimate | None) -> str:
        """More in use than available is saturation, or something is wrong: which."""
        if not self._warm[axle] or estimate is None or not math.isfinite(estimate.mu_available_pct[axle]):
            return "Unknown"
        if estimate.contradicted[axle]:
            return "Contradiction"
        return "Saturated" if estimate.saturated[axle] else "Consistent"

    def _health_values(self) -> dict[str, Value]:
        h = self.health
        return {
            "State": h.state,
            "Overruns": float(h.overruns % 256),
            "RejectedFrames": float(self.counts.rejected.total() % 1024),
            "LastReason": self._last_reason,
            "ReceiveDrops": float(h.link.drops % 64),
            "Reopens": float(h.link.reopens % 16),
            "DesignChecksum": float(int(self.config.design.checksum[:4], 16)),
        }

    def _reject_values(self) -> dict[str, Value]:
        new = self.counts.rejected - self._rejected_before
        self._rejected_before = self.counts.rejected.copy()
        return {f"Rejected{r.label}": float(min(new[r], 15)) for r in Reason}

    def _link_values(self) -> dict[str, Value]:
        link = self.health.link
        return {
            "LinkState": link.state,
            "ErrorFrames": float(link.error_frames % 4096),
            "BusOffs": float(link.bus_offs % 16),
            "Unsent": float(link.unsent % 256),
            "TimeSteps": float(self.counts.time_steps % 16),
            "LateFrames": float(self.counts.late % 16),
            "Outliers": float(self.estimator.outliers % 256),
            "Restarts": float(self.counts.restarts % 256),
        }

    def farewell(self, now_us: int) -> list[Frame]:
        """The last frames: every axle NotAvailable, the daemon stopping."""
        slot_us = self.config.adhesion_cycle_us
        gone = Report(Validity.NOT_AVAILABLE, None, None, 255, "Unknown", "Unknown", "None")
        # the present slot's frames have gone out: the next counter, or a receiver takes these for repeats
        out = [w.frame(now_us, now_us // slot_us + 1, gone.values()) for w in self._adhesion]
        if self._status:
            self.health.state = "Stopping"
            out.append(self._status.frame(now_us, now_us // self.config.status_cycle_us + 1, self._health_values()))
        return out


def _outgoing(w: Writer, end_us: int, cycle_us: int, values: dict[str, Value], why: Estimate | None = None) -> Outgoing:
    return Outgoing(w.frame(end_us, end_us // cycle_us, values), cycle_us, why)
