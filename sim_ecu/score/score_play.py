"""One run of a score: rig -> frames -> daemon's core -> frames, and the baselines on the very same ticks."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_ecu.physics.contact import peak
from sim_ecu.play.encoder import Sent, databases
from sim_ecu.play.mapped import Train
from sim_ecu.play.play import LOG_START_US
from sim_ecu.play.player import LARGE_CHUNK, Player
from sim_ecu.play.scenario import Scenario
from sim_ecu.play.train import PACKAGED, placed
from sim_ecu.score import WORLDS
from sim_ecu.score.baselines import Baseline, GivenTicks
from sim_ecu.score.suites.run import Run
from wrcd.bus.frame import Frame
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.terms import CHANNELS, MAX_AXLES
from wrcd.core.vocabulary import CONFIDENCES, MESSAGES, Words
from wrcd.logs.decoder import UNKNOWN, MessageDecoder, Values, decoders

FloatArray = NDArray[np.float64]
ALONE = "each axle alone"  # beside the axles of a train on one rail


@dataclass
class MessageFrames:
    """The frames of a message: when (microseconds after the run's begin), and what. To be read when all are there."""

    decoder: MessageDecoder
    stamps_us: list[int] = field(default_factory=list)
    data: list[bytes] = field(default_factory=list)

    def numbers(self, signal: str) -> FloatArray:
        """Values (frames,) in the signal's unit; NaN where there is none."""
        values = self._values.get(signal)
        return np.full(len(self.data), np.nan) if values is None else values.astype(np.float64)

    def words(self, signal: str) -> NDArray[np.str_]:
        """Words (frames,) of the vocabulary; empty for another one, and where the message lacks the signal."""
        of = MESSAGES[self.decoder.kind][signal]
        assert isinstance(of, Words)
        places = self._values.get(signal, np.full(len(self.data), UNKNOWN, np.int8))
        return np.array([*of.words, ""])[places.astype(np.int8)]

    @cached_property
    def _values(self) -> Mapping[str, Values]:
        data = np.frombuffer(b"".join(self.data), np.uint8)
        return self.decoder.read(data.reshape(-1, self.decoder.length))


class TrainFrames:
    """Keeps the frames of a train's axles as someone on the bus receives them: adhesion and its detail where the
    configuration sends it, and the truth. Times are microseconds from the start."""

    def __init__(self, numbers: Iterable[int], config: Config) -> None:
        numbers, truth = list(numbers), databases()[1].get_message_by_name
        self.truth = {n: MessageFrames(MessageDecoder(truth(f"SimTruth_A{n}"))) for n in numbers}
        sent = {(d.kind, d.axle): MessageFrames(d) for d in decoders(config) if d.axle in numbers}
        self.adhesion, self.detail = (
            {n: sent[kind, n] for n in numbers if (kind, n) in sent} for kind in ("adhesion", "detail")
        )
        self._by_id = {h.decoder.message.frame_id: h for h in (*sent.values(), *self.truth.values())}

    def keep(self, stamp_us: int, can_id: int, data: bytes) -> None:
        """Keep a frame; others are ignored."""
        found = self._by_id.get(can_id)
        if found is not None:
            found.stamps_us.append(stamp_us)
            found.data.append(data)


HALF_WIDTHS = {name: half_width for half_width, name in CONFIDENCES}


def half_widths_pp(adhesion: MessageFrames) -> FloatArray:
    """Half-widths (frames,) of the levels of Confidence; inf for wider than any, NaN for no level."""
    return np.array([HALF_WIDTHS.get(word, np.nan) for word in adhesion.words("Confidence").tolist()], np.float64)


@dataclass(slots=True)
class Trace:
    """What one axle's adhesion frames contain, beside the truth. Arrays (frames,); NaN and "" for nothing."""

    suite: str
    group: str
    run: int  # number of the run's conditions within the suite; the same in another group: the same conditions
    curve: str
    sensors: str
    speed_m_s: float
    judged_from_s: float
    changes_s: tuple[float, ...]
    time_s: FloatArray
    mu_pct: FloatArray
    validity: NDArray[np.str_]
    cause: NDArray[np.str_]  # why it is not Valid, where the bus has it
    half_width_pp: FloatArray  # of the level on the bus; NaN for none, inf for wider
    own_half_width_pp: FloatArray  # the estimator's, before it became a level
    contact: NDArray[np.str_]
    surface: NDArray[np.str_]
    true_mu_pct: FloatArray
    true_used_pct: FloatArray
    true_slip: FloatArray
    peak_slip: float  # creep at the peak of the first curve
    baselines: dict[str, FloatArray] = field(default_factory=dict)
    beside: dict[str, "Trace"] = field(default_factory=dict)  # of other designs on the same frames, by name


class TickRecorder:
    """What the train's estimator is given, kept for the baselines."""

    def __init__(self, config: Config) -> None:
        self._design, self._axles = config.design, len(config.axles)
        self.ticks: list[NDArray[Any]] = []

    def take(self, ticks: NDArray[Any]) -> None:
        """Keep ticks of the core."""
        self.ticks.append(ticks)

    def all(self) -> GivenTicks:
        """Everything so far."""
        t = np.concatenate(self.ticks)
        z, present = (t[name].reshape(len(t), CHANNELS, MAX_AXLES)[..., : self._axles] for name in ("z", "present"))
        return GivenTicks(
            z=z, present=present > 0, torque_ratio=t["torque_ratio"][:, : self._axles], speed_m_s=t["speed_m_s"],
            tick_s=self._design.tick_s, number=t["number"],
        )  # fmt: skip


class Listener:
    """A core that is fed the frames of a run, and what someone on its bus receives."""

    def __init__(self, run: Run, config: Config, recording: TickRecorder | None = None) -> None:
        self._run, self._core = run, Core(config, ticks=None if recording is None else recording.take)
        self._kept = TrainFrames([a.number for a in run.scenario.axles], config)
        self._half_widths: dict[int, dict[int, float]] = {}  # by time and axle

    def knows(self, calm: Core) -> None:
        """Know of every bogie what a core knows of its first one."""
        self._core.take_design_fit(calm)

    def hear(self, frames: Sequence[Sent]) -> None:
        """Take frames of the rig."""
        for f in frames:
            if not f.error:
                self._kept.keep(f.due_us, f.can_id, f.data)
        made = self._core.feed([_stamped(f) for f in frames])
        for out in made:
            self._kept.keep(out.frame.stamp_us - LOG_START_US, out.frame.can_id, out.frame.data)
        numbers = [a.number for a in self._core.config.axles]
        slots = made.reports.reshape(-1, len(numbers))
        widths = np.where(slots["has_estimate"] > 0, slots["estimate"]["half_width_pp"], np.nan)
        times_us = slots["time_us"][:, 0] - LOG_START_US
        self._half_widths.update(
            (t, dict(zip(numbers, w, strict=True))) for t, w in zip(times_us.tolist(), widths, strict=True)
        )

    def traces(self) -> list[Trace]:
        """An entry for each axle."""
        return [_trace(self._run, k, self._kept, self._half_widths) for k in range(len(self._run.scenario.axles))]


def _stamped(f: Sent) -> Frame:
    return Frame(LOG_START_US + f.due_us, f.can_id, f.data, f.extended, error=f.error, fd=f.fd)


def play(
    run: Run, config: Config, baselines: dict[str, Baseline], train: Train = PACKAGED,
    beside: Sequence[tuple[str, Config]] = (),
) -> list[Trace]:  # fmt: skip
    """Play a run and gather what came on the bus, an entry for each axle. train: whose messages the configurations map.
    beside: other designs' names and configurations, whose cores are fed the same frames.
    Raises InputError for a fault or an axle that they leave no way to."""
    if train is PACKAGED and (together := placed(config, run.scenario)).fuses:
        alone = [(ALONE, config)] if run.suite == WORLDS else []
        beside = [*((name, placed(other, run.scenario)) for name, other in beside), *alone]
        config = together
    recording = TickRecorder(config) if baselines else None
    ours, others = Listener(run, config, recording), {name: Listener(run, other) for name, other in beside}
    listeners = [ours, *others.values()]
    if run.before is not None:
        for listener, of in zip(listeners, (config, *(other for _, other in beside)), strict=True):
            listener.knows(_after(run.before, run.group, of, train))
    samples = iter(Player(run.scenario, chunk=LARGE_CHUNK, train=train))
    while chunk := list(islice(samples, LARGE_CHUNK)):
        frames = [f for _, of_sample in chunk for f in of_sample]
        for listener in listeners:
            listener.hear(frames)
    traces = ours.traces()
    for name, other in others.items():
        for trace, theirs in zip(traces, other.traces(), strict=True):
            trace.beside[name] = theirs
    if recording is not None and recording.ticks:
        _estimate(traces, recording.all(), baselines)
    return traces


_AFTER: dict[tuple[str, str], Core] = {}  # by a run's group and a design's checksum


def _after(before: Scenario, group: str, config: Config, train: Train) -> Core:
    """A core that has run a scenario. Those of one group are alike."""
    core = _AFTER.get((group, config.design.checksum))
    if core is None:
        core = _AFTER[group, config.design.checksum] = Core(config)
        core.muted = True
        for _, of_sample in Player(before, chunk=LARGE_CHUNK, train=train):
            core.feed([_stamped(f) for f in of_sample])
    return core


def _estimate(traces: Sequence[Trace], ticks: GivenTicks, baselines: dict[str, Baseline]) -> None:
    """Return the baselines' estimates at the traces' frames: from the newest tick that was over by then."""
    tick_us = round(ticks.tick_s * 1e6)
    others = {name: b.mu_pct(ticks) for name, b in baselines.items()}
    for place, trace in enumerate(traces):
        over = ((trace.time_s * 1e6).round().astype(np.int64) + LOG_START_US) // tick_us - 1
        at = np.searchsorted(ticks.number, over, side="right") - 1
        trace.baselines = {name: np.where(at >= 0, mu[np.maximum(at, 0), place], np.nan) for name, mu in others.items()}


def newest(frames: MessageFrames, signal: str, at_us: NDArray[np.int64]) -> NDArray[np.str_]:
    """The newest frame's word at each time; empty before the first."""
    place = np.searchsorted(np.array(frames.stamps_us), at_us, side="right")
    return np.concatenate(([""], frames.words(signal)))[place]


def _cause(detail: MessageFrames | None, at_us: NDArray[np.int64]) -> NDArray[np.str_]:
    """Why each adhesion frame is not Valid."""
    return np.full(len(at_us), "") if detail is None else newest(detail, "Cause", at_us)


def _trace(run: Run, place: int, kept: TrainFrames, half_widths: dict[int, dict[int, float]]) -> Trace:
    axle = run.scenario.axles[place]
    adhesion, truth = kept.adhesion[axle.number], kept.truth[axle.number]
    speed = float(run.scenario.speed.at(np.zeros(1))[0])
    # an adhesion frame covers the time up to its stamp; the truth is the newest by then
    true_us, adhesion_us = np.array(truth.stamps_us), np.array(adhesion.stamps_us)
    use = adhesion_us >= true_us[0]
    latest = np.searchsorted(true_us, adhesion_us[use], side="right") - 1
    return Trace(
        suite=run.suite,
        group=run.group,
        run=run.number,
        curve=run.curves[place],
        sensors=axle.sensors.name,
        speed_m_s=speed,
        judged_from_s=run.judged_from_s,
        changes_s=run.changes_s,
        time_s=adhesion_us[use] * 1e-6,
        mu_pct=adhesion.numbers("MuAvailable")[use],
        validity=adhesion.words("Validity")[use],
        cause=_cause(kept.detail.get(axle.number), adhesion_us[use]),
        half_width_pp=half_widths_pp(adhesion)[use],
        own_half_width_pp=np.array(
            [half_widths.get(t, {}).get(axle.number, np.nan) for t in adhesion_us[use].tolist()]
        ),
        contact=adhesion.words("ContactState")[use],
        surface=adhesion.words("Surface")[use],
        true_mu_pct=truth.numbers("MuAvailable")[latest],
        true_used_pct=truth.numbers("MuUsed")[latest],
        true_slip=truth.numbers("Slip")[latest],
        peak_slip=float(peak(speed, run.scenario.wheelset.contact, *axle.rail[0, 1:6])[0]),
    )
