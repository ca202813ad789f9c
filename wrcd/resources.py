"""Files that the package brings along."""

from pathlib import Path

DATA = Path(__file__).parent / "data"
DBC = DATA / "wrcd.dbc"
DESIGNS = DATA / "designs"  # NAME.design.json
DEFAULT_DESIGN = "multiple-unit"  # the packaged design that holds where none is named
LONE = "lone-wheelset"  # the packaged design and the vehicle that are the paper's
DESIGN = DESIGNS / f"{DEFAULT_DESIGN}.design.json"
