"""What a DBC says of a message, to be compared; databases made of a few lines; DBC files that are not ours."""

from pathlib import Path

from wrcd.bus.dbc import Database, Message, parse_dbc

_HEAD = 'VERSION ""\nNS_ :\nBS_:\nBU_: B\n'

# Two bogie signals in a train's own units, a big-endian speed, neither with E2E
TRAIN_DBC = """VERSION ""
NS_ :
BS_:
BU_: BCU
BO_ 2364540158 Bogie1: 8 BCU
 SG_ Gyro : 0|16@1- (0.01,0) [-200|200] "deg/s" BCU
 SG_ Side : 16|16@1- (0.001,0) [-20|20] "g" BCU
 SG_ Tractive : 32|16@1- (0.1,0) [-100|100] "kNm" BCU
BO_ 800 Drive: 2 BCU
 SG_ V : 7|16@0+ (0.01,0) [0|300] "km/h" BCU
VAL_ 800 V 65535 "SNA" ;
"""

# Optional inputs: direction and load
DIRECTION_AND_LOAD_DBC = """VERSION ""
NS_ :
BS_:
BU_: B
BO_ 800 State: 4 B
 SG_ Dir : 0|2@1+ (1,0) [0|3] "" B
 SG_ Load : 8|16@1+ (0.1,0) [0|0] "kN" B
VAL_ 800 Dir 0 "Forward" 1 "Reverse" 3 "SNA" ;
"""


def told(m: Message) -> tuple[object, ...]:
    """All that is known of a message, down to its signals."""
    attributes = {k: v.value for k, v in m.dbc.attributes.items()} if m.dbc else {}
    signals = [
        (repr(s), s.start, s.length, s.comment, s.choices, {k: v.value for k, v in s.dbc.attributes.items()})
        for s in m.signals
        if s.dbc is not None
    ]
    return repr(m), m.cycle_time, m.senders, m.comment, attributes, signals


def database(body: str) -> Database:
    """Of messages, value tables and so on; the lines before them are usual."""
    return parse_dbc(_HEAD + body, Path("lines.dbc"))
