"""A score and a design, small ones, by this tree and by an older one: processor time of the whole command, in turn."""

import tempfile
from collections.abc import Iterator
from pathlib import Path

from tests.bench.core import BEFORE, OURS, ROOT
from tests.bench.replay import measured
from tests.bench.timing import Goal, Row, Times, show

TURNS = 2
RIG = '[wheelset]\nname = "small"\n[vehicle]\n[plan]\nspeeds = 2\nper_speed = 12\n'
COMMANDS = {
    "score, four runs of the suite dead": ["score", "--suite", "dead", "--quick", "--jobs", "1"],
    "score, four runs of the suite drops, with baselines": ["score", "--suite", "drops", "--quick", "--jobs", "1"],
    "design from 72 conditions": ["design", "--config", "rig.toml", "-o", "small.design.json", "--jobs", "1"],
}


def rows(before: Path | None) -> Iterator[Row]:
    """By command; of this tree alone where there is no older one."""
    trees = {OURS: ROOT} | ({} if before is None else {BEFORE: before})
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "rig.toml").write_text(RIG)
        for what, command in COMMANDS.items():
            show(what + ("" if before is None else f", and by {before}"))
            turns = [
                {who: measured(command, folder, tree, "sim_ecu") for who, tree in trees.items()} for _ in range(TURNS)
            ]
            row = Row("sim-ecu, processor time", what, unit="s")
            row.times = {who: Times(tuple(turn[who]["cpu_s"] for turn in turns)) for who in trees}
            row.compare(OURS, BEFORE, Goal("≤", 0.33))
            yield row
