"""Where the rig's packaged files are."""

from pathlib import Path

FOLDER = Path(__file__).parent / "data"
TRUTH_DBC = FOLDER / "sim_ecu.dbc"
PAPER_DESIGN = FOLDER / "paper.design.json"  # the paper's own form, a baseline of the default design
BASELINES = FOLDER / "default.baselines.json"  # what `sim-ecu score` compares the default design with
