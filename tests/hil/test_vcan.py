"""Rig, daemon and can-utils on a real kernel's vcan."""

import csv
import os
import re
import signal
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import pytest

from sim_ecu.play.encoder import databases
from tests.support.can_ids import (
    ADHESION,
    ADHESION_A1,
    INPUTS,
    WRCD_LINK,
    WRCD_REJECTS,
    WRCD_STATUS,
    YAW_RATE_A1,
    id_of,
)
from tests.support.lone_wheelset import LONE, PLAYED
from tests.support.metronome import SLOT_US, WINDOW_US, Cycle, Machine, calm, cycle, metronome, mostly, within
from tests.support.processes import BIN, ROOT, running, stopped, wait_for
from tests.support.scenarios import FOUR_AXLES, SIX_AXLES, held
from tests.support.vcan import CANDUMP, add, allow_large_buffers, ip, overruns_at, slot_of
from wrcd.bus.candump import format_line
from wrcd.bus.frame import Frame
from wrcd.config.config import DEFAULT
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

YAW_RATE_TIMEOUT_US = 15_000  # as the DBC says
AXLES = 4  # of the packaged configuration
# a train's sensors do not wait for the daemon's processor: in the guest they share the only one
PRIORITY = 10
CANPLAYER = ("chrt", "-f", str(PRIORITY), "canplayer")


@dataclass
class Recorded:
    """What candump saw, and what came of the processes."""

    log: Path
    frames: list[Frame]
    daemon_says: str
    rig_says: str
    machine: Machine

    def of(self, can_id: int) -> list[Frame]:
        return [f for f in self.frames if f.can_id == can_id]

    def calm(self, axle: int) -> list[tuple[int, int]]:
        """Return the times in which the axle's sensors were not held up."""
        return calm([f.stamp_us for f in self.of(id_of(f"YawRate_A{axle}"))], YAW_RATE_TIMEOUT_US)

    @property
    def cycle(self) -> Cycle:
        """Axle 1's slots while its sensors send: a program that starts takes the guest's processor before."""
        yaw = self.of(YAW_RATE_A1)
        slots = [slot_of(f) for f in self.of(ADHESION_A1)[:-1]]  # without the one of the stop
        return cycle(slots, yaw[0].stamp_us, yaw[-1].stamp_us, self.machine)

    def counted_cycle(self) -> Cycle:
        """The cycle, printed. Every slot that is missing must be one that the daemon says it left out: an overrun for
        each of its axles. How many a machine leaves out that has other work is no matter of the daemon's."""
        kept = self.cycle
        print(kept)
        assert AXLES * len(kept.missing) <= overruns_since(
            self.frames, self.daemon_says, self.of(YAW_RATE_A1)[0].stamp_us
        )
        return kept


def overruns_since(frames: list[Frame], daemon_says: str, begin_us: int) -> int:
    """How many frames the daemon says it left out from a time on. What the bus tells wraps at 256."""
    told = re.search(r"(\d+) overruns", daemon_says)
    assert told is not None
    return int(told[1]) - overruns_at(frames, begin_us)


def sizes(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0


def end_of(path: Path) -> bytes:
    with path.open("rb") as f:
        f.seek(max(0, sizes(path) - 20_000))
        return f.read()


def wait_for_adhesion(log: Path, since_us: int) -> None:
    """Until there is a frame of half a second later: a daemon that was held up has taken what came before it."""

    def there() -> bool:
        lines = [line for line in end_of(log).splitlines()[1:] if b" 091#" in line]
        return bool(lines) and float(lines[-1][1:18]) * 1e6 > since_us + 500_000

    wait_for("an Adhesion frame after the play", 60, there)


def record(folder: Path, play: Callable[[], str]) -> Recorded:
    """candump, then the daemon, then what plays; the daemon is stopped by SIGTERM."""
    folder.mkdir(exist_ok=True)
    log = folder / "candump.log"
    allow_large_buffers()
    with metronome(0) as machine, running(*CANDUMP, "vcan0", output=log):
        with running(BIN / "wrcd", "run", "-i", "socketcan", "-c", "vcan0") as daemon:
            wait_for("the daemon's first frame", 30, lambda: sizes(log) > 0)
            says = play()
            wait_for_adhesion(log, time.time_ns() // 1000)
            daemon_says = stopped(daemon)
        time.sleep(0.5)
    return Recorded(log, [f for f, _ in read_log(log, Damage())], daemon_says, says, machine)


@pytest.fixture(scope="module")
def one_axle(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    """The real rig plays a dry rail. It starts beside the daemon: with the sensors' priority its start would take the
    only processor for seconds, and the daemon would have to catch up with them while the play has begun."""
    folder = tmp_path_factory.mktemp("one")
    scenario = folder / "dry.toml"
    scenario.write_text(held("A", 8.0, 0.5))

    def play() -> str:
        with running(BIN / "sim-ecu", "play", scenario, "-c", "vcan0") as rig:
            first = f" {YAW_RATE_A1:03X}#".encode()
            wait_for("the rig's first frame", 60, lambda: first in end_of(folder / "candump.log"))
            os.sched_setscheduler(rig.pid, os.SCHED_FIFO, os.sched_param(PRIORITY))
            assert rig.wait(240) == 0
            assert rig.stderr is not None
            return rig.stderr.read().decode()

    return record(folder, play)


@pytest.fixture(scope="module")
def four_axles(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    """canplayer plays four lone wheelsets, each on another curve, in real time."""
    folder = tmp_path_factory.mktemp("four")
    scenario, log = folder / "four.toml", folder / "four.log"
    scenario.write_text(PLAYED + FOUR_AXLES)
    subprocess.run([BIN / "sim-ecu", "play", scenario, "--fast", "--log", log], timeout=120, check=True)
    # the guest has one slow processor: leave the truth out, it is not needed here
    lines = [line.removesuffix(" R") for line in log.read_text().splitlines() if " 7A" not in line]
    log.write_text("\n".join(lines) + "\n")

    def play() -> str:
        done = subprocess.run(
            [*CANPLAYER, "-I", log, "vcan0=can0"], timeout=60, check=True, capture_output=True, text=True
        )
        return done.stderr

    return record(folder / "bus", play)


def test_every_slot_of_adhesion_is_sent_or_counted_as_left_out(one_axle: Recorded) -> None:
    kept = one_axle.counted_cycle()
    assert kept.wanted - len(kept.missing) > 50


def test_rig_keeps_time_and_sends_every_frame(one_axle: Recorded) -> None:
    assert " 0 not sent" in one_axle.rig_says
    yaw = one_axle.of(YAW_RATE_A1)
    assert len(yaw) == 1600
    begin_us, end_us = yaw[0].stamp_us, yaw[-1].stamp_us
    at_ends_us = one_axle.machine.taken_us(begin_us, begin_us + 100_000) + one_axle.machine.taken_us(
        end_us - 100_000, end_us
    )
    assert end_us - begin_us == pytest.approx(8_000_000, abs=100_000 + at_ends_us)


def test_valid_estimate_meets_the_truth(one_axle: Recorded) -> None:
    """Whatever is called Valid, from a window after the wanted creep is held, and Valid unless the guest stalled."""
    message = databases()[0].get_message_by_name("Adhesion_A1")
    yaw = one_axle.of(YAW_RATE_A1)
    since_us, until_us = yaw[0].stamp_us + 3_000_000, yaw[-1].stamp_us
    late = [f for f in one_axle.of(ADHESION_A1) if since_us < f.stamp_us <= until_us]
    valid = [f for f in late if f.data[1] >> 4 == 1]
    sound = one_axle.calm(1)
    judged = [f.data[1] >> 4 == 1 for f in late if within(f.stamp_us, sound)]
    print(f"{len(valid)} of {len(late)} Valid, {sum(judged)} of {len(judged)} undisturbed ones")
    assert mostly(judged, 0.8, since_us - WINDOW_US, until_us, one_axle.machine)
    for f in valid:
        values = message.decode(f.data)
        assert isinstance(values, dict)
        assert abs(float(str(values["MuAvailable"])) - 38.4) < 3.0


def test_sigterm_sends_not_available_for_every_axle(one_axle: Recorded) -> None:
    for can_id in ADHESION.values():
        assert one_axle.of(can_id)[-1].data[1] >> 4 == 0
    assert one_axle.frames[-1].data[1] >> 4 & 3 == 3  # WrcdStatus: Stopping


def replayed(recorded: Recorded, folder: Path) -> list[Frame]:
    out = folder / "replayed.log"
    subprocess.run([BIN / "wrcd", "replay", recorded.log, "-o", out], timeout=300, check=True)
    return [f for f, _ in read_log(out, Damage())]


@pytest.mark.parametrize("which", ["one_axle", "four_axles"])
def test_live_frames_equal_those_of_a_replay(which: str, request: pytest.FixtureRequest, tmp_path: Path) -> None:
    """The adhesion frames that the daemon sent are, byte for byte, those that a replay of candump's log computes."""
    axles = 1 if which == "one_axle" else 4
    recorded: Recorded = request.getfixturevalue(which)
    kept = recorded.counted_cycle()
    assert_enough(compared(recorded, axles, tmp_path), 100, axles, kept)


def assert_enough(compared: int, slots: int, axles: int, kept: Cycle) -> None:
    """So many slots of so many axles were compared, less those that are missing."""
    assert compared > max(0, slots - len(kept.missing)) * axles


def compared(recorded: Recorded, axles: int, tmp_path: Path) -> int:
    """How many adhesion frames of the first axles are, from the first Valid one on, or from where it would be in a
    guest that is not held up, those of a replay: all must be."""
    computed = {(f.can_id, f.stamp_us // 20_000): f.data for f in replayed(recorded, tmp_path)}
    last = max(f.stamp_us for f in recorded.frames if f.can_id in INPUTS) // 20_000
    settled = min(f.stamp_us for f in recorded.frames if f.can_id in INPUTS) // 20_000 + 125
    print(recorded.daemon_says)
    assert "lost" not in recorded.daemon_says
    compared = 0
    for can_id in list(ADHESION.values())[:axles]:
        sent = {slot_of(f): f.data for f in recorded.of(can_id)}
        first = min([settled, *(s for s, data in sent.items() if data[1] >> 4 == 1)])
        judged = {s: data for s, data in sent.items() if first <= s <= last}
        different = [s for s, data in judged.items() if computed[can_id, s] != data]
        print([(s, sent[s].hex(), computed[can_id, s].hex()) for s in different[:5]])
        assert different == []
        compared += len(judged)
    return compared


def test_silence_of_the_sensors_is_no_time_step(tmp_path: Path) -> None:
    """Three seconds without a frame of theirs: NotAvailable at every slot, live and in a replay of candump's log."""
    scenario, log = tmp_path / "dry.toml", tmp_path / "dry.log"
    scenario.write_text(held("A", 5.0, 0.5))
    subprocess.run([BIN / "sim-ecu", "play", scenario, "--fast", "--no-truth", "--log", log], timeout=120, check=True)
    frames = [f for f, _ in read_log(log, Damage())]
    half_us = frames[0].stamp_us + 2_500_000
    later = [f if f.stamp_us < half_us else replace(f, stamp_us=f.stamp_us + 3_000_000) for f in frames]
    log.write_text("".join(format_line(f, "can0") + "\n" for f in later))

    def play() -> str:
        subprocess.run([*CANPLAYER, "-I", log, "vcan0=can0"], timeout=60, check=True, capture_output=True)
        return ""

    recorded = record(tmp_path / "bus", play)
    assert "the clock stepped" not in recorded.daemon_says
    assert ", 0 steps of time" in recorded.daemon_says
    kept = recorded.counted_cycle()
    assert_enough(compared(recorded, 1, tmp_path), 250, 1, kept)  # 275 from 2.5 s on
    yaw = [f.stamp_us for f in recorded.of(YAW_RATE_A1)]
    gap_us, back_us = max((b - a, b) for a, b in pairwise(yaw))
    taken_us = recorded.machine.taken_us(back_us - gap_us - 200_000, back_us + 200_000)
    assert gap_us == pytest.approx(3_000_000, abs=200_000 + taken_us)
    silent = [f for f in recorded.of(ADHESION_A1) if back_us - gap_us + 200_000 < f.stamp_us < back_us]
    assert len(silent) > max(0, 120 - len(kept.missing))
    assert {f.data[1] >> 4 for f in silent} == {0}


def test_sigusr1_dump_replays_to_what_was_sent(tmp_path: Path) -> None:
    """SIGUSR1 has the last seconds written; they begin with the daemon, so a replay is what was sent while inputs came,
    byte for byte."""
    scenario, log, config = tmp_path / "dry.toml", tmp_path / "dry.log", tmp_path / "wrcd.toml"
    scenario.write_text(held("A", 6.0, 0.5))
    subprocess.run([BIN / "sim-ecu", "play", scenario, "--fast", "--log", log], timeout=120, check=True)
    log.write_text(log.read_text().replace(" R\n", "\n"))
    config.write_text(DEFAULT + '[recorder]\nfolder = "dumps"\n')
    bus = tmp_path / "candump.log"
    allow_large_buffers()
    with (
        metronome(0) as machine,
        running(*CANDUMP, "vcan0", output=bus),
        running(BIN / "wrcd", "run", "-i", "socketcan", "-c", "vcan0", "--config", config) as daemon,
    ):
        wait_for("the daemon's first frame", 30, lambda: sizes(bus) > 0)
        subprocess.run([*CANPLAYER, "-I", log, "vcan0=can0"], timeout=60, check=True)
        daemon.send_signal(signal.SIGUSR1)
        wait_for("the dump", 30, lambda: bool(list(tmp_path.glob("dumps/wrcd-vcan0-*-asked.log"))))
        said = stopped(daemon)
    print(said)
    (dump,) = tmp_path.glob("dumps/wrcd-vcan0-*-asked.log")
    assert len(list(tmp_path.glob("dumps/*.log"))) == 1  # none at the end
    out = tmp_path / "out.log"
    subprocess.run([BIN / "wrcd", "replay", dump, "--config", config, "-o", out], timeout=300, check=True)
    computed = {(f.can_id, f.stamp_us // 20_000): f.data for f, _ in read_log(out, Damage())}
    # what candump saw, but for the slots before the first input and after the last, which only the clock closed
    frames = [f for f, _ in read_log(bus, Damage())]
    sent = {(f.can_id, slot_of(f)): f.data for f in frames if f.can_id in ADHESION.values()}
    judged = {key: data for key, data in sent.items() if key in computed}
    slots = [f.stamp_us // SLOT_US for f in frames if f.can_id == YAW_RATE_A1]
    assert {key for key in sent if slots[0] + 2 <= key[1] <= slots[-1] - 2} <= computed.keys()
    different = {key: (data.hex(), computed[key].hex()) for key, data in judged.items() if computed[key] != data}
    assert different == {}
    recorded = Recorded(bus, frames, said, "", machine)
    kept = recorded.counted_cycle()
    assert_enough(len(judged), 200, 4, kept)
    yaw, sound = [f.stamp_us for f in recorded.of(YAW_RATE_A1)], recorded.calm(1)
    valid = [
        data[1] >> 4 == 1
        for (can_id, slot), data in judged.items()
        if can_id == ADHESION_A1 and within(slot * SLOT_US, sound)
    ]
    print(f"{sum(valid)} of {len(valid)} Valid")
    assert mostly(valid, 0.8, yaw[0], yaw[-1], machine)
    # and the dump, like any log, has what was sent: every frame of it that the bus carried
    noted = {(f.can_id, slot_of(f)): f.data for f, _ in read_log(dump, Damage()) if f.can_id in ADHESION.values()}
    assert noted.items() <= sent.items()
    assert {key: data for key, data in noted.items() if key in computed}.items() <= computed.items()


def test_four_axles_estimate_their_own_rails(four_axles: Recorded, tmp_path: Path) -> None:
    """What is called Valid is near the truth, once the wanted point is held for a window."""
    table = tmp_path / "four.csv"
    command: list[str | Path] = [BIN / "wrcd", "replay", four_axles.log, "--design", LONE, "--csv", table]
    subprocess.run(command, timeout=300, check=True)
    stamps = [f.stamp_us * 1e-6 for f in four_axles.frames if f.can_id in INPUTS]
    with table.open() as f:
        rows = [r for r in csv.DictReader(f) if min(stamps) + 2.5 < float(r["time_s"]) <= max(stamps)]
    for axle, true in ((1, 38.4), (2, 21.6), (3, 11.4), (4, 2.7)):
        mine = [r for r in rows if r["axle"] == str(axle)]
        valid = [float(r["mu_available_pct"]) for r in mine if r["validity"] == "Valid"]
        print(f"axle {axle}: {len(valid)} of {len(mine)} Valid")
        sound = four_axles.calm(axle)
        judged = [r["validity"] == "Valid" for r in mine if within(round(float(r["time_s"]) * 1e6), sound)]
        assert len(mine) == pytest.approx((max(stamps) - min(stamps) - 2.5) * 50, abs=2)
        since_us, until_us = round((min(stamps) + 2.5) * 1e6), round(max(stamps) * 1e6)
        assert mostly(judged, 0.8, since_us - WINDOW_US, until_us, four_axles.machine)
        assert not valid or sum(valid) / len(valid) == pytest.approx(true, abs=3.0)


def test_every_slot_of_six_axles_is_sent_or_counted_and_nothing_is_lost(tmp_path: Path) -> None:
    """Every sensor's frame is accepted, every slot has six frames but for those that the daemon counts as left out, and
    there is no other loss."""
    allow_large_buffers()
    scenario, log, seen = tmp_path / "six.toml", tmp_path / "six.log", tmp_path / "candump.log"
    scenario.write_text(SIX_AXLES.replace("[1.0, 1.0]", "[1.0, 0.5]"))  # of the peak's creep: not too still to be Valid
    subprocess.run([BIN / "sim-ecu", "play", scenario, "--fast", "--no-truth", "--log", log], timeout=240, check=True)
    log.write_text(log.read_text().replace(" R\n", "\n"))
    played = len(log.read_text().splitlines())
    assert played == 6 * (1200 + 1200 + 600) + 300
    with metronome(0) as machine:
        begin_us, end_us, said = play_six_axles(log, seen)
    sent = [f for f, _ in read_log(seen, Damage())]
    counted = losses(sent, begin_us)
    print(said, counted)
    overruns = overruns_since(sent, said, begin_us)
    assert counted.pop("Overruns") <= overruns
    assert not any(counted.values()), counted
    assert f"{played} frames accepted, rejected: none;" in said
    assert "lost" not in said
    assert "could not send" not in said
    cycles = []
    for axle in range(1, 7):
        # a frame of the last slots may be late
        every = [f for f in sent if f.can_id == id_of(f"Adhesion_A{axle}") and begin_us <= f.stamp_us]
        cycles.append(cycle([slot_of(f) for f in every[:-1]], begin_us, end_us, machine))
        mine = [f for f in every if f.stamp_us <= end_us]
        yaw = [f.stamp_us for f in sent if f.can_id == id_of(f"YawRate_A{axle}")]
        sound = calm(yaw, YAW_RATE_TIMEOUT_US)
        judged = [f.data[1] >> 4 == 1 for f in mine if within(f.stamp_us, sound)]
        print(f"axle {axle}: {cycles[-1]}; {sum(judged)} of {len(judged)} Valid")
        assert mostly(judged, 0.6, yaw[0], yaw[-1], machine)
    assert sum(len(c.missing) for c in cycles) <= overruns


def play_six_axles(log: Path, seen: Path) -> tuple[int, int, str]:
    """Play a log of six axles to a daemon; seen gets what it sends. Returns when, in us, and what the daemon logged."""
    six = ROOT / "examples" / "six-axles.toml"
    with (
        running(*CANDUMP, "vcan0,080:7C0,101:7FF,102:7FF,103:7FF,104:7FF,105:7FF,106:7FF", output=seen),
        # not at a real-time priority: vcan carries frames in a thread of the kernel's that has none
        running(BIN / "wrcd", "run", "-i", "socketcan", "-c", "vcan0", "--config", six) as daemon,
    ):
        wait_for("the daemon's first WrcdLink", 30, lambda: seen.exists() and " 0B2#" in seen.read_text())
        begin_us = time.time_ns() // 1000
        subprocess.run([*CANPLAYER, "-I", log, "vcan0=can0"], timeout=60, check=True)
        end_us = time.time_ns() // 1000
        wait_for_adhesion(seen, end_us)
        return begin_us, end_us, stopped(daemon)


LOSSES = {
    "Overruns": WRCD_STATUS, "RejectedFrames": WRCD_STATUS, "ReceiveDrops": WRCD_STATUS, "Unsent": WRCD_LINK,
    "LateFrames": WRCD_LINK,
}  # fmt: skip


def losses(sent: list[Frame], begin_us: int) -> dict[str, int]:
    """What WrcdStatus and WrcdLink count from a time on, as anyone on the bus reads them: a start may be slow. Each
    count wraps."""
    database, _ = databases()
    counted = {}
    for name, can_id in LOSSES.items():
        frames = [f for f in sent if f.can_id == can_id]
        before = [f for f in frames if f.stamp_us < begin_us][-1]
        first, last = (database.decode_message(can_id, f.data) for f in (before, frames[-1]))
        assert isinstance(first, dict)
        assert isinstance(last, dict)
        highest = database.get_message_by_frame_id(can_id).get_signal_by_name(name).maximum
        counted[name] = (int(str(last[name])) - int(str(first[name]))) % (int(highest or 0) + 1)
    return counted


def test_garbage_frames_do_not_stop_the_daemon(tmp_path: Path) -> None:
    log = tmp_path / "candump.log"
    with (
        running(*CANDUMP, "vcan0,090:7F0", output=log),
        running(BIN / "wrcd", "run", "-i", "socketcan", "-c", "vcan0") as daemon,
    ):
        wait_for("the daemon's first frame", 30, lambda: sizes(log) > 0)
        for text in ("101#", "101#00", "101#R", "101#0011223344556677", "091#FFFFFFFFFFFFFFFF", "00000101#0011223344",
                     "130#FFFFFFFF", "7FF#", "121##1001122334455667788", "20000040#0000000000000000"):  # fmt: skip
            subprocess.run(["cansend", "vcan0", text], timeout=10, check=True)
        before = sizes(log)
        time.sleep(1.0)
        assert daemon.poll() is None
        assert sizes(log) > before
        said = stopped(daemon)
    assert "rejected: " in said
    assert "length" in said
    assert "Traceback" not in said


def test_daemon_survives_link_down_and_device_gone(tmp_path: Path) -> None:
    """vcan1 goes down, comes up, is deleted and made again; frames come back each time."""
    log = tmp_path / "candump.log"

    def frames_come(seconds: float) -> None:
        with running(*CANDUMP, "vcan1,091:7FF", output=log):
            wait_for("a frame on vcan1", seconds, lambda: sizes(log) > 0)

    with running(BIN / "wrcd", "run", "-i", "socketcan", "-c", "vcan1") as daemon:
        frames_come(30)
        ip("set", "vcan1", "down")
        time.sleep(0.5)
        ip("set", "vcan1", "up")
        frames_come(5)
        ip("del", "vcan1")
        time.sleep(0.5)
        add("vcan1")
        ip("set", "vcan1", "up")
        frames_come(5)
        assert daemon.poll() is None


def test_second_daemon_on_the_bus_is_said_and_counted(bus: str, tmp_path: Path) -> None:
    """Each of two says that somebody else sends its messages, about as many a second as it sends itself."""
    log = tmp_path / "candump.log"
    with running(*CANDUMP, bus, output=log):
        daemon = BIN / "wrcd", "run", "-i", "socketcan", "-c", bus
        with running(*daemon) as first, running(*daemon) as second:
            wait_for("some seconds of both", 60, lambda: log.exists() and log.read_text().count(" 0B1#") >= 8)
            says = [stopped(process) for process in (first, second)]
    for journal in says:
        seconds = [
            int(n)
            for n in re.findall(r"somebody else sends .*: (\d+) frames in the last second; is another wrcd on", journal)
        ]
        assert len(seconds) >= 2
        assert 100 < max(seconds) < 1000  # four axles send 283 a second
    rejects = [f for f, _ in read_log(log, Damage()) if f.can_id == WRCD_REJECTS]
    assert {f.data[7] >> 4 for f in rejects} >= {15}
