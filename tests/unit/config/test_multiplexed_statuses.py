"""A multiplexed message: a status guards the frames that have it, and no others; a signal comes in some frames only."""

from pathlib import Path

import pytest

from wrcd.bus.batch import FrameBatch
from wrcd.bus.frame import Frame
from wrcd.bus.reasons import Reason
from wrcd.config.config import load_config
from wrcd.core.configuration import Config
from wrcd.core.reading import Receiver
from wrcd.errors import InputError

WORDS = '0 "Init" 1 "{good}" 2 "Impaired" 3 "Broken" ;'
DBC = """VERSION ""
NS_ :
BS_:
BU_: A
BO_ 768 Bogie: 8 A
 SG_ Wheelset M : 0|4@1+ (1,0) [0|15] "" A
 SG_ Health1 m1 : 4|4@1+ (1,0) [0|15] "" A
 SG_ Yaw1 m1 : 8|16@1- (0.005,0) [-60|60] "deg/s" A
 SG_ Acc1 m1 : 24|16@1- (0.002,0) [-60|60] "m/s2" A
 SG_ Health2 m2 : 4|4@1+ (1,0) [0|15] "" A
 SG_ Yaw2 m2 : 8|16@1- (0.005,0) [-60|60] "deg/s" A
 SG_ Acc2 m2 : 24|16@1- (0.002,0) [-60|60] "m/s2" A
 SG_ Load : 40|8@1+ (1,0) [0|255] "kN" A
 SG_ Mode : 48|4@1+ (1,0) [0|15] "" A
 SG_ Health3 m3 : 4|4@1+ (1,0) [0|15] "" A
BO_ 769 Drive: 8 A
 SG_ T1 : 0|16@1- (4,0) [-130000|130000] "Nm" A
 SG_ T2 : 16|16@1- (4,0) [-130000|130000] "Nm" A
 SG_ V : 32|16@1+ (0.01,0) [0|300] "km/h" A
BO_ 770 Diag: 1 A
 SG_ Imu1 : 0|4@1+ (1,0) [0|15] "" A
 SG_ Imu2 : 4|4@1+ (1,0) [0|15] "" A
BO_ 848 Adhesion_A1: 2 A
 SG_ MuAvailable : 0|8@1+ (0.5,0) [0|100] "%" A
 SG_ Validity : 8|4@1+ (1,0) [0|15] "" A
BO_ 849 Adhesion_A2: 2 A
 SG_ MuAvailable : 0|8@1+ (0.5,0) [0|100] "%" A
 SG_ Validity : 8|4@1+ (1,0) [0|15] "" A
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 768 1;
BA_ "GenMsgCycleTime" BO_ 848 20;
BA_ "GenMsgCycleTime" BO_ 849 20;
VAL_ 768 Health1 {words}
VAL_ 768 Health2 {words}
VAL_ 768 Health3 {words}
VAL_ 768 Mode 1 "Run" 3 "Idle" ;
VAL_ 770 Imu1 1 "Ok" 3 "Fault" ;
VAL_ 770 Imu2 1 "Ok" 3 "Fault" ;
VAL_ 848 MuAvailable 255 "NotAvailable" ;
VAL_ 849 MuAvailable 255 "NotAvailable" ;
VAL_ 848 Validity 0 "NotAvailable" 1 "Valid" 2 "Degraded" 3 "Error" ;
VAL_ 849 Validity 0 "NotAvailable" 1 "Valid" 2 "Degraded" 3 "Error" ;
"""
STATED = ', status = "Bogie.Health{}", ok = ["Measuring"], degraded = ["Impaired"]'


def train(folder: Path, yaw1: str = "", yaw2: str = "", *, vehicle: str = "", load: str = "", good: str = "Ok") -> Path:
    """A configuration of two axles. yaw1, yaw2: keys of their gyros."""
    (folder / "own.dbc").write_text(DBC.replace("{words}", WORDS.format(good=good)))
    axles = [
        f'[[axle]]\nnumber = {n}\nyaw_rate = {{ signal = "Bogie.Yaw{n}"{keys} }}\n'
        f'lateral_acceleration = "Bogie.Acc{n}"\ntorque = "Drive.T{n}"\n{rest}'
        for n, keys, rest in ((1, yaw1, load), (2, yaw2, ""))
    ]
    path = folder / "train.toml"
    path.write_text(
        '[dbc]\nfile = "own.dbc"\n[wheelset]\nname = "multiple-unit"\n'
        f'[vehicle]\nspeed = "Drive.V"\n{vehicle}\n' + "\n".join(axles)
    )
    return path


def rules(config: Config) -> dict[str, list[str]]:
    """Signals of Bogie, and what guards them."""
    sources = [i.source for i in config.inputs if i.source.message == "Bogie"]
    return {s.signal: sorted(f"{r.message}.{r.signal}" for r in s.statuses or ()) for s in sources}


def frame(wheelset: int, health: int, mode: int = 1, stamp_us: int = 0) -> Frame:
    return Frame(stamp_us, 768, bytes([health << 4 | wheelset, 20, 0, 50, 0, 60, mode, 0]))


@pytest.fixture
def stated(tmp_path: Path) -> Config:
    return load_config(train(tmp_path, STATED.format(1), STATED.format(2), good="Measuring"))


def test_stated_status_of_a_branch_guards_the_inputs_of_that_branch(stated: Config) -> None:
    one, two = ["Bogie.Health1"], ["Bogie.Health2"]
    assert rules(stated) == {"Yaw1": one, "Acc1": one, "Yaw2": two, "Acc2": two}


def test_broken_sensor_of_one_branch_leaves_the_other_axle_alone(stated: Config) -> None:
    r = Receiver(stated.database, [i.source for i in stated.inputs], stated.data_ids)
    for k in range(20):
        stamp_us = 4000 * k
        assert r.read(frame(2, 3, stamp_us=stamp_us)) is Reason.STATUS
        good = r.read(frame(1, 1, stamp_us=stamp_us + 2000))
        assert isinstance(good, list)
        assert [(stated.inputs[s.source].source.signal, s.degraded) for s in good] == [("Yaw1", False), ("Acc1", False)]
    degraded = r.read(frame(2, 2))
    assert isinstance(degraded, list)
    assert all(s.degraded for s in degraded)


def test_branch_whose_frames_stop_leaves_the_other_axle_alone(stated: Config) -> None:
    r = Receiver(stated.database, [i.source for i in stated.inputs], stated.data_ids)
    assert isinstance(r.read(frame(2, 1)), list)
    for k in range(1, 1000):
        got = r.read(frame(1, 1, stamp_us=5000 * k))
        assert isinstance(got, list)
        assert len(got) == 2


def test_frame_is_accepted_whole_or_not_at_all(tmp_path: Path) -> None:
    """A signal of every frame goes with the branch whose frame it is in."""
    config = load_config(
        train(
            tmp_path, STATED.format(1), STATED.format(2), load='axle_load = "Bogie.Load"', good="Measuring"
        )
    )  # fmt: skip
    r = Receiver(config.database, [i.source for i in config.inputs], config.data_ids)
    got = r.read(frame(1, 1))
    assert isinstance(got, list)
    assert {config.inputs[s.source].source.signal for s in got} == {"Yaw1", "Acc1", "Load"}
    assert r.read(frame(2, 3)) is Reason.STATUS
    _, refused = r.read_all(FrameBatch.of((frame(2, 3),)))
    assert [config.inputs[k].source.signal for k in refused["input"]] == ["Load", "Yaw2", "Acc2"]


def test_status_of_another_branch_is_refused_with_the_ones_that_come_with_it(tmp_path: Path) -> None:
    path = train(tmp_path, STATED.format(1), STATED.format(1), good="Measuring")
    with pytest.raises(InputError) as e:
        load_config(path)
    assert str(e.value) == (
        f"{path}:16: axle[2].yaw_rate.status: Bogie.Health1 comes in frames with Wheelset = 1, and Yaw2 in those with "
        "Wheelset = 2: it says nothing of them — Bogie.Health2 comes with it"
    )


def test_status_that_nobody_names_counts_in_its_own_branch_and_where_it_is_in_every_frame(tmp_path: Path) -> None:
    config = load_config(train(tmp_path))
    one, two = ["Bogie.Health1"], ["Bogie.Health2"]
    assert rules(config) == {"Yaw1": one, "Acc1": one, "Yaw2": two, "Acc2": two}
    assert not [w for w in config.warnings if "Health" in w]
    r = Receiver(config.database, [i.source for i in config.inputs], config.data_ids)
    assert r.read(frame(2, 3)) is Reason.STATUS
    assert isinstance(r.read(frame(1, 1)), list)


def test_signal_of_every_frame_is_not_guarded_by_a_branch_and_that_is_said(tmp_path: Path) -> None:
    config = load_config(train(tmp_path, load='axle_load = "Bogie.Load"'))
    assert rules(config)["Load"] == []
    assert [w for w in config.warnings if "Health3" in w] == [
        "Bogie.Health3 may say whether its sender is well, and does not count: it comes in frames with Wheelset = 3, "
        "and Load in others, too"
    ]


def test_stated_status_of_every_frame_guards_all_branches(tmp_path: Path) -> None:
    config = load_config(train(tmp_path, ', status = "Bogie.Mode", ok = ["Run"]'))
    every = ["Bogie.Mode"]
    assert rules(config) == {"Yaw1": every, "Acc1": every, "Yaw2": every, "Acc2": every}


def test_status_of_another_message_guards_the_branch_of_the_input_that_names_it(tmp_path: Path) -> None:
    config = load_config(train(tmp_path, ', status = "Diag.Imu1"', ', status = "Diag.Imu2"'))
    one, two = ["Diag.Imu1"], ["Diag.Imu2"]
    assert rules(config) == {"Yaw1": one, "Acc1": one, "Yaw2": two, "Acc2": two}


def test_status_that_is_not_to_count_is_that_of_its_branch(tmp_path: Path) -> None:
    config = load_config(train(tmp_path, "", ", status = false"))
    assert rules(config) == {"Yaw1": ["Bogie.Health1"], "Acc1": ["Bogie.Health1"], "Yaw2": [], "Acc2": []}


def test_status_that_counts_and_does_not_in_one_branch_is_refused(tmp_path: Path) -> None:
    path = train(tmp_path, STATED.format(1), STATED.format(2), good="Measuring")
    text = path.read_text().replace('"Bogie.Acc2"', '{ signal = "Bogie.Acc2", status = false }')
    path.write_text(text)
    with pytest.raises(InputError, match=r"axle\[2\].lateral_acceleration.status: "):
        load_config(path)


def test_words_that_nobody_explains_are_asked_for_in_each_branch(tmp_path: Path) -> None:
    with pytest.raises(InputError) as e:
        load_config(train(tmp_path, good="Quite"))
    said = str(e.value).splitlines()
    assert len(said) == 2
    assert "axle[1].yaw_rate" in said[0]
    assert 'status = "Bogie.Health1", ok = ["…"]' in said[0]
    assert 'status = "Bogie.Health2", ok = ["…"]' in said[1]


# a cycle of 0: the DBC states none
@pytest.mark.parametrize(("cycle", "turns"), [("1", ""), ("0", ""), ("2", " (6 ms where they take turns)")])
def test_multiplexed_gyro_is_said(tmp_path: Path, cycle: str, turns: str) -> None:
    path = train(tmp_path)
    own = tmp_path / "own.dbc"
    own.write_text(own.read_text().replace("BO_ 768 1;", f"BO_ 768 {cycle};"))
    said = [w for w in load_config(path).warnings if "multiplexed" in w]
    assert said == [
        f"Bogie.{name} is multiplexed: it comes only in frames with Wheelset = {n}{turns}, and is needed every 5 ms"
        for n in (1, 2)
        for name in (f"Yaw{n}", f"Acc{n}")
    ]
