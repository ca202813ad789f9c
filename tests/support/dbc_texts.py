"""DBC files that are not ours."""

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
