"""Measurements at an end of their range: counted, and no part of the estimate."""

import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.support.can_ids import LAT_ACCEL_A1
from tests.support.config_texts import AXLE, VEHICLE
from tests.support.sensor_simulator import SensorSimulator, validities
from tests.support.signals import measured
from wrcd.bus.candump import format_line
from wrcd.bus.e2e import protect
from wrcd.bus.frame import Frame
from wrcd.config.config import load_config
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.logs.damage import Damage
from wrcd.logs.feed import made, made_of_stretches, outgoing
from wrcd.logs.reader import read_log, read_stretches

SIGNAL = '"LatAccel_A1.LatAccel"'
Spoil = Callable[[list[Frame]], list[Frame]]


@pytest.fixture
def clipping_at(tmp_path: Path) -> Callable[[float], Config]:
    """Axle 1 with an accelerometer of a range."""

    def made(end_m_s2: float) -> Config:
        file = tmp_path / "train.toml"
        ranged = f"{{ signal = {SIGNAL}, range = [{-end_m_s2}, {end_m_s2}] }}"
        file.write_text(AXLE.replace(SIGNAL, ranged) + VEHICLE)
        return load_config(file)

    return made


def clipped_at(end: float) -> Spoil:
    """What an accelerometer gives that clips there."""

    def spoil(frames: list[Frame]) -> list[Frame]:
        return [f if f.can_id != LAT_ACCEL_A1 else _with_raw(f, lambda x: min(max(x, -limit), limit)) for f in frames]

    limit = round(end * 1e5)
    return spoil


def _with_raw(f: Frame, raw: Callable[[int], int]) -> Frame:
    (unsigned,) = struct.unpack("<I", f.data[2:] + b"\0")
    payload = struct.pack("<i", raw(unsigned - (unsigned >> 23 << 24)))[:3]
    return replace(f, data=protect(b"\0\0" + payload, f.can_id, f.data[1] & 0x0F))


def test_sample_age_is_that_of_the_newest_measurement_that_is_used(clipping_at: Callable[[float], Config]) -> None:
    sim = SensorSimulator(clipping_at(2.0))
    sim.run(1500)
    at_end = sim.run(
        100, lambda frames: [_with_raw(f, lambda _: 200_000) if f.can_id == LAT_ACCEL_A1 else f for f in frames]
    )
    assert at_end[-1]["SampleAge"] == 104
    assert sim.run(20)[-1]["SampleAge"] == 4


def every(ticks: int, spoil: Callable[[Frame], list[Frame]]) -> Spoil:
    """Spoil the lateral acceleration of one tick in so many."""
    passed = iter(range(1_000_000))

    def spoiled(frames: list[Frame]) -> list[Frame]:
        hit = next(passed) % ticks == ticks - 1
        return [g for f in frames for g in (spoil(f) if hit and f.can_id == LAT_ACCEL_A1 else [f])]

    return spoiled


def test_clipped_sample_has_no_part_in_the_estimate(clipping_at: Callable[[float], Config]) -> None:
    """As if its frame were lost."""
    clipped, lost = (SensorSimulator(clipping_at(0.4)) for _ in range(2))
    with_end = clipped.run(2400, every(40, lambda f: [_with_raw(f, lambda _: 40_000)]))
    without = lost.run(2400, every(40, lambda _: []))
    assert validities(with_end)[-1] == "Valid"
    assert [f["MuAvailable"] for f in with_end] == [f["MuAvailable"] for f in without]
    assert clipped.core.counts.clipped == {(1, "lateral acceleration"): 12}
    assert not lost.core.counts.clipped


def test_value_just_within_its_range_is_a_measurement(clipping_at: Callable[[float], Config]) -> None:
    sim = SensorSimulator(clipping_at(0.40001))
    sim.run(1000, every(40, lambda f: [_with_raw(f, lambda _: 40_000)]))
    assert not sim.core.counts.clipped


@pytest.mark.parametrize(("share", "valid"), [(0.01, True), (0.2, False)])
def test_axle_of_a_sensor_that_often_clips_is_not_valid(
    clipping_at: Callable[[float], Config], share: float, valid: bool
) -> None:
    end = float(np.quantile(np.abs(measured()[:, 1]), 1 - share).round(5))
    sim = SensorSimulator(clipping_at(end))
    frames = sim.run(10_000, clipped_at(end))
    assert ("Valid" in validities(frames)) is valid
    counts = sim.core.counts
    assert counts.clippings == f"{counts.clipped.total()} axle 1 lateral acceleration"
    assert 0 < counts.clipped.total() <= 2 * share * 2000


def test_clipped_samples_of_a_log_are_those_of_the_bus(clipping_at: Callable[[float], Config], tmp_path: Path) -> None:
    sim, clip, log = SensorSimulator(clipping_at(0.25)), clipped_at(0.25), tmp_path / "ride.log"
    log.write_text("".join(format_line(f, "can0") + "\n" for _ in range(600) for f in clip(sim.frames())))
    live, replayed = Core(sim.config), Core(sim.config)
    sent = [o.frame for o, _ in outgoing(made(live, read_log(log, Damage())))]
    assert [o.frame for o, _ in outgoing(made_of_stretches(replayed, read_stretches(log, Damage())))] == sent
    assert live.counts.clipped == replayed.counts.clipped
    assert live.counts.clipped[1, "lateral acceleration"] > 3
