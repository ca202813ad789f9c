"""Whatever a scenario says, it is refused with an InputError or it plays."""

import itertools

from hypothesis import given
from hypothesis import strategies as st

from sim_ecu.play.player import Player
from sim_ecu.play.scenario import read_scenario
from tests.fuzz.strategies import mutated
from tests.support.scenarios import CHANGING_SPEED, FOUR_AXLES
from wrcd.config.settings import parse_toml
from wrcd.errors import InputError

EVERYTHING = """
title = "everything"
duration_s = 8
axles = [1, 3]
seed = 7
track = "poor"
sensors = "mems"
speed_m_s = [[0, 10], [8, 32]]
hold_speed = true
[wheelset]
m_w = 1250.0
r_0 = 0.5
[[rail]]
curve = "A"
[[rail]]
from_m = 40
mu_0 = 0.06
radius_m = 1500
cant_rad = 0.05
transition_m = 30
[axlebox]
vibration_m_s2 = 0.3
band_hz = [20, 100]
joint_m_s2 = 1
joint_shape = "unipolar"
[drive]
utilisation = [[0, 0], [1, 0.5]]
creep_limit_of_peak = 1.5
[axle.3]
seed = 4
track = 1e-7
position_m = -2.5
[axle.3.axlebox]
crossing_m_s2 = 5
gyro_per_m_s2 = 0.001
[axle.3.sensors]
kind = "tactical"
yaw_rate_bias_rad_s = 0.01
"""


def judge(text: str) -> None:
    """Refuse it, or play its first 0.1 s."""
    try:
        scenario = read_scenario(parse_toml(text, "test"), "test")
    except InputError:
        return
    for _, frames in itertools.islice(Player(scenario), 20):
        assert all(len(f.data) <= 8 for f in frames)


@given(st.sampled_from((CHANGING_SPEED, FOUR_AXLES, EVERYTHING)).flatmap(mutated))
def test_mutated_scenario_plays_or_is_rejected(text: str) -> None:
    judge(text)


def test_texts_before_mutation_are_good() -> None:
    for text in (CHANGING_SPEED, FOUR_AXLES, EVERYTHING):
        assert list(itertools.islice(Player(read_scenario(parse_toml(text, "test"), "test")), 1))
