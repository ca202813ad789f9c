"""Frames made for any configuration: all of them are accepted, and every axle is Valid on them."""

from pathlib import Path

import pytest

from tests.support.synthetic import Synthetic
from wrcd.bus.candump import format_line
from wrcd.cli.main import main
from wrcd.config.config import load_config
from wrcd.core.causes import Validity
from wrcd.core.core import Core
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

FILE = Path(__file__).parents[3] / "tests/data/dbc/third-party.toml"


def test_frames_are_accepted_make_every_axle_valid_and_replay_to_the_same(tmp_path: Path) -> None:
    core = Core(load_config(FILE))
    frames, made = [], []
    for tick in Synthetic(core.config).ticks(400):
        assert [f.stamp_us for f in tick] == sorted(f.stamp_us for f in tick)
        frames += tick
        made += [o.frame for f in tick for o in core.feed(f)]
    assert core.counts.rejected == {}
    assert {f.key for f in frames} == set(core.receiver.keys)
    assert {r.validity for r in core.reports} == {Validity.VALID}
    assert [r.mu_used_pct for r in core.reports] == pytest.approx([10.0] * len(core.reports), abs=0.1)
    log = tmp_path / "bus.log"
    log.write_text("".join(format_line(f, "can0") + "\n" for f in frames))
    assert main(["replay", str(log), "--config", str(FILE), "-o", str(tmp_path / "out.log")]) == 0
    assert [f for f, _ in read_log(tmp_path / "out.log", Damage())] == made
