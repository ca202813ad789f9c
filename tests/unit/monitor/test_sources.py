"""Where frames come from: the reader's process and its pipe, a link of one's own, a log."""

import os
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import can
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.can_ids import SENDABLE, UNMAPPED
from tests.support.daemon_frames import GOOD, START_US, DaemonFrames
from tests.support.recorded_train import RecordedTrain
from wrcd.bus.candump import format_line
from wrcd.bus.frame import Frame
from wrcd.bus.link import MAX_FRAMES
from wrcd.bus.pythoncan import PythonCanLink
from wrcd.core.causes import Validity
from wrcd.core.configuration import Config
from wrcd.errors import BusError, InputError
from wrcd.logs.damage import Damage
from wrcd.logs.decoder import OwnFrames
from wrcd.logs.reader import read_log
from wrcd.logs.story import estimate, gather
from wrcd.monitor import bus_reader
from wrcd.monitor.board import Board, ScreenView
from wrcd.monitor.buffers import Batch
from wrcd.monitor.bus_reader import FRAMES, HEALTH, Pump, Unpacker, frames_message, message_of
from wrcd.monitor.panels import SourceState, why
from wrcd.monitor.screen import write_log
from wrcd.monitor.sources import OwnLink, ReaderProcess, model_of_log

ROOT = Path(__file__).parents[3]
GOLDEN = ROOT / "tests/golden/leaf-film.log"
EVERY_KIND = [
    Frame(1_700_000_000_000_001, 0x101, b"\1\2\3"),
    Frame(1_700_000_000_000_002, 0x18FF0001, bytes(8), extended=True),
    Frame(1_700_000_000_000_003, 0x102, b"", remote=True, extra=4),
    Frame(1_700_000_000_000_004, 0x40, bytes(8), error=True),
    Frame(1_700_000_000_000_005, 0x103, bytes(range(8)), fd=True, extra=1),
]
LONG = Frame(1_700_000_000_000_006, 0x104, bytes(range(64)), fd=True, extra=3)


def unpacked(data: bytes) -> tuple[list[Frame], list[int]]:
    """Frames, and kinds of messages."""
    frames: list[Frame] = []
    kinds: list[int] = []
    for kind, width, _, body in Unpacker().take(data):
        kinds.append(kind)
        if kind == FRAMES:
            frames += Batch.of_bytes(width, body).frames()
    return frames, kinds


def test_frames_wait_while_nobody_fetches_and_none_is_lost() -> None:
    """The pipe takes 64 KiB; the pump keeps the rest, and hands it on in order."""
    begin, end = os.pipe()
    os.set_blocking(begin, False)
    sent = [[Frame(k * MAX_FRAMES + n, 0x100, bytes(8)) for n in range(MAX_FRAMES)] for k in range(10)]
    given = iter(sent)
    pump = Pump(lambda now_us: next(given, []), dict, end)
    try:
        for _ in sent:
            assert pump.turn() is True
        data = b""
        for _ in range(40):
            try:
                data += os.read(begin, 1 << 20)
            except BlockingIOError:
                pass
            assert pump.turn() is False
        frames, kinds = unpacked(data)
        assert frames == [f for part in sent for f in part]
        assert HEALTH in kinds
    finally:
        os.close(begin)
        os.close(end)


def test_frames_beyond_what_may_wait_are_counted_as_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bus_reader, "MAX_WAITING", 100_000)
    monkeypatch.setattr(bus_reader, "HEALTH_S", 0.0)
    begin, end = os.pipe()
    try:
        pump = Pump(lambda now_us: [Frame(0, 0x100, bytes(8))] * 3000, dict, end)
        for _ in range(10):
            pump.turn()
        assert pump._lost == 7 * 3000
    finally:
        os.close(begin)
        os.close(end)


def test_pump_ends_when_the_screen_is_gone() -> None:
    begin, end = os.pipe()
    os.close(begin)
    pump = Pump(lambda now_us: [], dict, end)
    try:
        with pytest.raises(BrokenPipeError):
            pump.turn()
    finally:
        os.close(end)


def test_bus_that_is_not_there_is_a_clear_error() -> None:
    source = ReaderProcess("socketcan", "nosuchbus9", True)
    with pytest.raises(BusError, match=r"nosuchbus9|AF_CAN"):
        source.wait_open()


def test_reader_that_cannot_start_is_a_clear_error(capfd: pytest.CaptureFixture[str]) -> None:
    source = ReaderProcess("socketcan", "can0", True, module="wrcd.no_such_module")
    with pytest.raises(BusError, match="channel: "):
        source.wait_open()
    assert "no_such_module" in capfd.readouterr().err


def test_virtual_bus_is_read_and_never_sent_to(config: Config) -> None:
    sender = can.Bus(interface="virtual", channel="monitor-test")
    source = OwnLink(PythonCanLink("virtual", "monitor-test", None))
    try:
        for n in range(50):
            sender.send(can.Message(arbitration_id=0x100 + n, data=b"\1", is_extended_id=False))
        got = [f for batch, _ in source.take() for f in batch.frames()]
        assert [f.can_id for f in got] == list(range(0x100, 0x132))
        assert sender.recv(0.0) is None
        assert not hasattr(source, "send")
    finally:
        source.close()
        sender.shutdown()


def test_reader_process_over_a_real_bus_of_python_can(config: Config) -> None:
    """udp_multicast goes from process to process; one that is silent still opens, tells its state and ends."""
    source: Any = ReaderProcess("virtual", "monitor-process", False)
    source.wait_open()
    try:
        end = time.monotonic() + 10
        while not (taken := list(source.take())) and time.monotonic() < end:
            time.sleep(0.02)
        assert taken
        assert source.state().state == "Up"
    finally:
        source.close()
    assert source._process.returncode is not None


def test_log_with_a_daemons_frames_is_shown_as_they_say(config: Config, tmp_path: Path) -> None:
    log = tmp_path / "ride.log"
    frames = DaemonFrames(config).stretch(0, 3_000_000, GOOD)
    log.write_text("".join(f"{format_line(f, 'can0')}\n" for f in frames))
    model, warnings = model_of_log(log, config, [], None, 500_000)
    assert warnings == []
    assert model.source == "frames of the log"
    assert len(model.axles[0].held.adhesion) == 150
    assert model.begin_us == START_US


def test_log_without_a_daemon_is_estimated_as_replay_does(config: Config) -> None:
    model, warnings = model_of_log(GOLDEN, config, [], None, 500_000)
    assert warnings[0] == "the log has no frame of a daemon: estimated here"
    assert len(model.axles[0].held.adhesion) > 100
    assert any(e.validity is Validity.VALID for e in model.axles[0].history.events())
    assert model.inputs_at(model.axles[0], model.now_us)[0].rate_hz > 100


def test_estimated_frames_are_none_of_the_logs(config: Config, tmp_path: Path) -> None:
    """Neither counted on its bus nor saved, and the screen says so for as long as it is shown."""
    model, _ = model_of_log(GOLDEN, config, [], None, 500_000)
    logged = [f for f, _ in read_log(GOLDEN, Damage())]
    assert model.load.frames == model.held.frames == len(logged)
    assert write_log(tmp_path / "saved.log", model.held, "can0") == len(logged)
    assert [f for f, _ in read_log(tmp_path / "saved.log", Damage())] == logged
    end_us = model.now_us
    seconds = [f for f in logged if end_us - 1_100_000 <= f.stamp_us < end_us - 100_000]
    assert model.load.at(end_us).frames_per_s == pytest.approx(len(seconds), rel=0.1)
    canvas = Board(model, ScreenView()).draw(80, 24, SourceState("ride.log", "log")).text()
    assert "no daemon in the log: estimated here" in canvas
    assert "Running" not in canvas


def test_estimate_goes_on_over_a_clock_that_was_set_back(config: Config, tmp_path: Path) -> None:
    frames = [f for f, _ in read_log(GOLDEN, Damage())]
    middle_us = (frames[0].stamp_us + frames[-1].stamp_us) // 2
    moved = [replace(f, stamp_us=f.stamp_us - 6_000_000 * (f.stamp_us > middle_us)) for f in frames]
    log = tmp_path / "back.log"
    log.write_text("".join(f"{format_line(f, 'can0')}\n" for f in moved))
    model, warnings = model_of_log(log, config, [], None, 500_000)
    assert model.clock_steps == 1
    assert any("step back" in w for w in warnings)
    length_us = frames[-1].stamp_us - frames[0].stamp_us
    assert model.now_us - model.axles[0].held.adhesion.time_us[0] == pytest.approx(length_us, abs=200_000)
    before, _ = model_of_log(GOLDEN, config, [], None, 500_000)
    assert len(model.axles[0].held.adhesion) == pytest.approx(len(before.axles[0].held.adhesion), abs=60)


def test_log_without_the_daemons_frames_is_estimated(config: Config, tmp_path: Path) -> None:
    """As a story has it."""
    train = RecordedTrain(config, tmp_path, seconds=6.0)
    train.run(3000)
    log = train.asked()
    frames = [replace(f, can_id=UNMAPPED) if f.can_id in SENDABLE else f for f, _ in read_log(log, Damage())]
    log.write_text("".join(f"{format_line(f, 'can0')}\n" for f in frames))
    begun, _ = model_of_log(log, config, [], None, 500_000)
    assert begun.is_estimated
    known = estimate(log, config, None)
    says = OwnFrames(config).adhesion(known.sent, 1)
    assert says is not None
    a = begun.axles[0].held.adhesion
    assert a.time_us.tolist() == says.time_us.tolist()
    assert a.validity.tolist() == says.validity.tolist()
    np.testing.assert_array_equal(a.available_pct, says.available_pct)
    assert begun.load.frames == sum(1 for _ in read_log(log, Damage()))


def test_log_that_is_not_there_is_an_input_error(config: Config, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such log"):
        model_of_log(tmp_path / "none.log", config, [], None, 500_000)


@pytest.mark.parametrize("frames", [[], EVERY_KIND, [*EVERY_KIND, LONG]], ids=["none", "short", "with a long one"])
def test_packed_frames_come_back_as_they_were(frames: list[Frame]) -> None:
    ((kind, width, until_us, body),) = Unpacker().take(frames_message(frames, 17))
    assert (kind, until_us) == (FRAMES, 17)
    assert list(Batch.of_bytes(width, body).frames()) == frames


@given(st.lists(st.integers(1, 200), max_size=40))
def test_stream_cut_anywhere_gives_the_same_messages(sizes: list[int]) -> None:
    stream = frames_message(EVERY_KIND, 5) + message_of(HEALTH, {"drops": 3}) + frames_message([LONG], 6)
    whole = list(Unpacker().take(stream))
    unpacker, at = Unpacker(), 0
    got: list[tuple[int, int, int, bytes]] = []
    for size in [*sizes, len(stream)]:
        got += unpacker.take(stream[at : at + size])
        at += size
    assert got == whole
    assert [kind for kind, *_ in whole] == [FRAMES, HEALTH, FRAMES]


def test_batch_of_frames_has_zeros_behind_the_data() -> None:
    batch = Batch.of_frames(EVERY_KIND[:1])
    assert batch.data.tolist() == [[1, 2, 3, 0, 0, 0, 0, 0]]
    assert batch.key.dtype == np.int64


def test_of_an_estimated_log_the_monitor_knows_what_why_knows(config: Config) -> None:
    """Of a train that sends Adhesion alone, too: cause, figures, model and residuals."""
    plain = replace(config, axles=tuple(replace(a, detail=None) for a in config.axles))
    model, _ = model_of_log(GOLDEN, plain, [], None, 500_000)
    model.update()  # as the screen does again and again
    told, axle = gather(GOLDEN, plain).axles[0].events, model.axles[0]
    assert axle.history.events() == list(told)
    figures = [e for e in told if e.detail]
    assert figures
    for e in figures:
        text = " ".join(" ".join(part for part, _ in why(model, axle, e.begin_us + 1000, 200)).split())
        assert e.detail in text
    settled = " ".join(part for part, _ in why(model, axle, told[-1].end_us - 1_500_000, 200))
    assert "not known" not in settled
    assert "wins" in settled
