"""A train whose Adhesion messages have odd ids, layouts, scales and words, and one that comes by CAN FD."""

from pathlib import Path

from wrcd import resources
from wrcd.bus.dbc import Message, find_message, parse_dbc
from wrcd.bus.signals import Output, OutputSignal
from wrcd.core.vocabulary import CONFIDENCES

FD_DATA_ID = 0xBEEF
MESSAGES = """
BO_ 2566914049 Odd_A1: 8 WRCD
 SG_ Zustand : 15|4@0+ (1,0) [0|15] "" Controller
 SG_ Mu : 18|13@0+ (0.0125,-2) [0|100] "%" Controller
 SG_ Stufe : 37|3@0+ (1,0) [0|7] "" Controller
 SG_ Alter : 34|6@0+ (0.005,0) [0|0.315] "s" Controller
 SG_ Kontakt : 44|2@0+ (1,0) [0|3] "" Controller
 SG_ Surface : 48|3@1+ (1,0) [0|5] "" Controller
 SG_ MuGenutzt : 51|13@1- (0.025,0) [0|100] "%" Controller

BO_ 673 Odd_A2: 5 WRCD
 SG_ State : 0|3@1+ (1,0) [0|7] "" Controller
 SG_ Level : 3|2@1+ (1,0) [0|3] "" Controller
 SG_ Mu : 5|14@1- (0.0001220703125,0) [0|0.9998779296875] "1" Controller
 SG_ Use : 25|11@1+ (0.05,0) [0|100] "%" Controller

BO_ 700 Odd_Fd: 64 WRCD
 SG_ State : 15|2@0+ (1,0) [0|3] "" Controller
 SG_ Level : 504|3@1+ (1,0) [0|7] "" Controller
 SG_ Mu : 482|18@0+ (0.0005,0) [0|100] "%" Controller
"""
ATTRIBUTES = """
BA_ "E2EProfile" BO_ 2566914049 "P11";
BA_ "E2EDataId" BO_ 2566914049 4660;
BA_ "GenMsgCycleTime" BO_ 2566914049 40;
BA_ "GenSigTimeoutTime" SG_ 2566914049 Mu 90;
BA_ "VFrameFormat" BO_ 2566914049 1;
VAL_ 2566914049 Zustand 3 "gestoert" 7 "gut" 9 "maessig" 14 "nichts" ;
VAL_ 2566914049 Stufe 0 "None" 1 "Wider" 2 "Within12pp" 3 "Within8pp" 4 "Within5pp" 5 "Within3pp"
 6 "Within2pp" 7 "Within1pp" ;
VAL_ 2566914049 Kontakt 0 "Saturated" 1 "Adhering" 3 "Unknown" ;
VAL_ 2566914049 Surface 0 "Unknown" 1 "Dry" 2 "Wet" 3 "Reduced" 4 "Low" 5 "VeryLow" ;
VAL_ 673 Mu 5000 "being calibrated" ;
"""
TOML = """
dbc = { file = "odd.dbc" }
wheelset = { name = "multiple-unit" }
[vehicle]
speed = "VehicleSpeed.Speed"
[[axle]]
number = 1
yaw_rate = "YawRate_A1.YawRate"
lateral_acceleration = "LatAccel_A1.LatAccel"
torque = "Torque_A1.Torque"
[axle.adhesion]
message = "Odd_A1"
mu_available = { signal = "Mu", not_available = 8191 }
mu_used = { signal = "MuGenutzt", not_available = -4096 }
validity = { signal = "Zustand", valid = "gut", degraded = "maessig", not_available = "nichts", error = "gestoert" }
sample_age = "Alter"
contact_state = "Kontakt"
confidence = "Stufe"
[[axle]]
number = 7
yaw_rate = "YawRate_A2.YawRate"
lateral_acceleration = "LatAccel_A2.LatAccel"
torque = "Torque_A2.Torque"
[axle.adhesion]
message = "Odd_A2"
cycle_ms = 50
mu_available = { signal = "Mu", not_available = 0x2000 }
mu_used = { signal = "Use", not_available = 2047 }
validity = { signal = "State", valid = 5, degraded = 2, not_available = 0, error = 0 }
[axle.adhesion.confidence]
signal = "Level"
none = 0
wider = 0
within12pp = 1
within8pp = 1
within5pp = 2
within3pp = 3
within2pp = 3
within1pp = 3
"""

TWIN_SIGNALS = """
 SG_ State : 12|3@1+ (1,0) [0|7] "" Controller
 SG_ Level : 16|3@1+ (1,0) [0|7] "" Controller
 SG_ Mu : 24|16@1+ (0.01,0) [0|100] "%" Controller
"""
TWIN_HEAD = """
dbc = { file = "twin.dbc" }
wheelset = { name = "multiple-unit" }
[vehicle]
speed = "VehicleSpeed.Speed"
"""
TWIN_AXLE = """
[[axle]]
number = {n}
yaw_rate = "YawRate_A{n}.YawRate"
lateral_acceleration = "LatAccel_A{n}.LatAccel"
torque = "Torque_A{n}.Torque"
[axle.adhesion]
message = "Twin_A{n}"
mu_available = {{ signal = "Mu", not_available = 65535 }}
validity = {{ signal = "State", valid = 1, degraded = 2, not_available = 0, error = 3 }}
[axle.adhesion.confidence]
signal = "Level"
none = 0
wider = 1
within12pp = 2
within8pp = 3
within5pp = 4
within3pp = 5
within2pp = 6
within1pp = 7
"""


def odd_dbc() -> str:
    """The packaged DBC's inputs, and the odd messages."""
    text = resources.DBC.read_text(encoding="utf-8")
    head, tail = text.split("\nBO_ ", 1)
    return f"{head}{MESSAGES}\nBO_ {tail}{ATTRIBUTES}"


def odd_train(folder: Path) -> Path:
    """Its configuration."""
    (folder / "odd.dbc").write_text(odd_dbc(), encoding="utf-8")
    (folder / "odd.toml").write_text(TOML, encoding="utf-8")
    return folder / "odd.toml"


def twin_train(folder: Path) -> Path:
    """Four axles whose ids are easily taken for each other: the same number in 11 and in 29 bits, and 0x400 apart."""
    ids = (0x2A1, 0x2A1 | 1 << 31, 0x2A3, 0x6A3)
    head, tail = resources.DBC.read_text(encoding="utf-8").split("\nBO_ ", 1)
    bodies = "".join(f"\nBO_ {i} Twin_A{n}: 8 WRCD{TWIN_SIGNALS}" for n, i in enumerate(ids, 1))
    lines = "".join(
        f'BA_ "GenMsgCycleTime" BO_ {i} 20;\nBA_ "VFrameFormat" BO_ {i} {i >> 31};\n'
        + (f'BA_ "E2EProfile" BO_ {i} "P11";\nBA_ "E2EDataId" BO_ {i} {n};\n' if n != 2 else "")
        for n, i in enumerate(ids, 1)
    )
    (folder / "twin.dbc").write_text(f"{head}{bodies}\nBO_ {tail}{lines}", encoding="utf-8")
    (folder / "twin.toml").write_text(TWIN_HEAD + "".join(TWIN_AXLE.format(n=n) for n in range(1, 5)), encoding="utf-8")
    return folder / "twin.toml"


def fd_message() -> tuple[Message, Output]:
    """What no configuration sends, but a receiver's tables can hold: 64 bytes, a number over three of them."""
    levels = ("None", *(name for _, name in reversed(CONFIDENCES)))
    signals = {
        "Validity": OutputSignal("State", words={"NotAvailable": 0, "Valid": 1, "Degraded": 2}),
        "MuAvailable": OutputSignal("Mu", not_available=0x3FFFF, round_down=True),
        "Confidence": OutputSignal("Level", words={word: raw for raw, word in enumerate(levels)}),
    }
    database = parse_dbc(odd_dbc(), Path("odd.dbc"))
    return find_message(database, "Odd_Fd"), Output("Odd_Fd", 20_000, FD_DATA_ID, signals)
