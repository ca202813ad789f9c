"""Where the rig's packaged files are."""

from pathlib import Path

FOLDER = Path(__file__).parent / "data"  # with NAME.paper.design.json of packaged designs
TRUTH_DBC = FOLDER / "sim_ecu.dbc"
SCENARIOS = Path(__file__).parent / "play" / "scenarios"
TO_DRIVE = Path(__file__).parent / "loop" / "scenarios"  # those that are no course of torques
PAPER_DESIGN = FOLDER / "lone-wheelset.paper.design.json"  # the paper's own form, for the paper's wheelset
