"""A log to a Story: what wrcd's own frames in it say, or where there are none what the core makes of it."""

import platform
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from wrcd import __version__
from wrcd.bus.codec import message_key
from wrcd.bus.dbc import Database, find_message
from wrcd.bus.log_kind import check_log
from wrcd.core.causes import Validity
from wrcd.core.configuration import Config
from wrcd.errors import InputError
from wrcd.tools.bus_load import BIT_RATE
from wrcd.tools.progress import Progress
from wrcd.tools.story import events, falls, statistics, truth, verdict
from wrcd.tools.story.estimate import Estimated, estimate
from wrcd.tools.story.inputs import Inputs, distance
from wrcd.tools.story.own import Own
from wrcd.tools.story.records import Adhesion, Axle, Story, Truth
from wrcd.tools.story.scan import Scan, scan

SENT, ESTIMATED = "frames of the log", "estimated here"
MAX_PART_MISSING = 0.01  # of a log, without wrcd's frames, before it is said


def gather(
    log: Path, config: Config, databases: Sequence[Database] = (), *, replay: bool = False, channel: str | None = None,
    progress: Progress | None = None, bit_rate: int = BIT_RATE,
) -> Story:  # fmt: skip
    """All that a log tells, as columns.

    A log with wrcd's own Adhesion frames is shown as those say: what the controllers saw. One without them, or with
    replay, is estimated by the core. databases are further DBCs, for the truth and for names.
    bit_rate: for the bus's load.

    Raises InputError for a log that cannot be read, that has several channels where none is named, or in which
    neither wrcd's frames nor a usable input is found.
    """
    progress = progress or Progress()
    check_log(log)
    if log.exists() and not log.is_file():
        raise InputError("is read twice, which a pipe or a device cannot", file=log, hint="write it to a file first")
    first: list[int] = []

    def reading(stamp_us: int) -> None:
        first[:] = first or [stamp_us]
        progress.at(f"{log.name}: read, {(stamp_us - first[0]) * 1e-6:.0f} s of log")

    found = scan(log, channel, reading)
    own = Own(config)
    adhesions = {a.number: own.adhesion(found, a.number) for a in config.axles}
    warnings = list(found.warnings)
    estimated: Estimated | None = None
    if replay or not any(adhesions.values()):
        estimated = _estimate(found, config, channel, progress)
        sent = estimated.sent
        own = Own(config)
        adhesions = {a.number: own.adhesion(sent, a.number) for a in config.axles}
    else:
        sent = found
        warnings += _uncovered(found, config, own, adhesions)
    progress.end()
    inputs = Inputs(config)
    inputs.count_wrong(found)
    messages = truth.truths(databases)
    speed = inputs.speed(found)
    axles = []
    torque = {}
    for place, a in enumerate(config.axles):
        said = truth.truth(found, messages.get(a.number))
        axle = _axle(a.number, adhesions[a.number], own, sent, said, found, estimated)
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
        config, _versions(config), found.whole, found.clock_steps,
    )  # fmt: skip
    return verdict.judged(falls.found(story))


def _estimate(found: Scan, config: Config, channel: str | None, progress: Progress) -> Estimated:
    span_us = max(found.end_us - found.begin_us, 1)
    mapped = {message_key(find_message(config.database, i.source.message)) for i in config.inputs}
    if not mapped & found.frames.keys():
        raise InputError(
            "has neither a frame of wrcd nor one of a mapped input", file=found.log,
            hint="the configuration's DBC is another train's: give --config",
        )  # fmt: skip

    def reached(stamp_us: int) -> None:
        progress.at(f"{found.log.name}: estimated", (stamp_us - found.begin_us) / span_us)

    estimated = estimate(found.log, config, channel, reached)
    if not estimated.accepted:
        raise InputError(
            "none of its frames is a usable input of this configuration", file=found.log,
            hint="wrcd check --log tells why",
        )  # fmt: skip
    return estimated


def _axle(
    number: int,
    adhesion: Adhesion | None,
    own: Own,
    sent: Scan,
    said: Truth | None,
    found: Scan,
    estimated: Estimated | None,
) -> Axle | None:
    """An axle's log; None for one that there is not a frame of."""
    if adhesion is None:
        return None
    detail, health = own.detail(sent, number), own.health(sent, number)
    if estimated is None:
        cycle_us = own.cycle_us("adhesion", number)
        lasted = events.of_frames(number, adhesion, detail, health, cycle_us, found.begin_us, found.end_us)
    else:
        lasted = events.of_changes(number, estimated.changes, found.begin_us, found.end_us)
        lasted = events.with_silences(lasted, adhesion.time_us, own.cycle_us("adhesion", number))
        answers = estimated.answers[number]
        adhesion, detail = answers.bound(adhesion), detail or answers.detail()
    return Axle(number, adhesion, detail, health, said, lasted)


def _with_inputs(axles: list[Axle], inputs: Inputs, found: Scan, config: Config, warnings: list[str]) -> list[Axle]:
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


def _uncovered(found: Scan, config: Config, own: Own, adhesions: dict[int, Adhesion | None]) -> list[str]:
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
        uncovered_us = int(steps[steps > events.STALE_AFTER * cycle_us].sum())
        if uncovered_us > max(MAX_PART_MISSING * span_us, events.STALE_AFTER * cycle_us):
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
