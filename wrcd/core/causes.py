"""The states of an axle, and why it is not Valid: one list for the bus, the log and a replay.

Which of them applies is decided in wrcd/core/c/validity.c. A new cause has its number here, in wrcd/core/c/wrcd.h and
in the DBC, and what it is about here; when it holds and what it comes behind in validity.c; if it has figures, they in
events.c and their words in details.py; rows in docs/reference/validity.md and what-a-controller-does.md, and the number
of causes in README.md. A DBC of others whose table lacks its word is refused.
"""

from enum import IntEnum, StrEnum


class Validity(StrEnum):
    """The labels of the DBC that are in use."""

    NOT_AVAILABLE = "NotAvailable"
    VALID = "Valid"
    DEGRADED = "Degraded"


class Cause(IntEnum):
    """Its number on the bus, and what it means in words. The DBC's value tables spell the names in one word."""

    words: str

    def __new__(cls, number: int, words: str) -> "Cause":
        """A number that carries its words."""
        member = int.__new__(cls, number)
        member._value_ = number
        member.words = words
        return member

    NONE = 0, ""
    # NotAvailable
    WARMING_UP = 1, "the window is not full yet"
    STANDSTILL = 2, "the train is slower than an estimate needs"
    INPUT_SILENT = 3, "an input is silent or refused"
    RESTARTED = 4, "measurements stayed absurd or the speed jumped: started anew, the window is not full yet"
    # Degraded: a tick within the window was not sound
    INPUT_STALE = 5, "an input was past its time-out"
    TWO_SENDERS = 6, "two senders sent the same message"
    SENSOR_DEGRADED = 7, "a sender reports Degraded"
    UNCHANGED = 8, "a sensor stood still while the train moved"
    SPEED_OUT_OF_RANGE = 9, "the speed is outside the design"
    FRICTION_SHARE_UNKNOWN = 10, "the friction brakes may have acted, and their torque is not known"
    LOAD_BEYOND = 11, "the axle load is too far from the design's"
    RADIUS_BEYOND = 12, "the wheel radius is too far from the design's"
    # Degraded: the pair of sensors is not what it should be
    SENSORS_SILENT = 13, "gyro and accelerometer say nothing but their own noise"
    GYRO_REVERSED = 14, "gyro and accelerometer are against each other: one is mounted the other way round"
    SENSORS_UNRELATED = 15, "gyro and accelerometer do not feel the same track: of two axles, or one of them late"
    ACCEL_SMALL = 16, "the accelerometer says too little for what the gyro says: broken, or its unit is wrong"
    GYRO_DEAD = 17, "the gyro says nothing but its own noise"
    # Degraded: the estimate speaks against itself
    TOO_LITTLE_DATA = 18, "too few measurements in the window, or of too little track"
    NO_RULE = 19, "no rule fits what is seen"
    BEYOND_TRAINING = 20, "what is seen is beyond what the rules were made from"
    HARSH = 21, "vibration or joints are beyond what the rules bear"
    CONTRADICTION = 22, "more adhesion is in use than the estimate with its interval allows"
    # Degraded as 5 to 12
    TORQUES_CONTRADICT = 23, "torques act against each other while the train brakes: one of them has the wrong sign"
    # Reserved: sent by wrcd up to 0.4
    WHEELSET_UNLIKE = 24, "reserved, not sent"
    # 31 had a meaning in earlier versions: it is not used again

    @property
    def label(self) -> str:
        """The name as the DBC spells it: GyroDead for GYRO_DEAD."""
        return "".join(word.capitalize() for word in self.name.split("_"))


# What a cause is about, for those who judge a train, a bus or a log by them.
OF_RIDE = (Cause.WARMING_UP, Cause.STANDSTILL)
OF_ARRIVAL = (Cause.INPUT_SILENT, Cause.INPUT_STALE)
OF_SENDER = (Cause.TWO_SENDERS, Cause.SENSOR_DEGRADED)
OF_PAIR = tuple(Cause)[Cause.SENSORS_SILENT : Cause.GYRO_DEAD + 1]
OF_SENSOR = (*OF_PAIR, Cause.UNCHANGED, Cause.TORQUES_CONTRADICT)  # they accuse one, or its mounting
OF_ESTIMATE = (Cause.RESTARTED, *tuple(Cause)[Cause.TOO_LITTLE_DATA : Cause.CONTRADICTION + 1])
RESERVED = frozenset((Cause.WHEELSET_UNLIKE,))  # numbers and names that others know, and that nothing gives any more
