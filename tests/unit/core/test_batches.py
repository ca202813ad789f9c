"""However frames come, one by one or many at once, a core makes the same of them: frames, events, counts and state."""

from collections.abc import Iterator, Sequence
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_ecu.play.mapped import MappedTrain
from sim_ecu.play.player import LARGE_CHUNK, Player
from sim_ecu.play.scenario import read_scenario
from tests.corpus.logs import spoilt
from tests.support.core_state import state
from tests.support.stretch import LENGTH_US, START_US, stretch
from wrcd.bus.batch import FrameBatch
from wrcd.bus.frame import Frame
from wrcd.config.config import load_config, packaged
from wrcd.config.settings import parse_toml
from wrcd.core.causes import Cause
from wrcd.core.configuration import Config
from wrcd.core.core import SLOTS, Core
from wrcd.core.reports import Outgoing

MOST_AT_ONCE = 300
ROOT = Path(__file__).parents[3]
# CAN FD, pages, statuses in other frames, floating-point numbers: trains with a DBC of their own
OWN = ("examples/own-dbc/train.toml", *(f"tests/data/dbc/{name}.toml" for name in ("third-party", "odd", "floats")))
RIDE = """
duration_s = 6
axles = [1]
speed_m_s = [[0, 24], [3, 30], [6, 26]]
rail = [{ curve = "C" }]
drive = { utilisation = [[0, 0.2], [2, 0.6], [4, 0.9]] }
"""


def configured(folder: Path, axles: int) -> Config:
    path = folder / "train.toml"
    path.write_text(packaged(axles))
    return load_config(path)


def played(axles: int) -> list[Frame]:
    """Twice the recorded stretch, 9.6 s."""
    return [
        Frame(START_US + again * LENGTH_US + r.at_us, r.can_id, r.data) for again in range(2) for r in stretch(axles)
    ]


@cache
def ridden(name: str) -> tuple[Config, list[Frame]]:
    """A train with a DBC of its own, and the frames of a ride."""
    config = load_config(ROOT / name)
    numbers = [a.number for a in config.axles]
    scenario = read_scenario(parse_toml(RIDE.replace("[1]", str(numbers)), "ride"), "ride")
    train = MappedTrain(config, scenario.wheelset)
    sent = (f for _, frames in Player(scenario, truth=False, chunk=LARGE_CHUNK, train=train) for f in frames)
    return config, [Frame(START_US + f.due_us, f.can_id, f.data, f.extended, fd=f.fd, error=f.error) for f in sent]


def batches(frames: Sequence[Frame], chance: np.random.Generator) -> Iterator[list[Frame]]:
    """Any number at once."""
    at = 0
    while at < len(frames):
        end = at + int(chance.integers(1, MOST_AT_ONCE))
        yield list(frames[at:end])
        at = end


def made(out: Sequence[Outgoing]) -> list[tuple[Frame, Cause, int, bytes | None]]:
    return [(o.frame, o.cause, o.cycle_us, None if o.why is None else o.why.tobytes()) for o in out]


def seen(core: Core) -> Any:
    """What can be seen of a core after any batch."""
    changes = [(c.text, c.time_us, c.axle) for c in core.events.since(0)]
    counts = core.counts
    told = counts.accepted, counts.late, counts.ticks, counts.rejected_by_message, counts.clipped, counts.last_reason
    return told, core.reports, changes, core.time_us, core.speed_m_s, counts.waits, core.newest_us, core.next_slot_us


class Shown:
    """The values and the ticks that a core shows, as records one behind the other."""

    def __init__(self) -> None:
        self.samples: list[Any] = []
        self.ticks: list[Any] = []

    def core(self, config: Config) -> Core:
        """One that shows them here."""
        return Core(config, samples=self.samples.append, ticks=self.ticks.append)

    @property
    def all(self) -> tuple[bytes, bytes]:
        """All of them."""
        return np.concatenate(self.samples).tobytes(), np.concatenate(self.ticks).tobytes()


def compare(config: Config, frames: Sequence[Frame], chance: np.random.Generator) -> Core:
    """Four cores: one is fed frame by frame, one by lists, one by batches, and one shows what it reads. In between all
    that can be seen is compared, and now and then the whole state. Then one that is given all at once, and shows it."""
    shown, at_once = Shown(), Shown()
    one, listed, batched, showing = Core(config), Core(config), Core(config), shown.core(config)
    expected = []
    for part in batches(frames, chance):
        got = made([o for f in part for o in one.feed(f)])
        assert made(listed.feed(part)) == got
        assert made(batched.feed(FrameBatch.of(part))) == got
        assert made(showing.feed(part)) == got
        expected += got
        if chance.random() < 0.3:
            assert seen(listed) == seen(batched) == seen(showing) == seen(one)
        if chance.random() < 0.02:
            assert state(batched) == state(one)
    assert state(listed) == state(batched) == state(one)
    whole = at_once.core(config)
    assert made(whole.feed(frames)) == expected
    assert seen(whole) == seen(one)
    assert at_once.all == shown.all
    assert state(whole) == state(showing)
    return one


@pytest.mark.parametrize("axles", [1, 3, 8])
def test_undisturbed_train_gives_the_same_however_it_is_fed(axles: int, tmp_path: Path) -> None:
    core = compare(configured(tmp_path, axles), played(axles), np.random.default_rng(axles))
    assert core.counts.ticks > 4 * SLOTS  # more slots than are made without coming back
    assert core.counts.rejected.total() == 0


@pytest.mark.parametrize("seed", range(6))
def test_whatever_happens_on_the_bus_gives_the_same_however_it_is_fed(seed: int, tmp_path: Path) -> None:
    chance = np.random.default_rng(seed)
    config = configured(tmp_path, int(chance.choice([1, 2, 4])))
    frames = list(spoilt(iter(played(len(config.axles))), config, chance))
    core = compare(config, frames, chance)
    assert core.counts.rejected.total() > 10


@pytest.mark.parametrize("is_spoilt", [False, True], ids=["undisturbed", "spoilt"])
@pytest.mark.parametrize("name", OWN)
def test_train_with_a_dbc_of_its_own_gives_the_same_however_it_is_fed(name: str, is_spoilt: bool) -> None:
    config, frames = ridden(name)
    chance = np.random.default_rng(5)
    core = compare(config, list(spoilt(iter(frames), config, chance)) if is_spoilt else frames, chance)
    assert (core.counts.rejected.total() > 5) is is_spoilt
    assert any(f.fd for f in frames) is core.mapped.fd
    assert core.counts.accepted > 1000


def test_time_that_the_clock_tells_may_come_in_any_steps(tmp_path: Path) -> None:
    """A silence of a minute in steps of a tick, of half a second, and of a second: more slots than are made at once."""
    config, frames = configured(tmp_path, 2), played(2)[:3000]
    cores = [Core(config) for _ in range(3)]
    begin_us = frames[-1].stamp_us // 5000 * 5000
    out = []
    for core, step_us in zip(cores, (5_000, 500_000, 1_000_000), strict=True):
        core.feed(frames)
        out.append([x for k in range(60_000_000 // step_us) for x in made(core.advance(begin_us + (k + 1) * step_us))])
    assert len(out[0]) > 30 * SLOTS
    assert out[0] == out[1] == out[2]
    assert seen(cores[0]) == seen(cores[1]) == seen(cores[2])
    assert state(cores[0]) == state(cores[1]) == state(cores[2])


@pytest.mark.parametrize("at", [10, 900, 4000])
def test_copy_of_a_core_goes_on_alike_and_leaves_it_alone(at: int, tmp_path: Path) -> None:
    config, chance = configured(tmp_path, 2), np.random.default_rng(at)
    frames = list(spoilt(iter(played(2)), config, chance))
    core = Core(config)
    core.feed(frames[:at])
    core.health.overruns = 3
    copy, before, known = deepcopy(core), state(core), seen(core)
    assert (state(copy), seen(copy)) == (before, known)
    out = [made(copy.feed(part)) for part in batches(frames[at:], chance)]
    assert [f.data for f in copy.shutdown_frames(frames[-1].stamp_us)]
    assert (state(core), seen(core)) == (before, known)
    assert core.health.state == "Running"
    assert [x for part in out for x in part] == made(core.feed(frames[at:]))
    assert seen(copy) == seen(core)


def test_foreign_frames_change_nothing(tmp_path: Path) -> None:
    """Before the first that is mapped, between, and after; and none at all."""
    config, chance = configured(tmp_path, 1), np.random.default_rng(1)
    frames = played(1)[:2000]
    among = [
        Frame(f.stamp_us + int(chance.integers(-10**9, 10**9)), int(chance.integers(0x200, 0x7FF)), bytes(3))
        for f in frames
    ]  # fmt: skip
    alone, mixed = Core(config), Core(config)
    assert made(mixed.feed(among[:5])) == made(mixed.feed([])) == []
    assert mixed.time_us is None
    expected = made(alone.feed(frames))
    assert made(mixed.feed([f for pair in zip(among, frames, among, strict=True) for f in pair])) == expected
    assert state(mixed) == state(alone)
