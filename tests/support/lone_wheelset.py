"""The paper's lone wheelset and the design for it: where an estimate is the subject, whatever the default ones are."""

from wrcd.config.config import load_config
from wrcd.config.packaged_designs import design_path
from wrcd.core.configuration import Config
from wrcd.resources import LONE as LONE

PLAYED = f'vehicle = "{LONE}"\n'  # the first line of a scenario
LONE_DESIGN = design_path(LONE)


def lone_config() -> Config:
    """The default configuration with the lone wheelset's design."""
    return load_config(None, design_file=LONE_DESIGN)
