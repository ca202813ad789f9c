"""Sensors one by one draw and say what they do in blocks."""

from dataclasses import replace

import numpy as np
import pytest

from sim_ecu.physics.axlebox import QUIET, AxleBox
from sim_ecu.physics.sensors import Sensor
from sim_ecu.physics.simulation import Samples
from sim_ecu.physics.wheelset import OUTPUTS
from sim_ecu.play.player import Sensing
from sim_ecu.play.scenario import load_scenario


@pytest.mark.parametrize("sensor", [Sensor(0.3, 1.0, 0.0), Sensor(0.1, 2.0, 0.25, bias=0.4, gain=-1.1)])
def test_one_sample_is_measured_as_in_a_block(sensor: Sensor) -> None:
    truth = np.linspace(-2.0, 2.0, 101)
    block = sensor.measure(truth, np.random.default_rng(1))
    rng = np.random.default_rng(1)
    assert [sensor.measure_one(float(x), rng) for x in truth] == block.tolist()
    assert len(set(block.tolist())) > 5


@pytest.mark.parametrize("box", [QUIET, AxleBox(vibration_m_s2=0.3)])
def test_reading_is_the_row_of_the_readings(box: AxleBox) -> None:
    axle = replace(load_scenario("half-wet").axles[0], axlebox=box)
    one, block = Sensing(axle), Sensing(axle)
    rng = np.random.default_rng(2)
    for _ in range(20):
        s = Samples(rng.standard_normal((1, 1, OUTPUTS)), np.array([20.0]), np.array([1.0]))
        assert one.reading(s, 0) == block.readings(s, 0)[0].tolist()
