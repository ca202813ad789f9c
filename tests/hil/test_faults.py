"""The fault matrix against the real daemon on a real kernel's buses: the rig plays fault after fault while the daemon
stays up, candump records, and the rig's own word on when each fault began and ended is what it is judged by."""

import re
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import pytest

from sim_ecu.play.encoder import databases
from sim_ecu.play.expected import ROWS, Row, Unseen
from sim_ecu.play.faults import KINDS, SILENT, Stage
from sim_ecu.play.judge import HEAD, Said, Verdict, judge, line
from tests.support.can_ids import ADHESION, ADHESION_A1, YAW_RATE_A2
from tests.support.processes import BIN, running, wait_for
from wrcd.bus.frame import Frame
from wrcd.bus.log import Damage, read_log

ATTEMPTS = 4  # of a row that goes wrong
STALLED_ATTEMPTS = 8  # of one in which the guest stalls: beside a busy neighbour every other one may
GUESTS_BABBLE = 500.0  # frames a second: more than that the guest's processor cannot send beside the sensors
SLACK_MS = 60.0  # what a busy guest with one processor may add
SLACK_PP = 4.0  # frames that come late may be used a tick later than their twins
STALL_US = 15_000  # a longer silence of a sound sensor is the guest's, and past its time-out
FIRST_S = 3.0  # from the rig's start to the first fault: the window is full
AFTER_S = 2.4  # judged so long after a fault
SETTLE_S = 0.25  # and from there to the next one
ADHESION_TIMEOUT_US = 60_000  # as the DBC says
# Axle 2 is axle 1's twin: its seed is the one that axle 1 has by default.
TWINS = """
speed_m_s = 25.0
axles = [1, 2]
track = "poor"
rail = [{ curve = "C" }]
drive = { utilisation = [[0.0, 0.0], [0.5, 0.5]] }
[axle.2]
seed = 17
"""
SUMMARY = re.compile(r"fault (\S+) of=\S+(?: axle=\d)? begin=(\d+\.\d+) end=(\d+\.\d+)")


@dataclass
class Played:
    """A row on the bus."""

    row: Row
    verdict: Verdict
    stalled: bool


def scenario(rows: Sequence[Row], first_s: float) -> str:
    """The faults one after another while the twins run."""
    at_s, tables = first_s, []
    for f in (r.fault for r in rows):
        table = f'[[fault]]\nkind = "{f.kind}"\nat_s = {at_s:.3f}\nduration_s = {f.duration_s}\n'
        if KINDS[f.kind].stage is not Stage.BUS:
            table += f'of = "{f.of}"\naxle = {f.axle}\n'
        amount = GUESTS_BABBLE if f.kind == "babble" else f.amount
        tables.append(table + (f"amount = {amount}\n" if amount is not None else ""))
        at_s += f.duration_s + AFTER_S + SETTLE_S
    # the last fault may have ended late: the interface is made again by a program
    return f"duration_s = {at_s + 0.5:.3f}\n{TWINS}" + "\n".join(tables)


def slot(f: Frame) -> int:
    """The slot that a frame was made for, by its counter: a starved daemon's frames leave some slots late."""
    last = f.stamp_us // 20_000
    return last - (last - (f.data[1] & 0x0F)) % 15


def said(frames: Sequence[Frame], can_id: int) -> list[Said]:
    message = databases()[0].get_message_by_frame_id(can_id)
    out = []
    for f in frames:
        if f.can_id == can_id:
            values = message.decode(f.data)
            assert isinstance(values, dict)
            mu = values["MuAvailable"]
            out.append(
                Said(f.stamp_us, slot(f), str(values["Validity"]) == "Valid", mu if isinstance(mu, float) else None)
            )
    return out


def heard(frames: Sequence[Said]) -> list[Said]:
    """With the moments put in at which a receiver gives up on Adhesion: its time-out after the last frame."""
    out = list(frames[:1])
    for before, s in pairwise(frames):
        if s.stamp_us - before.stamp_us > ADHESION_TIMEOUT_US:
            out.append(Said(before.stamp_us + ADHESION_TIMEOUT_US, -1, False, None))
        out.append(s)
    return out


def judged(rows: Sequence[Row], frames: Sequence[Frame], told: str) -> list[Played]:
    """Each row by the rig's line on it; the twin, whom no fault befalls, is how it would be without one."""
    found = SUMMARY.findall(told)
    assert [kind for kind, _, _ in found] == [r.fault.kind for r in rows], told
    axle, twin = heard(said(frames, ADHESION_A1)), said(frames, ADHESION[2])
    without = {s.slot: s.mu_pct for s in twin if s.valid and s.mu_pct is not None}
    yaw = [f.stamp_us for f in frames if f.can_id == YAW_RATE_A2]
    out = []
    for row, (_, begin, end) in zip(rows, found, strict=True):
        begin_us, end_us = round(float(begin) * 1e6), round(float(end) * 1e6)
        until_us = end_us + round(AFTER_S * 1e6)
        span = [s for s in axle if begin_us - 200_000 < s.stamp_us < until_us]
        gaps = [b - a for a, b in pairwise(yaw) if begin_us - 1_100_000 < b < until_us]
        if row.fault.kind in SILENT:
            gaps = sorted(gaps)[:-1]  # the fault itself
        # so is what befalls a twin whom the fault does not reach, or the axle before it
        sound = all(s.valid for s in span if s.stamp_us < begin_us)
        if row.fault.kind not in (*SILENT, "swap") and row.fault.of != "speed":
            sound &= all(s.valid for s in heard(twin) if begin_us - 200_000 < s.stamp_us < until_us)
        verdict = judge(row.must, begin_us, end_us, span, without, SLACK_MS, SLACK_PP)
        out.append(Played(row, verdict, not sound or max(gaps) > STALL_US))
    return out


def play(folder: Path, rows: Sequence[Row], interface: str, channel: str) -> list[Played]:
    """Rig, daemon and candump; a slcan interface is there only while the rig runs."""
    folder.mkdir()
    first_s = FIRST_S if interface != "slcan" else FIRST_S + 4.0
    file, log, told = folder / "faults.toml", folder / "candump.log", folder / "told.txt"
    file.write_text(scenario(rows, first_s))
    rig = ("chrt", "-f", "10", BIN / "sim-ecu", "inject", file, "-i", interface, "-c", channel, "--no-truth", "--ahead")
    # as systemd/wrcd@.service.d/realtime.conf has it, but below the sensors, who do not wait for the daemon's processor
    daemon = ("chrt", "-f", "5", BIN / "wrcd", "run", "-i", "socketcan", "-c", channel)
    # any: a socket on all interfaces outlives each of them
    dump = ("candump", "-L", "any,090:7F0,102:7FF")
    with running(*dump, output=log):
        if interface == "slcan":
            with running(*rig, output=told) as playing:
                wait_for(channel, 30, (Path("/sys/class/net") / channel).exists)
                with running(*daemon) as process:
                    finish(playing, process)
        else:
            with running(*daemon) as process:
                wait_for("the daemon's first frame", 30, lambda: log.exists() and log.stat().st_size > 0)
                with running(*rig, output=told) as playing:
                    finish(playing, process)
        time.sleep(0.3)
    frames = [f for f, name in read_log(log, Damage()) if name == channel]
    return judged(rows, frames, told.read_text())


def finish(rig: subprocess.Popen[bytes], daemon: subprocess.Popen[bytes]) -> None:
    status = rig.wait(240)
    assert rig.stderr is not None
    says = rig.stderr.read().decode()
    print(says.strip())
    assert status == 0, says
    assert daemon.poll() is None, "the daemon did not stay up"


def on(row: Row) -> tuple[str, str]:
    """The bus that a row needs."""
    if row.fault.kind == "bus-off":
        return "slcan", "can7"
    return "socketcan", "vcan1" if row.fault.kind in SILENT else "vcan0"


JUDGED = [r for r in ROWS if not isinstance(r.must, Unseen)]


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> dict[Row, Played]:
    """Every row once; rows in which the guest itself stalled, or that went wrong, again: not every stall of a guest
    with one slow processor shows in the frames of a sound sensor. What is wrong with the daemon goes wrong every
    time."""
    done: dict[Row, Played] = {}
    folder = tmp_path_factory.mktemp("faults")
    for attempt in range(STALLED_ATTEMPTS):
        again = {r for r, p in done.items() if p.stalled or (p.verdict.wrong and attempt < ATTEMPTS)}
        for bus in sorted({on(r) for r in JUDGED}):
            rows = [r for r in JUDGED if on(r) == bus and (r not in done or r in again)]
            if rows:
                done |= {p.row: p for p in play(folder / f"{bus[1]}-{attempt}", rows, *bus)}
    print(HEAD)
    for p in (done[r] for r in JUDGED):
        print(line(p.row, p.verdict) + (" (the guest stalled)" if p.stalled else ""))
    return done


@pytest.mark.parametrize("row", JUDGED, ids=lambda r: f"{r.fault.kind} of {r.fault.of}, {r.fault.duration_s:g} s")
def test_daemon_under_a_fault_is_as_its_row_says(played: dict[Row, Played], row: Row) -> None:
    """What must be, is, with some tens of milliseconds for the guest. A row that is never played without a stall fails,
    too: nothing was shown."""
    assert not played[row].stalled
    assert played[row].verdict.wrong == ""
