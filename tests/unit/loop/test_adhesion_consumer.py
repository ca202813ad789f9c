"""The careful receiver of UsableAdhesion, rule by rule of docs/reference/what-a-controller-does.md."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from sim_ecu.loop.control.adhesion_consumer import (
    DROPS_WITHIN_US,
    MAX_AGE_MS,
    MAX_DROPPED,
    AdhesionReceiver,
    Facts,
    UsableAdhesion,
    receiver,
)
from sim_ecu.loop.control.slip_controller import make_controller
from sim_ecu.physics.actuators import Actuators
from sim_ecu.physics.wheelset import Wheelset
from tests.support.daemon_frames import GOOD, NOTHING, START_US, DaemonFrames
from wrcd.bus.dbc import find_message, load_dbc
from wrcd.bus.frame import Frame
from wrcd.bus.signals import Output, OutputSignal
from wrcd.bus.writers import Value, Writer
from wrcd.config.config import load_packaged
from wrcd.core.configuration import Config
from wrcd.errors import InputError

CYCLE_US, TIMEOUT_US = 20_000, 60_000
OWN_DBC = """VERSION ""

BS_:

BU_: WRCD TCU

BO_ 2566127873 WSP_Adhesion1: 7 WRCD
 SG_ Check : 0|8@1+ (1,0) [0|255] "" TCU
 SG_ Alive : 8|4@1+ (1,0) [0|14] "" TCU
 SG_ State : 12|2@1+ (1,0) [0|3] "" TCU
 SG_ Friction : 16|10@1+ (0.001,0) [0|1] "" TCU
 SG_ Trust : 28|3@1+ (1,0) [0|7] "" TCU
 SG_ Age : 32|8@1+ (1,0) [0|255] "ms" TCU

VAL_ 2566127873 State 0 "None" 1 "Good" 2 "Poor" 3 "Err" ;
"""
CONFIG = load_packaged(1)
GOOD_ONE = UsableAdhesion(0.3, 0.03, False)


def careful(config: Config = CONFIG) -> AdhesionReceiver:
    return receiver(config, config.axles[0])


def frames(
    count: int, begin_us: int = 0, values: dict[str, Value] | None = None, config: Config = CONFIG
) -> list[Frame]:
    made = DaemonFrames(config)
    return [made.adhesion(begin_us + k * CYCLE_US, values or GOOD) for k in range(count)]


def hear(r: AdhesionReceiver, heard: Sequence[Frame], late_us: int = 0) -> list[bool]:
    return [r.hear(f.can_id, f.data, f.stamp_us - START_US + late_us) for f in heard]


@pytest.mark.parametrize(
    ("changed", "used"),
    [
        ({}, GOOD_ONE),
        ({"ContactState": "Saturated"}, UsableAdhesion(0.3, 0.03, True)),
        ({"ContactState": "Unknown"}, None),
        ({"Surface": "Unknown"}, None),
        ({"MuAvailable": 0.0}, UsableAdhesion(0.0, 0.03, False)),
        ({"Confidence": "Within1pp"}, UsableAdhesion(0.3, 0.01, False)),
        ({"Confidence": "Within12pp"}, UsableAdhesion(0.3, 0.12, False)),
        ({"Confidence": "Wider"}, UsableAdhesion(0.3, None, False)),
        ({"Confidence": "None"}, None),
        ({"Validity": "Degraded"}, None),
        ({"Validity": "NotAvailable"}, None),
        ({"MuAvailable": None}, None),
        ({"SampleAge": MAX_AGE_MS}, GOOD_ONE),
        ({"SampleAge": MAX_AGE_MS + 1.0}, None),
        ({"SampleAge": 255.0}, None),
        (NOTHING, None),
    ],
)
def test_frame_is_used_only_where_every_field_allows_it(changed: dict[str, Value], used: UsableAdhesion | None) -> None:
    r = careful()
    assert hear(r, frames(1, values=GOOD | changed)) == [True]
    assert r.adhesion(0) == used


def test_raw_values_that_no_daemon_sends_are_not_used() -> None:
    output = CONFIG.axles[0].adhesion
    writer = Writer(find_message(CONFIG.database, output.message), output)
    raw = {"Validity": 1, "MuAvailable": 3000, "SampleAge": 5, "Surface": 1, "ContactState": 1, "Confidence": 3}
    cases: list[tuple[dict[str, int], bool]] = [
        ({}, True), ({"Validity": 3}, False), ({"MuAvailable": 65534}, False), ({"MuAvailable": 10001}, False),
    ]  # fmt: skip
    for k, (changed, is_used) in enumerate(cases):
        r, frame = careful(), writer.raw_frame(START_US, k, raw | changed)
        assert r.hear(frame.can_id, frame.data, 0)
        assert (r.adhesion(0) is not None) is is_used, changed


def test_frame_holds_until_its_time_out_and_the_first_good_one_after_it_counts_again() -> None:
    r = careful()
    first, *_, later = frames(10)
    assert r.adhesion(0) is None
    hear(r, [first])
    assert r.adhesion(TIMEOUT_US) == GOOD_ONE
    assert r.adhesion(TIMEOUT_US + 1) is None
    assert hear(r, [later]) == [True]  # whatever its counter: a new sequence
    assert r.adhesion(9 * CYCLE_US) == GOOD_ONE


@pytest.mark.parametrize(("missing", "is_taken"), [(0, True), (1, True), (2, True), (3, False), (7, False)])
def test_counter_may_jump_over_two_slots(missing: int, is_taken: bool) -> None:
    r = careful()
    every = frames(missing + 3)
    hear(r, every[:1])
    early_us = START_US + 1 - every[missing + 1].stamp_us  # within the time-out
    assert hear(r, [every[missing + 1]], early_us) == [is_taken]
    assert hear(r, [every[missing + 2]], early_us) == [True]  # it continues what was dropped
    assert r.rejected["counter"] == (not is_taken)


@pytest.mark.parametrize(("apart_us", "is_taken"), [(100, False), (CYCLE_US // 2 - 1, False), (CYCLE_US // 2, True)])
def test_old_frames_that_come_at_once_are_no_sender_that_starts_anew(apart_us: int, is_taken: bool) -> None:
    r = careful()
    every = frames(9)
    hear(r, every[:1])
    first, second = every[6:8]
    assert not r.hear(first.can_id, first.data, 1000)
    assert r.hear(second.can_id, second.data, 1000 + apart_us) is is_taken
    assert r.rejected["counter"] == 2 - is_taken
    assert r.hear(second.can_id, every[8].data, 1000 + apart_us + CYCLE_US)


def test_bad_frames_are_dropped_counted_and_leave_the_last_good_one() -> None:
    r = careful()
    first, second = frames(2)
    other = frames(1, values=GOOD | {"MuAvailable": 5.0})[0]
    beyond = bytearray(second.data)
    hear(r, [first])
    for data in (first.data, bytes((second.data[0] ^ 1, *second.data[1:])), second.data[:-1], second.data + b"\0"):
        assert not r.hear(first.can_id, data, CYCLE_US)
    assert (r.rejected["repeated"], r.rejected["CRC"], r.rejected["length"]) == (1, 1, 2)
    assert not r.hear(first.can_id + 1, other.data, CYCLE_US)  # not this message: not even counted
    assert sum((r.rejected["repeated"], r.rejected["CRC"], r.rejected["length"], r.rejected["counter"])) == 4
    beyond[1] |= 0x0F
    assert not r.hear(first.can_id, bytes(beyond), CYCLE_US)


def test_more_than_a_few_dropped_frames_in_a_second_end_the_use() -> None:
    r = careful()
    bad = bytes(8)
    for k, f in enumerate(frames(MAX_DROPPED + 1)):  # five are borne, the sixth is not
        assert r.adhesion(k * CYCLE_US) == (GOOD_ONE if k else None)
        hear(r, [f])
        r.hear(f.can_id, bad, k * CYCLE_US + 1000)
    assert r.rejected["CRC"] == MAX_DROPPED + 1
    assert r.adhesion(MAX_DROPPED * CYCLE_US + 1000) is None
    again_us = DROPS_WITHIN_US + CYCLE_US
    hear(r, frames(1, again_us))
    assert r.adhesion(again_us) == GOOD_ONE


def own_config(folder: Path) -> Config:
    """The packaged configuration, but that it sends an adhesion message of a train's own DBC, with an id of 29 bits."""
    levels = ("None", "Within1pp", "Within2pp", "Within3pp", "Within5pp", "Within8pp", "Within12pp", "Wider")
    signals = {
        "Validity": OutputSignal("State", words={"NotAvailable": 0, "Valid": 1, "Degraded": 2, "Error": 3}),
        "MuAvailable": OutputSignal("Friction", factor=0.01, not_available=1023),
        "Confidence": OutputSignal("Trust", words={name: 7 - k for k, name in enumerate(levels)}),
        "SampleAge": OutputSignal("Age"),
    }
    file = folder / "own.dbc"
    file.write_text(OWN_DBC)
    adhesion = Output("WSP_Adhesion1", 50_000, 0x1234, signals)
    return replace(CONFIG, database=load_dbc(file), axles=(replace(CONFIG.axles[0], adhesion=adhesion),))


def test_own_names_words_and_units_are_read(tmp_path: Path) -> None:
    own = own_config(tmp_path)
    r = careful(own)
    assert r.unusable is None
    (f,) = frames(1, values=GOOD | {"MuAvailable": 12.0, "Confidence": "Within3pp"}, config=own)
    assert r.hear(f.can_id, f.data, 0)
    said = r.adhesion(0)
    assert said is not None
    assert (round(said.mu, 6), said.half_width, said.saturated) == (0.12, 0.03, False)
    assert r.adhesion(150_000) == said  # three cycles of 50 ms
    assert r.adhesion(150_001) is None


@pytest.mark.parametrize("lacks", ["E2E", "Validity", "MuAvailable", "Confidence"])
def test_message_without_what_a_controller_needs_is_never_used(lacks: str) -> None:
    axle = CONFIG.axles[0]
    signals = {ours: s for ours, s in axle.adhesion.signals.items() if ours != lacks}
    output = replace(axle.adhesion, signals=signals, data_id=None if lacks == "E2E" else axle.adhesion.data_id)
    poor = replace(CONFIG, axles=(replace(axle, adhesion=output),))
    r = careful(poor)
    assert lacks in str(r.unusable)
    hear(r, frames(2))
    assert r.adhesion(CYCLE_US) is None
    with pytest.raises(InputError, match=lacks):
        make_controller("thresholds", Facts((1,), Wheelset(), Actuators()), poor)
