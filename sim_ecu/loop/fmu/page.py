"""documentation/index.html of the FMU: what it is, what it needs, its variables."""

from collections.abc import Iterable
from html import escape

from sim_ecu.loop.fmu.variables import Variable
from sim_ecu.loop.scenario import DriveScenario
from wrcd import __version__

HEAD = ("name", "type", "causality", "unit", "what")


def page(scenario: DriveScenario, variables: Iterable[Variable]) -> str:
    """The page as HTML."""
    rows = [(v.name, v.kind, v.causality, v.unit, v.what) for v in variables]
    table = "\n".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows)
    head = "".join(f"<th>{cell}</th>" for cell in HEAD)
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>wrcd's rig</title></head><body>
<h1>wrcd's rig: {escape(scenario.train.title)}</h1>
<p>Simulation only. FMI 2.0 co-simulation; communication step 0.005 s or a multiple of it.</p>
<p>It holds no Python: the importing side needs Linux on x86-64 and Python 3.11 or newer with wrcd[bench] {__version__}.
The scenario is resources/scenario.toml.</p>
<table><tr>{head}</tr>
{table}
</table></body></html>
"""
