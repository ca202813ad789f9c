"""The fast lane makes of any frames what feed() makes of them one by one: frames, counts, events and state."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.bench.workload import LENGTH_US, START_US, stretch
from wrcd.bus.batch import FrameBatch
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.config.config import load_config, packaged
from wrcd.core import lane
from wrcd.core.causes import Cause
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.messages import Outgoing
from wrcd.estimator.native_estimator import CompiledEstimator
from wrcd.recorder.state import capture, encode

pytestmark = pytest.mark.usefixtures("library")
MOST_AT_ONCE = 300


def configured(folder: Path, axles: int, more: str = "") -> Config:
    path = folder / "train.toml"
    path.write_text(packaged(axles) + more)
    return load_config(path)


def played(axles: int) -> list[Frame]:
    """Twice the recorded stretch, 9.6 s."""
    return [
        Frame(START_US + again * LENGTH_US + r.at_us, r.can_id, r.data) for again in range(2) for r in stretch(axles)
    ]


def spoilt(frames: Sequence[Frame], chance: np.random.Generator) -> Iterator[Frame]:
    """The frames with what happens on a bus: damage, repeats, losses, jitter, foreign and odd frames, stuck sensors,
    values that jump or stand at an end, senders that call themselves degraded, silences and steps of the clock."""
    moved_us, silent_until_us = 0, 0
    stuck: dict[int, tuple[bytes, int]] = {}
    quiet: dict[int, int] = {}
    for f in frames:
        if f.stamp_us < silent_until_us:
            continue
        if chance.random() < 2e-4:
            moved_us += int(chance.choice([-30_000, 700_000, 1_500_000, -5_000_000]))
        if chance.random() < 1e-4:
            silent_until_us = f.stamp_us + int(chance.choice([12_000, 60_000, 300_000, 1_400_000]))
        if chance.random() < 3e-4:
            quiet[f.can_id] = f.stamp_us + int(chance.choice([8_000, 17_000, 50_000, 400_000]))
        if chance.random() < 3e-4:
            stuck[f.can_id] = f.data, f.stamp_us + int(chance.choice([20_000, 40_000, 200_000]))
        if f.stamp_us < quiet.get(f.can_id, 0):
            continue
        data, until_us = stuck.get(f.can_id, (f.data, 0))
        payload = data if f.stamp_us < until_us else f.data
        what, counter = chance.random(), f.data[1] & 0x0F
        if what < 1e-3:
            payload = bytes([payload[0], payload[1], *chance.integers(0, 256, len(payload) - 2).tolist()])
        elif what < 2e-3:
            payload = payload[:2] + bytes(len(payload) - 3) + b"\x7f"
        elif what < 2.5e-3:
            payload = bytes([payload[0], payload[1] | 0x10, *payload[2:]])
        elif what < 3e-3:
            counter = (counter + int(chance.integers(1, 14))) % 15
        data = protect(payload, f.can_id, counter)
        if 3e-3 < what < 4e-3:
            data = bytes([data[0] ^ 1, *data[1:]])
        jitter_us = int(chance.integers(-1500, 1500)) if chance.random() < 0.05 else 0
        frame = Frame(f.stamp_us + moved_us + jitter_us, f.can_id, data)
        yield frame
        if what > 0.999:
            yield replace(frame, stamp_us=frame.stamp_us + 50)
        elif what > 0.998:
            yield replace(frame, can_id=int(chance.integers(0, 0x7FF)))
        elif what > 0.9975:
            yield replace(frame, remote=True, data=b"")
        elif what > 0.997:
            yield replace(frame, can_id=0x20, error=True)
        elif what > 0.9965:
            yield replace(frame, data=frame.data[:-1])


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
    slots = [(list(s.reports), list(s.adhesion), s.below_min_speed) for s in core.take_reports()]
    changes = [(c.text, c.time_us, c.axle) for c in core.events.since(0)]
    return core.counts, slots, core.reports, changes, core.time_us, core.speed_m_s, core.waits


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
            assert json.dumps(encode(capture(many))) == json.dumps(encode(capture(one)))
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
    assert isinstance(core.estimator, CompiledEstimator)
    assert core.lane_ticks > 0.8 * core.counts.ticks
    assert count > 500 * axles


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("fusing", [False, True])
@pytest.mark.usefixtures("waits")
def test_whatever_happens_on_the_bus_gives_the_same(seed: int, fusing: bool, tmp_path: Path) -> None:
    chance = np.random.default_rng(seed)
    axles = int(chance.choice([2, 4] if fusing else [1, 2, 4]))
    frames = list(spoilt(played(axles), chance))
    more = f"\n[fusion]\npositions_m = {[-2.5 * k for k in range(axles)]}\none_way = true\n" if fusing else ""
    core, _ = compare(configured(tmp_path, axles, more), frames, chance, bool(seed % 2))
    assert core.counts.rejected.total() > 10
    assert 0 < core.lane_ticks < core.counts.ticks
