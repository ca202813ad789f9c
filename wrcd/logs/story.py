"""A log to a Story: what wrcd's own frames in it say, or where there are none what the core makes of it."""

import platform
from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wrcd import __version__
from wrcd.bus.dbc import Database, find_message
from wrcd.bus.frame import counted_ids, id_text
from wrcd.bus.positions import message_key
from wrcd.bus.reasons import Reason
from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.design_fit import DesignFit
from wrcd.core.events import Change
from wrcd.core.terms import MODELS
from wrcd.errors import InputError
from wrcd.logs import statistics, story_events, truth, verdict
from wrcd.logs.decoder import OwnFrames
from wrcd.logs.feed import made_of_log, outgoing
from wrcd.logs.mapped_inputs import MappedInputs, distance
from wrcd.logs.reader import LogReader
from wrcd.logs.scan import Gathering, Scan, scan
from wrcd.logs.statistics import BIT_RATE
from wrcd.logs.story_events import NewChanges
from wrcd.logs.story_records import AdhesionRecord, Detail, Story, StoryAxle, TruthRecord
from wrcd.progress import Progress
from wrcd.recorder.kept import take_file

SENT, ESTIMATED = "frames of the log", "estimated here"
MAX_PART_MISSING = 0.01  # of a log, without wrcd's frames, before it is reported


@dataclass(frozen=True, slots=True)
class Estimated:
    """What came of a log: frames by their message, changes in their order, frames that were accepted and (by message
    and reason) refused; by axle number what the core estimated for its Adhesion frames."""

    sent: Scan
    changes: tuple[Change, ...]
    accepted: int
    refused: Mapping[tuple[str, Reason], int]
    answers: Mapping[int, "FrameEstimates"]
    fits: tuple[DesignFit, ...]


@dataclass(frozen=True, slots=True)
class FrameEstimates:
    """What the core estimated for each Adhesion frame of an axle: more than a train's message may carry."""

    time_us: "array[int]" = field(default_factory=lambda: array("q"))
    ends_pct: "array[float]" = field(default_factory=lambda: array("f"))  # two a frame, NaN without an estimate
    residuals: "array[float]" = field(default_factory=lambda: array("f"))  # four a frame
    chosen: "array[int]" = field(default_factory=lambda: array("h"))  # model, rule and cause of a frame

    def put(self, time_us: int, why: Any, cause: Cause) -> None:
        """Take down a frame's."""
        self.time_us.append(time_us)
        if why is None:
            self.ends_pct.extend((np.nan, np.nan))
            self.residuals.extend([np.nan] * MODELS)
            self.chosen.extend((0, 0, int(cause)))
            return
        mu, half = float(why["mu_available_pct"]), float(why["half_width_pp"])
        self.ends_pct.extend((max(mu - half, 0.0), mu + half) if np.isfinite(half) else (np.nan, np.nan))
        self.residuals.extend(why["residuals"].tolist())
        self.chosen.extend((int(why["winner"]), int(why["rule"]), int(cause)))

    def _by_time(self) -> NDArray[np.int64]:
        """The order that the frames are in once they are gathered."""
        return np.argsort(np.array(self.time_us), kind="stable")

    def bound(self, adhesion: AdhesionRecord) -> AdhesionRecord:
        """The frames with the interval that was estimated, for a message that states none."""
        ends = np.array(self.ends_pct, np.float32).reshape(-1, 2)[self._by_time()]
        return replace(adhesion, low_pct=ends[:, 0], high_pct=ends[:, 1])

    def detail(self) -> Detail:
        """As AdhesionDetail would tell it with each of the frames. Of stale inputs the causes' figures tell."""
        order = self._by_time()
        residuals = np.array(self.residuals, np.float32).reshape(-1, MODELS)[order]
        winner, rule, cause = np.array(self.chosen, np.int16).reshape(-1, 3)[order].T
        return Detail(
            np.array(self.time_us)[order], 20 * np.log10(residuals), winner.astype(np.int8), rule,
            cause.astype(np.int8), np.zeros((len(order), 4), bool),
        )  # fmt: skip


def estimate(
    log: Path, config: Config, channel: str | None, reached: Callable[[int], None] = lambda stamp_us: None,
    state: Path | None = None,
) -> Estimated:  # fmt: skip
    """Replay a log. reached gets the stamps on the way. state: what slides had revealed before, None for nothing."""
    core, gathering, reader = Core(config), Gathering(), LogReader(log, channel)
    if state is not None:
        take_file(core.estimator, state)
    clock = reader.clock
    changes: list[Change] = []
    new_changes = NewChanges(core, clock)
    answers = {a.number: FrameEstimates() for a in config.axles}
    of_message = {
        message_key(find_message(config.database, a.adhesion.message)): answers[a.number] for a in config.axles
    }
    for number, (o, _) in enumerate(outgoing(made_of_log(core, reader))):
        stamp_us = clock.made(o.frame.stamp_us)
        gathering.put((replace(o.frame, stamp_us=stamp_us), channel or ""))
        if (found := of_message.get(o.frame.key)) is not None:
            found.put(stamp_us, o.why, o.cause)
        changes += new_changes.take()
        if number % 1024 == 0:
            reached(stamp_us)
    changes += new_changes.take()
    counts = core.counts
    counted = counts.accepted, dict(counts.rejected_by_message)
    return Estimated(gathering.done(log), tuple(changes), *counted, answers, core.design_fits)


def gather(
    log: Path, config: Config, databases: Sequence[Database] = (), *, replay: bool = False, channel: str | None = None,
    progress: Progress | None = None, bit_rate: int = BIT_RATE, state: Path | None = None,
) -> Story:  # fmt: skip
    """All that a log tells, as columns.

    A log with wrcd's own Adhesion frames is shown as those say: what the controllers saw. One without them, or with
    replay or a state to begin with (a dump's NAME.state.json), is estimated by the core. databases are further DBCs,
    for the truth and for names. bit_rate: for the bus's load.

    Raises InputError for a log that cannot be read, that has several channels where none is named, or in which
    neither wrcd's frames nor a usable input is found.
    """
    progress = progress or Progress()
    if log.exists() and not (log.is_file() or log.is_dir()):
        raise InputError("is read twice, which a pipe or a device cannot", file=log, hint="write it to a file first")
    first: list[int] = []

    def reading(stamp_us: int) -> None:
        first[:] = first or [stamp_us]
        progress.at(f"{log.name}: read, {(stamp_us - first[0]) * 1e-6:.0f} s of log")

    found, inputs = scan(log, channel, reading), MappedInputs(config)
    found.rename(inputs.named)
    own = OwnFrames(config)
    adhesions = {a.number: own.adhesion(found, a.number) for a in config.axles}
    warnings = list(found.warnings)
    estimated: Estimated | None = None
    if replay or state is not None or not any(adhesions.values()):
        estimated = _estimate(found, config, channel, progress, state)
        sent = estimated.sent
        own = OwnFrames(config)
        adhesions = {a.number: own.adhesion(sent, a.number) for a in config.axles}
    else:
        sent = found
        warnings += _uncovered(found, config, own, adhesions)
    progress.end()
    inputs.count_wrong(found)
    messages = truth.truths(databases)
    speed = inputs.speed(found)
    axles = []
    torque = {}
    for place, a in enumerate(config.axles):
        truth_record = truth.truth(found, messages.get(a.number))
        axle = story_axle(a.number, adhesions[a.number], own, sent, truth_record, found, estimated)
        if axle is not None:
            axles.append(axle)
        series = inputs.torque(found, place)
        if series is not None:
            torque[a.number] = series
    axles = _with_inputs(axles, inputs, found, config, warnings)
    status, rejects, link = (own.series(sent, kind) for kind in ("status_message", "rejects_message", "link_message"))
    wrong = {**inputs.wrong, **(own.wrong if estimated is None else {})}
    truth_keys = frozenset(map(message_key, messages.values()))
    story = Story(
        log, found.channel, SENT if estimated is None else ESTIMATED, found.begin_us, found.end_us, tuple(axles), speed,
        distance(speed), torque, status, rejects, link,
        statistics.bus(found, config, databases, truth_keys, own.keys, wrong, bit_rate), (), (), tuple(warnings),
        config, _versions(config), found.whole, found.clock_steps, found.gaps,
        *((estimated.accepted, estimated.refused, estimated.fits) if estimated else (0, {}, ())),
    )  # fmt: skip
    return verdict.judged(story_events.with_falls(story))


def _estimate(found: Scan, config: Config, channel: str | None, progress: Progress, state: Path | None) -> Estimated:
    span_us = max(found.end_us - found.begin_us, 1)
    mapped = {message_key(find_message(config.database, i.source.message)) for i in config.inputs}
    if not mapped & found.frames.keys():
        raise InputError(
            "has neither a frame of wrcd nor one of a mapped input", file=found.log,
            hint="the configuration's DBC is another train's: give --config",
        )  # fmt: skip

    def reached(stamp_us: int) -> None:
        progress.at(f"{found.log.name}: estimated", (stamp_us - found.begin_us) / span_us)

    estimated = estimate(found.log, config, channel, reached, state)
    if not estimated.accepted:
        raise InputError(
            f"none of its frames is a usable input of this configuration: it maps {', '.join(map(id_text, mapped))}; "
            f"the log has {counted_ids({key: len(frames) for key, frames in found.frames.items()})}", file=found.log,
            hint="wrcd check --log tells why",
        )  # fmt: skip
    return estimated


def story_axle(
    number: int, adhesion: AdhesionRecord | None, own: OwnFrames, sent: Scan, truth_record: TruthRecord | None,
    found: Scan, estimated: Estimated | None,
) -> StoryAxle | None:  # fmt: skip
    """An axle's log; None for one that there is not a frame of. found: from when to when it is, and its gaps."""
    if adhesion is None:
        return None
    detail, health = own.detail(sent, number), own.health(sent, number)
    if estimated is None:
        cycle_us = own.cycle_us("adhesion", number)
        lasted = story_events.of_frames(number, adhesion, detail, health, cycle_us, found.begin_us, found.end_us)
    else:
        lasted = story_events.of_changes(number, estimated.changes, found.begin_us, found.end_us)
        answers = estimated.answers[number]
        adhesion, detail = answers.bound(adhesion), detail or answers.detail()
    events = story_events.with_gaps(lasted, found.gaps)
    return StoryAxle(number, adhesion, detail, health, truth_record, events, own.series(sent, "own", number))


def _with_inputs(
    axles: list[StoryAxle], inputs: MappedInputs, found: Scan, config: Config, warnings: list[str]
) -> list[StoryAxle]:
    """The axles but those that the log has no input frame of and that are NotAvailable throughout: a sentence says it
    all. Where all are like that, all of them."""
    places = {a.number: place for place, a in enumerate(config.axles)}
    silent = [
        a
        for a in axles
        if all(e.validity is Validity.NOT_AVAILABLE for e in a.events) and not inputs.any_frame(found, places[a.number])
    ]
    if not silent or len(silent) == len(axles):
        return axles
    numbers = ", ".join(str(a.number) for a in silent)
    warnings.append(
        f"{found.log}: has no input frame of axle{'s' * (len(silent) > 1)} {numbers}: NotAvailable throughout; "
        "not shown"
    )
    left_out = {a.number for a in silent}
    return [a for a in axles if a.number not in left_out]


def _uncovered(found: Scan, config: Config, own: OwnFrames, adhesions: dict[int, AdhesionRecord | None]) -> list[str]:
    """What of the log wrcd's frames do not cover, and what else is odd about them."""
    out = []
    span_us = max(found.end_us - found.begin_us, 1)
    missing = [str(number) for number, a in adhesions.items() if a is None]
    if missing:
        out.append(
            f"{found.log}: has wrcd's frames, but none of axle{'s' * (len(missing) > 1)} {', '.join(missing)}; "
            "--replay estimates"
        )
    for number, a in adhesions.items():
        if a is None:
            continue
        cycle_us = own.cycle_us("adhesion", number)
        steps = np.diff(np.concatenate(([found.begin_us], a.time_us, [found.end_us])))
        uncovered_us = int(steps[steps > story_events.STALE_AFTER * cycle_us].sum())
        if uncovered_us > max(MAX_PART_MISSING * span_us, story_events.STALE_AFTER * cycle_us):
            out.append(
                f"{found.log}: wrcd's frames of axle {number} are missing for {uncovered_us * 1e-6:.1f} of "
                f"{span_us * 1e-6:.1f} s; --replay estimates all of it"
            )
        slots = (a.time_us[-1] - a.time_us[0]) / cycle_us + 1
        if len(a.time_us) > 1.5 * slots + 5:
            out.append(
                f"{found.log}: {len(a.time_us)} Adhesion frames of axle {number} in {slots:.0f} slots: two daemons "
                "send it, or the log has each frame twice"
            )
    return out


def _versions(config: Config) -> dict[str, str]:
    from importlib.metadata import PackageNotFoundError, version

    out = {
        "wrcd": __version__,
        "design": f"{config.design.name} {config.design.checksum[:12]}",
        "Python": platform.python_version(),
    }
    for name in ("numpy", "cantools", "python-can"):
        try:
            out[name] = version(name)
        except PackageNotFoundError:
            out[name] = "missing"
    return out
