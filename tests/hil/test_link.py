"""The daemon on a link that goes, comes back, is off the bus, loses frames or takes none; and a clock that is set."""

import re
from itertools import takewhile

import pytest

from tests.hil.recording import RECORDED, VALID, Episode, played, recorded, validity
from tests.support.can_ids import ADHESION_A1, WRCD_LINK, WRCD_STATUS, YAW_RATE_A1
from wrcd.bus.rawcan import MAX_ERRORS
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

BUS_OFF = 0x40  # a class of error frames
STATES = {
    "the CAN link is up": "up", "the CAN link is down": "down", "the CAN device is gone": "gone",
    "the CAN controller is error-passive": "passive", "the CAN controller is bus-off": "off",
}  # fmt: skip


def states(e: Episode) -> list[str]:
    """Of the link, as the daemon's lines say."""
    lines = (line.removeprefix("wrcd: ") for line in e.said.splitlines())
    return [word for line in lines for begin, word in STATES.items() if line.startswith(begin)]


@pytest.mark.parametrize("ride", ["ride2", "ride3", "ride4"])
def test_adhesion_comes_again_after_the_link_was_down_or_gone(ride: str) -> None:
    """What it says is compared in test_daemon.py, frame by frame."""
    e = recorded("link")
    frames = e.between(f"play {ride}", f"played {ride}")
    print(f"{len(frames)} slots of 100, {sum(validity(f) == VALID for f in frames)} Valid")
    assert len(frames) > 10


def test_device_that_is_back_is_opened_again_each_time() -> None:
    """Also where it was replaced between two looks."""
    e = recorded("link")
    assert e.told(WRCD_STATUS, "Reopens") == 2
    assert e.said.count("the CAN device was opened again") == 2
    assert states(e)[:2] == ["down", "up"]
    assert states(e)[-1] == "up"


def test_states_of_the_controller_are_told_as_error_frames_say_them() -> None:
    """Whatever arrives proves that it is on the bus; active after warning, and after passive."""
    e = recorded("errors")
    assert states(e) == ["off", "up"] * 2 + ["passive", "up"] * 2 + ["off", "up"]
    assert e.told(WRCD_LINK, "BusOffs") == 3


@pytest.mark.parametrize("name", ["errors", "busoff"])
def test_off_the_bus_one_slot_a_second_is_tried(name: str) -> None:
    """Should the frame that tells of the restart have been lost, and nobody else send. One slot may be on its way."""
    e = recorded(name)
    begin = next(k for k, f in enumerate(e.frames) if f.error and f.can_id & BUS_OFF)
    rest = takewhile(lambda f: not f.error and f.key != YAW_RATE_A1, e.frames[begin + 1 :])
    sent = [f for f in rest if f.can_id == ADHESION_A1]
    assert len(sent) <= 4
    again = [f for f in e.frames[begin:] if f.can_id == ADHESION_A1 and e.is_own(f)]
    assert len(again) > 20


def test_flood_of_error_frames_is_shut_out_but_not_what_tells_a_state() -> None:
    e = recorded("errors")
    sent = [f for f in e.frames if f.error]
    counted = e.told(WRCD_LINK, "ErrorFrames")
    print(f"{counted} of {len(sent)} error frames")
    assert len(sent) == 3000 + 11
    assert MAX_ERRORS < counted < len(sent)


def test_frame_that_the_controller_lost_is_counted() -> None:
    e = recorded("errors")
    assert e.counted(r"lost (\d+) received frames") == 1
    assert e.told(WRCD_STATUS, "ReceiveDrops") == 1


def test_every_frame_of_somebody_else_under_an_own_id_is_counted() -> None:
    """A node of the same computer is somebody else, too."""
    e = recorded("errors")
    assert "somebody else sends Adhesion_A1 (0x091): " in e.said
    assert e.counted(r"(\d+) frames in the last second; is another wrcd on this bus") == len(played("foreign"))


def test_frames_that_a_full_buffer_loses_are_counted_one_by_one() -> None:
    """A daemon that stands still. Frames that nobody wants do not fill its buffer. What it sends comes back: where
    it goes on with a slot before it has read, that finds no room, either."""
    e = recorded("lost")
    lost = e.counted(r"lost (\d+) received frames")
    last = re.search(r"(\d+) frames accepted, rejected: (.*?);", e.said.splitlines()[-1])
    assert last is not None
    print(f"{len(e.inputs)} frames, {lost} lost, {last[0]}")
    assert lost > 1000
    own_us = [f.stamp_us for _, f in e.sent if f.stamp_us > e.mark("full")]
    echoes = sum(us < own_us[0] + 100_000 for us in own_us)
    counted = int(last[1]) + sum(map(int, re.findall(r"\d+", last[2]))) + lost
    assert len(e.inputs) <= counted <= len(e.inputs) + echoes
    assert e.told(WRCD_STATUS, "ReceiveDrops", e.mark("full") - 1_000_000) == 0


def test_fd_frames_come_at_the_kernels_stamps_where_a_controller_has_none() -> None:
    e = recorded("fd")
    (file,) = RECORDED.glob("fd/*-asked.log")
    noted = [f for f, _ in read_log(file, Damage()) if not e.is_own(f)]
    inputs = e.inputs
    assert {f.fd for f in inputs} == {True, False}
    assert [(f.stamp_us, f.key, f.data, f.fd) for f in noted] == [(f.stamp_us, f.key, f.data, f.fd) for f in inputs]


def test_controller_off_the_bus_and_its_interface_set_up_anew() -> None:
    e = recorded("busoff")
    assert states(e)[0] == "off"
    assert states(e)[-1] == "up"
    assert e.told(WRCD_LINK, "BusOffs") == 1
    assert len(e.between("set can7 up", "deaf")) > 20


def test_line_that_nobody_reads_is_full_and_not_down() -> None:
    """What the kernel does not take is counted, and frames go out again when the line is read."""
    e = recorded("busoff")
    lines = [line.split()[1] for line in (RECORDED / "line").read_text().splitlines()]
    deaf, hears = lines.index("deaf"), lines.index("hear")
    unsent = e.counted(r"could not send (\d+) frames")
    came = [line for line in lines[hears:] if line.startswith("t0918")]
    print(f"{unsent} frames not sent, then {len(came)} slots")
    assert not [line for line in lines[deaf:hears] if line.startswith("t")]
    assert unsent > 100
    assert len(came) > 10
    assert states(e).count("down") <= 1  # the interface that was set up anew; a busy computer may not see that


def test_clock_that_is_set_is_a_step_of_time_and_frames_go_on() -> None:
    """By an hour, and back by less. Forwards by less than a second it is a silence."""
    e = recorded("busoff")
    begun = [at for what, at in e.marks if what.startswith("stepped")]
    if not begun:
        pytest.skip("recorded without a guest: nobody sets the clock of a computer that is in use")
    assert ", 3 steps of time" in e.said
    ended = [at for what, at in e.marks if what.startswith("step ")][1:] + [e.mark("deaf")]
    for begin_us, end_us in zip(begun, ended, strict=True):
        frames = [f for f in e.of(ADHESION_A1) if begin_us < f.stamp_us < end_us]
        print(f"{len(frames)} slots of 125, {sum(validity(f) == VALID for f in frames)} Valid")
        assert len(frames) > 20
