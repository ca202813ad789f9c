"""As much as can-utils sends, and a wall clock that steps, with the real daemon beside the sensors."""

import os
import re
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import pytest

from sim_ecu.cli import main as sim_ecu
from tests.support.can_ids import ADHESION_A1
from tests.support.processes import BIN, running, wait_for
from tests.support.scenarios import held
from wrcd.bus.e2e import crc
from wrcd.bus.frame import Frame
from wrcd.bus.log import Damage, read_log

VALID = 1
LOG_S = 10.0


@pytest.fixture(scope="module")
def sensors(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int]:
    """A log of one axle on a wet rail for ten seconds, and how many frames it holds."""
    folder = tmp_path_factory.mktemp("load")
    scenario, log = folder / "wet.toml", folder / "wet.log"
    scenario.write_text(held("C", LOG_S))
    assert sim_ecu(["play", str(scenario), "--fast", "--no-truth", "--log", str(log)]) == 0
    log.write_text(log.read_text().replace(" R\n", "\n"))
    return log, len(log.read_text().splitlines())


@contextmanager
def daemon(log: Path) -> Iterator["subprocess.Popen[bytes]"]:
    """The daemon on vcan0, with candump's log of what it says of axle 1."""
    with (
        running("candump", "-L", "vcan0,091:7FF,0B0:7FF", output=log),
        # the priority of systemd/wrcd@.service.d/realtime.conf: for a computer that has other work, too
        running("chrt", "-f", "40", BIN / "wrcd", "run", "-i", "socketcan", "-c", "vcan0") as process,
    ):
        wait_for("the daemon's first frame", 30, lambda: log.exists() and log.stat().st_size > 0)
        yield process


def adhesion(log: Path, since_s: float = 0.0) -> list[Frame]:
    """Adhesion_A1 as candump saw it."""
    every = (f for f, _ in read_log(log, Damage()) if f.can_id == ADHESION_A1 and f.stamp_us * 1e-6 >= since_s)
    return [f for f in every if len(f.data) == 8 and crc(f.data, ADHESION_A1) == f.data[0]]  # not cangen's


@pytest.mark.parametrize("ids", ["300", "r"], ids=["unmapped", "any id, random bytes"])
def test_flood_of_frames_loses_no_sensor_frame_and_no_cycle(
    sensors: tuple[Path, int], ids: str, tmp_path: Path
) -> None:
    """The adhesion frame keeps its cycle, no sensor's frame is lost, and what is lost would be counted."""
    log, sent = sensors
    seen = tmp_path / "candump.log"
    before = received()
    with daemon(seen) as process:
        begin = time.time()
        with running("cangen", "vcan0", "-g", "0", "-I", ids, "-L", "r", "-D", "r", stop=signal.SIGTERM):
            subprocess.run(["chrt", "-f", "10", "canplayer", "-I", log, "vcan0=can0"], timeout=60, check=True)
        end = time.time()
        process.send_signal(signal.SIGTERM)
        assert process.wait(10) == 0
        assert process.stderr is not None
        said = process.stderr.read().decode()
    load = (received() - before) / (end - begin)
    frames = [f for f in adhesion(seen, begin) if f.stamp_us * 1e-6 <= end]
    gaps = sorted((b.stamp_us - a.stamp_us) * 1e-3 for a, b in pairwise(frames))
    valid = sum(f.data[1] >> 4 == VALID for f in frames)
    accepted = int(found[1]) if (found := re.search(r"(\d+) frames accepted", said)) else -1
    print(
        f"\n{load:.0f} frames/s on the bus: {len(frames)} Adhesion frames in {end - begin:.1f} s, gaps median "
        f"{gaps[len(gaps) // 2]:.1f}, 99 % {gaps[int(0.99 * len(gaps))]:.1f}, longest {gaps[-1]:.1f} ms, {valid} Valid"
        f"; {accepted} of {sent} sensor frames accepted\n{said}"
    )
    assert load > 5000
    assert len(frames) >= 0.97 * 50 * (end - begin)
    assert gaps[int(0.99 * len(gaps))] < 60
    # among random ids are the sensors' own, forty a second of the right length: one in 256 has the right CRC and may be
    # taken for one of theirs, with up to three of theirs then out of sequence
    assert accepted == pytest.approx(sent, abs=0 if ids == "300" else 12)
    assert ("rejected: none" not in said) == (ids == "r")
    assert "lost" not in said
    assert valid > 0.8 * (50 * LOG_S - 100)


def received() -> int:
    """Frames that vcan0 has carried."""
    return int(Path("/sys/class/net/vcan0/statistics/tx_packets").read_text())


@pytest.mark.skipif(os.environ.get("GUEST") != "uml", reason="nobody steps the clock of a machine that is in use")
@pytest.mark.parametrize("step_s", [3600.0, -3600.0, 0.4, -0.4])
def test_wall_clock_step_costs_one_window(sensors: tuple[Path, int], step_s: float, tmp_path: Path) -> None:
    """Frames come without a break through the step, and are Valid again a window after it."""
    seen = tmp_path / "candump.log"
    with (
        daemon(seen) as process,
        # the rig keeps to the monotonic clock, which canplayer does not
        running("chrt", "-f", "10", BIN / "sim-ecu", "play", sensors[0].with_suffix(".toml"), "-c", "vcan0"),
    ):
        wait_for("a Valid frame", 15, lambda: adhesion(seen)[-1].data[1] >> 4 == VALID)
        time.sleep(0.5)
        stepped, began = time.time() + step_s, time.monotonic()
        time.clock_settime(time.CLOCK_REALTIME, stepped)
        time.sleep(3.0)
        frames = read_from_step(seen, stepped, step_s)
        time.clock_settime(time.CLOCK_REALTIME, time.time() - step_s)
        assert process.poll() is None
        # a frame made just before the step may leave just after it
        lost = next(k for k, f in enumerate(frames) if f.data[1] >> 4 != VALID)
        assert lost <= 1
        first = next((f.stamp_us * 1e-6 - stepped for f in frames[lost:] if f.data[1] >> 4 == VALID), None)
        gaps = [(b.stamp_us - a.stamp_us) * 1e-3 for a, b in pairwise(frames)]
        print(f"\nstep of {step_s:g} s: {len(frames)} frames within {time.monotonic() - began:.1f} s, longest gap "
              f"{max(gaps):.0f} ms, Valid again after {first} s")  # fmt: skip
        assert first is not None
        assert first < 1.5
        assert max(gaps) < 200


def read_from_step(log: Path, stepped: float, step_s: float) -> list[Frame]:
    """What was said after the step, in the order of the log."""
    frames = adhesion(log)
    at = next(k for k, (a, b) in enumerate(pairwise(frames)) if abs((b.stamp_us - a.stamp_us) * 1e-6 - step_s) < 0.3)
    return [f for f in frames[at + 1 :] if f.stamp_us * 1e-6 >= stepped]
