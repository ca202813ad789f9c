"""A recorded log through the daemon's core: what it was worth, what was wrong, and the adhesion along the way."""

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sim_ecu.campaign.kind import Factor, Kind, Scalar
from sim_ecu.campaign.kinds.given import named_by
from sim_ecu.score.low_rail import LAG_S, AxleWords, blocks_of
from wrcd.config.config import load_config
from wrcd.core.causes import OF_ARRIVAL, OF_SENDER, OF_SENSOR, RESERVED, Cause, Validity
from wrcd.core.design import Design
from wrcd.core.design_fit import DesignFit
from wrcd.core.vocabulary import FITS, SURFACES, snake
from wrcd.errors import InputError
from wrcd.logs.mapped_inputs import MAX_HOLD_US
from wrcd.logs.story import gather
from wrcd.logs.story_events import VALIDITIES
from wrcd.logs.story_records import Event, Story, StoryAxle, newest_values

CLASSES = (*(snake(name) for _, name in SURFACES), "not_valid")  # the most slippery last but one
LOWS = np.array(sorted(low for low, _ in SURFACES))[1:]  # from which the next better one begins
CAUSES = {c: f"cause_{snake(c.label)}" for c in Cause if c is not Cause.NONE and c not in RESERVED}
# Causes that name a sensor, its wiring or its sender, and for how long in all one must have held.
SUSPICIOUS_S = dict.fromkeys((*OF_SENSOR, *OF_SENDER), 0.0) | dict.fromkeys(OF_ARRIVAL, 1.0)
MIN_REFUSED_SHARE = 0.01  # of a message's frames
KILOMETRE = 1000.0
DIRECTIONS = UP, DOWN = "up", "down"  # whether the track's kilometres go up or down as the train runs forward
SHARES = {v: snake(v) for v in (Validity.VALID, Validity.DEGRADED, Validity.NOT_AVAILABLE)}
FIGURES = {
    "begin_s": float, "hours": float, "km": float, "axles": int,
    **dict.fromkeys(SHARES.values(), float),
    **dict.fromkeys(("read", "accepted", "refused", "restarts", "clock_steps"), int),
    "whole": bool, "suspects": int, "worst_s": float,
    **{f"{of}_{c}": float for of in ("km", "hours") for c in CLASSES},
    **dict.fromkeys(CAUSES.values(), float), "design_fit": str, "conicity": float, "detail": str,
}  # fmt: skip


def figures(inputs: Mapping[str, Any]) -> Mapping[str, Scalar]:
    """Replay a log. Raises InputError for one that cannot be read, or has no usable input."""
    log, channel = Path(inputs["log"]), inputs.get("channel") or None
    config = load_config(Path(inputs["configuration"]) if inputs.get("configuration") else None)
    if ("from_km" in inputs) != ("direction" in inputs):
        raise InputError("only one is given", file=log, key="from_km, direction", hint="give both, or neither")
    story = gather(log, config, replay=True, channel=channel)
    if not story.axles:
        raise InputError("is too short: not one slot ends in it", file=log, hint="leave it out")
    suspects = [*(s for a in story.axles for s in _named(a.events, story.begin_us)), *_refused(story)]
    parts = [_part(story, a) for a in story.axles]
    seconds = sum(p["seconds"] for p in parts)
    numbers = [a.number for a in story.axles]
    detail = {
        "blocks": _blocks(story, inputs["from_km"], inputs["direction"]) if "from_km" in inputs else [],
        "axles": [{"axle": number, "metres": p["way"]} for number, p in zip(numbers, parts, strict=True)],
        "without_frame": [a.number for a in config.axles if a.number not in numbers],
        "suspects": suspects, "warnings": story.warnings,
    }  # fmt: skip
    return {
        "begin_s": story.begin_us / 1e6, "hours": max(p["seconds"] for p in parts) / 3600,
        "km": max(sum(p[f"km_{c}"] for c in CLASSES) for p in parts),
        "axles": len(parts),
        "read": sum(m.frames for m in story.bus.messages) + len(story.bus.error_frames),
        "accepted": story.accepted, "refused": sum(story.refused.values()),
        "restarts": sum(e.cause is Cause.RESTARTED for a in story.axles for e in a.events),
        "clock_steps": len(story.clock_steps), "whole": story.whole, "suspects": len(suspects),
        "worst_s": max((s["seconds"] for s in suspects), default=0.0),
        **{name: sum(p[name] for p in parts) / seconds for name in (*SHARES.values(), *CAUSES.values())},
        **{name: sum(p[name] for p in parts) for c in CLASSES for name in (f"km_{c}", f"hours_{c}")},
        **of_design(story.design_fits, config.design), "detail": json.dumps(detail, separators=(",", ":")),
    }  # fmt: skip


def of_design(fits: Sequence[DesignFit], design: Design) -> dict[str, Any]:
    """Whether the design is the train's, of all bogies the worst; the mean of the conicities that are known. Of another
    vehicle than the design's it is known badly."""
    known = [fit.times["gamma"] for fit in fits if fit.word in ("Like", "Unsure")]
    return {
        "design_fit": max((fit.word for fit in fits), key=FITS.index, default=FITS[0]),
        "conicity": float(design.wheelset["gamma"] * np.mean(known)) if known else math.nan,
    }


def _part(story: Story, axle: StoryAxle) -> dict[str, Any]:
    """An axle's seconds, in all and of each validity and cause; hours and kilometres of each class; metres of each
    class by kilometre."""
    a, n = axle.adhesion, len(CLASSES)
    cycle_s = next(c.adhesion.cycle_us for c in story.config.axles if c.number == axle.number) * 1e-6
    known = (a.validity == VALIDITIES.index(Validity.VALID)) & np.isfinite(a.available_pct)
    of = np.where(known, n - 2 - np.searchsorted(LOWS, a.available_pct, side="right"), n - 1)
    speed = story.speed.values["speed_m_s"] if story.speed else np.zeros(0)
    stamps_us = story.speed.time_us if story.speed else np.zeros(0, np.int64)
    sound = np.isfinite(speed)
    hold_us = np.iinfo(np.int64).max if story.speed and story.speed.constant else MAX_HOLD_US
    metres = np.nan_to_num(newest_values(stamps_us[sound], np.abs(speed[sound]), a.time_us, hold_us)) * cycle_s
    kilometre = ((np.cumsum(metres) - metres) // KILOMETRE).astype(np.int64)
    way = np.bincount(kilometre * n + of, metres, (kilometre.max() + 1) * n).reshape(-1, n)
    hours, km = np.bincount(of, minlength=n) * cycle_s / 3600, way.sum(axis=0) / KILOMETRE
    return {
        "seconds": axle.spells.known_s, "way": way.round(1).tolist(),
        **{name: axle.spells.lasted_s(v) for v, name in SHARES.items()},
        **{name: sum(e.duration_s for e in axle.events if e.cause is c) for c, name in CAUSES.items()},
        **{f"{of}_{c}": float(v[k]) for of, v in (("hours", hours), ("km", km)) for k, c in enumerate(CLASSES)},
    }  # fmt: skip


def _blocks(story: Story, from_km: float, direction: str) -> list[tuple[float, ...]]:
    """What the train says of the blocks of track, rows of TrackBlocks. Places are by the way from its speed; behind a
    hole in that none is known."""
    way, axles, onward = story.distance, list[AxleWords](), 1.0 if direction == UP else -1.0
    if way is None:
        return []
    holes_us = way.time_us[:-1][np.diff(way.time_us) > MAX_HOLD_US]
    last_us = int(holes_us[0]) if len(holes_us) and not way.constant else story.end_us
    ahead_m = {c.number: c.position_m or 0.0 for c in story.config.axles}
    for axle in story.axles:
        a = axle.adhesion
        run_m = np.interp(a.time_us - LAG_S * 1e6, way.time_us, way.values["distance_m"]) + ahead_m[axle.number]
        place_m = np.where(a.time_us <= last_us, from_km * KILOMETRE + onward * run_m, np.nan)
        available = np.where(a.validity == VALIDITIES.index(Validity.VALID), a.available_pct, np.nan)
        axles.append(AxleWords(place_m, available, np.where(np.isnan(a.high_pct), np.inf, a.high_pct)))
    return list(zip(*(column.tolist() for column in blocks_of(axles)), strict=True))


def _named(events: Iterable[Event], begin_us: int) -> Iterator[dict[str, Any]]:
    """Yield what the daemon itself named of an axle's sensors: for how long, first when, in its words."""
    for cause, least_s in SUSPICIOUS_S.items():
        every = [e for e in events if e.cause is cause]
        seconds = sum(e.duration_s for e in every)
        if every and seconds >= least_s:
            text = max(every, key=lambda e: e.duration_s).detail or cause.words
            first_s = (every[0].begin_us - begin_us) * 1e-6
            yield {"what": cause.label, "axle": every[0].axle, "text": text, "first_s": first_s, "seconds": seconds}


def _refused(story: Story) -> Iterator[dict[str, Any]]:
    """Yield messages of which many frames were refused for a reason; their time is their share of the log's."""
    frames, config = {m.name: m.frames for m in story.bus.messages}, story.config
    axles = {i.source.message: i.source.axles for i in config.inputs}
    for (message, reason), refused in story.refused.items():
        share = refused / max(frames.get(message, 0), refused)
        if share >= MIN_REFUSED_SHARE:
            axle = config.axles[axles[message][0]].number if len(axles[message]) == 1 else 0
            text = f"{message}: {refused} of {frames.get(message)} frames refused for {reason.value}"
            seconds = share * (story.end_us - story.begin_us) * 1e-6
            yield {"what": f"Refused{reason.label}", "axle": axle, "text": text, "seconds": seconds}


LOG = Kind(
    "log",
    (Factor("train", str), Factor("log", str, needed=True, is_file=True),
     Factor("configuration", str, is_file=True), Factor("channel", str), Factor("from_km", float),
     Factor("direction", str, choices=DIRECTIONS)),
    FIGURES, figures, "train", seeded=False, check=lambda inputs: float(Path(inputs["log"]).stat().st_size),
    named=named_by,
)  # fmt: skip
