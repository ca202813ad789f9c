"""The contract: names, ids, lengths, cycles, layout. Others test against these."""

from pathlib import Path
from typing import get_args

import cantools
import pytest
from cantools.database.can import Database

from tests.support.dbc import told
from wrcd.bus.dbc import attribute, timeout_ms
from wrcd.bus.link import LinkState
from wrcd.bus.reasons import Reason
from wrcd.core.causes import Cause, Validity
from wrcd.core.counts import State
from wrcd.core.terms import MAX_AXLES

ROOT = Path(__file__).parents[3]
MESSAGES = {
    "Adhesion_A{a}": (0x090, "WRCD", 20, 60, 8),
    "AdhesionDetail_A{a}": (0x0A0, "WRCD", 100, 300, 8),
    "InputHealth_A{a}": (0x0A8, "WRCD", 100, 300, 8),
    "AdhesionOwn_A{a}": (0x0D0, "WRCD", 100, 300, 8),
    "YawRate_A{a}": (0x100, "IMU", 5, 15, 5),
    "LatAccel_A{a}": (0x110, "IMU", 5, 15, 5),
    "Torque_A{a}": (0x120, "TCU", 10, 30, 5),
}
SINGLE = {
    "WrcdStatus": (0x0B0, "WRCD", 1000, 3000, 8),
    "WrcdRejects": (0x0B1, "WRCD", 1000, 3000, 8),
    "WrcdLink": (0x0B2, "WRCD", 1000, 3000, 8),
    "VehicleSpeed": (0x130, "TCU", 20, 60, 4),
}
AXLES = range(1, MAX_AXLES + 1)
# 0x0B0 is WrcdStatus: the eighth InputHealth takes the first place of its block
EVERY = {n.format(a=a): (i + a, *rest) for n, (i, *rest) in MESSAGES.items() for a in AXLES} | SINGLE
EVERY["InputHealth_A8"] = (0x0A0, *EVERY["InputHealth_A8"][1:])
# start, length, signed, scale, unit
SIGNALS = {
    "YawRate_A1": {"Status": (12, 4, False, 1, None), "YawRate": (16, 24, True, 1e-6, "rad/s")},
    "LatAccel_A1": {"Status": (12, 4, False, 1, None), "LatAccel": (16, 24, True, 1e-5, "m/s^2")},
    "Torque_A1": {"Status": (12, 4, False, 1, None), "Torque": (16, 24, True, 0.01, "N*m")},
    "VehicleSpeed": {"Status": (12, 4, False, 1, None), "Speed": (16, 16, False, 0.0025, "m/s")},
    "Adhesion_A4": {
        "Validity": (12, 4, False, 1, None),
        "MuAvailable": (16, 16, False, 0.01, "%"),
        "MuUsed": (32, 16, False, 0.01, "%"),
        "SampleAge": (48, 8, False, 1, "ms"),
        "Surface": (56, 3, False, 1, None),
        "ContactState": (59, 2, False, 1, None),
        "Confidence": (61, 3, False, 1, None),
    },
    "AdhesionOwn_A4": {
        "AxlesFused": (12, 4, False, 1, None),
        "MuAvailableOwn": (16, 16, False, 0.01, "%"),
        "HalfWidthOwn": (32, 10, False, 0.1, "%"),
        "MuUsedMost": (42, 14, False, 0.01, "%"),
        "MuUsedMostAxle": (56, 4, False, 1, None),
    },
}


def load(name: str) -> Database:
    database = cantools.database.load_file(ROOT / "dbc" / name, strict=True)
    assert isinstance(database, Database)
    return database


@pytest.fixture(scope="module")
def production() -> Database:
    return load("wrcd.dbc")


def test_messages_have_id_sender_cycle_timeout_and_length(production: Database) -> None:
    found = {
        m.name: (m.frame_id, m.senders[0], m.cycle_time, timeout_ms(m, m.signals[0]), m.length)
        for m in production.messages
    }
    assert found == {n: tuple(v) for n, v in EVERY.items()}


@pytest.mark.parametrize("name", SIGNALS)
def test_signals_have_position_scale_and_unit(production: Database, name: str) -> None:
    signals = {
        s.name: (s.start, s.length, s.is_signed, s.scale, s.unit)
        for s in production.get_message_by_name(name).signals
        if s.name not in ("Crc", "Counter")
    }
    assert signals == SIGNALS[name]


def test_ids_of_ended_messages_are_not_used_again(production: Database) -> None:
    ended = {0x0B3, *range(0x0C1, 0x0C9)}
    messages = [*production.messages, *load("sim_ecu.dbc").messages]
    assert ended.isdisjoint(m.frame_id for m in messages)
    assert ended.isdisjoint(attribute(m, "E2EDataId") for m in messages)


def test_no_two_messages_share_an_id_or_a_data_id(production: Database) -> None:
    messages = [*production.messages, *load("sim_ecu.dbc").messages]
    assert len({m.frame_id for m in messages}) == len({m.name for m in messages}) == len(messages)
    assert len({attribute(m, "E2EDataId") for m in messages}) == len(messages)


@pytest.mark.parametrize(
    "name", [*MESSAGES, *(f"{own}_A{{a}}" for own in ("Demand", "WheelSpeed", "BrakePressure", "SimTruth"))]
)
def test_every_axle_has_the_same_messages(production: Database, name: str) -> None:
    """Down to comments, value tables and attributes; only ids and numbers differ."""

    def said(axle: int) -> str:
        database = production if name in MESSAGES else load("sim_ecu.dbc")
        m = database.get_message_by_name(name.format(a=axle))
        text = repr(told(m)).replace(f"wheelset {axle}", "wheelset 1").replace(name.format(a=axle), name)
        return text.replace(f"'{name}', 0x{m.frame_id:x}", "ID").replace(f"'E2EDataId': {m.frame_id}", "ID")

    assert said(1).count("ID") == 2
    assert {said(a) for a in AXLES} == {said(1)}


@pytest.mark.parametrize("file", ["wrcd.dbc", "sim_ecu.dbc"])
def test_every_message_has_e2e_and_every_signal_a_comment(file: str) -> None:
    for m in load(file).messages:
        assert m.dbc is not None
        attributes = {k: v.value for k, v in m.dbc.attributes.items()}
        assert attributes["E2EProfile"] == "P11"
        assert attributes["E2EDataId"] == m.frame_id
        assert attributes["VFrameFormat"] == 0
        assert attributes["GenMsgCycleTime"] == m.cycle_time
        crc, counter = m.get_signal_by_name("Crc"), m.get_signal_by_name("Counter")
        assert (crc.start, crc.length, counter.start, counter.length, counter.maximum) == (0, 8, 8, 4, 14)
        assert m.comment
        for s in m.signals:
            assert s.byte_order == "little_endian"
            assert s.comment
            assert s.minimum is not None
            assert s.maximum is not None
            assert s.minimum < s.maximum
            assert s.dbc is not None
            assert "GenSigStartValue" in s.dbc.attributes


def test_value_tables_have_their_labels(production: Database) -> None:
    m = production.get_message_by_name("Adhesion_A2")
    tables = {s.name: {int(k): str(v) for k, v in s.choices.items()} for s in m.signals if s.choices}
    assert tables["Validity"] == {0: "NotAvailable", 1: "Valid", 2: "Degraded"}
    assert tables["Surface"] == {0: "Unknown", 1: "Dry", 2: "Wet", 3: "Reduced", 4: "Low", 5: "VeryLow"}
    assert tables["ContactState"] == {0: "Unknown", 1: "Adhering", 2: "Saturated"}
    assert tables["MuAvailable"] == {0xFFFF: "NotAvailable", 0xFFFE: "Error"}
    assert len(tables["Confidence"]) == 8
    status = production.get_message_by_name("Torque_A3").get_signal_by_name("Status").choices
    assert {int(k): str(v) for k, v in (status or {}).items()} == {
        0: "Ok",
        1: "Degraded",
        14: "Error",
        15: "NotAvailable",
    }


def words(production: Database, message: str, signal: str) -> set[str]:
    return {
        str(word)
        for word in (production.get_message_by_name(message).get_signal_by_name(signal).choices or {}).values()
    }


def test_labels_are_those_that_the_code_sends(production: Database) -> None:
    """Each of these words is one that the daemon uses, and it uses no other."""
    assert words(production, "Adhesion_A3", "Validity") == {v.value for v in Validity}
    assert words(production, "WrcdStatus", "State") == set(get_args(State))
    assert words(production, "WrcdLink", "LinkState") == set(get_args(LinkState))


# What is in the rig's DBC for each wheelset: its base id. Controllers of the closed loop send and hear the first three
RIGS_OWN = {"Demand": 0x140, "WheelSpeed": 0x150, "BrakePressure": 0x160, "SimTruth": 0x7A0}


def test_truth_is_in_the_rigs_dbc_only(production: Database) -> None:
    truth = load("sim_ecu.dbc")
    assert {m.name: m.frame_id for m in truth.messages} == {
        f"{name}_A{a}": base + a for name, base in RIGS_OWN.items() for a in AXLES
    } | {"DriverDemand": 0x131}
    slip = truth.get_message_by_name("SimTruth_A1").get_signal_by_name("Slip")
    assert (slip.start, slip.length, slip.is_signed, slip.scale) == (48, 16, True, 1e-5)
    assert not {m.name for m in truth.messages} & {m.name for m in production.messages}


def test_the_loops_messages_have_their_layout_and_time_outs() -> None:
    rig = load("sim_ecu.dbc")
    layout = {
        "Demand_A8": (6, 10, {"Torque": (16, 24, True, 0.01), "Valve": (40, 2, False, 1)}),
        "WheelSpeed_A8": (5, 10, {"WheelSpeed": (16, 24, True, 1e-4)}),
        "BrakePressure_A8": (4, 20, {"Pressure": (16, 16, False, 1e-3)}),
        "DriverDemand": (5, 20, {"Mode": (16, 2, False, 1), "Share": (24, 16, False, 1e-4)}),
    }
    for name, (length, cycle_ms, signals) in layout.items():
        m = rig.get_message_by_name(name)
        assert (m.length, m.cycle_time) == (length, cycle_ms)
        own = {s.name: s for s in m.signals if s.name not in ("Crc", "Counter", "Status")}
        assert {n: (s.start, s.length, s.is_signed, s.scale) for n, s in own.items()} == signals
        for s in m.signals:
            assert s.dbc is not None
            assert s.dbc.attributes["GenSigTimeoutTime"].value == 3 * cycle_ms
    demand, driver = rig.get_message_by_name("Demand_A1"), rig.get_message_by_name("DriverDemand")
    assert dict(demand.get_signal_by_name("Valve").choices or {}) == {0: "Fill", 1: "Hold", 2: "Vent"}
    assert dict(driver.get_signal_by_name("Mode").choices or {}) == {0: "Coast", 1: "Traction", 2: "Brake"}


def test_every_cause_has_a_label_and_residuals_keep_their_range(production: Database) -> None:
    for a in AXLES:
        m = production.get_message_by_name(f"AdhesionDetail_A{a}")
        cause = m.get_signal_by_name("Cause")
        labels = {int(c): c.label for c in Cause}
        assert {int(k): str(v) for k, v in (cause.choices or {}).items()} == labels
        assert max(labels) < 31 < 1 << cause.length  # 31 had a meaning in earlier versions
        for k in range(1, 5):
            s = m.get_signal_by_name(f"Residual{k}")
            assert (s.length, s.scale, s.minimum, s.maximum) == (8, 0.4, -70, 31.6)
            assert {int(n): str(v) for n, v in (s.choices or {}).items()} == {255: "NotAvailable"}


def test_every_reason_has_a_label_and_a_counter(production: Database) -> None:
    labels = ["None", *(r.label for r in Reason)]
    for message, signal in (("WrcdStatus", "LastReason"), ("InputHealth_A3", "RefusedTorque")):
        choices = production.get_message_by_name(message).get_signal_by_name(signal).choices
        assert choices is not None
        assert [str(choices[i]) for i in range(len(choices))] == labels
    names = {s.name for s in production.get_message_by_name("WrcdRejects").signals}
    assert names == {"Crc", "Counter", "ForeignFrames", *(f"Rejected{r.label}" for r in Reason)}
