"""States of an axle over a long time: what a screen asks for does not grow with what is kept."""

import time

import numpy as np
import pytest

from tests.support.daemon_frames import START_US
from wrcd.core.configuration import Config
from wrcd.tools.monitor.board import Board
from wrcd.tools.monitor.happenings import happenings, newest
from wrcd.tools.monitor.model import Model
from wrcd.tools.monitor.panels import Link
from wrcd.tools.monitor.spells import MAX_SPELLS, Spells
from wrcd.tools.monitor.view import View
from wrcd.tools.story.records import Adhesion, Fall

CYCLE_US = 20_000
LIVE = Link("socketcan:can0", "live")


def adhesion(validity: np.ndarray) -> Adhesion:
    n = len(validity)
    none, place = np.zeros(n, np.float32), np.zeros(n, np.int8)
    times = START_US + CYCLE_US * np.arange(n)
    return Adhesion(times, validity.astype(np.int8), none, none, none, none, place, place, place, none)


@pytest.fixture(scope="module")
def spells() -> Spells:
    """A state ends every one to five cycles."""
    random = np.random.default_rng(3)
    validity = np.repeat(np.arange(300) % 3, random.integers(1, 6, 300))
    out, a = Spells(1, CYCLE_US), adhesion(validity)
    for rows in range(10, len(validity) + 10, 10):
        part = Adhesion(*(getattr(a, name)[:rows] for name in Adhesion.__slots__))
        out.update(part, None, int(part.time_us[-1]))
    return out


def test_spells_of_a_time_are_those_of_all_that_touch_it(spells: Spells) -> None:
    end_us = spells.all()[-1].end_us
    for begin_us in range(START_US - CYCLE_US, end_us + CYCLE_US, 7 * CYCLE_US // 3):
        for until_us in (None, begin_us, begin_us + 9 * CYCLE_US):
            every = spells.all(until_us)
            assert spells.newest(5, until_us)[-5:] == every[-5:]
            wide_us = begin_us + 20 * CYCLE_US
            touching = [s for s in every if s.end_us >= begin_us and s.begin_us <= wide_us]
            assert spells.between(begin_us, wide_us, until_us) == touching
            before = [s for s in every if s.begin_us <= begin_us]
            assert spells.at(begin_us, until_us) == (before[-1] if before else None)


def test_newest_happenings_are_the_last_of_all(spells: Spells) -> None:
    end_us = spells.all()[-1].end_us
    fell = [Fall(1, t, t + 700_000, 30.0, 5.0) for t in range(START_US + 1_000_000, end_us, 3_000_000)]
    for until_us in range(START_US, end_us, 1_300_000):
        known = [f for f in fell if f.end_us <= until_us]
        every = happenings(known, spells.all(until_us))
        for count in (1, 3, 10, 1000):
            found = newest(known, spells, count, until_us)
            assert found == every[len(every) - len(found) :]
            assert len(found) >= min(count, len(every))


def test_drawing_many_spells_costs_what_few_do(config: Config) -> None:
    def drawn_s(count: int) -> float:
        model = Model(config)
        for axle in model.axles:
            a = adhesion(np.arange(count) % 2 + 1)
            axle.spells.update(a, None, int(a.time_us[-1]))
            axle.spells.update(a, None, int(a.time_us[-1]))
        model.begin_us, model.now_us = START_US, START_US + CYCLE_US * count
        board, times = Board(model, View()), []
        for _ in range(5):
            begin = time.process_time()
            board.draw(80, 24, LIVE)
            times.append(time.process_time() - begin)
        assert len(model.axles[0].spells.all()) == count
        return min(times)

    assert drawn_s(MAX_SPELLS - 10) < 3 * drawn_s(2000)
