"""A third party's train against ours: the same sensors give the same adhesion, within what its fields resolve."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cantools
import pytest
from cantools.database.can import Database

from tests.support.sensor_simulator import START_US
from tests.support.signals import measured
from wrcd.bus.candump import format_line
from wrcd.bus.frame import Frame
from wrcd.cli.main import main
from wrcd.config.config import load_config, load_packaged
from wrcd.core.configuration import Config
from wrcd.core.core import Core
from wrcd.core.reports import Outgoing

FOLDER = Path(__file__).parents[2] / "data/dbc"
OURS = Path(__file__).parents[3] / "dbc/wrcd.dbc"
TICKS = 1200
TORQUE_NM, SPEED_M_S = 10_000.0, 25.0
SECOND = measured(curve="C", torque_Nm=7_000.0, seed=2)
# of the sensors; theirs are coarser
RESOLUTION_PP = 0.2


def database(path: Path) -> Database:
    found = cantools.database.load_file(path, encoding="cp1252")
    assert isinstance(found, Database)
    return found


def packed(dbc: Database, name: str, stamp_us: int, values: dict[str, Any]) -> Frame:
    """By cantools."""
    m = dbc.get_message_by_name(name)
    data = m.encode({s.name: 0 for s in m.signals} | values, strict=False)
    return Frame(stamp_us, m.frame_id, data, extended=m.is_extended_frame, fd=m.is_fd)


def theirs() -> Iterator[Frame]:
    """Both wheelsets' frames, tick by tick; what they leave out of their file is in their sheets."""
    dbc, deg = database(FOLDER / "third-party.dbc"), 180 / math.pi
    well = {"Zustand": "Messbetrieb"}
    for k in range(TICKS):
        t = START_US + 5_000 * k + 1_000
        (yaw, lat), (yaw2, lat2) = measured()[k], SECOND[k]
        yield packed(dbc, "RS1_Sensorik", t, {"Drehrate": yaw * deg, "Querbeschl": lat / 9.80665, **well})
        yield packed(dbc, "RS2_Gyro", t + 100, {"Drehrate": yaw2 * deg, **well})
        yield packed(dbc, "RS2_Beschl", t + 200, {"Querbeschl": -lat2, **well})
        # the standard id of the same number, from somebody else
        yield packed(dbc, "Klima_Ist", t + 300, {"T_Innen": 21.0, "Zustand": "Fehler"})
        if k % 2 == 0:
            torques = {"M_Radsatz1": TORQUE_NM / 1000, "M_Radsatz2": 7.0, "Zustand": "OK"}
            yield packed(dbc, "ASG_Moment", t + 400, torques)
        if k % 4 == 0:
            yield packed(dbc, "ZSG_Fahrt", t + 500, {"v_Ist": SPEED_M_S * 3.6, "v_Soll": 90})


def ours() -> Iterator[Frame]:
    """The same by our file, and by autosar-e2e."""
    import e2e.p11

    dbc = database(OURS)

    def protected(name: str, stamp_us: int, counter: int, values: dict[str, Any]) -> Frame:
        frame = packed(dbc, name, stamp_us, {"Counter": counter % 15, "Status": "Ok"} | values)
        data = bytearray(frame.data)
        e2e.p11.e2e_p11_protect(data, frame.can_id, increment_counter=False)
        frame.data = bytes(data)
        return frame

    for k in range(TICKS):
        t = START_US + 5_000 * k + 1_000
        for a, (yaw, lat), torque in ((1, measured()[k], TORQUE_NM), (2, SECOND[k], 7_000.0)):
            yield protected(f"YawRate_A{a}", t, k, {"YawRate": yaw})
            yield protected(f"LatAccel_A{a}", t + 200, k, {"LatAccel": lat})
            if k % 2 == 0:
                yield protected(f"Torque_A{a}", t + 400, k // 2, {"Torque": torque})
        if k % 4 == 0:
            yield protected("VehicleSpeed", t + 500, k // 4, {"Speed": SPEED_M_S})


@pytest.fixture(scope="module")
def third_party() -> Config:
    return load_config(FOLDER / "third-party.toml")


def sent(config: Config, frames: Iterator[Frame]) -> tuple[Core, list[Outgoing]]:
    core = Core(config)
    return core, [o for f in frames for o in core.feed(f)]


def test_third_partys_train_gives_our_adhesion(third_party: Config) -> None:
    core, out = sent(third_party, theirs())
    reference, usual = sent(load_packaged(2), ours())
    assert core.counts.rejected == reference.counts.rejected == {}
    dbc, known = database(FOLDER / "third-party.dbc"), database(OURS)
    for axle, cycle_us in ((1, 20_000), (2, 50_000)):
        message = dbc.get_message_by_name(f"WSP_Adhesion{axle}")
        expected = known.get_message_by_name(f"Adhesion_A{axle}")
        frames = [o for o in out if o.frame.can_id == message.frame_id]
        assert {o.cycle_us for o in frames} == {cycle_us}
        assert all(o.frame.extended for o in frames)
        valid: Any = {
            o.frame.stamp_us: expected.decode(o.frame.data) for o in usual if o.frame.can_id == expected.frame_id
        }
        compared = 0
        for o in frames:
            got: Any = message.decode(o.frame.data)
            want = valid.get(o.frame.stamp_us)
            if want is None or str(want["Validity"]) != "Valid":
                continue
            compared += 1
            assert str(got["State"]) == "Good"
            assert -0.5 - RESOLUTION_PP <= float(got["Friction"]) - float(want["MuAvailable"]) <= RESOLUTION_PP
        assert compared > 2_000_000 / cycle_us


def test_replay_of_a_third_partys_log_is_in_our_words(third_party: Config, tmp_path: Path) -> None:
    log, table = tmp_path / "train.log", tmp_path / "out.csv"
    log.write_text("".join(format_line(f, "can0") + "\n" for f in theirs()))
    config = str(FOLDER / "third-party.toml")
    assert main(["replay", str(log), "--config", config, "--csv", str(table)]) == 0
    header, *rows = (line.split(",") for line in table.read_text().splitlines())
    for axle in ("1", "2"):
        of_axle = [dict(zip(header, row, strict=True)) for row in rows if row[1] == axle]
        assert {row["validity"] for row in of_axle} == {"NotAvailable", "Valid"}
        first, last = of_axle[0], of_axle[-1]
        assert (first["mu_available_pct"], first["confidence"]) == ("", "None")
        assert last["confidence"].startswith(("Within", "Wider"))
        assert 5 < float(last["mu_available_pct"]) < 60


def test_fault_of_one_sensor_ends_valid_of_its_axle_alone(third_party: Config) -> None:
    dbc = database(FOLDER / "third-party.dbc")
    gyro = dbc.get_message_by_name("RS2_Gyro").frame_id
    core = Core(third_party)
    for k, f in enumerate(theirs()):
        if k > 4000 and f.can_id == gyro:
            f.data = f.data[:3] + b"\xe0" + f.data[4:]
        core.feed(f)
    assert core.counts.rejected_by_message.keys() == {("RS2_Gyro", "status")}
    assert [r.validity.value for r in core.reports] == ["Valid", "NotAvailable"]
