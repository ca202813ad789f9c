"""Sentences of a verdict: what is told of what, and in which order."""

from dataclasses import replace

import numpy as np
import pytest

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
from wrcd.logs.story_records import Fall, Finding, MessageStatistics, Story
from wrcd.logs.verdict import LEVELS, judged
from wrcd.report.data import tables


def place(message: str, signal: str, word: str) -> float:
    words = MESSAGES[message][signal]
    assert isinstance(words, Words)
    return float(words.words.index(word))


def verdict(made: Story) -> tuple[Finding, ...]:
    return judged(with_falls(made)).verdict


def only(made: Story, part: str) -> Finding:
    (finding,) = [f for f in verdict(made) if part in f.text]
    return finding


def test_log_that_was_never_valid_says_so_first(config: Config) -> None:
    a = adhesion(np.full(100, np.nan), NOT_AVAILABLE)
    made = story(config, axle(a, detail(100, Cause.INPUT_SILENT)))
    first, second, *_ = verdict(made)
    assert (first.level, second.level) == ("bad", "bad")
    assert first.text == "The axle was never Valid in 2.0 s of log: not one value was to be used."
    assert second.text.startswith("Axle 1 was never Valid: an input is silent or refused (InputSilent, from 0.0 s on")


def test_one_axle_that_was_never_valid_names_the_cause_that_lasted_longest(config: Config) -> None:
    causes = [Cause.WARMING_UP] * 4 + [Cause.GYRO_REVERSED] * 16
    bad = axle(adhesion(np.full(100, 20.0), [NOT_AVAILABLE] * 20 + [DEGRADED] * 80), detail(100, causes), number=3)
    made = story(config, axle(adhesion(np.full(100, 20.0))), bad)
    finding = verdict(made)[0]
    assert finding.axle == 3
    assert finding.text.startswith("Axle 3 was never Valid: gyro and accelerometer are against each other")
    assert "(GyroReversed, from 0.4 s on, 1.6 s in all)" in finding.text
    assert "WarmingUp 0.42 s" in finding.text


def test_fall_is_told_with_time_length_interval_and_what_was_not_valid(config: Config) -> None:
    values = np.concatenate((np.full(450, 38.0), np.full(30, 20.0), np.full(400, 5.0)))
    validity = [VALID] * 450 + [DEGRADED] * 30 + [VALID] * 400
    causes = [0] * 90 + [Cause.TOO_LITTLE_DATA] * 6 + [0] * 80
    finding = only(story(config, axle(adhesion(values, validity), detail(880, causes))), "fell")
    assert finding.level == "warning"
    assert finding.text == (
        "Axle 1: available adhesion fell from 38 to 5.0 % at 9.0 s, within 0.62 s, for 8.0 s, to the end of the log; "
        "interval ±1 pp; Valid throughout but for 0.60 s of Degraded (TooLittleData 0.60 s)."
    )


def test_rise_is_a_note(config: Config) -> None:
    values = np.concatenate((np.full(300, 5.0), np.full(300, 38.0)))
    finding = only(story(config, axle(adhesion(values))), "rose")
    assert finding.level == "note"
    assert "Valid throughout." in finding.text


def test_share_of_valid_is_told_with_the_causes_of_the_rest(config: Config) -> None:
    a = adhesion(np.full(100, 30.0), [VALID] * 80 + [DEGRADED] * 20)
    finding = only(story(config, axle(a, detail(100, [0] * 16 + [Cause.HARSH] * 4))), "was Valid for")
    assert "Valid for 81.0 % of 2.0 s; Degraded 0.38 s (Harsh 0.38 s)." in finding.text
    assert finding.level == "warning"


def test_outage_is_told_with_its_time_and_the_cause_that_lasted_longest(config: Config) -> None:
    a = adhesion(np.full(500, 30.0), [VALID] * 100 + [DEGRADED] * 5 + [NOT_AVAILABLE] * 100 + [VALID] * 295)
    causes = [0] * 20 + [Cause.INPUT_STALE] + [Cause.INPUT_SILENT] * 20 + [0] * 59
    finding = only(story(config, axle(a, detail(500, causes))), "was not Valid")
    assert finding.level == "warning"
    assert finding.text == (
        "Axle 1 was not Valid from 2.0 to 4.1 s (2.1 s): an input is silent or refused (InputSilent 2.0 s, "
        "InputStale 0.10 s)."
    )


def test_outage_within_a_fall_and_a_short_one_are_not_told_again(config: Config) -> None:
    values = np.concatenate((np.full(450, 38.0), np.full(100, 20.0), np.full(400, 5.0)))
    validity = [VALID] * 200 + [DEGRADED] * 20 + [VALID] * 230 + [DEGRADED] * 100 + [VALID] * 400
    told = [f.text for f in verdict(story(config, axle(adhesion(values, validity))))]
    assert any("fell" in t for t in told)
    assert not [t for t in told if "was not Valid" in t]


def test_warm_up_alone_is_good(config: Config) -> None:
    a = adhesion(np.full(100, 30.0), [NOT_AVAILABLE] * 20 + [VALID] * 80)
    assert only(story(config, axle(a, detail(100, [Cause.WARMING_UP] * 4 + [0] * 16))), "was Valid").level == "good"


def test_contradiction_is_told(config: Config) -> None:
    a = adhesion(np.full(100, 30.0), [VALID] * 80 + [DEGRADED] * 20)
    made = story(config, axle(a, detail(100, [0] * 16 + [Cause.CONTRADICTION] * 4)))
    assert only(made, "more adhesion is in use").level == "warning"


def test_errors_against_the_truth_are_told(config: Config) -> None:
    a = adhesion(np.full(200, 30.0), half=2.0)
    true = truth(np.concatenate((np.full(150, 31.0), np.full(50, 20.0))))
    made = story(config, axle(a, true=true))
    assert (
        "mean error +1.8 pp, mean absolute error 3.2 pp; the interval held the truth in 75.0 % of 200 frames"
        in only(made, "against the truth").text
    )
    lie = only(made, "worst Valid claim")
    assert lie.level == "warning"
    assert "30 % where 20 % was there, at 3.0 s; the whole interval lay above the truth for 1.0 s" in lie.text


def test_truth_within_the_interval_is_no_lie(config: Config) -> None:
    made = story(config, axle(adhesion(np.full(200, 30.0), half=2.0), true=truth(np.full(200, 29.0))))
    assert only(made, "against the truth").level == "good"
    assert not [f for f in verdict(made) if "worst" in f.text]


@pytest.mark.parametrize(
    ("kind", "name", "values", "told", "level"),
    [
        ("status", "Overruns", (250, 255, 3), "Overruns: 9 (frames left out because the loop came too late", "warning"),
        ("status", "ReceiveDrops", (1, 1, 2), "ReceiveDrops: 1 (frames that the kernel dropped", "warning"),
        ("link", "Restarts", (0, 2), "Restarts: 2 (axles started anew), first at 2.0 s.", "warning"),
        ("link", "Outliers", (255, 1), "Outliers: 2 (measurements left out", "note"),
        ("link", "Unsent", (7, 9), "Unsent: 2 (frames that could not be sent", "warning"),
    ],
)
def test_counts_that_grew_are_told(
    config: Config, kind: str, name: str, values: tuple[int, ...], told: str, level: str
) -> None:
    grown, a = counts(config, name, *values), axle(adhesion(np.full(200, 30.0)))
    made = story(config, a, status=grown) if kind == "status" else story(config, a, link=grown)
    finding = only(made, told)
    assert finding.level == level
    assert finding.begin_us is not None


def test_counts_that_stand_still_are_not_told(config: Config) -> None:
    made = story(config, axle(adhesion(np.full(200, 30.0))), status=counts(config, "Overruns", 5, 5, 5))
    assert not [f for f in verdict(made) if "Overruns" in f.text]
    assert increase(counts(config, "Overruns", 5, 5, 5), "Overruns", "status_message") == (0, 0)


def test_link_down_and_stopping_are_told(config: Config) -> None:
    down = place("link_message", "LinkState", "Down")
    stopping = place("status_message", "State", "Stopping")
    made = story(
        config, axle(adhesion(np.full(200, 30.0))), link=series(LinkState=[0.0, down, down]),
        status=series(State=[0.0, 0.0, stopping]),
    )  # fmt: skip
    assert only(made, "link said Down in 2 frames, first at 2.0 s").level == "bad"
    assert only(made, "daemon said Stopping in 1 frames").level == "note"


def test_another_design_is_a_warning(config: Config) -> None:
    ours = int(config.design.checksum[:4], 16)
    a = axle(adhesion(np.full(200, 30.0)))
    same = story(config, a, status=series(DesignChecksum=[float(ours)] * 2))
    other = story(config, a, status=series(DesignChecksum=[float(ours ^ 1)] * 2))
    assert not [f for f in verdict(same) if "design" in f.text]
    assert only(other, "Give the --config").level == "warning"


def test_rejects_are_told_by_reason_and_full_counts_as_or_more(config: Config) -> None:
    rejects = series(RejectedCrc=[0.0, 15.0], RejectedJump=[2.0, 1.0], ForeignFrames=[0.0, 0.0])
    finding = only(story(config, axle(adhesion(np.full(200, 30.0))), rejects=rejects), "refused")
    assert finding.text == "Input frames refused: 15 or more Crc, 3 Jump; first at 1.0 s."


def test_foreign_frames_are_bad(config: Config) -> None:
    rejects = series(ForeignFrames=[0.0, 4.0])
    assert only(story(config, axle(adhesion(np.full(200, 30.0))), rejects=rejects), "another wrcd").level == "bad"


def test_gaps_of_the_daemons_own_frames_are_told(config: Config) -> None:
    a = kept(adhesion(np.full(200, 30.0)), slice(0, 80), slice(120, 150), slice(155, 200))
    finding = only(story(config, axle(a)), "gaps of more than 60 ms")
    assert "2 gaps" in finding.text
    assert "longest 0.82 s at 1.6 s" in finding.text


def test_bus_is_told(config: Config) -> None:
    late = MessageStatistics(0x101, "YawRate_A1", "input", 100, 200.0, 80.0, at_s(1), 5.0, 3)
    made = story(config, axle(adhesion(np.full(200, 30.0))), messages=[late], errors_us=[at_s(1), at_s(2)])
    made = replace(made, bus=replace(made.bus, load_pct=np.array([91], np.float32)))
    assert "the longest gap, 0.08 s at 1.0 s, is past its time-out of 15 ms" in only(made, "longest gap").text
    assert only(made, "3 of 100 frames have a length or an E2E CRC").level == "note"
    assert only(made, "2 error frames").level == "warning"
    assert only(made, "Bus load up to 91 %").level == "warning"


def test_levels_are_in_order_of_importance(ride: Ride) -> None:
    levels = [LEVELS.index(f.level) for f in ride.sent.verdict]
    assert levels == sorted(levels)


def test_verdict_of_a_ride_begins_with_the_fall(lone_ride: Ride) -> None:
    first, fall = lone_ride.sent.verdict[0], lone_ride.sent.falls[0]
    assert first.text.startswith(
        f"Axle 1: available adhesion fell from {fall.before_pct:.2g} to {fall.after_pct:.2g} %"
    )
    assert fall.before_pct > 30.0
    assert first.begin_us == fall.begin_us


def test_many_falls_are_counted(config: Config) -> None:
    made = with_falls(story(config, axle(adhesion(np.full(3000, 30.0)))))
    falls = tuple(Fall(1, at_s(2 * k + 1), at_s(2 * k + 1.2), 30.0, 20.0) for k in range(12))
    told = judged(replace(made, falls=falls)).verdict
    assert sum("fell" in f.text for f in told) == 8
    assert any("4 more falls and rises" in f.text for f in told)


def test_log_without_an_axle_is_bad(config: Config) -> None:
    assert verdict(story(config))[0].text == "No axle has a frame of wrcd: nothing was estimated."


def test_restart_of_the_daemon_is_no_overrun(config: Config) -> None:
    made = story(
        config, axle(adhesion(np.full(200, 30.0))), status=series(Overruns=[3, 3, 0, 1], ReceiveDrops=[2, 2, 1, 1])
    )
    assert only(made, "Overruns").text.startswith("Overruns: 1 (")
    assert only(made, "ReceiveDrops").text.startswith("ReceiveDrops: 1 (")
    assert only(made, "daemon was restarted").begin_us == at_s(3)
    page_values = tables(made)["status"]["Overruns"].values
    assert page_values[:4].tolist() == [0, 0, 0, 1]


def test_gap_is_what_the_configured_cycle_makes_one(config: Config) -> None:
    slow = replace(
        config, axles=tuple(replace(a, adhesion=replace(a.adhesion, cycle_us=100_000)) for a in config.axles)
    )  # fmt: skip
    a = kept(adhesion(np.full(200, 30.0)), slice(0, 200, 5))
    assert not [f for f in verdict(story(slow, axle(a))) if "gap" in f.text]
    assert "of more than 300 ms" in only(story(slow, axle(a.part(np.r_[0:10, 14:40]))), "gap").text


@pytest.mark.parametrize(
    ("pct", "half", "level"), [(3.0, np.nan, "warning"), (3.0, 2.0, "note"), (39.0, np.nan, "note")]
)
def test_claims_without_interval_or_far_above_the_truth_are_not_good(
    config: Config, pct: float, half: float, level: str
) -> None:
    made = story(config, axle(adhesion(np.full(200, 40.0), half=half), true=truth(np.full(200, pct))))
    found = only(made, "against the truth")
    assert (found.level, "no frame stated an interval" in found.text) == (level, bool(np.isnan(half)))
    assert [f.level for f in verdict(made) if "worst Valid claim" in f.text] == ["warning"] * (pct < 39.0)


def test_log_that_is_mostly_warming_up_is_not_good(config: Config) -> None:
    a = adhesion(np.full(100, 30.0), [NOT_AVAILABLE] * 78 + [VALID] * 22)
    finding = only(story(config, axle(a, detail(100, [Cause.WARMING_UP] * 15 + [0] * 5))), "was Valid for")
    assert finding.level == "note"


def test_outage_is_told_with_the_cause_that_began_it(config: Config) -> None:
    a = adhesion(np.full(500, 30.0), [VALID] * 100 + [NOT_AVAILABLE] * 100 + [VALID] * 300)
    causes = [0] * 20 + [Cause.INPUT_SILENT] + [Cause.WARMING_UP] * 19 + [0] * 60
    finding = only(story(config, axle(a, detail(500, causes))), "was not Valid")
    assert "an input is silent or refused (WarmingUp 1.9 s, InputSilent 0.10 s)" in finding.text
