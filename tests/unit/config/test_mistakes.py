"""Every mistake that a configuration can have is said with file, line, key, reason and advice, all at once."""

import re
import shutil
import tomllib
from pathlib import Path

import pytest

from tests.unit.config.support import (
    ACC,
    DBC,
    SECOND,
    SPEED,
    TORQUE,
    YAW,
    Edit,
    after,
    of_adhesion,
    of_torque,
    of_yaw_rate,
    written,
)
from wrcd.config import load_config
from wrcd.errors import InputError

# a message that asks for a key, in words
ASKS = re.compile(
    r"is missing|states no|has no word (for|that is known)|tells of failures|no signal '(Validity|Mu)|lacks "
    r"|without a status"
)
# what is changed in BASE, and the messages from the line on
CASES: dict[str, tuple[list[Edit], list[str]]] = {
    # tables and keys
    "typo of a needed key": (
        [(YAW, YAW.replace("yaw_rate", "yaw_rat"))],
        ["9: axle[1].yaw_rat: unknown key — did you mean 'yaw_rate'?"],
    ),
    "needed key missing": (
        [(YAW, "")],
        [
            (
                "7: axle[1].yaw_rate: is missing — name the signal that carries it: write in [[axle]]: yaw_rate "
                '= "Message.Signal"'
            )
        ],
    ),
    "unknown key of an input": (
        [of_yaw_rate("singal = 1")],
        ["9: axle[1].yaw_rate.singal: unknown key — did you mean 'signal'?"],
    ),
    "key of another input": (
        [after('axle_load = { signal = "Extended.Load", sign = -1 }')],
        ["12: axle[1].axle_load.sign: unknown key — did you mean 'signal'?"],
    ),
    "unknown key of the wheelset": (
        [('name = "default"', 'name = "default"\nradius = 0.5')],
        [
            (
                "5: wheelset.radius: unknown key — the design's wheelset has C_s, G, I_L, I_R, I_w, L_g, M_v, a, b, "
                "gamma, k_s, k_w, m_w, name, r_0, resistance_0, resistance_2"
            )
        ],
    ),
    "unknown table": ([("[wheelset]", "[wheelst]")], ["3: wheelst: unknown key — did you mean 'wheelset'?"]),
    "unknown interface": (
        [("[dbc]", '[bus]\ninterface = "socketcam"\n[dbc]')],
        ["2: bus.interface: 'socketcam' is no interface of python-can — did you mean 'socketcan'?"],
    ),
    "unknown encoding": (
        [('"mistakes.dbc"', '"mistakes.dbc"\nencoding = "latin"')],
        ["3: dbc.encoding: is 'latin', not one of utf-8, cp1252"],
    ),
    "not a table or text": ([(YAW, "yaw_rate = 3")], ["9: axle[1].yaw_rate: takes text or a table, not 3"]),
    "empty list of parts": (
        [(TORQUE, "torque = []")],
        ["11: axle[1].torque: takes text, a table or several of them, not an empty list"],
    ),
    "part that is no table": (
        [(TORQUE, 'torque = ["Tcu.Torque", 3]')],
        ["11: axle[1].torque[2]: takes text or a table, not 3"],
    ),
    "number of an axle": ([("number = 1", "number = 9")], ["8: axle[1].number: takes 1 … 8, not 9"]),
    "axle twice": (
        [after(SECOND.replace("number = 2", 'number = 1\nadhesion = "Adhesion_A2"'))],
        ["14: axle[2].number: 1 is there twice"],
    ),
    # inputs
    "not Message.Signal": (
        [(YAW, 'yaw_rate = "Gyro"')],
        ["9: axle[1].yaw_rate: 'Gyro' is not of the form Message.Signal"],
    ),
    "no such message": (
        [(YAW, 'yaw_rate = "Imo1.Gyro"')],
        ["9: axle[1].yaw_rate: the DBC has no message 'Imo1' — did you mean 'Imu1.Gyro'?"],
    ),
    "no such signal": (
        [(YAW, 'yaw_rate = "Imu1.Giro"')],
        ["9: axle[1].yaw_rate: message Imu1 has no signal 'Giro' — did you mean 'Imu1.Gyro'?"],
    ),
    "sign": ([of_yaw_rate("sign = 2")], ["9: axle[1].yaw_rate.sign: takes 1 or -1, not 2"]),
    "sign of another type": (
        [of_yaw_rate('sign = "minus"')],
        ["9: axle[1].yaw_rate.sign: takes a whole number, not 'minus'"],
    ),
    "unit that cannot be converted": (
        [of_yaw_rate('unit = "m/s"')],
        [
            (
                "9: axle[1].yaw_rate.unit: unit 'm/s' cannot be converted to rad/s (known: rad/s, deg/s, "
                "mrad/s, rpm, 1/min)"
            )
        ],
    ),
    "no unit in the DBC": (
        [(ACC, 'lateral_acceleration = "Imu2.Acc"')],
        [
            (
                "10: axle[1].lateral_acceleration: Imu2.Acc: the DBC states no unit — write in [[axle]]: "
                'lateral_acceleration = { signal = "Imu2.Acc", unit = "m/s2" }'
            )
        ],
    ),
    "another unit in the DBC": (
        [(ACC, 'lateral_acceleration = "Drive.V"')],
        [
            ("6: vehicle.speed: Drive.V is axle[1].lateral_acceleration already; one signal measures one thing"),
            (
                "10: axle[1].lateral_acceleration: Drive.V: unit 'km/h' cannot be converted to m/s2 (known: "
                'm/s2, g, mg, mm/s2, cm/s2) — write in [[axle]]: lateral_acceleration = { signal = "Drive.V", '
                'unit = "m/s2" }'
            ),
        ],
    ),
    "scale of 0": ([of_yaw_rate("scale = 0")], ["9: axle[1].yaw_rate.scale: takes a number other than 0"]),
    "offset without end": (
        [of_yaw_rate("offset = inf")],
        ["9: axle[1].yaw_rate.offset: takes a finite number, not inf"],
    ),
    "range the wrong way round": (
        [of_yaw_rate("range = [20, -20]")],
        ["9: axle[1].yaw_rate.range: takes two numbers, the lower one first, not [20, -20]"],
    ),
    "range beyond every raw value": (
        [of_yaw_rate("range = [1000, 2000]")],
        ["9: axle[1].yaw_rate.range: no raw value of Imu1.Gyro lies within 1000 … 2000"],
    ),
    "range of the DBC that shuts out": (
        [(YAW, 'yaw_rate = "Imu1.Narrow"')],
        [
            (
                "9: axle[1].yaw_rate: the DBC's range of Imu1.Narrow, [-1|1], shuts out 99 % of its raw values, "
                "and values that a train reaches — mend the DBC, or say what it measures, at least this: write "
                'in [[axle]]: yaw_rate = { signal = "Imu1.Narrow", range = [-20.1, 20.1] }'
            )
        ],
    ),
    "range of the DBC that is empty": (
        [(YAW, 'yaw_rate = "Imu2.Backwards"')],
        [
            (
                "9: axle[1].yaw_rate: the DBC's range of Imu2.Backwards is empty, [300|-300] — mend the DBC, or "
                'say what it measures: write in [[axle]]: yaw_rate = { signal = "Imu2.Backwards", range = ["…", '
                '"…"] }'
            )
        ],
    ),
    "time-out of more than three ticks": (
        [of_yaw_rate("timeout_ms = 30")],
        ["9: axle[1].yaw_rate.timeout_ms: 30 ms is longer than three ticks of the design, 15 ms"],
    ),
    "time-out of a cycle": (
        [(SPEED, 'speed = { signal = "Drive.V", timeout_ms = 20 }')],
        ["6: vehicle.speed.timeout_ms: 20 ms is not longer than the cycle of Drive, 20 ms"],
    ),
    "time-out beyond its range": (
        [(SPEED, 'speed = { signal = "Drive.V", timeout_ms = 70000 }')],
        ["6: vehicle.speed.timeout_ms: takes 1 … 65535, not 70000"],
    ),
    "invalid value beyond its field": (
        [of_yaw_rate("invalid = [65536]")],
        ["9: axle[1].yaw_rate.invalid: 65536 is beyond the 16 bits of Gyro"],
    ),
    "invalid word that there is not": (
        [of_yaw_rate('invalid = ["Void"]')],
        [
            (
                "9: axle[1].yaw_rate.invalid: the value table of Gyro has no word 'Void' — it has no value "
                "table: give the raw value"
            )
        ],
    ),
    "gyro slower than the tick": (
        [(YAW, 'yaw_rate = "SlowImu.Gyro"')],
        [
            (
                "9: axle[1].yaw_rate: message SlowImu comes every 20 ms, slower than the design's tick of 5 "
                "ms — a faster sensor, or a design of that tick by `sim-ecu design`"
            )
        ],
    ),
    "multiplexer": (
        [(SPEED, 'speed = "Paged.Page"')],
        ["6: vehicle.speed: Paged.Page says which signals a frame carries; it measures nothing"],
    ),
    "direction of unknown words": (
        [(SPEED, SPEED + '\ndirection = "Drive.Dir"')],
        [
            (
                "7: vehicle.direction: Drive.Dir has no word that is known to mean reverse (Cab A, Cab B) — say "
                'which: write in [vehicle]: direction = { signal = "Drive.Dir", reverse = ["…"] }'
            )
        ],
    ),
    # status
    "status of another form": (
        [of_yaw_rate("status = true")],
        ['9: axle[1].yaw_rate.status: takes "Message.Signal" or false, not true'],
    ),
    "status without Message": (
        [of_yaw_rate('status = "Mode"')],
        ["9: axle[1].yaw_rate.status: 'Mode' is not of the form Message.Signal"],
    ),
    "status that there is not": (
        [of_yaw_rate('status = "Imu1.Mod"')],
        ["9: axle[1].yaw_rate.status: message Imu1 has no signal 'Mod' — did you mean 'Imu1.Mode'?"],
    ),
    "words of a status that there are not": (
        [of_yaw_rate('status = "Imu1.Mode", ok = ["Onn"]')],
        ["9: axle[1].yaw_rate.ok: the value table of Mode has no word 'Onn' — did you mean 'On'?"],
    ),
    "ok and degraded": (
        [of_yaw_rate('status = "Imu1.Mode", ok = ["On"], degraded = [1]')],
        ["9: axle[1].yaw_rate.degraded: 1 is good already"],
    ),
    "ok that is no list": (
        [of_yaw_rate('status = "Imu1.Mode", ok = "On"')],
        ["9: axle[1].yaw_rate.ok: takes a list of raw values or words, not 'On' — write [1]"],
    ),
    "ok without a status": (
        [of_yaw_rate('ok = ["On"]')],
        [
            (
                "9: axle[1].yaw_rate.ok: says nothing without a status — write in [[axle]]: yaw_rate = { signal "
                '= "Imu1.Gyro", ok = ["On"], status = "Message.Signal" }'
            )
        ],
    ),
    "status with no word that is good": (
        [of_yaw_rate('status = "StatusImu.SensorState"')],
        [
            (
                "9: axle[1].yaw_rate.status: StatusImu.SensorState has no word that is known to be good — say "
                'which of Run, Fault: write in [[axle]]: yaw_rate = { signal = "Imu1.Gyro", status = '
                '"StatusImu.SensorState", ok = ["…"] }'
            )
        ],
    ),
    "status that nobody explains": (
        [(YAW, 'yaw_rate = "StatusImu.Gyro"')],
        [
            (
                "9: axle[1].yaw_rate: StatusImu.SensorState tells of failures, and none of its words is known to"
                ' be good (Run, Fault) — write in [[axle]]: yaw_rate = { signal = "StatusImu.Gyro", status = '
                '"StatusImu.SensorState", ok = ["…"] }, or status = false'
            )
        ],
    ),
    "two statements about one status": (
        [
            of_yaw_rate('status = "Imu1.Mode", ok = [1]'),
            (ACC, 'lateral_acceleration = { signal = "Imu1.Acc", status = "Imu1.Mode", ok = [2] }'),
        ],
        [("10: axle[1].lateral_acceleration.status: takes other values of Imu1.Mode for good than axle[1].yaw_rate")],
    ),
    "status that counts and does not": (
        [
            of_yaw_rate('status = "Imu1.Mode", ok = [1]'),
            (ACC, 'lateral_acceleration = { signal = "Imu1.Acc", status = false }'),
        ],
        [("10: axle[1].lateral_acceleration.status: is false, but axle[1].yaw_rate names the status of Imu1")],
    ),
    # E2E
    "unknown profile": (
        [of_torque('signal = "Tcu.Torque", e2e = "P5", data_id = 1')],
        ["11: axle[1].torque.e2e: is 'P5', not one of P11, none"],
    ),
    "profile of the DBC that is not known": (
        [(TORQUE, 'torque = "OtherProfile.Torque"')],
        [
            (
                "11: axle[1].torque: message OtherProfile asks for E2E profile 'P5'; only P11 is known — write "
                'in [[axle]]: torque = { signal = "OtherProfile.Torque", e2e = "none" }, or e2e = "P11" and its '
                "data_id"
            )
        ],
    ),
    "data id missing": (
        [of_torque('signal = "Tcu.Torque", e2e = "P11"')],
        [
            (
                "11: axle[1].torque.data_id: is missing — the DBC states none for Tcu: write in [[axle]]: torque"
                ' = { signal = "Tcu.Torque", e2e = "P11", data_id = "…" }'
            )
        ],
    ),
    "data id beyond its range": (
        [of_torque('signal = "Tcu.Torque", e2e = "P11", data_id = 65536')],
        ["11: axle[1].torque.data_id: takes 0 … 65535, not 65536"],
    ),
    "data id of a message without protection": (
        [of_torque('signal = "Tcu.Torque", data_id = 3')],
        [
            (
                "11: axle[1].torque.data_id: message Tcu is not protected — if it is, write in [[axle]]: torque "
                '= { signal = "Tcu.Torque", data_id = 3, e2e = "P11" }'
            )
        ],
    ),
    "data id beside none": (
        [of_torque('signal = "Protected.Brake", e2e = "none", data_id = 3')],
        ['11: axle[1].torque.data_id: says nothing beside e2e = "none"'],
    ),
    "signal where the counter is": (
        [(TORQUE, 'torque = "Protected.Torque"')],
        [
            (
                "11: axle[1].torque: Protected.Torque lies where the E2E CRC and counter of Protected are — if "
                'it is not protected, write in [[axle]]: torque = { signal = "Protected.Torque", e2e = "none" }'
            )
        ],
    ),
    "two protections of one message": (
        [
            (
                TORQUE,
                'torque = [{ signal = "Protected.Brake", e2e = "none" }, { signal = "Protected.Torque", e2e = "P11" }]',
            )
        ],
        ["11: axle[1].torque[2].e2e: says another E2E protection of Protected than axle[1].torque[1]"],
    ),
    # torque
    "place of a torque": (
        [of_torque('signal = "Tcu.Motor", at = "moter"')],
        ["11: axle[1].torque.at: is 'moter', not one of axle, motor, rim — did you mean 'motor'?"],
    ),
    "motor without a gear ratio": (
        [of_torque('signal = "Tcu.Motor", at = "motor"')],
        [
            (
                "11: axle[1].torque.gear_ratio: is missing — the torque at the axle is the motor's times it: "
                'write in [[axle]]: torque = { signal = "Tcu.Motor", at = "motor", gear_ratio = "…" }'
            )
        ],
    ),
    "gear ratio without a motor": (
        [of_torque('signal = "Tcu.Motor", gear_ratio = 4.6')],
        [
            (
                "11: axle[1].torque.gear_ratio: says nothing of a torque at the axle — of a motor's: write in "
                '[[axle]]: torque = { signal = "Tcu.Motor", gear_ratio = 4.6, at = "motor" }'
            )
        ],
    ),
    "gear ratio of 0": (
        [of_torque('signal = "Tcu.Motor", at = "motor", gear_ratio = 0')],
        ["11: axle[1].torque.gear_ratio: takes a number from 0.1 to 100, not 0"],
    ),
    "share": (
        [of_torque('signal = "Tcu.Torque", share = 1.5')],
        ["11: axle[1].torque.share: takes a number from 0.01 to 1, not 1.5"],
    ),
    "torque at the rim": (
        [of_torque('signal = "Tcu.Torque", at = "rim"')],
        [
            (
                "11: axle[1].torque.signal: unit 'kNm' cannot be converted to N (known: n, kn, kg, t) — a force "
                'at the rim is in N or kN: write in [[axle]]: torque = { signal = "Tcu.Torque", at = "rim", unit'
                ' = "kN" }'
            )
        ],
    ),
    "force at the axle": (
        [of_torque('signal = "Tcu.Force"')],
        [
            (
                "11: axle[1].torque.signal: Tcu.Force: unit 'kN' cannot be converted to N m (known: nm, knm) — "
                'write in [[axle]]: torque = { signal = "Tcu.Force", unit = "N m" }, or at = "rim" for a force'
            )
        ],
    ),
    "part counted twice": (
        [(TORQUE, 'torque = ["Tcu.Torque", { signal = "Tcu.Torque", sign = -1 }]')],
        ["11: axle[1].torque[2].signal: Tcu.Torque is counted in axle[1].torque[1] already"],
    ),
    # contradictions
    "gyro of two axles": (
        [after(SECOND.replace("Imu2.Gyro", "Imu1.Gyro"))],
        [("15: axle[2].yaw_rate: Imu1.Gyro is axle[1].yaw_rate already; each wheelset has its own yaw_rate")],
    ),
    "one signal for two things": (
        [after('brake_torque = "Tcu.Torque"')],
        ["12: axle[1].brake_torque: Tcu.Torque is counted in axle[1].torque already"],
    ),
    "speed mapped and constant": (
        [after("[limits]\nconstant_speed_m_s = 20")],
        [
            (
                "13: limits.constant_speed_m_s: is given, and vehicle.speed names a signal — one of the two: "
                "which one holds?"
            )
        ],
    ),
    "no speed": (
        [(SPEED, "")],
        [
            (
                '5: vehicle.speed: is missing — write in [limits]: constant_speed_m_s = "…", or name the signal:'
                ' write in [vehicle]: speed = "Message.Signal"'
            )
        ],
    ),
    "message of two axles": (
        [after('adhesion = "Adhesion_A1"' + SECOND + 'adhesion = "Adhesion_A1"')],
        ["18: axle[2].adhesion: Adhesion_A1 is sent for axle[1].adhesion already — one job a message"],
    ),
    "message that is read and sent": (
        [(SPEED, 'speed = { signal = "Adhesion_A1.Unnamed", unit = "km/h", range = [0, 600] }')],
        ["7: axle[1].adhesion: Adhesion_A1 is read for vehicle.speed already — one job a message"],
    ),
    "field of something that has no unit": (
        [after('detail = { message = "Tcu", winning_model = "Motor" }')],
        [
            (
                "12: axle[1].detail.winning_model: Tcu.Motor is in 'Nm', not in 1 — write in [[axle]]: detail = "
                '{ message = "Tcu", winning_model = { signal = "Motor", unit = "1" } }'
            )
        ],
    ),
    # outputs
    "no such message to send": (
        [after('adhesion = "Adhesion_A3"')],
        ["12: axle[1].adhesion: the DBC has no message 'Adhesion_A3' — did you mean 'Adhesion_A2'?"],
    ),
    "message that needs a signal": (
        [after('adhesion = "Empty"')],
        [
            (
                "12: axle[1].adhesion.validity: message Empty has no signal 'Validity' — name the one that "
                'carries it: write in [[axle]]: adhesion = { message = "Empty", validity = "…" }'
            ),
            (
                "12: axle[1].adhesion.mu_available: message Empty has no signal 'MuAvailable' — name the one "
                'that carries it: write in [[axle]]: adhesion = { message = "Empty", mu_available = "…" }'
            ),
        ],
    ),
    "message of which nothing is ours": (
        [after('detail = "Empty"')],
        [
            (
                "12: axle[1].detail: message Empty has none of the signals WinningModel, StaleYawRate, "
                "StaleLatAccel, StaleTorque, StaleSpeed, DominantRule, Residual1, Residual2, Residual3, "
                'Residual4, Cause — name those that carry them: write in [[axle]]: detail = { message = "Empty",'
                ' winning_model = "…" }'
            )
        ],
    ),
    "CAN FD": (
        [after('adhesion = "FdAdhesion"')],
        [("12: axle[1].adhesion: message FdAdhesion is CAN FD or multiplexed; only plain classical ones are sent")],
    ),
    "multiplexed message": (
        [after('adhesion = "PagedAdhesion"')],
        [("12: axle[1].adhesion: message PagedAdhesion is CAN FD or multiplexed; only plain classical ones are sent")],
    ),
    "unknown signal of ours": (
        [of_adhesion('mu_availble = "Share"')],
        ["12: axle[1].adhesion.mu_availble: unknown key — did you mean 'mu_available'?"],
    ),
    "no such signal of theirs": (
        [of_adhesion('mu_available = "Shar"')],
        [("12: axle[1].adhesion.mu_available: message Adhesion_A1 has no signal 'Shar' — did you mean 'Share'?")],
    ),
    "one signal for two values": (
        [of_adhesion('mu_used = "MuAvailable"')],
        ["12: axle[1].adhesion.mu_used: Adhesion_A1.MuAvailable carries MuAvailable already"],
    ),
    "not available within the range": (
        [of_adhesion('mu_available = "Share"')],
        [
            (
                "12: axle[1].adhesion.mu_available: 255 is 102 % to Adhesion_A1.Share, a value within its range "
                "0 … 102, and can't say that there is none — another raw value, or a range without it: write in "
                '[[axle]]: adhesion = { mu_available = { signal = "Share", range = ["…", "…"] } }'
            )
        ],
    ),
    "no word for not available": (
        [of_adhesion('mu_available = "Unnamed"')],
        [
            (
                '12: axle[1].adhesion.mu_available: Adhesion_A1.Unnamed has no word for "not available", and '
                "MuAvailable is not always there — say which raw value means it: write in [[axle]]: adhesion = {"
                ' mu_available = { signal = "Unnamed", not_available = 65535 } }'
            )
        ],
    ),
    "not available beyond the field": (
        [of_adhesion('mu_available = { signal = "Unnamed", not_available = 65536 }')],
        ["12: axle[1].adhesion.mu_available.not_available: 65536 is beyond the 16 bits of Unnamed"],
    ),
    "too coarse": (
        [of_adhesion('mu_available = "Coarse"')],
        [("12: axle[1].adhesion.mu_available: Adhesion_A1.Coarse has steps of 5 %; MuAvailable needs 1 or finer")],
    ),
    "too low": (
        [of_adhesion('mu_available = "Low"')],
        ["12: axle[1].adhesion.mu_available: Adhesion_A1.Low says 0 … 14 %; MuAvailable needs 0 … 50"],
    ),
    "no unit": (
        [of_adhesion('mu_available = "Bare"')],
        [
            (
                "12: axle[1].adhesion.mu_available: the DBC states no unit of Adhesion_A1.Bare — write in "
                '[[axle]]: adhesion = { mu_available = { signal = "Bare", unit = "%" } }, or unit = "1"'
            )
        ],
    ),
    "unit of something else": (
        [of_adhesion('message = "Adhesion_A2", mu_available = "Kelvin"')],
        [
            (
                "12: axle[1].adhesion.mu_available: Adhesion_A2.Kelvin is in 'K', not in % or 1 — write in "
                '[[axle]]: adhesion = { message = "Adhesion_A2", mu_available = { signal = "Kelvin", unit = "%" '
                '} }, or unit = "1"'
            )
        ],
    ),
    "counts downwards": (
        [of_adhesion('message = "Adhesion_A2", mu_available = "Down"')],
        [("12: axle[1].adhesion.mu_available: Adhesion_A2.Down counts downwards, by -0.5; nothing is sent so")],
    ),
    "age that ends too early": (
        [of_adhesion('message = "Adhesion_A2", sample_age = "Age"')],
        ["12: axle[1].adhesion.sample_age: Adhesion_A2.Age says 0 … 100 ms; SampleAge needs 0 … 255"],
    ),
    "words missing": (
        [of_adhesion('message = "Adhesion_A2", confidence = "Level"')],
        [
            (
                "12: axle[1].adhesion.confidence: the value table of Adhesion_A2.Level lacks Within1pp, "
                "Within2pp, Within3pp, Within5pp, Within8pp, Within12pp, Wider — say by which of its words or "
                'raw values: write in [[axle]]: adhesion = { message = "Adhesion_A2", confidence = { signal = '
                '"Level", within1pp = "…", within2pp = "…", within3pp = "…", within5pp = "…", within8pp = "…", '
                'within12pp = "…", wider = "…" } }'
            )
        ],
    ),
    "word that there is not": (
        [of_adhesion('validity = { signal = "Validity", valid = "God" }')],
        [
            (
                "12: axle[1].adhesion.validity.valid: the value table of Validity has no word 'God' — known: "
                "NotAvailable, Valid, Degraded"
            )
        ],
    ),
    "value beyond the field": (
        [of_adhesion('validity = { signal = "Validity", valid = 16 }')],
        ["12: axle[1].adhesion.validity.valid: 16 is beyond the 4 bits of Validity"],
    ),
    "unknown word of ours": (
        [of_adhesion('validity = { signal = "Validity", vlid = 1 }')],
        ["12: axle[1].adhesion.validity.vlid: unknown key — did you mean 'valid'?"],
    ),
    "two words with one value": (
        [of_adhesion('validity = { signal = "Validity", degraded = 1 }')],
        [
            (
                "12: axle[1].adhesion.validity.degraded: Adhesion_A1.Validity says Degraded by the same raw "
                "value as Valid, 1"
            )
        ],
    ),
    "cycle shorter than the tick": (
        [of_adhesion("cycle_ms = 2")],
        ["12: axle[1].adhesion.cycle_ms: 2 ms is shorter than the design's tick of 5 ms"],
    ),
    "cycle beyond its range": (
        [of_adhesion("cycle_ms = 0")],
        ["12: axle[1].adhesion.cycle_ms: takes 1 … 65535, not 0"],
    ),
    "protected output over its own signals": (
        [of_adhesion('e2e = "P11", data_id = 5')],
        [
            (
                "12: axle[1].adhesion.message: Adhesion_A1.Validity lies where the E2E CRC and counter of "
                'Adhesion_A1 are — if it is not protected, write in [[axle]]: adhesion = { e2e = "none" }'
            )
        ],
    ),
    # all at once
    "three typing errors": (
        [
            (YAW, YAW.replace("yaw_rate", "yaw_rat")),
            (TORQUE, 'torque = "Tcu.Torqe"'),
            ("[vehicle]", '[limits]\nmin_speed_m_s = "slow"\n[vehicle]'),
        ],
        [
            "6: limits.min_speed_m_s: takes a number, not 'slow'",
            "11: axle[1].yaw_rat: unknown key — did you mean 'yaw_rate'?",
            "13: axle[1].torque: message Tcu has no signal 'Torqe' — did you mean 'Tcu.Torque'?",
        ],
    ),
    "a mistyped DBC and others": (
        [('"mistakes.dbc"', '"mistake.dbc"'), of_yaw_rate("sign = 2"), after("cycle = 3")],
        [
            "2: dbc.file: mistake.dbc: no such DBC file — check the path",
            "9: axle[1].yaw_rate.sign: takes 1 or -1, not 2",
            (
                "12: axle[1].cycle: unknown key — known here: adhesion, ahead, axle_load, brake_torque, detail, "
                "inputs, lateral_acceleration, number, torque, wheel_radius, yaw_rate"
            ),
        ],
    ),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    shutil.copy(DBC, tmp_path)
    return tmp_path


@pytest.mark.parametrize("case", CASES)
def test_mistake_is_said_whole(folder: Path, case: str) -> None:
    edits, messages = CASES[case]
    path = written(folder, edits)
    with pytest.raises(InputError) as error:
        load_config(path)
    assert error.value.status == 2
    assert str(error.value).replace(f"{folder}/mistake.dbc", "mistake.dbc").splitlines() == [
        f"{path}:{message}" for message in messages
    ]
    # each says file, line and key
    assert all(re.match(r"\d+: [a-z0-9_.\[\]]+: ", message) for message in messages)


@pytest.mark.parametrize("case", [case for case in CASES if any(ASKS.search(said) for said in CASES[case][1])])
def test_mistake_that_asks_for_a_key_shows_the_line_to_write(folder: Path, case: str) -> None:
    edits, messages = CASES[case]
    text = written(folder, edits).read_text()
    for message in filter(ASKS.search, messages):
        shown = re.search(r"write in (\[+)([a-z]+)\]+: (.*)", message)
        assert shown, message
        assert shown[1] == "[" * (1 + isinstance(tomllib.loads(text).get(shown[2]), list))
        # what follows the line in the message is another way out
        ends = [k for k, c in enumerate(shown[3], 1) if c in '"}]' or k == len(shown[3])]
        assert any(_is_toml(shown[3][:end]) for end in ends), message


def _is_toml(text: str) -> bool:
    try:
        return bool(tomllib.loads(text))
    except tomllib.TOMLDecodeError:
        return False


def test_line_that_is_shown_mends_the_mistake(folder: Path) -> None:
    """Copied as it is, where nothing in it has to be filled in."""
    for case, old in (
        ("no unit in the DBC", 'lateral_acceleration = "Imu2.Acc"'),
        ("range of the DBC that shuts out", 'yaw_rate = "Imu1.Narrow"'),
        ("no word for not available", 'adhesion = { mu_available = "Unnamed" }'),
    ):
        edits, (message,) = CASES[case]
        line = message.partition("write in [[axle]]: ")[2]
        load_config(written(folder, [*edits, (old, line)]))


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
