"""Verdicts: what is told of a log, how much it weighs, in which order. tests/data/verdicts.txt has the sentences."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from tests.support.snapshots import assert_kept
from tests.support.story import (
    DEGRADED,
    NOT_AVAILABLE,
    VALID,
    Ride,
    adhesion,
    at_s,
    axle,
    counts,
    detail,
    kept,
    series,
    story,
    truth,
)
from wrcd.core.causes import Cause
from wrcd.core.configuration import Config
from wrcd.core.vocabulary import MESSAGES, Words
from wrcd.logs.daemon import increase
from wrcd.logs.story_events import with_falls
from wrcd.logs.story_records import Fall, Finding, MessageStatistics, Story, StoryAxle
from wrcd.logs.verdict import LEVELS, judged
from wrcd.report.data import tables


def place(message: str, signal: str, word: str) -> float:
    words = MESSAGES[message][signal]
    assert isinstance(words, Words)
    return float(words.words.index(word))


def verdict(made: Story) -> tuple[Finding, ...]:
    return judged(with_falls(made)).verdict


def full() -> StoryAxle:
    return axle(adhesion(np.full(200, 30.0)))


def mostly(
    states: Sequence[tuple[int, int]], causes: Sequence[tuple[int, int]] = (), values: float = 30.0
) -> StoryAxle:
    """States of frames and causes of details, each with how often it comes."""
    validity = [state for state, n in states for _ in range(n)]
    a = adhesion(np.full(len(validity), 30.0), validity)
    return axle(a, detail(len(validity), [cause for cause, n in causes for _ in range(n)])) if causes else axle(a)


def fell(config: Config) -> Story:
    values = np.concatenate((np.full(450, 38.0), np.full(30, 20.0), np.full(400, 5.0)))
    validity = [VALID] * 450 + [DEGRADED] * 30 + [VALID] * 400
    return story(
        config, axle(adhesion(values, validity), detail(880, [0] * 90 + [Cause.TOO_LITTLE_DATA] * 6 + [0] * 80))
    )


def many_falls(config: Config) -> Story:
    made = with_falls(story(config, axle(adhesion(np.full(3000, 30.0)))))
    return replace(made, falls=tuple(Fall(1, at_s(2 * k + 1), at_s(2 * k + 1.2), 30.0, 20.0) for k in range(12)))


def busy_bus(config: Config) -> Story:
    late = MessageStatistics(0x101, "YawRate_A1", "input", 100, 200.0, 80.0, at_s(1), 5.0, 3)
    made = story(config, full(), messages=[late], errors_us=[at_s(1), at_s(2)])
    return replace(made, bus=replace(made.bus, load_pct=np.array([91], np.float32)))


def another_cycle(config: Config) -> Story:
    axles = tuple(replace(a, adhesion=replace(a.adhesion, cycle_us=100_000)) for a in config.axles)
    a = kept(adhesion(np.full(200, 30.0)), slice(0, 200, 5))
    return story(replace(config, axles=axles), axle(a.part(np.r_[0:10, 14:40])))


def another_design(config: Config, by: int) -> Story:
    return story(config, full(), status=series(DesignChecksum=[float(int(config.design.checksum[:4], 16) ^ by)] * 2))


def against(config: Config, pct: float, half: float) -> Story:
    return story(config, axle(adhesion(np.full(200, 40.0), half=half), true=truth(np.full(200, pct))))


N, V, D = NOT_AVAILABLE, VALID, DEGRADED
ALL_FITS = ("Unknown", "Like", "Unsure", "Unlike", "Unlike")
LIES = np.concatenate((np.full(150, 31.0), np.full(50, 20.0)))
SLOW_FALL = np.concatenate((np.full(450, 38.0), np.full(100, 20.0), np.full(400, 5.0)))
STORIES: dict[str, Callable[[Config], Story]] = {
    "no axle": story,
    "never Valid": lambda c: story(c, axle(adhesion(np.full(100, np.nan), N), detail(100, Cause.INPUT_SILENT))),
    "one axle never Valid": lambda c: story(
        c, full(), replace(mostly([(N, 20), (D, 80)], [(Cause.WARMING_UP, 4), (Cause.GYRO_REVERSED, 16)]), number=3)
    ),
    "fall": fell,
    "rise": lambda c: story(c, axle(adhesion(np.concatenate((np.full(300, 5.0), np.full(300, 38.0)))))),
    "many falls": many_falls,
    "a fifth Degraded": lambda c: story(c, mostly([(V, 80), (D, 20)], [(0, 16), (Cause.HARSH, 4)])),
    "outage": lambda c: story(c, mostly(
        [(V, 100), (D, 5), (N, 100), (V, 295)], [(0, 20), (Cause.INPUT_STALE, 1), (Cause.INPUT_SILENT, 20), (0, 59)]
    )),
    "outage by what began it": lambda c: story(c, mostly(
        [(V, 100), (N, 100), (V, 300)], [(0, 20), (Cause.INPUT_SILENT, 1), (Cause.WARMING_UP, 19), (0, 60)]
    )),
    "outage within a fall, and a short one": lambda c: story(
        c, axle(adhesion(SLOW_FALL, [V] * 200 + [D] * 20 + [V] * 230 + [D] * 100 + [V] * 400))
    ),
    "warm-up": lambda c: story(c, mostly([(N, 20), (V, 80)], [(Cause.WARMING_UP, 4), (0, 16)])),
    "mostly warm-up": lambda c: story(c, mostly([(N, 78), (V, 22)], [(Cause.WARMING_UP, 15), (0, 5)])),
    "contradiction": lambda c: story(c, mostly([(V, 80), (D, 20)], [(0, 16), (Cause.CONTRADICTION, 4)])),
    "truth left": lambda c: story(c, axle(adhesion(np.full(200, 30.0), half=2.0), true=truth(LIES))),
    "truth held": lambda c: story(c, axle(adhesion(np.full(200, 30.0), half=2.0), true=truth(np.full(200, 29.0)))),
    "truth far below, no interval": lambda c: against(c, 3.0, np.nan),
    "truth far below": lambda c: against(c, 3.0, 2.0),
    "truth near, no interval": lambda c: against(c, 39.0, np.nan),
    "overruns that wrap": lambda c: story(c, full(), status=counts(c, "Overruns", 250, 255, 3)),
    "overruns that stand still": lambda c: story(c, full(), status=counts(c, "Overruns", 5, 5, 5)),
    "drops": lambda c: story(c, full(), status=counts(c, "ReceiveDrops", 1, 1, 2)),
    "restarts": lambda c: story(c, full(), link=counts(c, "Restarts", 0, 2)),
    "outliers": lambda c: story(c, full(), link=counts(c, "Outliers", 255, 1)),
    "unsent": lambda c: story(c, full(), link=counts(c, "Unsent", 7, 9)),
    "daemon restarted": lambda c: story(c, full(), status=series(Overruns=[3, 3, 0, 1], ReceiveDrops=[2, 2, 1, 1])),
    "link down, and stopping": lambda c: story(
        c, full(), link=series(LinkState=[0.0, *[place("link_message", "LinkState", "Down")] * 2]),
        status=series(State=[0.0, 0.0, place("status_message", "State", "Stopping")]),
    ),
    "the same design": lambda c: another_design(c, 0),
    "another design": lambda c: another_design(c, 1),
    "a design of another bogie": lambda c: story(
        c, full(), status=series(DesignFit=[place("status_message", "DesignFit", word) for word in ALL_FITS])
    ),
    "a design that may be": lambda c: story(
        c, full(), status=series(DesignFit=[place("status_message", "DesignFit", word) for word in ALL_FITS[:3]])
    ),
    "rejects": lambda c: story(
        c, full(), rejects=series(RejectedCrc=[0.0, 15.0], RejectedJump=[2.0, 1.0], ForeignFrames=[0.0, 0.0])
    ),
    "foreign frames": lambda c: story(c, full(), rejects=series(ForeignFrames=[0.0, 4.0])),
    "gaps": lambda c: story(
        c, axle(kept(adhesion(np.full(200, 30.0)), slice(0, 80), slice(120, 150), slice(155, 200)))
    ),
    "gaps of another cycle": another_cycle,
    "bus": busy_bus,
}  # fmt: skip


@pytest.mark.parametrize("name", STORIES)
def test_verdict_of_a_story(name: str, config: Config) -> None:
    made = STORIES[name](config)
    found = verdict(made) if not made.falls else judged(made).verdict
    levels = [LEVELS.index(f.level) for f in found]
    assert levels == sorted(levels)
    at = ["" if f.begin_us is None else f", from {(f.begin_us - made.begin_us) * 1e-6:g} s" for f in found]
    lines = (f"{f.level}{f', axle {f.axle}' if f.axle else ''}{a}: {f.text}" for f, a in zip(found, at, strict=True))
    assert_kept("verdicts", name, lines)


def test_counts_that_stand_still_or_begin_anew_are_no_increase(config: Config) -> None:
    assert increase(counts(config, "Overruns", 5, 5, 5), "Overruns", "status_message") == (0, 0)
    page = tables(STORIES["daemon restarted"](config))["status"]["Overruns"].values
    assert page[:4].tolist() == [0, 0, 0, 1]


def test_verdict_of_a_ride_begins_with_the_fall(lone_ride: Ride) -> None:
    first, fall = lone_ride.sent.verdict[0], lone_ride.sent.falls[0]
    assert f"fell from {fall.before_pct:.2g} to {fall.after_pct:.2g} %" in first.text
    assert fall.before_pct > 30.0
    assert first.begin_us == fall.begin_us
