"""One run of a score: rig -> frames -> daemon's core -> frames, and the baselines on the very same ticks."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from cantools.database.can import Message
from numpy.typing import NDArray

from sim_ecu.physics.contact import peak
from sim_ecu.play.encoder import databases
from sim_ecu.play.play import LOG_START_US
from sim_ecu.play.player import Player
from sim_ecu.score.suites import Run
from sim_ecu.score.ticks import Ticks
from wrcd.bus.frame import Frame
from wrcd.daemon.config import Config
from wrcd.daemon.core import Core
from wrcd.daemon.report import CONFIDENCES
from wrcd.estimator.design import COLUMNS, Design
from wrcd.estimator.estimator import Estimate, Estimator, Tick

FloatArray = NDArray[np.float64]
HALF_WIDTHS = {name: half_width for half_width, name in CONFIDENCES}
TRUTH = ("MuAvailable", "MuUsed", "Slip")


class Baseline(Protocol):
    """Another way to the same figure, on the same ticks."""

    def mu_pct(self, ticks: Ticks) -> FloatArray:
        """Available adhesion in percent, (ticks, n)."""
        ...


@dataclass(slots=True)
class Trace:
    """What one axle's adhesion frames said, beside the truth. Arrays (frames,); NaN and "" where nothing was said."""

    suite: str
    group: str
    curve: str
    sensors: str
    speed_m_s: float
    judged_from_s: float
    changes_s: tuple[float, ...]
    time_s: FloatArray
    mu_pct: FloatArray
    half_width_pp: FloatArray  # of the level on the bus; NaN for none, inf for wider
    contact: NDArray[np.str_]
    surface: NDArray[np.str_]
    true_mu_pct: FloatArray
    true_used_pct: FloatArray
    true_slip: FloatArray
    peak_slip: float  # creep at the peak of the first curve
    baselines: dict[str, FloatArray] = field(default_factory=dict)


class Recording(Estimator):
    """The train's estimator; what it is given is kept for the baselines."""

    def __init__(self, design: Design, axles: int) -> None:
        super().__init__(design, axles)
        self.ticks: list[Tick] = []
        self.seen: list[tuple[int, FloatArray]] = []

    def step(self, tick: Tick) -> FloatArray:
        """As on the train."""
        self.ticks.append(tick)
        return super().step(tick)

    def estimate(self) -> Estimate:
        """As on the train."""
        out = super().estimate()
        self.seen.append((len(self.ticks), out.inputs))
        return out

    def all(self) -> Ticks:
        """Everything so far; the estimator never skips a tick while its inputs are there."""
        seen = np.full((len(self.ticks), self.axles, COLUMNS), np.nan)
        for (at, inputs), (until, _) in itertools.pairwise([*self.seen, (len(self.ticks) + 1, seen[0])]):
            seen[at - 1 : until - 1] = inputs
        return Ticks(
            z=np.stack([t.z for t in self.ticks]),
            present=np.stack([t.present for t in self.ticks]),
            torque_ratio=np.stack([t.torque_ratio for t in self.ticks]),
            speed_m_s=np.array([t.speed_m_s for t in self.ticks]),
            tick_s=self.design.tick_s,
            number=np.array([t.number for t in self.ticks]),
            seen=seen,
        )


def play(run: Run, config: Config, baselines: dict[str, Baseline]) -> list[Trace]:
    """Play a run and gather what the bus said, an entry for each axle."""
    estimator = Recording(config.design, len(config.axles))
    core = Core(config, estimator)
    axles = run.scenario.axles
    said: dict[int, list[tuple[int, dict[str, Any]]]] = {a.number: [] for a in axles}
    truth: dict[int, list[tuple[int, dict[str, Any]]]] = {a.number: [] for a in axles}
    production, rig = databases()
    ours = {f"Adhesion_A{a.number}": said[a.number] for a in axles}
    true = {f"SimTruth_A{a.number}": truth[a.number] for a in axles}
    table = {
        production.get_message_by_name(k).frame_id: (production.get_message_by_name(k), v) for k, v in ours.items()
    }
    table |= {rig.get_message_by_name(k).frame_id: (rig.get_message_by_name(k), v) for k, v in true.items()}
    for _, frames in Player(run.scenario):
        for f in frames:
            stamp_us = LOG_START_US + f.due_us
            _note(table, stamp_us, f.can_id, f.data)
            for out in core.feed(Frame(stamp_us, f.can_id, f.data)):
                _note(table, out.frame.stamp_us, out.frame.can_id, out.frame.data)
    ticks = estimator.all()
    others = {name: b.mu_pct(ticks) for name, b in baselines.items()}
    tick_us = round(ticks.tick_s * 1e6)
    first = estimator.ticks[0].number
    traces = []
    for place, axle in enumerate(axles):
        trace = _trace(run, place, said[axle.number], truth[axle.number])
        at = ((trace.time_s * 1e6).round().astype(np.int64) + LOG_START_US) // tick_us - 1 - first
        at = np.clip(at, 0, len(estimator.ticks) - 1)
        trace.baselines = {name: mu[at, place] for name, mu in others.items()}
        traces.append(trace)
    return traces


def _note(
    table: dict[int, tuple[Message, list[tuple[int, dict[str, Any]]]]], stamp_us: int, can_id: int, data: bytes
) -> None:
    found = table.get(can_id)
    if found is not None:
        values: Any = found[0].decode(data)
        found[1].append((stamp_us - LOG_START_US, values))


def _trace(
    run: Run, place: int, said: Sequence[tuple[int, dict[str, Any]]], truth: Sequence[tuple[int, dict[str, Any]]]
) -> Trace:
    axle = run.scenario.axles[place]
    speed = float(run.scenario.speed.at(np.zeros(1))[0])
    # an adhesion frame tells of the time up to its stamp; the truth is the newest by then
    true_us = np.array([t for t, _ in truth])
    said = [row for row in said if row[0] >= true_us[0]]
    newest = np.searchsorted(true_us, [t for t, _ in said], side="right") - 1
    true = np.array([[float(truth[k][1][name]) for name in TRUTH] for k in newest])

    def words(signal: str) -> NDArray[np.str_]:
        return np.array([str(v[signal]) for _, v in said])

    return Trace(
        suite=run.suite,
        group=run.group,
        curve=run.curves[place],
        sensors=axle.sensors.name,
        speed_m_s=speed,
        judged_from_s=run.judged_from_s,
        changes_s=run.changes_s,
        time_s=np.array([t * 1e-6 for t, _ in said]),
        mu_pct=np.array([v["MuAvailable"] if isinstance(v["MuAvailable"], float) else np.nan for _, v in said]),
        half_width_pp=np.array([HALF_WIDTHS.get(str(v["Confidence"]), np.nan) for _, v in said]),
        contact=words("ContactState"),
        surface=words("Surface"),
        true_mu_pct=true[:, 0],
        true_used_pct=true[:, 1],
        true_slip=true[:, 2],
        peak_slip=float(peak(speed, run.scenario.wheelset.contact, *axle.rail[0, 1:6])[0]),
    )
