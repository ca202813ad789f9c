"""Every mistake that a configuration can have is said with file, line, key, reason and advice, all at once."""

import re
import shutil
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.unit.config.support import BASE, DBC, SECOND, SPEED, YAW, after, written
from wrcd.config.config import load_config, load_config_to_run
from wrcd.core.configuration import Config
from wrcd.errors import InputError

# a message that asks for a key, in words
ASKS = re.compile(
    r"is missing|states no|has no word (for|that is known)|tells of failures|no signal '(Validity|Mu)|lacks "
    r"|without a status"
)
# What is changed in BASE, and below it the messages, from the line on. A line takes the place of the one of its key, a
# new key and what is below a table's head come last; "->" stands where the key itself changes, with \n in what is new.
TABLE = r"""
# tables and keys
yaw_rate -> yaw_rat = "Imu1.Gyro"
    9: axle[1].yaw_rat: unknown key — did you mean 'yaw_rate'?
yaw_rate ->
    7: axle[1].yaw_rate: is missing — name the signal that carries it: write in [[axle]]: yaw_rate = "Message.Signal"
yaw_rate = { signal = "Imu1.Gyro", singal = 1 }
    9: axle[1].yaw_rate.singal: unknown key — did you mean 'signal'?
axle_load = { signal = "Extended.Load", sign = -1 }
    12: axle[1].axle_load.sign: unknown key — did you mean 'signal'?
name -> name = "multiple-unit"\nradius = 0.5
    5: wheelset.radius: unknown key — the design's wheelset has C_s, G, I_L, I_R, I_w, L_g, M_v, a, b, bogie, gamma,
        k_s, k_w, m_w, name, r_0, resistance_0, resistance_2
[wheelset] -> [wheelst]
    3: wheelst: unknown key — did you mean 'wheelset'?
[dbc] -> [bus]\ninterface = "socketcam"\n[dbc]
    2: bus.interface: 'socketcam' is no interface of python-can — did you mean 'socketcan'?
file -> file = "mistakes.dbc"\nencoding = "latin"
    3: dbc.encoding: is 'latin', not one of utf-8, cp1252
yaw_rate = 3
    9: axle[1].yaw_rate: takes text or a table, not 3
torque = []
    11: axle[1].torque: takes text, a table or several of them, not an empty list
torque = ["Tcu.Torque", 3]
    11: axle[1].torque[2]: takes text or a table, not 3
number = 9
    8: axle[1].number: takes 1 … 8, not 9
[[axle]]
number = 1
adhesion = "Adhesion_A2"
yaw_rate = "Imu2.Gyro"
lateral_acceleration = { signal = "Imu2.Acc", unit = "g" }
torque = "Tcu.Torque"
    13: axle[2].number: 1 is there twice
# inputs
yaw_rate = "Gyro"
    9: axle[1].yaw_rate: 'Gyro' is not of the form Message.Signal
yaw_rate = "Imo1.Gyro"
    9: axle[1].yaw_rate: the DBC has no message 'Imo1' — did you mean 'Imu1.Gyro'?
yaw_rate = "Imu1.Giro"
    9: axle[1].yaw_rate: message Imu1 has no signal 'Giro' — did you mean 'Imu1.Gyro'?
yaw_rate = { signal = "Imu1.Gyro", sign = 2 }
    9: axle[1].yaw_rate.sign: takes 1 or -1, not 2
yaw_rate = { signal = "Imu1.Gyro", sign = "minus" }
    9: axle[1].yaw_rate.sign: takes a whole number, not 'minus'
yaw_rate = { signal = "Imu1.Gyro", unit = "m/s" }
    9: axle[1].yaw_rate.unit: unit 'm/s' cannot be converted to rad/s (known: rad/s, deg/s, mrad/s, rpm, 1/min)
lateral_acceleration = "Imu2.Acc"
    10: axle[1].lateral_acceleration: Imu2.Acc: the DBC states no unit — write in [[axle]]: lateral_acceleration = {
        signal = "Imu2.Acc", unit = "m/s2" }
lateral_acceleration = "Drive.V"
    6: vehicle.speed: Drive.V is axle[1].lateral_acceleration already; one signal measures one thing
    10: axle[1].lateral_acceleration: Drive.V: unit 'km/h' cannot be converted to m/s2 (known: m/s2, g, mg, mm/s2,
        cm/s2) — write in [[axle]]: lateral_acceleration = { signal = "Drive.V", unit = "m/s2" }
yaw_rate = { signal = "Imu1.Gyro", scale = 0 }
    9: axle[1].yaw_rate.scale: takes a number other than 0
yaw_rate = { signal = "Imu1.Gyro", offset = inf }
    9: axle[1].yaw_rate.offset: takes a finite number, not inf
yaw_rate = { signal = "Imu1.Gyro", range = [20, -20] }
    9: axle[1].yaw_rate.range: takes two numbers, the lower one first, not [20, -20]
yaw_rate = { signal = "Imu1.Gyro", range = [1000, 2000] }
    9: axle[1].yaw_rate.range: no raw value of Imu1.Gyro lies within 1000 … 2000
yaw_rate = "Imu1.Narrow"
    9: axle[1].yaw_rate: the DBC's range of Imu1.Narrow, [-1|1], shuts out 99 % of its raw values, and values that a
        train reaches — mend the DBC, or say what it measures, at least this: write in [[axle]]: yaw_rate = { signal =
        "Imu1.Narrow", range = [-20.1, 20.1] }
yaw_rate = "Imu2.Backwards"
    9: axle[1].yaw_rate: the DBC's range of Imu2.Backwards is empty, [300|-300] — mend the DBC, or say what it
        measures: write in [[axle]]: yaw_rate = { signal = "Imu2.Backwards", range = ["…", "…"] }
yaw_rate = { signal = "Imu1.Gyro", timeout_ms = 30 }
    9: axle[1].yaw_rate.timeout_ms: 30 ms is longer than three ticks of the design, 15 ms
speed = { signal = "Drive.V", timeout_ms = 20 }
    6: vehicle.speed.timeout_ms: 20 ms is not longer than the cycle of Drive, 20 ms
speed = { signal = "Drive.V", timeout_ms = 70000 }
    6: vehicle.speed.timeout_ms: takes 1 … 65535, not 70000
yaw_rate = { signal = "Imu1.Gyro", invalid = [65536] }
    9: axle[1].yaw_rate.invalid: 65536 is beyond the 16 bits of Gyro
yaw_rate = { signal = "Imu1.Gyro", invalid = ["Void"] }
    9: axle[1].yaw_rate.invalid: the value table of Gyro has no word 'Void' — it has no value table: give the raw
        value
yaw_rate = "SlowImu.Gyro"
    9: axle[1].yaw_rate: message SlowImu comes every 20 ms, slower than the design's tick of 5 ms — a faster sensor,
        or a design of that tick by `sim-ecu design`
speed = "Paged.Page"
    6: vehicle.speed: Paged.Page says which signals a frame carries; it measures nothing
speed -> speed = "Drive.V"\ndirection = "Drive.Dir"
    7: vehicle.direction: Drive.Dir has no word that is known to mean reverse (Cab A, Cab B) — say which: write in
        [vehicle]: direction = { signal = "Drive.Dir", reverse = ["…"] }
# status
yaw_rate = { signal = "Imu1.Gyro", status = true }
    9: axle[1].yaw_rate.status: takes "Message.Signal" or false, not true
yaw_rate = { signal = "Imu1.Gyro", status = "Mode" }
    9: axle[1].yaw_rate.status: 'Mode' is not of the form Message.Signal
yaw_rate = { signal = "Imu1.Gyro", status = "Imu1.Mod" }
    9: axle[1].yaw_rate.status: message Imu1 has no signal 'Mod' — did you mean 'Imu1.Mode'?
yaw_rate = { signal = "Imu1.Gyro", status = "Imu1.Mode", ok = ["Onn"] }
    9: axle[1].yaw_rate.ok: the value table of Mode has no word 'Onn' — did you mean 'On'?
yaw_rate = { signal = "Imu1.Gyro", status = "Imu1.Mode", ok = ["On"], degraded = [1] }
    9: axle[1].yaw_rate.degraded: 1 is good already
yaw_rate = { signal = "Imu1.Gyro", status = "Imu1.Mode", ok = "On" }
    9: axle[1].yaw_rate.ok: takes a list of raw values or words, not 'On' — write [1]
yaw_rate = { signal = "Imu1.Gyro", ok = ["On"] }
    9: axle[1].yaw_rate.ok: says nothing without a status — write in [[axle]]: yaw_rate = { signal = "Imu1.Gyro", ok =
        ["On"], status = "Message.Signal" }
yaw_rate = { signal = "Imu1.Gyro", status = "StatusImu.SensorState" }
    9: axle[1].yaw_rate.status: StatusImu.SensorState has no word that is known to be good — say which of Run, Fault:
        write in [[axle]]: yaw_rate = { signal = "Imu1.Gyro", status = "StatusImu.SensorState", ok = ["…"] }
yaw_rate = "StatusImu.Gyro"
    9: axle[1].yaw_rate: StatusImu.SensorState tells of failures, and none of its words is known to be good (Run,
        Fault) — write in [[axle]]: yaw_rate = { signal = "StatusImu.Gyro", status = "StatusImu.SensorState", ok =
        ["…"] }, or status = false
yaw_rate = { signal = "Imu1.Gyro", status = "Imu1.Mode", ok = [1] }
lateral_acceleration = { signal = "Imu1.Acc", status = "Imu1.Mode", ok = [2] }
    10: axle[1].lateral_acceleration.status: takes other values of Imu1.Mode for good than axle[1].yaw_rate
yaw_rate = { signal = "Imu1.Gyro", status = "Imu1.Mode", ok = [1] }
lateral_acceleration = { signal = "Imu1.Acc", status = false }
    10: axle[1].lateral_acceleration.status: is false, but axle[1].yaw_rate names the status of Imu1
# E2E
torque = { signal = "Tcu.Torque", e2e = "P5", data_id = 1 }
    11: axle[1].torque.e2e: is 'P5', not one of P11, none
torque = "OtherProfile.Torque"
    11: axle[1].torque: message OtherProfile asks for E2E profile 'P5'; only P11 is known — write in [[axle]]: torque
        = { signal = "OtherProfile.Torque", e2e = "none" }, or e2e = "P11" and its data_id
torque = { signal = "Tcu.Torque", e2e = "P11" }
    11: axle[1].torque.data_id: is missing — the DBC states none for Tcu: write in [[axle]]: torque = { signal =
        "Tcu.Torque", e2e = "P11", data_id = "…" }
torque = { signal = "Tcu.Torque", e2e = "P11", data_id = 65536 }
    11: axle[1].torque.data_id: takes 0 … 65535, not 65536
torque = { signal = "Tcu.Torque", data_id = 3 }
    11: axle[1].torque.data_id: message Tcu is not protected — if it is, write in [[axle]]: torque = { signal =
        "Tcu.Torque", data_id = 3, e2e = "P11" }
torque = { signal = "Protected.Brake", e2e = "none", data_id = 3 }
    11: axle[1].torque.data_id: says nothing beside e2e = "none"
torque = "Protected.Torque"
    11: axle[1].torque: Protected.Torque lies where the E2E CRC and counter of Protected are — if it is not protected,
        write in [[axle]]: torque = { signal = "Protected.Torque", e2e = "none" }
torque = [{ signal = "Protected.Brake", e2e = "none" }, { signal = "Protected.Torque", e2e = "P11" }]
    11: axle[1].torque[2].e2e: says another E2E protection of Protected than axle[1].torque[1]
# torque
torque = { signal = "Tcu.Motor", at = "moter" }
    11: axle[1].torque.at: is 'moter', not one of axle, motor, rim — did you mean 'motor'?
torque = { signal = "Tcu.Motor", at = "motor" }
    11: axle[1].torque.gear_ratio: is missing — the torque at the axle is the motor's times it: write in [[axle]]:
        torque = { signal = "Tcu.Motor", at = "motor", gear_ratio = "…" }
torque = { signal = "Tcu.Motor", gear_ratio = 4.6 }
    11: axle[1].torque.gear_ratio: says nothing of a torque at the axle — of a motor's: write in [[axle]]: torque = {
        signal = "Tcu.Motor", gear_ratio = 4.6, at = "motor" }
torque = { signal = "Tcu.Motor", at = "motor", gear_ratio = 0 }
    11: axle[1].torque.gear_ratio: takes a number from 0.1 to 100, not 0
torque = { signal = "Tcu.Torque", share = 1.5 }
    11: axle[1].torque.share: takes a number from 0.01 to 1, not 1.5
torque = { signal = "Tcu.Torque", at = "rim" }
    11: axle[1].torque.signal: unit 'kNm' cannot be converted to N (known: n, kn, kg, t) — a force at the rim is in N
        or kN: write in [[axle]]: torque = { signal = "Tcu.Torque", at = "rim", unit = "kN" }
torque = { signal = "Tcu.Force" }
    11: axle[1].torque.signal: Tcu.Force: unit 'kN' cannot be converted to N m (known: nm, knm) — write in [[axle]]:
        torque = { signal = "Tcu.Force", unit = "N m" }, or at = "rim" for a force
torque = ["Tcu.Torque", { signal = "Tcu.Torque", sign = -1 }]
    11: axle[1].torque[2].signal: Tcu.Torque is counted in axle[1].torque[1] already
# contradictions
[[axle]]
number = 2
yaw_rate = "Imu1.Gyro"
lateral_acceleration = { signal = "Imu2.Acc", unit = "g" }
torque = "Tcu.Torque"
    14: axle[2].yaw_rate: Imu1.Gyro is axle[1].yaw_rate already; each wheelset has its own yaw_rate
brake_torque = "Tcu.Torque"
    12: axle[1].brake_torque: Tcu.Torque is counted in axle[1].torque already
[limits]
constant_speed_m_s = 20
    13: limits.constant_speed_m_s: is given, and vehicle.speed names a signal — one of the two: which one holds?
speed ->
    5: vehicle.speed: is missing — write in [limits]: constant_speed_m_s = "…", or name the signal: write in
        [vehicle]: speed = "Message.Signal"
adhesion = "Adhesion_A1"
[[axle]]
number = 2
yaw_rate = "Imu2.Gyro"
lateral_acceleration = { signal = "Imu2.Acc", unit = "g" }
torque = "Tcu.Torque"
adhesion = "Adhesion_A1"
    18: axle[2].adhesion: Adhesion_A1 is sent for axle[1].adhesion already — one job a message
speed = { signal = "Adhesion_A1.Unnamed", unit = "km/h", range = [0, 600] }
    7: axle[1].adhesion: Adhesion_A1 is read for vehicle.speed already — one job a message
detail = { message = "Tcu", winning_model = "Motor" }
    12: axle[1].detail.winning_model: Tcu.Motor is in 'Nm', not in 1 — write in [[axle]]: detail = { message = "Tcu",
        winning_model = { signal = "Motor", unit = "1" } }
# outputs
adhesion = "Adhesion_A3"
    12: axle[1].adhesion: the DBC has no message 'Adhesion_A3' — did you mean 'Adhesion_A2'?
adhesion = "Empty"
    12: axle[1].adhesion.validity: message Empty has no signal 'Validity' — name the one that carries it: write in
        [[axle]]: adhesion = { message = "Empty", validity = "…" }
    12: axle[1].adhesion.mu_available: message Empty has no signal 'MuAvailable' — name the one that carries it: write
        in [[axle]]: adhesion = { message = "Empty", mu_available = "…" }
detail = "Empty"
    12: axle[1].detail: message Empty has none of the signals WinningModel, StaleYawRate, StaleLatAccel, StaleTorque,
        StaleSpeed, DominantRule, Residual1, Residual2, Residual3, Residual4, Cause — name those that carry them:
        write in [[axle]]: detail = { message = "Empty", winning_model = "…" }
adhesion = "FdAdhesion"
    12: axle[1].adhesion: message FdAdhesion is CAN FD or multiplexed; only plain classical ones are sent
adhesion = "PagedAdhesion"
    12: axle[1].adhesion: message PagedAdhesion is CAN FD or multiplexed; only plain classical ones are sent
adhesion = { mu_availble = "Share" }
    12: axle[1].adhesion.mu_availble: unknown key — did you mean 'mu_available'?
adhesion = { mu_available = "Shar" }
    12: axle[1].adhesion.mu_available: message Adhesion_A1 has no signal 'Shar' — did you mean 'Share'?
adhesion = { mu_used = "MuAvailable" }
    12: axle[1].adhesion.mu_used: Adhesion_A1.MuAvailable carries MuAvailable already
adhesion = { mu_available = "Share" }
    12: axle[1].adhesion.mu_available: 255 is 102 % to Adhesion_A1.Share, a value within its range 0 … 102, and can't
        say that there is none — another raw value, or a range without it: write in [[axle]]: adhesion = {
        mu_available = { signal = "Share", range = ["…", "…"] } }
adhesion = { mu_available = "Unnamed" }
    12: axle[1].adhesion.mu_available: Adhesion_A1.Unnamed has no word for "not available", and MuAvailable is not
        always there — say which raw value means it: write in [[axle]]: adhesion = { mu_available = { signal =
        "Unnamed", not_available = 65535 } }
adhesion = { mu_available = { signal = "Unnamed", not_available = 65536 } }
    12: axle[1].adhesion.mu_available.not_available: 65536 is beyond the 16 bits of Unnamed
adhesion = { mu_available = "Coarse" }
    12: axle[1].adhesion.mu_available: Adhesion_A1.Coarse has steps of 5 %; MuAvailable needs 1 or finer
adhesion = { mu_available = "Low" }
    12: axle[1].adhesion.mu_available: Adhesion_A1.Low says 0 … 14 %; MuAvailable needs 0 … 50
adhesion = { mu_available = "Bare" }
    12: axle[1].adhesion.mu_available: the DBC states no unit of Adhesion_A1.Bare — write in [[axle]]: adhesion = {
        mu_available = { signal = "Bare", unit = "%" } }, or unit = "1"
adhesion = { message = "Adhesion_A2", mu_available = "Kelvin" }
    12: axle[1].adhesion.mu_available: Adhesion_A2.Kelvin is in 'K', not in % or 1 — write in [[axle]]: adhesion = {
        message = "Adhesion_A2", mu_available = { signal = "Kelvin", unit = "%" } }, or unit = "1"
adhesion = { message = "Adhesion_A2", mu_available = "Down" }
    12: axle[1].adhesion.mu_available: Adhesion_A2.Down counts downwards, by -0.5; nothing is sent so
adhesion = { message = "Adhesion_A2", sample_age = "Age" }
    12: axle[1].adhesion.sample_age: Adhesion_A2.Age says 0 … 100 ms; SampleAge needs 0 … 255
adhesion = { message = "Adhesion_A2", confidence = "Level" }
    12: axle[1].adhesion.confidence: the value table of Adhesion_A2.Level lacks Within1pp, Within2pp, Within3pp,
        Within5pp, Within8pp, Within12pp, Wider — say by which of its words or raw values: write in [[axle]]: adhesion
        = { message = "Adhesion_A2", confidence = { signal = "Level", within1pp = "…", within2pp = "…", within3pp =
        "…", within5pp = "…", within8pp = "…", within12pp = "…", wider = "…" } }
adhesion = { validity = { signal = "Validity", valid = "God" } }
    12: axle[1].adhesion.validity.valid: the value table of Validity has no word 'God' — known: NotAvailable, Valid,
        Degraded
adhesion = { validity = { signal = "Validity", valid = 16 } }
    12: axle[1].adhesion.validity.valid: 16 is beyond the 4 bits of Validity
adhesion = { validity = { signal = "Validity", vlid = 1 } }
    12: axle[1].adhesion.validity.vlid: unknown key — did you mean 'valid'?
adhesion = { validity = { signal = "Validity", degraded = 1 } }
    12: axle[1].adhesion.validity.degraded: Adhesion_A1.Validity says Degraded by the same raw value as Valid, 1
adhesion = { cycle_ms = 2 }
    12: axle[1].adhesion.cycle_ms: 2 ms is shorter than the design's tick of 5 ms
adhesion = { cycle_ms = 0 }
    12: axle[1].adhesion.cycle_ms: takes 1 … 65535, not 0
adhesion = { e2e = "P11", data_id = 5 }
    12: axle[1].adhesion.message: Adhesion_A1.Validity lies where the E2E CRC and counter of Adhesion_A1 are — if it
        is not protected, write in [[axle]]: adhesion = { e2e = "none" }
# all at once
yaw_rate -> yaw_rat = "Imu1.Gyro"
torque = "Tcu.Torqe"
[vehicle] -> [limits]\nmin_speed_m_s = "slow"\n[vehicle]
    6: limits.min_speed_m_s: takes a number, not 'slow'
    11: axle[1].yaw_rat: unknown key — did you mean 'yaw_rate'?
    13: axle[1].torque: message Tcu has no signal 'Torqe' — did you mean 'Tcu.Torque'?
file = "mistake.dbc"
yaw_rate = { signal = "Imu1.Gyro", sign = 2 }
cycle = 3
    2: dbc.file: mistake.dbc: no such DBC file — check the path
    9: axle[1].yaw_rate.sign: takes 1 or -1, not 2
    12: axle[1].cycle: unknown key — known here: adhesion, axle_load, brake_torque, detail, inputs,
        lateral_acceleration, number, torque, wheel_radius, yaw_rate
"""


class Case(NamedTuple):
    """A text, and what is said of it."""

    text: str
    messages: list[str]


def cases() -> list[Case]:
    """The table, parsed."""
    made, lines, added, messages = [], BASE.splitlines(), [""], [""]
    for line in [*TABLE.strip().splitlines(), "#"]:
        if line.startswith(" " * 8):
            messages[-1] += " " + line.strip()
        elif line.startswith(" " * 4):
            messages.append(line.strip())
        else:
            if len(messages) > 1:
                made.append(Case("\n".join([*lines, *added[1:]]) + "\n", messages[1:]))
                lines, added, messages = BASE.splitlines(), [""], [""]
            key, arrow, new = line.partition(" ->")
            key = key if arrow else line.partition(" = ")[0]
            at = [k for k, old in enumerate(lines) if (arrow and old == key) or old.startswith(f"{key} = ")]
            if at and not any(one.startswith("[") for one in added):
                lines[at[0]] = new.strip().replace(r"\n", "\n") if arrow else line
            elif not line.startswith("#"):
                added.append(line)
    return made


CASES = cases()
SHOWN = re.compile(r"write in (\[+)([a-z]+)\]+: (.*)")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    shutil.copy(DBC, tmp_path)
    return tmp_path


@pytest.mark.parametrize("read", [load_config, load_config_to_run])
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.messages[0].split(" — ")[0])
def test_mistake_is_said_whole(folder: Path, case: Case, read: Callable[[Path], Config]) -> None:
    path = folder / "train.toml"
    path.write_text(case.text)
    with pytest.raises(InputError) as error:
        read(path)
    assert error.value.status == 2
    assert str(error.value).replace(f"{folder}/mistake.dbc", "mistake.dbc").splitlines() == [
        f"{path}:{message}" for message in case.messages
    ]
    # each says file, line and key
    assert all(re.match(r"\d+: [a-z0-9_.\[\]]+: ", message) for message in case.messages)


def test_mistake_that_asks_for_a_key_shows_the_line_to_write() -> None:
    asking = [(case, message) for case in CASES for message in case.messages if ASKS.search(message)]
    assert len(asking) > 10
    for case, message in asking:
        shown = SHOWN.search(message)
        assert shown, message
        assert shown[1] == "[" * (1 + isinstance(tomllib.loads(case.text).get(shown[2]), list))
        # what follows the line in the message is another way out
        ends = [k for k, c in enumerate(shown[3], 1) if c in '"}]' or k == len(shown[3])]
        assert any(_is_toml(shown[3][:end]) for end in ends), message


def _is_toml(text: str) -> bool:
    try:
        return bool(tomllib.loads(text))
    except tomllib.TOMLDecodeError:
        return False


@pytest.mark.parametrize("of", ["the DBC states no unit — write", "shuts out 99 %", 'no word for "not available"'])
def test_line_that_is_shown_mends_the_mistake(folder: Path, of: str) -> None:
    """Copied as it is, where nothing in it has to be filled in."""
    ((text, (message,)),) = [case for case in CASES if of in case.messages[0]]
    number, _, _ = message.partition(":")
    lines = text.splitlines()
    lines[int(number) - 1] = message.partition("write in [[axle]]: ")[2]
    path = folder / "train.toml"
    path.write_text("\n".join(lines))
    load_config(path)


def test_line_that_is_shown_keeps_every_digit_of_the_file(folder: Path) -> None:
    scale = "scale = 0.017453292519943295"
    path = written(folder, [(YAW, f'yaw_rate = {{ signal = "Imu1.Gyro", {scale}, ok = [2] }}')])
    with pytest.raises(InputError, match=rf"write in \[\[axle\]\]: yaw_rate = .* {scale}, "):
        load_config(path)


def test_texts_of_the_cases_are_good_without_their_mistake(folder: Path) -> None:
    second = SECOND + 'adhesion = "Adhesion_A2"'
    extended = 'axle_load = "Extended.Load"\nwheel_radius = "Extended.Radius"\nbrake_torque = "Extended.Brake"'
    for edits in ([], [after(second)], [after(extended)], [(SPEED, 'speed = "Paged.V"')]):
        load_config(written(folder, edits))
