"""Events of an axle from its frames: the Validity at 20 ms, the cause that AdhesionDetail says."""

import numpy as np
import pytest

from tests.support.story import BEGIN_US, DEGRADED, NOT_AVAILABLE, SLOT_US, VALID, adhesion, detail, kept
from wrcd.core.causes import Cause, Validity
from wrcd.core.events import Change
from wrcd.logs.story_events import REASONS, of_changes, of_frames
from wrcd.logs.story_records import Event, HealthRecord


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


V, D, N = VALID, DEGRADED, NOT_AVAILABLE


@pytest.mark.parametrize(
    ("validity", "causes", "expected"),
    [
        pytest.param(
            [N] * 50 + [V] * 50, [Cause.WARMING_UP] * 10 + [0] * 10,
            [(0.0, 1.02, "NotAvailable", "WarmingUp"), (1.02, 0.98, "Valid", "")],
            id="states follow the frames without a gap",
        ),
        pytest.param(
            # Degraded from slot 33 to 45; detail comes in slots 35, 40, 45
            [V] * 32 + [D] * 13 + [V] * 55, [0] * 6 + [Cause.HARSH] * 3 + [0] * 11,
            [(0.0, 0.66, "Valid", ""), (0.66, 0.26, "Degraded", "Harsh"), (0.92, 1.08, "Valid", "")],
            id="cause is the one at or first after the beginning",
        ),
        pytest.param(
            [D] * 100, [Cause.HARSH] * 10 + [Cause.NO_RULE] * 10,
            [(0.0, 1.02, "Degraded", "Harsh"), (1.02, 0.98, "Degraded", "NoRule")],
            id="cause that changes within a state begins an event",
        ),
        pytest.param(
            [V] * 41 + [D] * 2 + [V] * 57, [0] * 20,
            [(0.0, 0.84, "Valid", ""), (0.84, 0.04, "Degraded", ""), (0.88, 1.12, "Valid", "")],
            id="state that is over before detail comes has no cause",
        ),
        pytest.param(
            # Degraded is over when detail tells of the standstill that follows
            [V] * 41 + [D] * 2 + [N] * 57, [0] * 8 + [Cause.STANDSTILL] * 12,
            [(0.0, 0.84, "Valid", ""), (0.84, 0.04, "Degraded", ""), (0.88, 1.12, "NotAvailable", "Standstill")],
            id="cause of another state is not taken",
        ),
        pytest.param([D] * 100, None, [(0.0, 2.0, "Degraded", "")], id="without detail no cause is known"),
    ],
)  # fmt: skip
def test_events_are_states_of_the_frames_with_causes_of_detail(
    validity: list[int], causes: list[int] | None, expected: list[tuple[float, float, str, str]]
) -> None:
    a = adhesion(np.full(100, 30.0), validity)
    d = None if causes is None else detail(100, causes)
    events = of_frames(1, a, d, None, SLOT_US, BEGIN_US, int(a.time_us[-1]))
    assert told(events) == expected
    assert {e.detail for e in events} == {""}


def test_missing_frames_are_an_event_of_their_own() -> None:
    a = kept(adhesion(np.full(200, 30.0)), slice(0, 80), slice(120, 200))
    events = of_frames(1, a, None, None, SLOT_US, BEGIN_US, int(a.time_us[-1]))
    assert told(events) == [
        (0.0, 1.66, "Valid", ""), (1.66, 0.76, "NotAvailable", ""), (2.42, 1.58, "Valid", ""),
    ]  # fmt: skip
    assert events[1].detail == "no frame of wrcd"


def test_two_missing_frames_are_none() -> None:
    a = kept(adhesion(np.full(200, 30.0)), slice(0, 80), slice(82, 200))
    assert len(of_frames(1, a, None, None, SLOT_US, BEGIN_US, int(a.time_us[-1]))) == 1


def test_stale_and_refused_inputs_are_named() -> None:
    a = adhesion(np.full(100, 30.0), [VALID] * 50 + [DEGRADED] * 50)
    d = detail(100, [0] * 10 + [Cause.INPUT_STALE] * 10)
    d.stale[12:, 2] = True
    refused = np.zeros((20, 4), np.int8)
    refused[11:, 2] = REASONS.index("Crc")
    nothing = np.zeros(20, bool)
    h = HealthRecord(d.time_us, np.full((20, 4), 255, np.uint8), refused, np.ones(20, np.int8), nothing, nothing)
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
