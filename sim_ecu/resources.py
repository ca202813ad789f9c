"""Where the rig's packaged files are."""

from pathlib import Path

FOLDER = Path(__file__).parent / "data"
TRUTH_DBC = FOLDER / "sim_ecu.dbc"
BASELINES = FOLDER / "default.baselines.json"  # what `sim-ecu score` compares the default design with
