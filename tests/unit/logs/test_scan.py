"""Frames of a log by message, inputs in SI units, and statistics of the bus."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim_ecu.resources import TRUTH_DBC
from tests.support.story import BEGIN_US, Ride
from wrcd.bus.candump import format_line
from wrcd.bus.dbc import find_message, load_dbc
from wrcd.bus.e2e import protect
from wrcd.bus.frame import EXTENDED, Frame
from wrcd.bus.positions import message_key
from wrcd.bus.units import Quantity
from wrcd.core.configuration import Config
from wrcd.core.reading import Receiver
from wrcd.errors import InputError
from wrcd.logs.damage import Damage
from wrcd.logs.decoder import OwnFrames
from wrcd.logs.mapped_inputs import MappedInputs, distance
from wrcd.logs.reader import read_log
from wrcd.logs.scan import NO_FRAMES, Frames, Gathering, good_frames, scan
from wrcd.logs.statistics import bits, bus
from wrcd.logs.story_records import Series, newest_values
from wrcd.logs.truth import truth, truths

YAW_RATE, SPEED = 0x101, 0x130


def written(path: Path, *frames: Frame) -> Path:
    path.write_text("".join(f"{format_line(f, 'can0')}\n" for f in frames))
    return path


def test_scan_holds_what_reading_frame_by_frame_gives(ride: Ride) -> None:
    expected: dict[int, list[Frame]] = {}
    for frame, _ in read_log(ride.both, Damage()):
        expected.setdefault(frame.key, []).append(frame)
    found = scan(ride.both, None)
    assert set(found.frames) == set(expected)
    for key, frames in expected.items():
        columns = found.of(key)
        assert columns.time_us.tolist() == [f.stamp_us for f in frames]
        assert [d[:n].tobytes() for d, n in zip(columns.data, columns.lengths, strict=True)] == [f.data for f in frames]


def test_error_remote_and_fd_frames_have_their_places(tmp_path: Path) -> None:
    frames = [
        Frame(BEGIN_US, 0x10, b"", error=True), Frame(BEGIN_US + 1, 0x20, b"", remote=True),
        Frame(BEGIN_US + 2, 0x30, bytes(range(12)), fd=True), Frame(BEGIN_US + 3, 0x30, b"\x07"),
        Frame(BEGIN_US + 4, 0x30, b"\x08", extended=True),
    ]  # fmt: skip
    found = scan(written(tmp_path / "odd.log", *frames), None)
    assert (found.errors_us, found.remote) == ([BEGIN_US], 1)
    assert set(found.frames) == {0x30, 0x30 | EXTENDED}
    assert found.of(0x30).lengths.tolist() == [12, 1]
    assert found.of(0x30).data[0].tolist() == list(range(12))
    assert found.of(0x30).data[1].tolist() == [7] + [0] * 11


def test_stamps_that_step_back_are_sorted_by_message() -> None:
    gathering = Gathering()
    for stamp in (3_000, 1_000, 2_000):
        gathering.put((Frame(stamp, 0x10, bytes([stamp // 1000])), "can0"))
    found = gathering.done(Path("a.log"))
    assert found.of(0x10).data[:, 0].tolist() == [1, 2, 3]
    assert (found.begin_us, found.end_us) == (1_000, 3_000)


def test_crc_and_length_are_checked_for_all_frames_at_once() -> None:
    good = [protect(bytes([0, 0, k, 7, 9]), 0x101, k % 15) for k in range(40)]
    data = np.array([list(d) + [0] * 3 for d in good], np.uint8)
    lengths = np.full(40, 5, np.uint8)
    data[3, 2] ^= 1
    lengths[5] = 4
    frames = Frames(np.arange(40, dtype=np.int64), lengths, data)
    assert good_frames(frames, 5, 0x101).time_us.tolist() == [k for k in range(40) if k not in (3, 5)]
    assert good_frames(frames, 5, None).time_us.tolist() == [k for k in range(40) if k != 5]
    assert not len(good_frames(frames, 5, 0x102))
    assert not len(good_frames(NO_FRAMES, 12, 0x101))


def test_wrong_frames_of_wrcd_are_left_out_and_counted(ride: Ride, config: Config) -> None:
    found = scan(ride.both, None)
    key = message_key(find_message(config.database, "Adhesion_A1"))
    found.frames[key].data.flags.writeable = True
    found.frames[key].data[7, 4] ^= 0x10
    own = OwnFrames(config)
    a = own.adhesion(found, 1)
    assert a is not None
    assert len(a.time_us) == len(found.of(key)) - 1
    assert own.wrong[key] == 1


def test_inputs_are_those_that_a_reader_gives_one_by_one(ride: Ride, config: Config) -> None:
    found, inputs = scan(ride.both, None), MappedInputs(config)
    receiver = Receiver(config.database, [i.source for i in config.inputs], config.data_ids)
    speed, torque = inputs.speed(found), inputs.torque(found, 0)
    assert speed is not None
    assert torque is not None
    values: dict[Quantity, list[float]] = {Quantity.SPEED: [], Quantity.TORQUE: []}
    for frame, _ in read_log(ride.both, Damage()):
        samples = receiver.read(frame)
        for s in samples if isinstance(samples, list) else ():
            values.setdefault(config.inputs[s.source].source.quantity, []).append(s.value)
    np.testing.assert_allclose(speed.values["speed_m_s"], values[Quantity.SPEED])
    np.testing.assert_allclose(torque.values["torque_Nm"], values[Quantity.TORQUE])


def test_values_beyond_their_range_or_of_a_bad_status_are_nan(config: Config, tmp_path: Path) -> None:
    def speed_frame(k: int, status: int, raw: int) -> Frame:
        m = find_message(config.database, "VehicleSpeed")
        body = bytes([0, status << 4, raw & 0xFF, raw >> 8]).ljust(m.length, b"\0")
        return Frame(BEGIN_US + 20_000 * k, SPEED, protect(body, SPEED, k % 15))

    log = written(tmp_path / "speed.log", speed_frame(0, 0, 4000), speed_frame(1, 14, 4000), speed_frame(2, 1, 8000))
    speed = MappedInputs(config).speed(scan(log, None))
    assert speed is not None
    np.testing.assert_allclose(speed.values["speed_m_s"], [10.0, np.nan, 20.0])


def test_torque_is_the_sum_of_its_parts(ride: Ride, config: Config) -> None:
    (one,) = [i for i in config.inputs if i.source.quantity is Quantity.TORQUE and i.source.axles == (0,)]
    found = scan(ride.both, None)
    doubled = replace(config, inputs=(*config.inputs, replace(one, source=replace(one.source, part=1))))
    single, both = MappedInputs(config).torque(found, 0), MappedInputs(doubled).torque(found, 0)
    assert single is not None
    assert both is not None
    np.testing.assert_allclose(both.values["torque_Nm"], 2 * single.values["torque_Nm"])


def test_distance_is_the_speed_summed_up_and_stands_still_in_long_gaps() -> None:
    t = np.array([0, 1, 2, 10, 11], np.int64) * 1_000_000
    made = distance(Series(t, {"speed_m_s": np.array([10.0, 10.0, 10.0, 10.0, -10.0])}))
    assert made is not None
    np.testing.assert_allclose(made.values["distance_m"], [0, 10, 20, 30, 40])
    assert distance(None) is None


def test_constant_speed_of_the_configuration_holds_all_along(ride: Ride, config: Config) -> None:
    constant = replace(
        config, constant_speed_m_s=25.0,
        inputs=tuple(i for i in config.inputs if i.source.quantity is not Quantity.SPEED),
    )  # fmt: skip
    found = scan(ride.log, None)
    speed = MappedInputs(constant).speed(found)
    assert speed is not None
    assert speed.time_us.tolist() == [found.begin_us, found.end_us]
    made = distance(speed)
    assert made is not None
    assert made.values["distance_m"][-1] == pytest.approx(25.0 * (found.end_us - found.begin_us) * 1e-6)


def test_statistics_tell_rates_gaps_roles_and_wrong_frames(ride: Ride) -> None:
    by_name = {m.name: m for m in ride.sent.bus.messages}
    yaw = by_name["YawRate_A1"]
    assert (yaw.role, yaw.cycle_ms, yaw.wrong_e2e) == ("input", 5.0, 0)
    assert yaw.mean_hz == pytest.approx(200, rel=0.01)
    assert yaw.longest_gap_ms == pytest.approx(5.0, abs=0.5)
    assert by_name["Adhesion_A1"].role == "output"
    assert by_name["SimTruth_A1"].role == "truth"
    assert sum(m.frames for m in ride.sent.bus.messages) == len(ride.both.read_text().splitlines())


def test_load_is_the_frames_bits_over_the_bit_rate(ride: Ride, config: Config) -> None:
    found = scan(ride.both, None)
    b = bus(found, config, (), frozenset(), frozenset(), {})
    first = [f for f, _ in read_log(ride.both, Damage()) if f.stamp_us < found.begin_us + 1_000_000]
    # 47 bits and eight a byte, half of the stuff bits that there may be
    expected = sum(47 + 8 * len(f.data) + 0.5 * ((34 + 8 * len(f.data) - 1) // 4) for f in first)
    assert b.load_pct[0] == pytest.approx(100 * expected / 500_000, rel=1e-5)
    assert b.frames_per_s[0] == len(first)


def test_clock_that_was_set_by_years_costs_no_memory(config: Config, tmp_path: Path) -> None:
    frames = [Frame(1_000_000 * k, 0x10, b"") for k in range(5)]
    frames += [Frame(BEGIN_US + 1_000_000 * k, 0x10, b"") for k in range(5)]
    b = bus(scan(written(tmp_path / "years.log", *frames), None), config, (), frozenset(), frozenset(), {})
    assert len(b.time_us) == 10
    assert b.time_us[5] == BEGIN_US
    assert b.frames_per_s.tolist()[:9] == [1.0] * 9


def test_bits_of_a_frame_lie_between_the_fewest_and_the_most() -> None:
    assert 87 < float(bits(5, extended=False, fd=False)) < 105
    assert float(bits(5, extended=True, fd=False)) == pytest.approx(
        float(bits(5, extended=False, fd=False)) + 20 + 2.5, abs=1
    )


def test_truth_is_recognised_by_name_and_signals(config: Config, ride: Ride) -> None:
    rig = load_dbc(TRUTH_DBC)
    assert sorted(truths([rig])) == list(range(1, 9))
    assert truths([config.database]) == {}
    t = ride.sent.axles[0].truth
    assert t is not None
    assert t.available_pct[0] == pytest.approx(38.4, abs=0.1)
    assert truth(scan(ride.log, None), None) is None


def test_truth_of_an_unknown_protection_is_an_error(tmp_path: Path, ride: Ride) -> None:
    other = tmp_path / "other.dbc"
    other.write_text(TRUTH_DBC.read_text().replace('"P11"', '"P07"'))
    message = truths([load_dbc(other)])[1]
    with pytest.raises(InputError, match="only P11"):
        truth(scan(ride.log, None), message)


def test_own_frames_without_a_message_are_none(ride: Ride, config: Config) -> None:
    assert OwnFrames(config).adhesion(scan(ride.log, None), 1) is None


def test_input_that_dies_has_its_gap_to_the_end_of_the_log(ride: Ride, config: Config, tmp_path: Path) -> None:
    log = tmp_path / "dies.log"
    stop = f"({(BEGIN_US + 6_000_000) * 1e-6:.6f}"
    log.write_text("".join(x for x in ride.log.read_text().splitlines(keepends=True) if x < stop or " 101#" not in x))
    (yaw,) = [m for m in bus(scan(log, None), config, (), frozenset(), frozenset(), {}).messages if m.key == YAW_RATE]
    assert yaw.longest_gap_ms == pytest.approx(5000, abs=50)
    assert yaw.longest_gap_at_us == pytest.approx(BEGIN_US + 6_000_000, abs=10_000)


def test_old_value_of_a_part_adds_nothing() -> None:
    at = np.array([0, 10, 100, 1_000], np.int64)
    found = newest_values(np.array([5, 90], np.int64), np.array([1.0, 2.0]), at, 50)
    np.testing.assert_array_equal(found, [np.nan, 1.0, 2.0, np.nan])
