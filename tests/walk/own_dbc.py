"""Own DBC: a third party's file, as docs/how-to/own-dbc.md tells it: proposed, settled, checked, played."""

import re

from tests.walk.demo import MAX_S, judged
from tests.walk.walk import Step, Walk, expect

DBC = "tests/data/dbc/third-party.dbc"
LATERAL = '{ signal = "RS2_Beschl.Querbeschl", unit = "m/s2",'
EDITS = [
    ('# wheelset = { name = "multiple-unit" }', 'wheelset = { name = "multiple-unit" }'),
    # the unit is right, and the sensor is mounted the other way round, as the DBC's comment says
    (f"# lateral_acceleration = {LATERAL}", f"lateral_acceleration = {LATERAL} sign = -1,"),
]
# A dry rail: on a quiet one the DBC's gyro, with steps of 0.005 deg/s, is rightly taken for frozen now and then.
SCENARIO = """duration_s = 8
rail = [{ curve = "A" }]
drive = { creep_of_peak = [[0, 0], [1, 1]] }
"""


def take(walk: Walk) -> str:
    """lint, init, check (which refuses), the edits, check, demo."""
    findings = re.search(r": (\d+ findings) of", walk.wrcd("lint", DBC, status=1))
    said = walk.wrcd("init", DBC, "-o", "my.toml")
    questions = len(re.findall(r"my\.toml: TODO", said))
    expect(findings is not None and questions == len(EDITS), f"init leaves {questions} questions open:\n{said}")
    walk.wrcd("check", "--config", "my.toml", status=2)
    file = walk.folder / "my.toml"
    text = file.read_text()
    for proposed, settled in EDITS:
        expect(text.count(proposed) == 1, f"my.toml has no line, or more than one, with {proposed}")
        text = text.replace(proposed, settled)
    file.write_text(text)
    checked = walk.wrcd("check", "--config", "my.toml")
    expect(checked.endswith("\nok\n"), f"check:\n{checked}")
    (walk.folder / "short.toml").write_text(SCENARIO)
    said = walk.sim_ecu("demo", "--config", "my.toml", "--scenario", "short.toml", "-o", "build/own", seconds=MAX_S)
    shown, error = judged(said, lines=12)
    return (
        f"{findings and findings[1]}, {questions} questions open; refused; settled by {len(EDITS)} lines; ok; "
        f"{shown}, {error}"
    )


STEP = Step("own-dbc", take)
