"""The receiver of a kit on a real bus, behind a gateway that loses, damages, repeats and forges the daemon's frames;
the daemon is killed and starts again."""

import contextlib
import re
import signal
import socket
import subprocess
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import pytest

from tests.support.can_ids import ADHESION_A1
from tests.support.kit.building import make, needs_compiler, written
from tests.support.kit.reading import Reading, Verdict
from tests.support.processes import BIN, running, wait_for
from tests.support.rig_frames import ticks_of
from tests.support.vcan import CANDUMP, FRAME
from wrcd.bus.candump import format_line
from wrcd.bus.e2e import COUNTER_MODULO, protect
from wrcd.config.config import load_config, packaged
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

pytestmark = needs_compiler
SECONDS = 20.0
VALID, EXTENDED = 1, 1 << 31
REAL_TIME = ("chrt", "-f", "10")
# What the gateway does with the n-th frame from the first Valid one on.
LOST = {*range(15, 45, 3), *range(130, 136)}
FLIPPED = {50, 56, 62, *range(70, 84, 2)}
REPEATED, JUMPED, SHORT, OTHER_ID, FORGED = {100}, {110}, {118}, {120}, set(range(150, 170))
KILLED = 245
TIMEOUTS_US = dict.fromkeys(range(1, 5), 60_000)
NAMES = dict(
    zip(
        ("accepted", "after a gap", "anew", "not mine", "kind", "length", "crc", "data id", "repeat", "counter",
         "two senders"),
        Verdict,
        strict=True,
    )
)  # fmt: skip


@dataclass
class Gateway:
    """Hands Adhesion_A1 on from one bus to another."""

    source: str
    target: str
    number: int = -1  # of the frame, from the first Valid one on

    def __post_init__(self) -> None:
        self._in, self._out = (socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) for _ in range(2))
        self._in.setsockopt(
            socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, ADHESION_A1.to_bytes(4, "little") + b"\xff\x07\0\0"
        )
        self._in.bind((self.source,))
        self._in.settimeout(10.0)
        self._out.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, b"")
        self._out.bind((self.target,))

    def forget(self) -> None:
        """Drop what has come until now."""
        self._in.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            while True:
                self._in.recv(FRAME.size)
        self._in.settimeout(10.0)

    def close(self) -> None:
        self._in.close()
        self._out.close()

    def hand_on(self) -> bool:
        """One frame; returns whether it says Valid."""
        _, length, data = FRAME.unpack(self._in.recv(FRAME.size))
        valid: bool = data[1] >> 4 == VALID
        self.number += valid or self.number >= 0
        n = self.number
        if n in LOST:
            return valid
        self._send(ADHESION_A1, bytes([data[0], data[1] ^ (n in FLIPPED) << 6, *data[2:length]]))
        other = protect(data, ADHESION_A1, ((data[1] & 0x0F) + 7) % COUNTER_MODULO)
        if n in REPEATED:
            self._send(ADHESION_A1, data)
        if n in JUMPED | FORGED:
            self._send(ADHESION_A1, other)
        if n in SHORT:
            self._send(ADHESION_A1, data[:7])
        if n in OTHER_ID:
            self._send(ADHESION_A1 | EXTENDED, data)
        return valid

    def _send(self, word: int, data: bytes) -> None:
        self._out.send(FRAME.pack(word, len(data), data.ljust(8, b"\0")))


@contextmanager
def daemon(config: Path) -> Iterator["subprocess.Popen[bytes]"]:
    command = ("chrt", "-f", "5", BIN / "wrcd", "run", "--config", config, "-i", "socketcan", "-c", "vcan0")
    with running(*command) as process:
        yield process


@dataclass
class Heard:
    """What the receiver said: seconds, state or reason; and what it counted. candump's log of the same bus."""

    lines: list[tuple[float, str]]
    counts: dict[Verdict, int]
    log: Path

    def reasons(self) -> list[str]:
        """Each when it begins."""
        found = [re.sub(r"adhesion .*", "FRESH_VALID", text.removeprefix("falls back: ")) for _, text in self.lines]
        return [text for place, text in enumerate(found) if place == 0 or found[place - 1] != text]


@pytest.fixture(scope="module")
def heard(tmp_path_factory: pytest.TempPathFactory) -> Heard:
    folder = tmp_path_factory.mktemp("kit")
    config, ride, told, log = (folder / name for name in ("one.toml", "ride.log", "told.txt", "candump.log"))
    config.write_text(packaged(1))
    ticks = ticks_of(load_config(config), SECONDS)
    ride.write_text("".join(format_line(f, "can0") + "\n" for tick in ticks for f in tick))
    subprocess.run(["ip", "link", "add", "vcan8", "type", "vcan"], timeout=10, check=True)
    subprocess.run(["ip", "link", "set", "vcan8", "up"], timeout=10, check=True)
    gateway = Gateway("vcan0", "vcan8")
    try:
        with daemon(config) as first:
            kit = written(folder / "receiver", config)  # while it starts
            make(kit, "example")
            with (
                running(*REAL_TIME, kit / "example_socketcan", "vcan8", output=told) as receiver,
                running(*CANDUMP, "vcan8", output=log),
            ):
                wait_for("the receiver's first line", 10, lambda: "nothing yet" in told.read_text())
                with running(*REAL_TIME, "canplayer", "-I", ride, "vcan0=can0"):
                    gateway.forget()  # in one burst, frames 15 slots apart would look like repeats
                    while gateway.number < KILLED:
                        gateway.hand_on()
                    first.send_signal(signal.SIGKILL)
                    first.wait(10)
                    with daemon(config) as second:
                        valid = 0
                        while valid < 25:
                            valid += gateway.hand_on()
                        second.send_signal(signal.SIGTERM)
                        while gateway.hand_on():  # what was on its way; the last one says NotAvailable
                            pass
                        assert second.wait(10) == 0
                    wait_for("the fall-back at the end", 5, lambda: told.read_text().rstrip().endswith("timed out"))
                time.sleep(0.2)
                receiver.send_signal(signal.SIGTERM)
                assert receiver.wait(10) == 0
    finally:
        gateway.close()
        subprocess.run(["ip", "link", "del", "vcan8"], timeout=10, check=False)
    text = told.read_text()
    print(text)
    lines = [(float(s), what) for s, what in re.findall(r"^ *([\d.]+) axle 1 (.+)$", text, re.MULTILINE)]
    (counted,) = re.findall(r"^axle 1: (.+)$", text, re.MULTILINE)
    counts = {NAMES[name]: int(n) for name, n in re.findall(r"([a-z ]+?) (\d+),", counted) for name in [name.strip()]}
    return Heard(lines, counts, log)


def test_receiver_falls_back_for_each_fault_and_comes_back(heard: Heard) -> None:
    seen = iter(heard.reasons())
    must = [
        "nothing yet", "NotAvailable", "FRESH_VALID",
        "many drops", "FRESH_VALID",  # flipped bits, every second frame; before that single ones, and lost ones
        "timed out", "FRESH_VALID",  # six frames lost
        "two senders", "many drops", "FRESH_VALID",
        "timed out", "FRESH_VALID",  # kill -9, and a new start
        "NotAvailable", "timed out",  # SIGTERM
    ]  # fmt: skip
    assert all(reason in seen for reason in must), heard.reasons()


def test_receiver_falls_back_for_nothing_else(heard: Heard) -> None:
    """No other reason occurs. A time-out needs a gap between frames that are used. A guest that stalls makes some."""
    reading, used_us = Reading(load_config(None), TIMEOUTS_US), []
    for f, _ in read_log(heard.log, Damage()):
        if reading.feed(f) <= Verdict.ANEW:
            used_us.append(f.stamp_us)
    gaps_us = [b - a for a, b in pairwise(used_us)]
    outs = heard.reasons().count("timed out") - 1  # the last one is for ever
    assert 2 <= outs <= sum(g > 55_000 for g in gaps_us)
    must = {"nothing yet", "NotAvailable", "FRESH_VALID", "many drops", "timed out", "two senders"}
    assert set(heard.reasons()) - {"Degraded"} == must


def test_receiver_counts_each_fault_under_its_verdict(heard: Heard) -> None:
    assert heard.counts[Verdict.CRC] == len(FLIPPED)
    assert heard.counts[Verdict.REPEAT] >= len(REPEATED)  # more, where the guest took 15 slots
    assert heard.counts[Verdict.COUNTER] >= len(JUMPED)
    assert heard.counts[Verdict.LENGTH] == len(SHORT)
    assert heard.counts[Verdict.AFTER_GAP] >= len(LOST) - 6
    assert heard.counts[Verdict.TWO_SENDERS] > len(FORGED)
    assert heard.counts[Verdict.ANEW] >= 3


def test_receiver_counts_what_the_daemons_checker_finds_in_candumps_log(heard: Heard) -> None:
    reading, found = Reading(load_config(None), TIMEOUTS_US), Counter[Verdict]()
    for f, _ in read_log(heard.log, Damage()):
        found[reading.feed(f)] += 1
    del found[Verdict.NOT_MINE]
    assert {v: n for v, n in heard.counts.items() if n} == dict(found)


def test_killed_daemon_is_noticed_at_its_time_out(heard: Heard) -> None:
    frames = [f for f, _ in read_log(heard.log, Damage())]
    gaps = [(b.stamp_us - a.stamp_us, a.stamp_us) for a, b in pairwise(frames)]
    _, last_us = max(gaps)  # from the kill to the first frame after it
    outs = [s for s, what in heard.lines if what.endswith("timed out")]
    begins = [s for s, what in heard.lines if what.endswith("NotAvailable")]
    # the receiver's clock and candump's differ by a constant, which the first frame tells
    offset_s = begins[0] - frames[0].stamp_us * 1e-6
    after_ms = min(abs(1e3 * (s - offset_s - last_us * 1e-6) - 60.0) for s in outs) + 60.0
    print(f"fell back {after_ms:.0f} ms after the last frame")
    assert after_ms < 1000.0
