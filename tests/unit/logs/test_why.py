"""`wrcd why` and the explanation of a moment."""

import itertools
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from sim_ecu.resources import TRUTH_DBC
from tests.support.story import BEGIN_US, NOT_AVAILABLE, VALID, Ride, adhesion, at_s, axle, detail, event, story
from wrcd.cli.main import main
from wrcd.core.causes import Cause, Validity
from wrcd.core.configuration import Config
from wrcd.errors import InputError
from wrcd.logs.rule_sentences import sentence
from wrcd.logs.story_events import REASONS
from wrcd.logs.story_records import Detail, Event, HealthRecord, Series, newest
from wrcd.logs.why import INPUT_MAX_AGE_US, answer, around, explain, first_fall, moment, shortened


def test_explanation_tells_what_the_frames_of_the_moment_say(ride: Ride, config: Config) -> None:
    s = ride.sent
    x = explain(s, 1, s.begin_us + 4_500_000)
    a, d = s.axles[0].adhesion, s.axles[0].detail
    assert d is not None
    row = int(np.searchsorted(a.time_us, x.time_us, "right")) - 1
    told = int(np.searchsorted(d.time_us, x.time_us, "right")) - 1
    assert x.available_pct == pytest.approx(float(a.available_pct[row]))
    assert x.rule == int(d.rule[told])
    assert x.rule_sentence == sentence(config.design, x.rule - 1)
    assert x.model == config.design.model_names[x.winner - 1]
    assert x.residual_db == pytest.approx(d.residual_db[told].tolist())
    assert x.torque_Nm == pytest.approx(19_000, rel=0.1)
    assert x.speed_m_s == pytest.approx(25.0, abs=0.1)
    assert x.distance_m == pytest.approx(112.5, abs=1)
    assert x.truth_available_pct == pytest.approx(38.4, abs=0.1)
    assert (x.validity, x.why) == (Validity.VALID, "")


def test_explanation_of_a_state_that_is_not_valid_tells_since_when_and_why(ride: Ride) -> None:
    s = ride.estimated
    event = next(b for a, b in itertools.pairwise(s.axles[0].events) if a.validity is Validity.VALID)
    x = explain(s, 1, event.begin_us)
    assert x.event == event
    assert x.validity is event.validity is not Validity.VALID
    assert x.why == f"{event.cause.words} ({event.detail})"


def test_moment_without_a_fresh_frame_is_not_available(config: Config) -> None:
    made = story(config, axle(adhesion(np.full(100, 30.0))))
    last = int(made.axles[0].adhesion.time_us[-1])
    assert explain(made, 1, last + 60_000).validity is Validity.VALID
    late = explain(made, 1, last + 60_001)
    assert (late.validity, late.surface) == (Validity.NOT_AVAILABLE, "")
    assert math.isnan(late.available_pct)


def test_old_detail_is_not_told(config: Config) -> None:
    made = story(config, axle(adhesion(np.full(100, 30.0)), detail(50)))
    assert explain(made, 1, at_s(1.2)).winner == 1
    assert explain(made, 1, at_s(1.9)).winner == 0


def test_newest_takes_no_older_one() -> None:
    times = np.array([10, 20, 30], np.int64)
    assert newest(times, 25, 5) == 1
    assert newest(times, 26, 5) is None
    assert newest(times, 5, 100) is None


def test_event_at_the_end_of_a_log_is_the_last(ride: Ride) -> None:
    events = ride.sent.axles[0].events
    assert ride.sent.axles[0].event_at(ride.sent.end_us) == events[-1]
    assert ride.sent.axles[0].event_at(events[1].begin_us) == events[1]


def test_seconds_are_after_the_first_frame_or_since_1970(ride: Ride) -> None:
    s = ride.sent
    assert moment(s, 9.3) == s.begin_us + 9_300_000
    assert moment(s, BEGIN_US / 1e6 + 9.3) == BEGIN_US + 9_300_000
    for outside in (-1.0, 99.0, BEGIN_US / 1e6 + 99):
        with pytest.raises(InputError, match="SECONDS: "):
            moment(s, outside)


def test_answer_names_the_fall_and_what_decided_before_and_after(lone_ride: Ride) -> None:
    s, fall = lone_ride.sent, lone_ride.sent.falls[0]
    lines = answer(s, 1, s.begin_us + 5_200_000)
    text = "\n".join(lines)
    assert len(lines) <= 25
    assert max(map(len, lines)) <= 110
    assert lines[0].startswith("Axle 1 at 5.200 s (1700000005.2")
    begin = (fall.begin_us - s.begin_us) * 1e-6
    assert f"between {begin:.3f} and" in text
    assert "truth" in text
    before, after = explain(s, 1, fall.begin_us), explain(s, 1, fall.end_us + 300_000)
    assert before.model != after.model
    assert f"the model that fits best went from {before.winner} to {after.winner}" in text
    assert f"rule {before.rule}: If" in text
    assert f"rule {after.rule}: If" in text
    assert "frames of the log" in text


def test_head_claims_of_a_state_only_what_the_newest_frame_says_too(config: Config) -> None:
    """Where estimates come more often than frames: Degraded for 10 ms between two frames that are Valid."""
    states = [(0, 5_000_000, Validity.VALID), (5_000_000, 5_010_000, Validity.DEGRADED)]
    events = [
        Event(1, BEGIN_US + a, BEGIN_US + b, v, Cause.HARSH if v is Validity.DEGRADED else Cause.NONE, "")
        for a, b, v in states
    ]
    made = story(config, axle(adhesion(np.full(500, 30.0)), events=events))
    assert answer(made, 1, at_s(4))[0].endswith("): Valid from 0.000 to 5.000 s (5.0 s)")
    assert answer(made, 1, at_s(5.005))[0].endswith("): Valid")


def test_moment_within_a_time_not_valid_is_compared_with_before_and_after_it(config: Config) -> None:
    validity = [VALID] * 200 + [NOT_AVAILABLE] * 100 + [VALID] * 200
    made = story(config, axle(adhesion(np.full(500, 30.0), validity), detail(500)))
    before, after, fall = around(made, 1, at_s(5))
    assert fall is None
    assert (before.validity, after.validity) == (Validity.VALID, Validity.VALID)
    assert (before.time_us, after.time_us) == (at_s(4.02) - 1, at_s(6.32))


def test_answer_names_inputs_that_were_refused_stale_or_blamed_or_that_none_was(config: Config) -> None:
    """At 2 s, from 0 to 4 s: one input refused, another stale in one frame, then a sensor blamed."""

    def inputs(d: Detail | None, h: HealthRecord | None, *events: Event) -> str:
        made = story(config, axle(adhesion(np.full(500, 30.0)), d, h, events=[event(0, 10, Validity.VALID), *events]))
        return next(line.split(maxsplit=1)[1] for line in answer(made, 1, at_s(2)) if line.startswith("  inputs"))

    d = detail(500)
    never = np.full((100, 4), -1, np.int8)
    h = HealthRecord(d.time_us, never.astype(np.uint8), never, never[:, 0], never[:, 0] > 0, never[:, 0] > 0)
    nothing = "none refused, stale or blamed within 2 s: nothing points to an input"
    assert inputs(d, h) == nothing
    late = replace(h, refused=np.where((np.arange(100) > 50)[:, None], 1, never).astype(np.int8))  # from 5 s on
    assert inputs(d, late, event(9, 10, Validity.DEGRADED, Cause.GYRO_DEAD)) == nothing
    stale = d.stale.copy()
    stale[15, 1] = True
    refused = never.copy()
    refused[20, 0] = 1
    blamed = event(3, 5, Validity.DEGRADED, Cause.GYRO_DEAD)
    assert inputs(replace(d, stale=stale), replace(h, refused=refused), blamed) == (
        f"refused yaw rate: {REASONS[1]}; stale lateral acceleration; blamed GyroDead"
    )
    for cause in (Cause.SENSOR_DEGRADED, Cause.CONTRADICTION, Cause.LOAD_BEYOND):
        assert inputs(d, h, event(3, 5, Validity.DEGRADED, cause)) == f"blamed {cause.label}"
    assert inputs(d, h, event(3, 5, Validity.DEGRADED, Cause.NO_RULE)) == nothing
    # what is known is named where the rest is not, also where no frame came near the moment
    assert inputs(d, None) == "no InputHealth within 2 s"
    assert inputs(None, replace(h, refused=refused)) == f"refused yaw rate: {REASONS[1]}; no AdhesionDetail within 2 s"
    later = replace(h, time_us=h.time_us + 10_000_000)
    assert inputs(d, later) == "no InputHealth within 2 s"


@pytest.mark.parametrize(("sends", "reason"), [(True, "the log has"), (False, "the configuration sends")])
def test_answer_without_detail_says_why_there_is_none(config: Config, sends: bool, reason: str) -> None:
    silent = replace(config, axles=tuple(replace(a, detail=None) for a in config.axles))
    made = story(config if sends else silent, axle(adhesion(np.full(500, 30.0))))
    text = " ".join("\n".join(answer(made, 1, at_s(5))).split())
    assert text.count(f"not known: {reason} no AdhesionDetail; --replay estimates them") == 2
    assert not {x for x in ("no model fits", "no rule fires", "the same model and rule") if x in text}


def test_rule_is_shortened_to_what_moves_it_most() -> None:
    head = "If a, then adhesion 26.5 % (output 24), the output corrected by -10 per doubling of x, +8 per 0.1 of a, b, "
    assert shortened(f"{head}-4 per 0.1 of y, +5 per doubling of z.") == f"{head}+5 per doubling of z and 1 more"
    assert shortened("If a, then Low (output 3, adhesion 2.0 %).") == "If a, then Low (output 3, adhesion 2.0 %)"


def test_command_answers_for_a_person(ride: Ride, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["why", str(ride.both), "5.2"]) == 0  # the truth unasked
    shown = capsys.readouterr().out
    assert shown.rstrip("\n").splitlines() == answer(ride.sent, 1, ride.sent.begin_us + 5_200_000)


def test_command_without_a_moment_takes_the_first_fall(ride: Ride, capsys: pytest.CaptureFixture[str]) -> None:
    (first, *_) = (fall for fall in ride.sent.falls if fall.is_down)
    assert main(["why", str(ride.both)]) == 0
    assert capsys.readouterr().out.rstrip("\n").splitlines() == answer(ride.sent, 1, first.end_us)
    calm = replace(ride.sent, falls=())
    with pytest.raises(InputError, match="has no fall of the estimate — give SECONDS"):
        first_fall(calm)


def test_command_answers_for_a_program(ride: Ride, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["why", str(ride.both), "5.2", "--axle", "1", "--json", "--dbc", str(TRUTH_DBC)]) == 0
    told = json.loads(capsys.readouterr().out)
    (one,) = told["axles"]
    fall = ride.sent.falls[0]
    assert told["source"] == "frames of the log"
    assert one["change"]["after_pct"] == pytest.approx(fall.after_pct, abs=1e-3)
    assert one["before"]["rule_sentence"].startswith("If ")
    assert one["now"]["truth_available_pct"] == pytest.approx(2.68, abs=0.1)
    assert next(e["validity"] for e in one["events"]) == "Valid"


def test_moment_after_the_last_frame_does_not_contradict_itself(config: Config) -> None:
    whole = adhesion(np.full(200, 30.0))
    kept = np.r_[0:100, 150:200]
    made = story(config, axle(whole.part(kept)))
    last = int(whole.time_us[99])
    for after_us in range(0, 120_000, 5_000):
        x = explain(made, 1, last + after_us)
        assert x.event is not None
        assert x.validity is x.event.validity
        assert math.isfinite(x.available_pct) is (x.validity is Validity.VALID)
        assert x.validity is (Validity.VALID if after_us < 60_000 else Validity.NOT_AVAILABLE)


def test_two_frames_far_apart_are_no_constant() -> None:
    t = np.array([0, 600_000_000], np.int64)
    two = Series(t, {"speed_m_s": np.array([10.0, 20.0])})
    assert two.at("speed_m_s", 500_000, INPUT_MAX_AGE_US) == 10.0
    assert math.isnan(two.at("speed_m_s", 300_000_000, INPUT_MAX_AGE_US))
    assert math.isnan(two.at("torque_Nm", 0, INPUT_MAX_AGE_US))
    assert replace(two, constant=True).at("speed_m_s", 300_000_000, INPUT_MAX_AGE_US) == pytest.approx(15.0)
