"""The rig speaks a train's own DBC: frames read back by cantools alone, against what the sensors said."""

import functools
import itertools
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import cantools
import e2e.p11
import pytest

from sim_ecu.cli.main import main as sim_ecu
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.play.encoder import SAMPLE_US, Encoder, Reading, SensorSample, Sent, message_key
from sim_ecu.play.faults import parse_fault
from sim_ecu.play.mapped import MappedTrain, Train
from sim_ecu.play.mapped_message import claim
from sim_ecu.play.player import Player
from sim_ecu.play.scenario import Scenario, load_scenario, read_scenario
from sim_ecu.play.train import PACKAGED, AdhesionReader
from tests.support.scenarios import held
from wrcd.bus.dbc import find_message, parse_dbc
from wrcd.bus.frame import Frame
from wrcd.bus.mapping import MappedSignal
from wrcd.bus.signals import Source, StatusRule
from wrcd.bus.units import G, Quantity
from wrcd.config.config import load_config, load_packaged
from wrcd.config.settings import parse_toml
from wrcd.core.configuration import Config, Input
from wrcd.core.core import Core
from wrcd.core.reading import Receiver
from wrcd.errors import InputError
from wrcd.kit.golden_frames import raw_of

ROOT = Path(__file__).parents[3]
EXAMPLE = ROOT / "examples/own-dbc/train.toml"
THIRD_PARTY = ROOT / "tests/data/dbc/third-party.toml"

# Motorola order, an extended id beside a standard one of its number, CAN FD, a multiplexer, E2E where one axle has it
DBC = """VERSION ""
NS_ :
BS_:
BU_: A
BO_ 2147484161 Imu1: 8 A
 SG_ Crc : 7|8@0+ (1,0) [0|255] "" A
 SG_ Counter : 11|4@0+ (1,0) [0|14] "" A
 SG_ Turn : 23|16@0- (0.005,0) [-160|160] "deg/s" A
 SG_ Side : 39|16@0- (0.0005,0) [-10|10] "g" A
 SG_ Heat : 55|8@0+ (1,-40) [-40|125] "degC" A
BO_ 513 Doors: 1 A
 SG_ Open : 7|8@0+ (1,0) [0|255] "" A
BO_ 2147484162 Imu2: 12 A
 SG_ Turn : 7|24@0- (0.0001,0) [-800|800] "deg/s" A
 SG_ Side : 31|24@0- (0.00001,0) [-80|80] "" A
BO_ 529 Health2: 1 A
 SG_ Imu : 7|4@0+ (1,0) [0|15] "" A
BO_ 530 Effort: 8 A
 SG_ Which M : 7|8@0+ (1,0) [0|9] "" A
 SG_ Motor1 m3 : 23|16@0- (0.002,0) [-60|60] "kNm" A
 SG_ Motor2 m4 : 23|16@0- (0.002,0) [-60|60] "kNm" A
BO_ 531 Brakes: 4 A
 SG_ Bogie : 7|16@0+ (0.004,0) [0|200] "kNm" A
 SG_ State : 31|2@0+ (1,0) [0|3] "" A
BO_ 532 Train: 4 A
 SG_ V : 7|16@0+ (0.01,0) [0|500] "km/h" A
 SG_ Way : 23|2@0+ (1,0) [0|3] "" A
 SG_ Load : 31|8@0+ (1,0) [0|255] "t" A
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","a","b","c","d","e","f","g","h","i","j","k","l","StandardCAN_FD","ExtendedCAN_FD";
BA_DEF_ SG_ "GenSigStartValue" FLOAT 0 100000;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_DEF_DEF_ "GenSigStartValue" 0;
BA_ "GenMsgCycleTime" BO_ 531 40;
BA_ "VFrameFormat" BO_ 2147484161 1;
BA_ "VFrameFormat" BO_ 2147484162 15;
BA_ "GenSigStartValue" SG_ 2147484161 Heat 60;
VAL_ 531 State 0 "Init" 1 "Good" 2 "Fault" 3 "SNA" ;
VAL_ 532 Way 0 "none" 1 "reverse" 2 "forward" 3 "SNA" ;
"""  # noqa: E501  # a DBC has a line for each definition
Q = Quantity


def mapped(**changes: Any) -> Config:
    """Two axles over the DBC above, by hand."""
    database = parse_dbc(DBC, Path("mapped.dbc"))
    rad = 3.141592653589793 / 180
    state = (StatusRule("Brakes", "State", ok=frozenset({1}), degraded=frozenset()),)
    health = (StatusRule("Health2", "Imu", ok=frozenset({5, 6}), degraded=frozenset({7})),)
    sources = [
        (Source("Imu1", "Turn", Q.YAW_RATE, (0,), factor=-rad, invalid=frozenset({-32768}), statuses=()), 15),
        (Source("Imu1", "Side", Q.LAT_ACCEL, (0,), statuses=()), 15),
        # a scale and an offset of its own, in a unit that the DBC does not say
        (Source("Imu2", "Turn", Q.YAW_RATE, (1,), statuses=health), 15),
        (
            Source(
                "Imu2",
                "Side",
                Q.LAT_ACCEL,
                (1,),
                scale=2e-5,
                offset=0.1,
                factor=1.0,
                low=-80.0,
                high=80.0,
                statuses=health,
            ),
            15,
        ),
        # motor torque through a gear; one friction brake for both axles, half of it each, positive when it brakes
        (Source("Effort", "Motor1", Q.TORQUE, (0,), factor=4600.0), 30),
        (Source("Effort", "Motor2", Q.TORQUE, (1,), factor=4600.0), 30),
        (Source("Brakes", "Bogie", Q.TORQUE, (0,), factor=-500.0, statuses=state, part=1), 120),
        (Source("Brakes", "Bogie", Q.TORQUE, (1,), factor=-500.0, statuses=state, part=1), 120),
        (Source("Train", "V", Q.SPEED, (0, 1)), 60),
        (Source("Train", "Way", Q.DIRECTION, (0, 1)), 60),
        (Source("Train", "Load", Q.AXLE_LOAD, (0,)), 60),
    ]
    base = load_packaged(2)
    return replace(
        base, database=database, data_ids={"Imu1": 0x1234},
        inputs=tuple(Input(source, 1000 * ms) for source, ms in sources), **changes,
    )  # fmt: skip


def train(config: Config | None = None) -> MappedTrain:
    return MappedTrain(config or mapped(), Wheelset())


def sample(number: int, torques: tuple[float, float] = (10_000.0, 5_000.0), speed: float = 25.0) -> SensorSample:
    """The number-th, from 1 on."""
    readings = (
        Reading(1, 0.1, -0.5, torques[0], 30.0, 5.0, 0.001),
        Reading(2, -0.02, 0.25, torques[1], 20.0, 4.0, 0.0),
    )
    return SensorSample(number * SAMPLE_US, speed, readings)


def sent(samples: Sequence[SensorSample], truth: bool = False, config: Config | None = None) -> list[Sent]:
    encoder = train(config).encoder([1, 2], truth)
    return [f for s in samples for f in encoder.frames(s)]


def read(frames: Sequence[Sent], name: str) -> list[dict[str, Any]]:
    """All frames of a message, physical values by cantools, labels as text."""
    message = mapped().database.get_message_by_name(name)
    assert isinstance(message, cantools.database.can.Message)
    mine = [f for f in frames if (f.can_id, f.extended) == (message.frame_id, message.is_extended_frame)]
    assert {len(f.data) for f in mine} <= {message.length}
    assert {f.fd for f in mine} <= {message.is_fd}
    rows: list[Any] = [message.decode(f.data) for f in mine]
    return [{k: str(v) if hasattr(v, "name") else v for k, v in row.items()} for row in rows]


FRAMES = sent([sample(k) for k in range(1, 41)])


def test_packaged_dbc_mapped_gives_the_bytes_of_the_default() -> None:
    scenario = replace(load_scenario("four-axles"), duration_s=0.4)
    by_default = [list(frames) for _, frames in Player(scenario)]
    spoken = MappedTrain(load_packaged(4), scenario.wheelset)
    assert [list(frames) for _, frames in Player(scenario, train=spoken)] == by_default
    encoder, default = spoken.encoder([2, 3], False, 7), Encoder([2, 3], False, 7)
    one = replace(sample(4), readings=tuple(replace(r, number=r.number + 1) for r in sample(4).readings))
    assert list(encoder.frames(one)) == list(default.frames(one))


def test_values_are_in_the_signal_unit_sign_and_gear_included() -> None:
    degree = 180 / 3.141592653589793
    imu = read(FRAMES, "Imu1")[-1]
    assert imu["Turn"] == pytest.approx(-0.1 * degree, abs=0.0026)
    assert imu["Side"] == pytest.approx(-0.5 / G, abs=0.00026)
    other = read(FRAMES, "Imu2")[-1]
    assert other["Turn"] == pytest.approx(-0.02 * degree, abs=6e-5)
    assert other["Side"] == pytest.approx((0.25 - 0.1) / 2, abs=1e-5)  # cantools' scale is half of the configuration's
    effort = read(FRAMES, "Effort")
    assert [row["Motor1"] for row in effort if "Motor1" in row][-1] == pytest.approx(10.0 / 4.6, abs=0.0011)
    assert [row["Motor2"] for row in effort if "Motor2" in row][-1] == pytest.approx(5.0 / 4.6, abs=0.0011)
    row = read(FRAMES, "Train")[-1]
    assert row["V"] == pytest.approx(90.0, abs=0.006)
    assert (row["Way"], row["Load"]) == ("forward", 15)


def test_rest_of_a_message_stands_at_its_start_and_statuses_are_good() -> None:
    assert {row["Heat"] for row in read(FRAMES, "Imu1")} == {20}  # raw 60
    assert {row["Imu"] for row in read(FRAMES, "Health2")} == {5}
    assert {row["State"] for row in read(FRAMES, "Brakes")} == {"Good"}
    assert read(FRAMES, "Doors") == []  # its id is that of Imu1, but standard


def test_cycles_are_the_dbc_ones_or_the_sensors_own() -> None:
    counts = {name: len(read(FRAMES, name)) for name in ("Imu1", "Imu2", "Health2", "Effort", "Brakes", "Train")}
    # 200 ms; of the multiplexed message one frame for each of its two axles
    assert counts == {"Imu1": 40, "Imu2": 40, "Health2": 40, "Effort": 40, "Brakes": 5, "Train": 10}
    assert {row["Which"] for row in read(FRAMES, "Effort")} == {3, 4}
    times = [f.due_us for f in FRAMES]
    assert times == sorted(set(times))


def test_protected_message_has_crc_and_counter() -> None:
    imu = [f for f in FRAMES if f.extended and f.can_id == 513]
    for f in imu:
        data = bytearray(f.data)
        e2e.p11.e2e_p11_protect(data, 0x1234, increment_counter=False)
        assert bytes(data) == f.data
    assert [f.data[1] & 0x0F for f in imu] == [k % 15 for k in range(40)]


@pytest.mark.parametrize(
    ("torques", "motors", "bogie"),
    [
        ((10_000.0, 5_000.0), (10.0, 5.0), 0.0),  # traction: the motors alone
        ((-10_000.0, -6_000.0), (-6.0, -2.0), 8.0),  # braking: half each; the bogie's brake acts alike on both axles
        ((-600_000.0, -600_000.0), (-276.0, -276.0), 200.0),  # more than the motors have: the brake to its end
    ],
)
def test_torque_is_split_between_its_parts(
    torques: tuple[float, float], motors: tuple[float, float], bogie: float
) -> None:
    frames = sent([sample(k, torques) for k in range(1, 41)])
    effort = read(frames, "Effort")
    assert [row["Motor1"] for row in effort if "Motor1" in row][-1] * 4.6 == pytest.approx(motors[0], abs=0.005)
    assert [row["Motor2"] for row in effort if "Motor2" in row][-1] * 4.6 == pytest.approx(motors[1], abs=0.005)
    assert read(frames, "Brakes")[-1]["Bogie"] == pytest.approx(bogie, abs=0.002)


def test_value_beyond_the_range_is_its_end_and_never_the_code_for_no_measurement() -> None:
    fast = replace(sample(1), readings=(replace(sample(1).readings[0], yaw_rate=10.0), sample(1).readings[1]))
    assert read(sent([fast]), "Imu1")[-1]["Turn"] == pytest.approx(-160.0)
    widest = mapped()
    source = replace(widest.inputs[0].source, low=-200.0, high=200.0, invalid=frozenset({-32768, -32767}))
    config = replace(widest, inputs=(replace(widest.inputs[0], source=source), *widest.inputs[1:]))
    assert read(sent([fast], config=config), "Imu1")[-1]["Turn"] == pytest.approx(-32766 * 0.005)


def test_truth_goes_out_beside_unless_the_train_has_its_id() -> None:
    ids = {f.can_id for f in sent([sample(4)], truth=True)}
    assert {0x7A1, 0x7A2} <= ids
    taken = mapped()
    taken.database.messages[1].frame_id = 0x7A2
    with pytest.raises(InputError, match=r"Doors .*--no-truth"):
        train(taken).encoder([1, 2])
    assert train(taken).encoder([1, 2], truth=False)


def test_axle_that_is_not_mapped_is_refused() -> None:
    with pytest.raises(InputError, match="axle 3"):
        train().encoder([1, 3])


def test_axle_that_does_not_run_leaves_its_signals_at_their_start() -> None:
    one = SensorSample(4 * SAMPLE_US, 25.0, (sample(4).readings[0],))
    frames = list(train().encoder([1], truth=False).frames(one))
    assert read(frames, "Imu2") == []
    assert {row["Which"] for row in read(frames, "Effort")} == {3}


# --- the daemon with the same file


TURN, HELD_RAD_S = Source("Imu1", "Turn", Q.YAW_RATE, (0,)), 3.0 * 3.141592653589793 / 180
# Of each field of a Source one that it changes, or two that add up.
CASES: dict[str, tuple[Source, ...]] = {
    "message": (replace(TURN, message="Imu2"),),
    "signal": (replace(TURN, signal="Side", factor=0.1),),
    "quantity": (Source("Imu1", "Side", Q.LAT_ACCEL, (0,)),),
    "axles": (replace(TURN, axles=(1,)),),
    "scale": (replace(TURN, scale=0.002),),
    "offset": (replace(TURN, offset=-20.0),),
    "factor": (replace(TURN, factor=-0.02),),
    "low": (replace(TURN, scale=-0.005, low=-3.0, factor=-HELD_RAD_S / 3.0),),
    "high": (replace(TURN, high=3.0),),
    "invalid": (replace(TURN, invalid=frozenset({1145, 1146, 1147})),),
    "statuses": (replace(TURN, statuses=(StatusRule("Health2", "Imu", frozenset({5}), frozenset()),)),),
    "reverse": (Source("Train", "Way", Q.DIRECTION, (0, 1), reverse=frozenset({2})),),
    "part": (
        Source("Effort", "Motor1", Q.TORQUE, (0,), factor=4600.0),
        Source("Brakes", "Bogie", Q.TORQUE, (0,), factor=-500.0, part=1),
    ),
    "pgn": (replace(TURN, pgn=True),),
}
SAID = {Q.YAW_RATE: (0.1, -0.02), Q.LAT_ACCEL: (-0.5, 0.25), Q.TORQUE: (-10_000.0, -5_000.0), Q.DIRECTION: (1.0, 1.0)}


@pytest.mark.parametrize("name", [f.name for f in fields(Source)])
def test_core_reads_what_the_rig_writes_by_every_field(name: str) -> None:
    sources = CASES[name]
    assert any(getattr(s, name) != getattr(TURN, name) for s in sources)
    config = replace(mapped(), inputs=tuple(Input(s, 15_000) for s in sources))
    receiver, newest, refused = Receiver(config.database, sources, config.data_ids), dict[int, float](), 0
    for f in sent([sample(k, (-10_000.0, -5_000.0)) for k in range(1, 41)], config=config):
        can_id = f.can_id ^ 0xFF if name == "pgn" else f.can_id  # another sender
        values = receiver.read(Frame(f.due_us, can_id, f.data, extended=f.extended, fd=f.fd))
        newest |= {v.source: v.value for v in values} if isinstance(values, list) else {}
        refused += not isinstance(values, list)
    expected = HELD_RAD_S if name in ("low", "high") else SAID[sources[0].quantity][sources[0].axles[0]]
    assert sum(newest.values()) == pytest.approx(expected, rel=0.01)
    assert (len(newest), refused) == (len(sources), name == "statuses")  # the first comes before its status


def valid(config: Config, spoken: Train, scenario: Scenario) -> list[dict[int, float]]:
    """MuAvailable in %, by axle and by time of the frame, as the train's own messages say it where they say Valid."""
    core = Core(config)
    readers: dict[int, tuple[int, AdhesionReader]] = {}
    for place, axle in enumerate(config.axles):
        message = find_message(config.database, axle.adhesion.message)
        readers[message_key(message)] = place, AdhesionReader(message, axle.adhesion)
    out: list[dict[int, float]] = [{} for _ in config.axles]
    for f in (f for _, frames in Player(scenario, False, 400, spoken) for f in frames):
        for o in core.feed(Frame(1_700_000_000_000_000 + f.due_us, f.can_id, f.data, extended=f.extended, fd=f.fd)):
            if o.frame.key in readers:
                place, reader = readers[o.frame.key]
                said = reader.read(o.frame.data)
                if said["Validity"] == "Valid":
                    mu = said["MuAvailable"]
                    assert isinstance(mu, float)
                    out[place][o.frame.stamp_us] = mu
    return out


def test_rig_and_daemon_with_an_own_dbc_give_the_estimate_of_the_default_one() -> None:
    scenario = replace(load_scenario("damp"), duration_s=5.0)
    own = load_config(EXAMPLE)
    (theirs,) = valid(own, MappedTrain(own, scenario.wheelset), scenario)
    (ours,) = valid(load_packaged(1), PACKAGED, scenario)
    apart = [abs(theirs[t] - ours[t]) for t in theirs.keys() & ours.keys()]
    assert len(apart) > 100
    # its gyro resolves 0.001 deg/s, its accelerometer a milli-g, its torque 5 N m
    assert max(apart) <= 0.6
    assert sorted(apart)[len(apart) // 2] <= 0.1


def test_rig_and_daemon_with_a_third_partys_dbc_give_the_estimate_of_the_default_one() -> None:
    """Motorola order, extended ids, CAN FD, no cycles, words and units of its own; 0.5 % in eight bits."""
    # a seed with which no window of one is cut a moment before the other's: for a second they differ by more then
    scenario = read_scenario(parse_toml(f"seed = 2\naxles = [1, 2]\n{held('C', 8.0)}", "test"), "test")
    own = load_config(THIRD_PARTY)
    theirs = valid(own, MappedTrain(own, scenario.wheelset), scenario)
    ours = valid(load_packaged(2), PACKAGED, scenario)
    for place, least in ((0, 150), (1, 40)):  # every 20 ms, every 50 ms: in every tenth of a second both
        apart = [theirs[place][t] - ours[place][t] for t in theirs[place].keys() & ours[place].keys()]
        assert len(apart) > least
        # rounded down to 0.5 %; its sensors resolve less than the default's
        assert min(apart) >= -0.8
        assert max(apart) <= 0.3


def test_own_dbc_is_played_into_a_log(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "own.log"
    file = tmp_path / "short.toml"
    file.write_text('duration_s = 0.2\nrail = [{ curve = "C" }]\ndrive = { utilisation = 0.1 }\n')
    assert sim_ecu(["play", str(file), "--config", str(EXAMPLE), "--fast", "--no-truth", "--log", str(log)]) == 0
    ids = [line.split()[2].partition("#")[0] for line in log.read_text().splitlines()]
    assert {i: ids.count(i) for i in ids} == {"201": 40, "211": 20, "221": 10, "230": 10}
    assert sim_ecu(["play", "four-axles", "--config", str(EXAMPLE), "--fast", "--log", str(log)]) == 2
    assert "axle 2" in capsys.readouterr().err


# --- faults


@functools.cache
def played(*specs: str) -> list[Sent]:
    faults = tuple(parse_fault(spec, [1, 2]) for spec in specs)
    scenario = replace(load_scenario("half-wet"), duration_s=0.6, faults=faults)
    return [f for _, frames in Player(scenario, truth=False, train=train()) for f in frames]


# and what the refusal names
REFUSED = {
    "crc:at=0.2,axle=2": "crc: Imu2",
    "counter:at=0.2,of=torque": "counter: Effort",
    "dlc:at=0.2,amount=1": "dlc: Imu1",
    "nan:at=0.2,of=speed": "nan: Train.V",
    "status:at=0.2": "status: Imu1",
    "status:at=0.2,axle=2,amount=16": "status: Health2.Imu",
    "swap:at=0.2": "swap: .*axle 1 and axle 2",
    "swap:at=0.2,of=torque": "swap: Effort",
}


@pytest.mark.parametrize("spec", REFUSED)
def test_fault_that_the_messages_leave_no_way_to_is_refused(spec: str) -> None:
    config = mapped()
    if "speed" in spec:  # with every raw value in its range, none is left
        config.database.get_message_by_name("Train").signals[0].maximum = 655.35
    scenario = replace(load_scenario("half-wet"), faults=(parse_fault(spec, [1, 2]),))
    with pytest.raises(InputError, match=REFUSED[spec]):
        Player(scenario, train=train(config))


def test_speed_that_is_not_mapped_cannot_be_at_fault() -> None:
    config = mapped()
    config = replace(config, inputs=tuple(i for i in config.inputs if i.source.message != "Train"))
    scenario = replace(load_scenario("half-wet"), faults=(parse_fault("bias:at=1,of=speed", [1]),))
    with pytest.raises(InputError, match="speed:"):
        Player(scenario, train=train(config))


AT = "at=0.2,for=0.2"


def during(frames: Sequence[Sent]) -> list[Sent]:
    return [f for f in frames if 200_000 <= f.due_us < 400_000]


def test_frame_faults_act_on_their_message_alone() -> None:
    for kind, mine in (
        (f"crc:{AT}", {(513, True)}),
        (f"counter:{AT}", {(513, True)}),
        (f"burst:{AT},axle=2", {(514, True)}),
        (f"dlc:{AT},axle=2,amount=1", {(514, True)}),
        (f"nan:{AT}", {(513, True)}),
        (f"status:{AT},axle=2", {(529, False)}),
        (f"delay:{AT},of=torque", {(530, False), (531, False)}),
        (f"sender:{AT},of=speed", {(532, False)}),
        (f"bias:{AT},of=torque,axle=2", {(530, False), (531, False)}),
    ):
        touched = set(played(kind)) ^ set(played())
        assert {(f.can_id, f.extended) for f in touched} <= mine, kind
        assert touched, kind


def test_status_fault_of_a_multiplexed_message_is_of_the_axle_of_its_branch() -> None:
    effort = ' SG_ Motor2 m4 : 23|16@0- (0.002,0) [-60|60] "kNm" A\n'
    assert effort in DBC
    healths = "".join(f' SG_ Health{n} m{2 + n} : 39|8@0+ (1,0) [0|255] "" A\n' for n in (1, 2))
    config = replace(mapped(), database=parse_dbc(DBC.replace(effort, effort + healths), Path("mapped.dbc")))
    guarded = []
    for i in config.inputs:
        rules = (StatusRule("Effort", f"Health{i.source.signal[-1]}", frozenset({1}), frozenset()),)
        guarded.append(replace(i, source=replace(i.source, statuses=rules)) if i.source.message == "Effort" else i)
    config = replace(config, inputs=tuple(guarded))
    faults = (parse_fault(f"status:{AT},of=torque,axle=2,amount=3", [1, 2]),)
    scenario = replace(load_scenario("half-wet"), duration_s=0.6, faults=faults)
    frames = [f for _, fs in Player(scenario, truth=False, train=train(config)) for f in fs if f.can_id == 530]
    said = {(f.data[0], f.data[4]) for f in during(frames)}
    assert said == {(3, 1), (4, 3)}  # multiplexer and health


def test_frame_faults_of_an_own_dbc_do_what_they_say() -> None:
    flipped = [f for f in during(played(f"crc:{AT}")) if f.can_id == 513]
    before = [f for f in during(played()) if f.can_id == 513]
    changed = [int.from_bytes(a.data) ^ int.from_bytes(b.data) for a, b in zip(flipped, before, strict=True)]
    assert {x.bit_count() for x in changed} == {1}
    longer = [f for f in during(played(f"dlc:{AT},axle=2,amount=1")) if f.can_id == 514]
    assert {(len(f.data), f.fd) for f in longer} == {(16, True)}  # the next length that CAN FD has
    assert {row["Turn"] for row in read(during(played(f"nan:{AT}")), "Imu1")} == {-32768 * 0.005}
    assert {row["Imu"] for row in read(during(played(f"status:{AT},axle=2")), "Health2")} == {14}
    assert {row["State"] for row in read(during(played(f"status:{AT},of=torque")), "Brakes")} == {"Fault"}
    idle = [f for f in during(played(f"babble:{AT},amount=1000")) if f.can_id == 0]
    assert len(idle) == 100


@pytest.mark.parametrize("kind", ["crc", "counter", "dlc", "nan", "status", "swap", "delay", "sender", "babble"])
def test_faults_on_the_packaged_dbc_mapped_are_the_default_ones(kind: str) -> None:
    faults = (parse_fault(f"{kind}:{AT},of=all", [1, 2]),)
    scenario = replace(load_scenario("half-wet"), duration_s=0.5, faults=faults)
    spoken = MappedTrain(load_packaged(2), Wheelset())
    assert list(itertools.chain(*(f for _, f in Player(scenario, train=spoken)))) == list(
        itertools.chain(*(f for _, f in Player(scenario)))
    )


@pytest.mark.parametrize(
    ("reverse", "factor", "expected"),
    [(None, None, "forward"), (None, -1.0, "reverse"), ({1}, None, "none"), ({0, 1}, None, "forward"),
     ({2}, -1.0, "forward")],
)  # fmt: skip
def test_direction_is_forwards_as_the_configuration_tells_it(
    reverse: set[int] | None, factor: float | None, expected: str
) -> None:
    raws = None if reverse is None else frozenset(reverse)
    way = Source("Train", "Way", Q.DIRECTION, (0, 1), factor=factor, reverse=raws)
    config = mapped()
    inputs = [replace(i, source=way) if i.source.quantity is Q.DIRECTION else i for i in config.inputs]
    config = replace(config, inputs=tuple(inputs))
    frames = [f for f in sent([sample(k) for k in range(1, 41)], config=config) if f.can_id == 532]
    assert {row["Way"] for row in read(frames, "Train")} == {expected}
    read_back = Receiver(config.database, [way]).read(Frame(0, 532, frames[0].data))
    assert isinstance(read_back, list)
    assert read_back[0].value == 1.0


@pytest.mark.parametrize(
    ("sign", "invalid", "value", "raw"),
    [
        ("+", (0, 1), 0.0, 2), ("+", (0, 1), 1.0, 2), ("+", (254, 255), 255.0, 253), ("-", (-1, 0, 1), 0.0, 2),
        ("-", (5,), 5.0, 4), ("-", (-128, -127), -128.0, -126),
    ],
)  # fmt: skip
def test_value_whose_raw_one_is_no_measurement_is_sent_as_the_nearest(
    sign: str, invalid: tuple[int, ...], value: float, raw: int
) -> None:
    dbc = parse_dbc(f'BO_ 7 M: 2 B\n SG_ T : 0|8@1{sign} (1,0) [0|0] "Nm" B\n', Path("m.dbc"))
    message, source = find_message(dbc, "M"), Source("M", "T", Q.TORQUE, (0,), invalid=frozenset(invalid))
    assert claim(message, message.signals[0], Input(source, 1000), [1]).raw(value) == raw
    assert raw_of(MappedSignal(0, source, message), value) in (raw, -raw)
