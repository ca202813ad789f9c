"""An axle's history over a long time: what a screen asks for does not grow with what is kept."""

import time

import numpy as np
import pytest

from tests.support.daemon_frames import START_US
from wrcd.core.configuration import Config
from wrcd.logs.story_records import AdhesionRecord, Fall, StoryAxle
from wrcd.monitor.board import Board, ScreenView
from wrcd.monitor.bus_model import BusModel
from wrcd.monitor.history import MAX_EVENTS, History, happenings
from wrcd.monitor.panels import SourceState

CYCLE_US = 20_000
LIVE = SourceState("socketcan:can0", "live")


def adhesion(validity: np.ndarray) -> AdhesionRecord:
    n = len(validity)
    none, place = np.zeros(n, np.float32), np.zeros(n, np.int8)
    times = START_US + CYCLE_US * np.arange(n)
    return AdhesionRecord(times, validity.astype(np.int8), none, none, none, none, place, place, place, none)


@pytest.fixture(scope="module")
def history() -> History:
    """A state ends every one to five cycles."""
    random = np.random.default_rng(3)
    validity = np.repeat(np.arange(300) % 3, random.integers(1, 6, 300))
    out, a = History(CYCLE_US), adhesion(validity)
    for rows in range(10, len(validity) + 10, 10):
        part = a.part(slice(rows))
        out.update(StoryAxle(1, part, None, None, None, ()), int(part.time_us[-1]))
    return out


def test_events_of_a_time_are_those_of_all_that_touch_it(history: History) -> None:
    end_us = history.events()[-1].end_us
    assert len(history.events()) == 300
    for begin_us in range(START_US - CYCLE_US, end_us + CYCLE_US, 7 * CYCLE_US // 3):
        for until_us in (None, begin_us, begin_us + 9 * CYCLE_US):
            every = history.events(until_us=until_us)
            assert all(e.end_us <= (until_us or end_us) for e in every)
            wide_us = begin_us + 20 * CYCLE_US
            touching = [e for e in every if e.end_us >= begin_us and e.begin_us <= wide_us]
            assert history.events(begin_us, wide_us, until_us) == touching
            before = [e for e in every if e.begin_us <= begin_us]
            assert history.at(begin_us, until_us) == (before[-1] if before else None)


def test_newest_happenings_are_the_last_of_all(history: History, monkeypatch: pytest.MonkeyPatch) -> None:
    end_us = history.events()[-1].end_us
    fell = [Fall(1, t, t + 700_000, 30.0, 5.0) for t in range(START_US + 1_000_000, end_us, 3_000_000)]
    monkeypatch.setattr(history, "_falls", tuple(fell))
    for until_us in range(START_US + 8_000_000, end_us, 1_300_000):
        known = [f for f in fell if f.end_us <= until_us]
        every = happenings(known, history.events(until_us=until_us))
        assert history.happenings(until_us) == every
        found = history.happenings(until_us, 100)
        assert len(found) >= 30
        assert found[-30:] == every[-30:]


def test_drawing_many_events_costs_what_few_do(config: Config) -> None:
    def drawn_s(count: int) -> float:
        model = BusModel(config)
        for axle in model.axles:
            a = adhesion(np.arange(count) % 2 + 1)
            axle.history.update(StoryAxle(axle.number, a, None, None, None, ()), int(a.time_us[-1]) + CYCLE_US)
        model.begin_us, model.now_us = START_US, START_US + CYCLE_US * count
        board, times = Board(model, ScreenView()), []
        for _ in range(5):
            begin = time.process_time()
            board.draw(80, 24, LIVE)
            times.append(time.process_time() - begin)
        assert len(model.axles[0].history.events()) == count
        return min(times)

    assert drawn_s(MAX_EVENTS - 10) < 3 * drawn_s(2000)
