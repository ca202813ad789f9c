"""What the daemon says of sensors in packaged scenarios where the signals of sound ones look as if one were broken."""

from dataclasses import replace

import pytest

from sim_ecu.physics.track import SPECTRA
from sim_ecu.play.faults import Fault
from sim_ecu.play.play import LOG_START_US
from sim_ecu.play.player import LARGE_CHUNK, Player
from sim_ecu.play.scenario import Scenario, load_scenario
from sim_ecu.play.vehicles import load_vehicle
from tests.support.lone_wheelset import LONE
from wrcd.bus.frame import Frame
from wrcd.config.config import load_packaged
from wrcd.core.causes import Cause, Validity
from wrcd.core.core import Core
from wrcd.core.events import PAIR_CAUSES, Change
from wrcd.resources import DEFAULT_DESIGN

CURVE_S = 15.0  # the train of `curves` is in the canted curve
OWN = [LONE, DEFAULT_DESIGN]  # vehicles with a design of the same name


def played(vehicle: str, name: str, seconds: float, seed: int, *faults: Fault) -> Scenario:
    """A packaged scenario's first axle, of a vehicle, for so long, with sensors and a track of a seed. A lone
    wheelset's track has alignment alone, as its training had."""
    scenario, wheelset = load_scenario(name), load_vehicle(vehicle)
    axle = replace(scenario.axles[0], seed=seed, track_seed=seed)
    if wheelset.bogie is None:
        axle = replace(axle, track=SPECTRA["good"])
    return replace(scenario, wheelset=wheelset, axles=(axle,), duration_s=seconds, faults=faults)


def changes(design: str, scenario: Scenario) -> list[Change]:
    """Of Validity, as the daemon's core says them."""
    core = Core(load_packaged(1, design=design))
    for _, frames in Player(scenario, truth=False, chunk=LARGE_CHUNK):
        for f in frames:
            core.feed(Frame(LOG_START_US + f.due_us, f.can_id, f.data, f.extended))
    return core.events.since(0)


@pytest.mark.parametrize("own", OWN)
@pytest.mark.parametrize(
    ("name", "seconds", "seed"), [("curves", 26.0, 17), ("greasy", 18.0, 97)], ids=["canted curve", "held at the peak"]
)
def test_sound_sensors_are_accused_of_nothing(own: str, name: str, seconds: float, seed: int) -> None:
    """In a canted curve gravity takes from the acceleration what the yaw rate shows; at the peak the track does not
    drive yaw, and what is left of gyro and accelerometer goes together by chance."""
    said = changes(own, played(own, name, seconds, seed))
    assert Validity.VALID in {c.after for c in said}
    assert not {c.cause for c in said} & PAIR_CAUSES


@pytest.mark.parametrize(
    ("own", "of", "kind", "cause"),
    [
        *((own, "lateral_acceleration", "dead", Cause.ACCEL_SMALL) for own in OWN),
        *((own, "yaw_rate", "dead", Cause.GYRO_DEAD) for own in OWN),
        # in a bogie it takes the other axle to tell, or longer
        (LONE, "yaw_rate", "reverse", Cause.GYRO_REVERSED),
    ],
)
def test_broken_sensor_is_found_in_a_canted_curve_too(own: str, of: str, kind: str, cause: Cause) -> None:
    fault = Fault(kind, CURVE_S, 60.0, of, 1)
    said = changes(own, played(own, "curves", CURVE_S + 10.0, 17, fault))
    found = [c for c in said if c.cause is cause]
    assert found
    assert found[0].time_us >= LOG_START_US + CURVE_S * 1e6
