"""The fast lane makes of any frames what feed() makes of them one by one: frames, counts, events and state."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.corpus.logs import spoilt
from tests.support.core_state import state
from tests.support.stretch import LENGTH_US, START_US, stretch
from wrcd.bus.batch import FrameBatch
from wrcd.bus.frame import Frame
from wrcd.config.config import load_config, packaged
from wrcd.core import lane
from wrcd.core.causes import Cause
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.messages import Outgoing

MOST_AT_ONCE = 300


def configured(folder: Path, axles: int) -> Config:
    path = folder / "train.toml"
    path.write_text(packaged(axles))
    return load_config(path)


def played(axles: int) -> list[Frame]:
    """Twice the recorded stretch, 9.6 s."""
    return [
        Frame(START_US + again * LENGTH_US + r.at_us, r.can_id, r.data) for again in range(2) for r in stretch(axles)
    ]


def batches(frames: Sequence[Frame], chance: np.random.Generator) -> Iterator[FrameBatch]:
    """Any number at once."""
    at = 0
    while at < len(frames):
        end = at + int(chance.integers(1, MOST_AT_ONCE))
        yield FrameBatch.of(frames[at:end])
        at = end


def made(out: Sequence[Outgoing]) -> list[tuple[Frame, Cause, int]]:
    return [(o.frame, o.cause, o.cycle_us) for o in out]


def seen(core: Core) -> Any:
    """What can be seen of a core after any batch."""
    changes = [(c.text, c.time_us, c.axle) for c in core.events.since(0)]
    return core.counts, core.reports, changes, core.time_us, core.speed_m_s, core.waits


def compare(config: Config, frames: Sequence[Frame], chance: np.random.Generator, explains: bool) -> tuple[Core, int]:
    """A core that is fed by batches, and how many frames it made: those of one that is fed frame by frame. In between
    all that can be seen is compared, and now and then the whole state."""
    one, many = Core(config), Core(config)
    many.explains = explains
    count = 0
    for batch in batches(frames, chance):
        got = made(many.feed_batch(batch))
        assert got == made([o for f in batch for o in one.feed(f)])
        count += len(got)
        if chance.random() < 0.3:
            assert seen(many) == seen(one)
        if chance.random() < 0.01:
            many.settle()
            assert state(many) == state(one)
    return many, count


@pytest.fixture(params=[8, 2], ids=["waits", "eager"])
def waits(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Eager: the lane is tried at every frame, so that everything happens at its ends."""
    monkeypatch.setattr(lane, "FIRST_WAIT", request.param)
    monkeypatch.setattr(lane, "LAST_WAIT", 16 * request.param if request.param > 2 else 2)


@pytest.mark.parametrize("axles", [1, 3, 8])
@pytest.mark.parametrize("explains", [False, True])
def test_undisturbed_train_runs_in_the_lane(axles: int, explains: bool, tmp_path: Path) -> None:
    core, count = compare(configured(tmp_path, axles), played(axles), np.random.default_rng(axles), explains)
    assert core.lane_ticks > 0.8 * core.counts.ticks
    assert count > 500 * axles


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.usefixtures("waits")
def test_whatever_happens_on_the_bus_gives_the_same(seed: int, tmp_path: Path) -> None:
    chance = np.random.default_rng(seed)
    config = configured(tmp_path, int(chance.choice([1, 2, 4])))
    frames = list(spoilt(iter(played(len(config.axles))), config, chance))
    core, _ = compare(config, frames, chance, bool(seed % 2))
    assert core.counts.rejected.total() > 10
    assert 0 < core.lane_ticks < core.counts.ticks
