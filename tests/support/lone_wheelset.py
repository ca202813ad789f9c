"""The paper's lone wheelset and the design for it: where an estimate is the subject, whatever the default ones are."""

from wrcd.config.config import load_config
from wrcd.config.packaged_designs import design_path
from wrcd.core.configuration import Config

LONE = "lone-wheelset"  # the vehicle's name, and the design's
PLAYED = f'vehicle = "{LONE}"\n'  # the first line of a scenario
DESIGN_FILE = design_path(LONE)


def lone_config() -> Config:
    """The default configuration with the lone wheelset's design."""
    return load_config(None, design_file=DESIGN_FILE)
