"""The rig's frames in memory, for any configuration: a wheelset on every axle, and the messages that it maps."""

from sim_ecu.play.mapped import MappedTrain
from sim_ecu.play.player import LARGE_CHUNK, Player
from sim_ecu.play.scenario import read_scenario
from wrcd.bus.frame import Frame
from wrcd.config.settings import parse_toml
from wrcd.core.configuration import Config

START_US = 1_700_000_000_000_000
STEADY = """
duration_s = {}
axles = {}
track = "erri-high"
rail = [{{ curve = "B" }}]
drive = {{ torque_N_m = 10000.0 }}
"""


def ticks_of(config: Config, seconds: float) -> list[list[Frame]]:
    """The frames of each tick of a steady ride on a rail of its own for every axle."""
    text = STEADY.format(seconds, [a.number for a in config.axles])
    scenario = read_scenario(parse_toml(text, "steady"), "steady")
    train = MappedTrain(config, scenario.wheelset)
    return [
        [Frame(START_US + f.due_us, f.can_id, f.data, f.extended, fd=f.fd) for f in frames]
        for _, frames in Player(scenario, truth=False, chunk=LARGE_CHUNK, train=train)
    ]
