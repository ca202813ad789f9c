"""Files that the package brings along."""

from pathlib import Path

DATA = Path(__file__).parent / "data"
DBC = DATA / "wrcd.dbc"
DESIGN = DATA / "default.design.json"
COMPLETION = DATA / "completion"
MANUAL = DATA / "man"
