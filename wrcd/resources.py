"""Files that the package brings along."""

from pathlib import Path

_DATA = Path(__file__).parent / "data"
DBC = _DATA / "wrcd.dbc"
DESIGN = _DATA / "default.design.json"
COMPLETION = _DATA / "completion"
MANUAL = _DATA / "man"
