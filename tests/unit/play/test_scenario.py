"""Scenarios as TOML, and the frames of many axles."""

from itertools import pairwise

import pytest

from sim_ecu.play.encoder import SAMPLE_US
from sim_ecu.play.player import Player
from sim_ecu.play.scenario import Scenario, load_scenario, read_scenario
from wrcd.core.configuration import MAX_AXLES
from wrcd.errors import InputError
from wrcd.settings import parse_toml


def scenario(axles: object) -> Scenario:
    text = f'duration_s = 0.2\naxles = {axles}\nrail = [{{ curve = "A" }}]\ndrive = {{ utilisation = 0.3 }}\n'
    return read_scenario(parse_toml(text, "test"), "test")


@pytest.mark.parametrize("axles", [[], [0], [9], list(range(1, 10)), [1.0], "one"])
def test_other_axles_than_one_to_eight_are_refused(axles: object) -> None:
    with pytest.raises(InputError, match=r"axles: takes one to 8 of the numbers 1 … 8, not"):
        scenario(f"'{axles}'" if isinstance(axles, str) else axles)


def test_an_axle_named_twice_is_refused() -> None:
    with pytest.raises(InputError, match="names an axle twice"):
        scenario([6, 6])


def test_a_second_vehicle_follows_the_first() -> None:
    places = [a.position_m for a in scenario(list(range(1, MAX_AXLES + 1))).axles]
    assert places[:4] == [0.0, -2.5, -19.0, -21.5]
    assert [b - a for a, b in zip(places[:4], places[4:], strict=True)] == [pytest.approx(-26.4)] * 4
    assert [a.position_m for a in scenario([5, 8]).axles] == pytest.approx([0.0, -21.5])


def test_the_locomotives_bogies_have_three_axles() -> None:
    places = [a.position_m for a in load_scenario("six-axles").axles]
    assert [round(a - b, 1) for a, b in pairwise(places)] == [2.1, 2.1, 7.8, 2.1, 2.1]


@pytest.mark.parametrize(("axles", "spacing_us"), [(4, 200), (5, 100), (8, 100)])
def test_the_frames_of_a_sample_are_sent_before_the_next(axles: int, spacing_us: int) -> None:
    samples = list(Player(scenario(list(range(1, axles + 1)))))
    assert max(len(frames) for _, frames in samples) == 4 * axles + 1
    for due_us, frames in samples:
        stamps = [f.due_us for f in frames]
        assert stamps[0] == due_us
        assert {b - a for a, b in pairwise(stamps)} == {spacing_us}
        assert stamps[-1] < due_us + SAMPLE_US
