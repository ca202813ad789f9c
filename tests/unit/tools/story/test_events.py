"""Events of an axle from its frames: the Validity at 20 ms, the cause that AdhesionDetail says."""

import numpy as np
import pytest

from tests.support.story import BEGIN_US, DEGRADED, NOT_AVAILABLE, SLOT_US, VALID, adhesion, detail
from wrcd.core.causes import Cause, Validity
from wrcd.core.events import Change
from wrcd.tools.story.events import REASONS, of_changes, of_frames
from wrcd.tools.story.records import Event, Health


def told(events: tuple[Event, ...]) -> list[tuple[float, float, str, str]]:
    def seconds(us: int) -> float:
        return round(us / 1e6, 3)

    return [
        (
            seconds(e.begin_us - BEGIN_US),
            seconds(e.end_us - e.begin_us),
            e.validity.value,
            e.cause.label * bool(e.cause),
        )
        for e in events
    ]


def test_states_follow_the_frames_without_a_gap() -> None:
    a = adhesion(np.full(100, 30.0), [NOT_AVAILABLE] * 50 + [VALID] * 50)
    d = detail(100, [Cause.WARMING_UP] * 10 + [0] * 10)
    events = of_frames(1, a, d, None, SLOT_US, BEGIN_US, int(a.time_us[-1]) + SLOT_US)
    assert told(events) == [(0.0, 1.02, "NotAvailable", "WarmingUp"), (1.02, 1.0, "Valid", "")]


def test_cause_is_the_one_that_detail_says_at_or_first_after_the_state_begins() -> None:
    # Degraded from slot 33 to 45; detail comes in slots 35, 40, 45
    a = adhesion(np.full(100, 30.0), [VALID] * 32 + [DEGRADED] * 13 + [VALID] * 55)
    causes = [0] * 6 + [Cause.HARSH] * 3 + [0] * 11
    events = of_frames(1, a, detail(100, causes), None, SLOT_US, BEGIN_US, int(a.time_us[-1]))
    assert told(events)[1] == (0.66, 0.26, "Degraded", "Harsh")


def test_cause_that_changes_within_a_state_begins_an_event() -> None:
    a = adhesion(np.full(100, 30.0), DEGRADED)
    causes = [Cause.HARSH] * 10 + [Cause.NO_RULE] * 10
    events = of_frames(1, a, detail(100, causes), None, SLOT_US, BEGIN_US, int(a.time_us[-1]))
    assert [e.cause for e in events] == [Cause.HARSH, Cause.NO_RULE]
    assert told(events)[1][0] == pytest.approx(1.02)


def test_state_that_is_over_before_detail_comes_has_no_cause() -> None:
    a = adhesion(np.full(100, 30.0), [VALID] * 41 + [DEGRADED] * 2 + [VALID] * 57)
    events = of_frames(1, a, detail(100), None, SLOT_US, BEGIN_US, int(a.time_us[-1]))
    assert told(events)[1] == (0.84, 0.04, "Degraded", "")


def test_cause_of_another_state_is_not_taken() -> None:
    # Degraded is over when detail tells of the standstill that follows
    a = adhesion(np.full(100, 30.0), [VALID] * 41 + [DEGRADED] * 2 + [NOT_AVAILABLE] * 57)
    causes = [0] * 8 + [Cause.STANDSTILL] * 12
    events = of_frames(1, a, detail(100, causes), None, SLOT_US, BEGIN_US, int(a.time_us[-1]))
    assert [e.cause for e in events] == [Cause.NONE, Cause.NONE, Cause.STANDSTILL]


def test_without_detail_no_cause_is_told() -> None:
    a = adhesion(np.full(50, 30.0), DEGRADED)
    (event,) = of_frames(1, a, None, None, SLOT_US, BEGIN_US, int(a.time_us[-1]))
    assert (event.cause, event.detail) == (Cause.NONE, "")


def test_missing_frames_are_an_event_of_their_own() -> None:
    whole = adhesion(np.full(200, 30.0))
    kept = np.r_[0:80, 120:200]
    a = type(whole)(*(getattr(whole, name)[kept] for name in whole.__slots__))
    events = of_frames(1, a, None, None, SLOT_US, BEGIN_US, int(a.time_us[-1]))
    assert told(events) == [
        (0.0, 1.66, "Valid", ""), (1.66, 0.76, "NotAvailable", ""), (2.42, 1.58, "Valid", ""),
    ]  # fmt: skip
    assert events[1].detail == "no frame of wrcd"


def test_two_missing_frames_are_none() -> None:
    whole = adhesion(np.full(200, 30.0))
    kept = np.r_[0:80, 82:200]
    a = type(whole)(*(getattr(whole, name)[kept] for name in whole.__slots__))
    assert len(of_frames(1, a, None, None, SLOT_US, BEGIN_US, int(a.time_us[-1]))) == 1


def test_stale_and_refused_inputs_are_named() -> None:
    a = adhesion(np.full(100, 30.0), [VALID] * 50 + [DEGRADED] * 50)
    d = detail(100, [0] * 10 + [Cause.INPUT_STALE] * 10)
    d.stale[12:, 2] = True
    refused = np.zeros((20, 4), np.int8)
    refused[11:, 2] = REASONS.index("Crc")
    nothing = np.zeros(20, bool)
    h = Health(d.time_us, np.full((20, 4), 255, np.uint8), refused, np.ones(20, np.int8), nothing, nothing)
    events = of_frames(1, a, d, h, SLOT_US, BEGIN_US, int(a.time_us[-1]))
    assert events[1].detail == "torque past its time-out (refused: Crc)"


def test_changes_of_the_core_become_events_with_their_figures() -> None:
    na, valid = Validity.NOT_AVAILABLE, Validity.VALID
    changes = [
        Change(BEGIN_US + 20_000, 1, na, na, Cause.WARMING_UP, "0.02 s of the window's 1 s"),
        Change(BEGIN_US + 20_000, 2, na, na, Cause.INPUT_SILENT, "silent"),
        Change(BEGIN_US + 1_000_000, 1, na, valid, Cause.NONE, ""),
    ]
    events = of_changes(1, changes, BEGIN_US, BEGIN_US + 3_000_000)
    assert told(events) == [(0.0, 1.0, "NotAvailable", "WarmingUp"), (1.0, 2.0, "Valid", "")]
    assert events[0].detail == "0.02 s of the window's 1 s"
