"""`make bench` compares like with like: ours, the peer and the limit compute the same numbers."""

import socket
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.bench import bank, frames, start
from tests.bench.core import ROOT, Worker, table
from tests.bench.on_pair import pair
from tests.bench.timing import Times
from tests.bench.workload import LENGTH_US, START_US, stretch, write_stretch
from wrcd import resources
from wrcd.bus.codec import Receiver
from wrcd.bus.e2e import crc
from wrcd.bus.frame import Frame
from wrcd.bus.reasons import Reason
from wrcd.config.config import load_config, packaged
from wrcd.estimator.design import Design, load_design
from wrcd.estimator.paper.bank import Bank


@pytest.fixture(scope="module")
def design() -> Design:
    return load_design(resources.DESIGN)


def test_bank_and_filterpy_give_the_same_innovations(design: Design) -> None:
    axles, ticks = 3, 40
    z = bank.measurements(design, axles, ticks)
    ours, peer = Bank(design, axles), bank.Peer(bank.gains(), axles)
    for tick in range(ticks):
        innovations, _ = ours.step(z[tick], np.ones((2, axles), dtype=bool), bank.SPEED_M_S)
        peer.step(z[tick])
        scale = np.abs(innovations).max()
        assert innovations == pytest.approx(peer.innovations, abs=1e-6 * scale)


@pytest.fixture
def both() -> Iterator[tuple[frames.Ours, socket.socket, frames.Peer, socket.socket]]:
    """Our end and the peer's, each with the other end of its pair."""
    ours, peer = pair(), pair()
    link, reader = frames.Ours(ours[0]), frames.Peer(peer[0])
    yield link, ours[1], reader, peer[1]
    for each in (link, reader, ours[1], peer[1]):
        each.close()


def test_link_and_python_can_read_the_same_values(
    both: tuple[frames.Ours, socket.socket, frames.Peer, socket.socket],
) -> None:
    link, to_link, reader, to_reader = both
    for number, batch in enumerate(frames.sensor_batches()[:12]):
        for f in batch:
            for end in (to_link, to_reader):
                end.send(frames.packed(f))
        samples = link.take(number * 5000)
        assert [s.value for s in samples] == [
            pytest.approx(d.get("YawRate", d.get("LatAccel")), rel=1e-12) for d in reader.take(len(batch))
        ]
    assert link.rejected == 0


def test_frame_out_is_the_peers_but_for_crc_and_counter(
    both: tuple[frames.Ours, socket.socket, frames.Peer, socket.socket],
) -> None:
    writer, from_writer, encoder, from_encoder = both
    made, encoded = writer.send(7), encoder.send()
    assert made.data[2:] == encoded[2:]
    assert made.data[1] & 0xF0 == encoded[1] & 0xF0
    assert made.data[1] & 0x0F == 7
    assert made.data[0] == crc(made.data, 0x091)
    assert from_writer.recv(64) == frames.packed(made)
    # python-can also fills in len8_dlc, byte 7 of struct can_frame
    sent = from_encoder.recv(64)
    assert sent[:7] + b"\0" + sent[8:] == frames.packed(Frame(0, 0x091, encoded))


def test_stretch_follows_itself_without_a_rejected_frame() -> None:
    config = load_config(None)
    receiver = Receiver(config.database, [i.source for i in config.inputs])
    recorded = stretch(4)
    assert len({r.can_id for r in recorded}) == 13
    for begin_us in (START_US, START_US + LENGTH_US):
        for r in recorded:
            assert not isinstance(receiver.read(Frame(begin_us + r.at_us, r.can_id, r.data)), Reason)


def test_worker_is_of_the_tree_it_was_given_and_its_axle_is_valid(tmp_path: Path) -> None:
    write_stretch(tmp_path / "stretch", 1)
    (tmp_path / "one.toml").write_text(packaged(1))
    with Worker(ROOT, tmp_path / "stretch", tmp_path / "one.toml") as worker:
        assert worker.tree == ROOT
        assert worker.valid == (1,)
        assert worker.ticks(5) > 0


def test_daemon_over_a_pair_gets_ready_and_imports_no_tool_of_the_rig() -> None:
    told = start.over_pair(traffic=False)
    assert 0 < told.ready_s < start.WAIT_S
    assert "wrcd.bus.socketcan" in told.modules
    assert told.most_kb > 1000


def test_table_has_the_frames_and_the_load_of_four_axles() -> None:
    *_, row = table([(4, Times((100.0,)))])
    assert row == "| 4 | 2050 | 283 | 42 … 51 % | 100 | 2.0 % | 10.0 % |"
