"""The map of low rail: the rule on words that are given, the places and passages of the suite, one passage played."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim_ecu.design.brief import load_source
from sim_ecu.play.scenario import Course
from sim_ecu.reporting.table import markdown
from sim_ecu.score.low_rail import (
    BLOCK_M,
    MIN_WORDS,
    RULE,
    AxleWords,
    LowRule,
    TrackBlocks,
    blocks_of,
    is_low,
    is_low_by_most,
    rule_for,
)
from sim_ecu.score.map_drawing import write_picture
from sim_ecu.score.map_play import Passage, play_passage
from sim_ecu.score.metrics.map_metrics import ONE, THREE, false_alarms
from sim_ecu.score.report import judge
from sim_ecu.score.run_score import ScoreRequest, play_any
from sim_ecu.score.sections import sections
from sim_ecu.score.suites.map_passages import (
    FILM,
    IN_WORLDS,
    MAX_SPEED_M_S,
    MOST_OF_LOW,
    PLACE_KINDS,
    WET_STRETCH,
    PassageRun,
    map_passages,
)
from sim_ecu.score.suites.run import lot_of
from sim_ecu.score.suites.worlds import AS_TRAINED, UNSEEN
from wrcd.config.config import load_config
from wrcd.resources import DESIGN

SOURCE = load_source(DESIGN)
WORDS = 3 * MIN_WORDS  # of an axle in a block


def passage(available: list[float], width: float | list[float] = 5.0, valid: int = 4) -> TrackBlocks:
    """What a train of four axles says that finds so much in each block; so many of its axles are Valid."""
    place = BLOCK_M * (np.arange(len(available) * WORDS) + 0.5) / WORDS
    mu = np.repeat(np.array(available, np.float64), WORDS)
    wide = np.repeat(np.broadcast_to(width, len(available)), WORDS)
    return blocks_of([
        AxleWords(place, mu if k < valid else np.full(len(mu), np.nan), mu + wide) for k in range(4)
    ])  # fmt: skip


def low_blocks(blocks: TrackBlocks, rule: LowRule = RULE) -> list[int]:
    return [int(number) for number in blocks.number[is_low(blocks, rule)]]


GOOD = [30.0] * 5


def test_low_blocks_amid_good_rail_are_called_low() -> None:
    blocks = passage([*GOOD, 5.0, 6.0, *GOOD])
    assert low_blocks(blocks) == [5, 6]
    assert (blocks.available_pct[5], blocks.upper_pct[5], blocks.rest_pct[5]) == (5.0, 10.0, 30.0)


def test_film_of_a_kilometre_is_compared_with_the_best_of_the_rest() -> None:
    assert low_blocks(passage([*GOOD, *[5.0] * 10, *GOOD])) == list(range(5, 15))


def test_train_that_finds_little_everywhere_calls_nothing_low() -> None:
    assert low_blocks(passage([7.0, 6.0, 5.0, 6.5, 6.0, 5.5, 7.0, 6.0, 5.0, 6.0], width=5.0)) == []


@pytest.mark.parametrize("width", [RULE.upper_pct - 5.0, math.inf])
def test_block_whose_interval_reaches_up_to_the_bound_is_not_called_low(width: float) -> None:
    assert low_blocks(passage([*GOOD, 5.0, *GOOD], width=[5.0] * 5 + [width] + [5.0] * 5)) == []


def test_one_axle_that_is_not_sure_is_enough_for_no_word() -> None:
    sure = passage([*GOOD, 5.0, *GOOD])
    assert low_blocks(sure) == [5]
    place = BLOCK_M * (np.arange(11 * WORDS) + 0.5) / WORDS
    mu = np.repeat([*GOOD, 5.0, *GOOD], WORDS)
    axles = [AxleWords(place, mu, mu + (20.0 if k == 3 else 5.0)) for k in range(4)]
    assert low_blocks(blocks_of(axles)) == []


@pytest.mark.parametrize(("valid", "found"), [(4, [5]), (2, [5]), (1, [])])
def test_half_of_the_axles_must_be_valid(valid: int, found: list[int]) -> None:
    assert low_blocks(passage([*GOOD, 5.0, *GOOD], valid=valid)) == found


def test_few_words_and_too_short_a_passage_say_nothing() -> None:
    place = np.linspace(0.0, BLOCK_M, MIN_WORDS - 1, endpoint=False)
    few = blocks_of([AxleWords(place, np.full(len(place), 5.0), np.full(len(place), 6.0))])
    assert np.isnan(few.available_pct).all()
    assert low_blocks(passage([30.0, 5.0, 30.0, 30.0])) == []  # two blocks away and more there is but one


def test_words_without_a_place_are_left_out_and_places_below_zero_are_blocks() -> None:
    place = np.array([np.nan] * WORDS + [-50.0] * WORDS)
    blocks = blocks_of([AxleWords(place, np.full(2 * WORDS, 5.0), np.full(2 * WORDS, 6.0))])
    assert blocks.number.tolist() == [-1]


def test_most_of_the_passages_decide() -> None:
    assert is_low_by_most(np.array([0, 1, 2, 2]), np.array([1, 2, 3, 2])).tolist() == [False, False, True, True]
    assert rule_for(1) == rule_for(2) == RULE
    assert all(more > one for more, one in zip(rule_for(3), RULE, strict=True))


def test_every_world_has_every_kind_of_place_and_seeds_of_its_lot() -> None:
    for number in (0, -1):
        lot, played = lot_of(number), list(map_passages(SOURCE, 0.05, lot_of(number)))
        assert {(r.place.world, r.place.kind) for r in played} == {(w, k.name) for w in IN_WORLDS for k in PLACE_KINDS}
        assert {r.place.family for r in played} == {AS_TRAINED, UNSEEN}
        seeds = [a.seed for r in played for a in r.scenario.axles]
        assert len(set(seeds)) == len(seeds)
        assert all(lot.first_seed <= seed < lot.first_seed + lot.seeds for seed in seeds)
        for r in played:
            first = r.scenario.axles[0]
            alike = all(np.array_equal(a.rail, first.rail) for a in r.scenario.axles)
            assert alike == (r.place.kind != "film that the first axles clean")
            load_N = r.scenario.wheelset.M_v * 9.80665 * r.scenario.wheelset.r_0
            used_pct = 100 * max(map(abs, first.drive.course.values)) / load_N
            assert r.driven or not r.place.has_film or used_pct <= MOST_OF_LOW * r.place.low_pct + 1e-9
            assert r.place.has_film == (r.place.kind != WET_STRETCH.name)


@pytest.fixture(scope="module")
def film() -> PassageRun:
    """The fastest ordinary passage over a film of the design's own vehicle."""
    every = [r for r in map_passages(SOURCE, 0.3) if r.place.world == IN_WORLDS[0] and r.place.kind == FILM.name]
    return max((r for r in every if not r.driven), key=lambda r: r.speed_m_s)


@pytest.fixture(scope="module")
def played(film: PassageRun) -> Passage:
    (found,) = play_any(ScoreRequest(DESIGN, ()), film)
    assert isinstance(found, Passage)
    return found


def test_film_is_found_though_no_wheel_slides(film: PassageRun, played: Passage) -> None:
    assert film.speed_m_s <= MAX_SPEED_M_S
    assert played.inside.sum() >= 1
    assert not played.slid.any()
    assert np.nanmax(played.used_share) < 0.95
    called = is_low(played.blocks)
    assert called[played.inside].all()
    assert not called[played.clear].any()
    begin, end = played.place.film_m
    middles_m = (played.blocks.number + 0.5) * BLOCK_M
    assert ((middles_m > begin) & (middles_m < end))[played.inside].all()
    assert not ((middles_m > begin) & (middles_m < end))[played.clear].any()


def test_torque_beyond_what_the_film_bears_slides(film: PassageRun) -> None:
    w = film.scenario.wheelset
    torque = Course((0.0, 1.0), (0.0, 0.12 * w.M_v * 9.80665 * w.r_0))
    axles = tuple(replace(a, drive=replace(a.drive, course=torque)) for a in film.scenario.axles)
    until_s = film.place.film_m[1] / film.speed_m_s + 4.0  # the train's length and the last block behind it
    scenario = replace(film.scenario, duration_s=until_s, axles=axles)
    assert play_passage(replace(film, scenario=scenario), load_config(None)).slid.any()


def test_false_alarms_have_the_poisson_interval_of_the_places_that_have_one() -> None:
    places = np.repeat(np.arange(20), 100)  # 200 km
    none = false_alarms(np.zeros(2000, bool), places)
    assert (none.value, none.low) == (0.0, 0.0)
    assert none.high == pytest.approx(3.0 / 200 * 100, rel=1e-2)
    called = np.zeros(2000, bool)
    called[[0, 1, 100, 200]] = True  # of three places
    three = false_alarms(called, places)
    assert three.value == 2.0
    assert (three.low, three.high) == pytest.approx((2.0 * 0.8177 / 3, 2.0 * 7.7537 / 3), rel=1e-3)


def test_table_and_picture_have_what_is_found(played: Passage, tmp_path: Path) -> None:
    again = [
        replace(played, place=replace(played.place, number=k, family=f)) for k, f in enumerate((AS_TRAINED, UNSEEN))
    ]
    result = judge([p for p in again for _ in range(FILM.ordinary)], SOURCE, "map")
    rows = result["suites"]["map"]["rows"]
    for family in (AS_TRAINED, UNSEEN):
        assert (rows[ONE][family]["found"].value, rows[THREE][family]["found"].value) == (1.0, 1.0)
        assert rows[ONE][family]["found"].count == FILM.ordinary * rows[THREE][family]["found"].count
        assert rows[ONE][family]["slides"].value == rows[ONE][family]["alarms"].value == 0.0
    text = "\n".join(markdown(sections(result | {"run": {}})))
    assert "| one passage | 100.0 % | 100.0 % |" in text
    assert "map: one passage, as trained, share of low blocks found" in text
    assert "**not Valid**" not in text
    write_picture(result["suites"]["map"], tmp_path / "map.png")
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")
