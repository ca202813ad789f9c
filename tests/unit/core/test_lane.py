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
from wrcd.core.core import Core
from wrcd.core.messages import Outgoing
from wrcd.estimator.native_estimator import CompiledEstimator
from wrcd.recorder.state import capture, encode

MOST_AT_ONCE = 300


def configured(folder: Path, axles: int, more: str = "") -> Any:
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


def taken(core: Core, out: Sequence[Outgoing]) -> Any:
    """All that can be seen of a core, and what it has made."""
    core.settle()
    changes = [(c.text, c.time_us, c.axle) for c in core.events.since(0)]
    return [(o.frame, o.cause, o.cycle_us) for o in out], core.counts, changes, core.reports, encode(capture(core))


def compare(config: Any, frames: Sequence[Frame], chance: np.random.Generator, explains: bool) -> tuple[Core, Any]:
    """A core that is fed by batches, and what came of it, which one that is fed frame by frame has made, too."""
    one, many = Core(config), Core(config)
    many.explains = explains
    expected = taken(one, [o for f in frames for o in one.feed(f)])
    got = taken(many, [o for batch in batches(frames, chance) for o in many.feed_batch(batch)])
    for mine, theirs in zip(got[:4], expected[:4], strict=True):
        assert mine == theirs
    assert json.dumps(got[4], sort_keys=True) == json.dumps(expected[4], sort_keys=True)
    return many, got


@pytest.mark.parametrize("axles", [1, 3, 8])
@pytest.mark.parametrize("explains", [False, True])
def test_undisturbed_train_runs_in_the_lane(axles: int, explains: bool, tmp_path: Path) -> None:
    core, got = compare(configured(tmp_path, axles), played(axles), np.random.default_rng(axles), explains)
    assert isinstance(core.estimator, CompiledEstimator)
    assert core.lane_ticks > 0.8 * core.counts.ticks
    assert len(got[0]) > 500 * axles


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("fusing", [False, True])
def test_whatever_happens_on_the_bus_gives_the_same(seed: int, fusing: bool, tmp_path: Path) -> None:
    chance = np.random.default_rng(seed)
    axles = int(chance.choice([2, 4] if fusing else [1, 2, 4]))
    frames = list(spoilt(played(axles), chance))
    more = f"\n[fusion]\npositions_m = {[-2.5 * k for k in range(axles)]}\none_way = true\n" if fusing else ""
    core, _ = compare(configured(tmp_path, axles, more), frames, chance, bool(seed % 2))
    assert core.counts.rejected.total() > 10
    assert 0 < core.lane_ticks < core.counts.ticks
