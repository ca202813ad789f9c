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

from sim_ecu.cli.main import main as sim_ecu
from tests.support.can_ids import ADHESION_A1, WRCD_STATUS, YAW_RATE_A1
from tests.support.metronome import calm, cycle, metronome, mostly, within
from tests.support.processes import BIN, running, stopped, wait_for
from tests.support.scenarios import held
from tests.support.vcan import CANDUMP, overruns_at, slot_of
from wrcd.bus.e2e import crc
from wrcd.bus.frame import Frame
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

VALID = 1
LOG_S = 10.0
# of systemd/wrcd@.service.d/realtime.conf: for a computer that has other work, too
PRIORITY = 40
YAW_RATE_TIMEOUT_US = 15_000  # as the DBC says
LENGTHS = {ADHESION_A1: 8, YAW_RATE_A1: 5, WRCD_STATUS: 8}
AXLES = 4  # of the packaged configuration


@pytest.fixture(scope="module")
def sensors(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int]:
    """A log of one axle on a dry rail for ten seconds, and how many frames it holds."""
    folder = tmp_path_factory.mktemp("load")
    scenario, log = folder / "dry.toml", folder / "dry.log"
    scenario.write_text(held("A", LOG_S, 0.5))
    assert sim_ecu(["play", str(scenario), "--fast", "--no-truth", "--log", str(log)]) == 0
    log.write_text(log.read_text().replace(" R\n", "\n"))
    return log, len(log.read_text().splitlines())


@contextmanager
def daemon(log: Path) -> Iterator["subprocess.Popen[bytes]"]:
    """The daemon on vcan0, with candump's log of what it says of axle 1, and of that axle's yaw rate."""
    with (
        running(*CANDUMP, "vcan0,091:7FF,0B0:7FF,101:7FF", output=log),
        running("chrt", "-f", str(PRIORITY), BIN / "wrcd", "run", "-i", "socketcan", "-c", "vcan0") as process,
    ):
        wait_for("the daemon's first WrcdStatus", 30, lambda: log.exists() and " 0B0#" in log.read_text())
        yield process


def seen_of(log: Path, can_id: int = ADHESION_A1) -> list[Frame]:
    """A message's frames as candump saw them."""
    every = (f for f, _ in read_log(log, Damage()) if f.can_id == can_id)
    return [f for f in every if len(f.data) == LENGTHS[can_id] and crc(f.data, can_id) == f.data[0]]  # not cangen's


@pytest.mark.parametrize("ids", ["300", "r"], ids=["unmapped", "any id, random bytes"])
def test_flood_of_frames_loses_no_sensor_frame_and_no_cycle(
    sensors: tuple[Path, int], ids: str, tmp_path: Path
) -> None:
    """Every cycle has its adhesion frame but those that the daemon counts as left out, no sensor's frame is lost, and
    what is lost would be counted."""
    log, sent = sensors
    seen = tmp_path / "candump.log"
    before = received()
    with metronome(PRIORITY) as machine, daemon(seen) as process:
        begin_us = time.time_ns() // 1000
        with running("cangen", "vcan0", "-g", "0", "-I", ids, "-L", "r", "-D", "r", stop=signal.SIGTERM):
            subprocess.run(["chrt", "-f", "10", "canplayer", "-I", log, "vcan0=can0"], timeout=60, check=True)
        end_us = time.time_ns() // 1000
        said = stopped(process)
    load = (received() - before) / ((end_us - begin_us) * 1e-6)
    # without the one of the stop; a frame of the last slots may be late
    every = [f for f in seen_of(seen) if begin_us <= f.stamp_us][:-1]
    frames = [f for k, f in enumerate(every) if k == 0 or slot_of(f) > max(map(slot_of, every[max(0, k - 20) : k]))]
    gaps = sorted((b.stamp_us - a.stamp_us) * 1e-3 for a, b in pairwise(frames))
    kept = cycle([slot_of(f) for f in frames], begin_us, end_us, machine)
    yaw = [f.stamp_us for f in seen_of(seen, YAW_RATE_A1)]
    sound = calm(yaw, YAW_RATE_TIMEOUT_US)
    judged = [f.data[1] >> 4 == VALID for f in frames if within(f.stamp_us, sound)]
    accepted, overruns = (number(said, what) for what in ("frames accepted", "overruns"))
    overruns -= overruns_at(seen_of(seen, WRCD_STATUS), begin_us)
    print(
        f"\n{load:.0f} frames/s on the bus: {len(frames)} Adhesion frames in {(end_us - begin_us) * 1e-6:.1f} s, gaps "
        f"median {gaps[len(gaps) // 2]:.1f}, 99 % {gaps[int(0.99 * len(gaps))]:.1f}, longest {gaps[-1]:.1f} ms, "
        f"{sum(judged)} of {len(judged)} Valid; {accepted} of {sent} sensor frames accepted; {kept}; "
        f"{overruns} overruns\n{said}"
    )
    assert load > 500  # a flood was there; how large a one is the machine's
    # a random frame of Adhesion_A1's id and length, four a second, has its CRC once in 256, and then any counter
    assert len(every) - len(frames) <= (0 if ids == "300" else 4)
    # A slot that is over costs each axle a frame. A frame that a random one, ahead of it, hides from `frames` was sent.
    assert AXLES * len(set(kept.missing) - set(map(slot_of, every))) <= overruns
    # among random ids are the sensors' own, forty a second of the right length: one in 256 has the right CRC and may be
    # taken for one of theirs, with up to three of theirs then out of sequence
    assert accepted == pytest.approx(sent, abs=0 if ids == "300" else 12)
    assert ("rejected: none" not in said) == (ids == "r")
    assert "lost" not in said
    assert mostly(judged, 0.8, yaw[0], yaw[-1], machine)


def number(said: str, what: str) -> int:
    """What the daemon's last line counts."""
    found = re.search(rf"stopped; .*?(\d+) {what}", said)
    assert found is not None, said
    return int(found[1])


def received() -> int:
    """Frames that vcan0 has carried."""
    return int(Path("/sys/class/net/vcan0/statistics/tx_packets").read_text())


@pytest.mark.skipif(os.environ.get("GUEST") != "uml", reason="nobody steps the clock of a machine that is in use")
@pytest.mark.parametrize("step_s", [3600.0, -3600.0, 0.4, -0.4])
def test_wall_clock_step_costs_one_window(sensors: tuple[Path, int], step_s: float, tmp_path: Path) -> None:
    """Frames come through the step, and are Valid again a window after it."""
    seen = tmp_path / "candump.log"
    with (
        metronome(PRIORITY) as machine,
        daemon(seen) as process,
        # the rig keeps to the monotonic clock, which canplayer does not
        running("chrt", "-f", "10", BIN / "sim-ecu", "play", sensors[0].with_suffix(".toml"), "-c", "vcan0"),
    ):
        wait_for("the sensors", 60, lambda: bool(seen_of(seen, YAW_RATE_A1)))
        began = time.time()
        while seen_of(seen)[-1].data[1] >> 4 != VALID and time.time() < began + 5.0:
            time.sleep(0.05)
        valid = seen_of(seen)[-1].data[1] >> 4 == VALID
        time.sleep(0.5)
        before = time.time()
        stepped = before + step_s
        time.clock_settime(time.CLOCK_REALTIME, stepped)
        time.sleep(3.0)
        frames, yaw = (from_step(seen_of(seen, i), stepped, step_s) for i in (ADHESION_A1, YAW_RATE_A1))
        time.clock_settime(time.CLOCK_REALTIME, time.time() - step_s)
        assert process.poll() is None
    # a frame made just before the step may leave just after it
    lost = next(k for k, f in enumerate(frames) if f.data[1] >> 4 != VALID)
    assert lost <= 1
    first = next((f.stamp_us * 1e-6 - stepped for f in frames[lost:] if f.data[1] >> 4 == VALID), 3.0)
    # the sensors may have been held up: a window from the last time that they were
    held_up = [b.stamp_us * 1e-6 - stepped for a, b in pairwise(yaw) if b.stamp_us - a.stamp_us > YAW_RATE_TIMEOUT_US]
    since = first - max((s for s in held_up if s < first), default=0.0)
    gap_us, begin_us = max((b.stamp_us - a.stamp_us, a.stamp_us) for a, b in pairwise(frames))
    taken_us = machine.taken_us(begin_us, begin_us + gap_us)
    print(f"\nstep of {step_s:g} s: {len(frames)} frames, longest gap {gap_us / 1000:.0f} ms, of it "
          f"{taken_us / 1000:.0f} ms taken, Valid again after {first:.2f} s, {since:.2f} s undisturbed")  # fmt: skip
    assert since < 1.5
    # both are judged unless the sensors were held up again and again
    for judged, since_s, until_s in ((valid, began, before), (first < 3.0, stepped, stepped + 3.0)):
        assert mostly([True] if judged else [], 1.0, round(since_s * 1e6), round(until_s * 1e6), machine)


def from_step(frames: list[Frame], stepped: float, step_s: float) -> list[Frame]:
    """What came after the step, in the order of the log."""
    at = next(k for k, (a, b) in enumerate(pairwise(frames)) if abs((b.stamp_us - a.stamp_us) * 1e-6 - step_s) < 0.3)
    return [f for f in frames[at + 1 :] if f.stamp_us * 1e-6 >= stepped]
