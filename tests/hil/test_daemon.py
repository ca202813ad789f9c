"""The daemon on a kernel's CAN bus: every slot, every frame, every input, of every episode.

The guest may be held up as it likes, and so may its host. A daemon is judged by what was on the bus: a core that is fed
the same frames makes the same bytes, a slot that has no frame is one that the daemon counts as left out, and an input
that was not taken is counted, too. Where that holds, what the tests of the core say holds on the bus.
"""

import re
from collections import Counter

import pytest

from tests.hil.recording import (
    EPISODES,
    NOT_AVAILABLE,
    OF_ITSELF,
    RECORDED,
    VALID,
    Replayed,
    played,
    recorded,
    validity,
)
from tests.support.can_ids import ADHESION, ADHESION_A1, SIM_TRUTH_A1, WRCD_LINK, WRCD_REJECTS, WRCD_STATUS, YAW_RATE_A1
from wrcd.bus.frame import Frame
from wrcd.logs.damage import Damage
from wrcd.logs.reader import read_log

# what was played onto a bus that took it all
PLAYED = {
    "axles": ("four", "dry"), "six": ("six",), "faults": ("faults",), "flood": ("dry", "dry"), "fd": ("fd",),
    "link": ("ride1", "ride2", "ride3", "ride4"),
}  # fmt: skip
OF_SLOTS = [n for n in EPISODES if n != "fd"]  # whose DBC has no counters
FOREIGN = ("errors", "flood")  # where somebody else sends under the daemon's ids
# Slots that may go out between the script's note and its signal. A daemon that is deaf for 3 s sends 150.
BEFORE_THE_STOP = 5


@pytest.mark.parametrize("name", EPISODES)
def test_script_and_daemon_came_to_their_end(name: str) -> None:
    e = recorded(name)
    assert [what for what, _ in e.marks if "TIMEOUT" in what] == []
    assert e.read("exit") == "0\n"
    assert "Traceback" not in e.said
    assert ("somebody else sends" in e.said) == (name in FOREIGN)


@pytest.mark.parametrize("name", OF_SLOTS)
def test_no_slot_is_sent_twice_or_out_of_its_order(name: str) -> None:
    assert {of: slots for of, slots in recorded(name).slots.items() if slots != sorted(set(slots))} == {}


@pytest.mark.parametrize("name", [n for n in OF_SLOTS if n != "busoff"])  # where the clock is set, slots are left out
def test_every_slot_is_sent_or_counted_as_left_out(name: str) -> None:
    """A slot that is over is skipped, and each frame of it is an overrun; what the kernel does not take is unsent. How
    many are left out on a machine that has other work is no matter of the daemon's, and only printed. What is told on
    the bus wraps at 256."""
    e = recorded(name)
    # from the first WrcdStatus on that comes right after a slot that was sent: it counts what was left out until then
    sent = set(e.slots[ADHESION_A1, 0])
    since_us = next(s for s in e.slots[WRCD_STATUS, 0] if s * 50 - 1 in sent) * 1_000_000
    left_out = e.counted(r"(\d+) overruns") - e.told(WRCD_STATUS, "Overruns", since_us)
    unsent = e.told(WRCD_LINK, "Unsent") - e.told(WRCD_LINK, "Unsent", since_us)
    valid = [validity(f) == VALID for f in e.of(ADHESION_A1)]
    print(f"{name}: {len(e.sent)} frames, {left_out} left out; {sum(valid)} of {len(valid)} of axle 1 Valid")
    assert 0 in {(missing - left_out - unsent) % 256 for missing in e.missing(since_us)}


@pytest.mark.parametrize("name", [n for n in OF_SLOTS if n != "lost"])  # of which nobody knows what the kernel lost
def test_frames_are_byte_for_byte_what_a_core_makes_of_the_bus(name: str) -> None:
    """All but the first of each message, also when the clock was set, and what the daemon says of itself and of
    others."""
    e = recorded(name)
    but = OF_ITSELF | ({WRCD_REJECTS} if name in FOREIGN else set())
    judged = [((i, s, t), f) for (i, s, t), f in e.settled if i not in but and s != e.slots[i, t][0]]
    assert len(judged) > 200
    computed = e.replayed.data
    assert [(s, f.data.hex(), computed.get(s, b"").hex()) for s, f in judged if computed.get(s) != f.data] == []


@pytest.mark.parametrize("name", [n for n in EPISODES if n != "lost"])
def test_every_input_is_accepted_or_refused_as_a_core_does(name: str) -> None:
    """None is lost: a frame that the socket did not take would be missing from one of the counts."""
    e = recorded(name)
    counts, last = e.replayed.core.counts, e.said.splitlines()[-1]
    assert f"{counts.accepted} frames accepted, rejected: {counts.rejections};" in last
    assert f" {counts.late} late frames" in last
    inputs = Counter(f.key for f in e.inputs)
    if name != "errors":  # its controller says that it has lost one
        assert "lost" not in e.said
    if name in PLAYED:
        sent = Counter(f.key for log in PLAYED[name] for f in played(log) if f.key in inputs and not f.error)
        assert sent <= inputs
        assert name == "flood" or sent == inputs


@pytest.mark.parametrize("name", EPISODES)
def test_sigterm_ends_it_with_frames_that_say_so(name: str) -> None:
    """Within a slot: NotAvailable for every axle, and Stopping."""
    e = recorded(name)
    after: list[Frame] = []
    for f in reversed(e.of(min(e.cycles_us))):
        if f.stamp_us < e.mark("stop"):
            break
        after.append(f)
    assert len(after) <= BEFORE_THE_STOP
    if name == "busoff":  # whose slow line may not take them
        return
    axles = sorted(e.cycles_us)[: len(e.config.axles)]
    assert [f.can_id for f in e.last] == [*axles, WRCD_STATUS] if name != "fd" else axles
    if name != "fd":
        assert {validity(f) for f in e.last[:-1]} == {NOT_AVAILABLE}
        assert e.last[-1].data[1] >> 4 & 3 == 3


def test_silence_of_the_sensors_is_no_step_of_time() -> None:
    """Three seconds without a frame of theirs: NotAvailable at every slot."""
    e = recorded("axles")
    silent = [f for f in e.between("played four", "play dry") if f.stamp_us > e.mark("played four") + 200_000]
    assert len(silent) > 10
    assert {validity(f) for f in silent} == {NOT_AVAILABLE}
    assert ", 0 steps of time" in e.said


def test_state_of_every_axle_is_printed_while_the_daemon_runs() -> None:
    bus, daemon, head, *axles = recorded("six").read("state").splitlines()
    assert " socketcan:vcan0 " in bus
    assert daemon.startswith("daemon ")
    assert head.split()[:3] == ["axle", "state", "available"]
    assert [line.split()[0] for line in axles] == list("123456")  # in which state depends on the guest's moment


def test_sigusr1_dump_replays_to_what_was_sent() -> None:
    """It begins with the daemon, so a core makes of it what was sent while inputs came. It holds what the kernel let
    in, at the kernel's stamps: no frame that is not mapped."""
    e = recorded("axles")
    (file,) = RECORDED.glob("axles/*-asked.log")
    noted = [f for f, _ in read_log(file, Damage())]
    known = {(f.stamp_us, f.can_id, f.data) for f in e.frames}
    inputs = [f for f in noted if not e.is_own(f)]
    assert {(f.stamp_us, f.can_id, f.data) for f in inputs} <= known
    assert len(inputs) == len(e.inputs)
    assert SIM_TRUTH_A1 in {f.can_id for f in e.frames} - {f.can_id for f in noted}
    slots = [f.stamp_us // 20_000 for f in inputs if f.can_id == YAW_RATE_A1]
    sent = {s: f.data for s, f in e.sent if s[0] in ADHESION.values() and slots[0] + 2 <= s[1] <= slots[-1] - 2}
    assert len(sent) > 100
    made = Replayed(e, noted).data
    assert {slot: data.hex() for slot, data in sent.items() if made.get(slot) != data} == {}
    of_dump = {(f.can_id, e.slot_of(f)): f.data for f in noted if f.can_id in ADHESION.values()}
    assert of_dump.items() <= {s[:2]: f.data for s, f in e.sent}.items()


def test_garbage_is_refused_in_the_middle_of_a_flood() -> None:
    """Of each kind."""
    e = recorded("flood")
    sensors = sum(map(len, map(played, PLAYED["flood"])))
    print(f"{len(e.frames)} frames on the bus, {sensors} of sensors")
    assert len(e.frames) > 3 * sensors
    for reason in ("kind", "length", "crc"):
        assert re.search(rf"rejected: .*\d {reason}", e.said.splitlines()[-1])
