"""The estimator's terms: numbers that C defines (wrcd/core/c), each by its name there, and states with their words."""

from enum import IntEnum

from wrcd.native import constant


def _whole(name: str) -> int:
    return int(constant(name))


MAX_AXLES = _whole("MAX_AXLES")  # of a train: a Co'Co' locomotive has six
MAX_SIGNALS = _whole("MAX_SIGNALS")  # mapped, of a message
MODELS = _whole("MODELS")
CHANNELS = _whole("CHANNELS")  # yaw rate, lateral acceleration
INPUTS = _whole("INPUTS")  # that choose the rules: four residuals, torque, speed
# What the rules' outputs move with: those six; correlations of each model's two innovations with themselves LAG ticks
# before, and of the two with each other; the window's LENGTH; the sensors' noise (NOISE); how far the torque has been
# above and below that of the moment (SWING); by how much each residual has stepped; powers and correlation of the two
# signals in three bands, and their correlations with those of the PARTNER, the other axle of the bogie.
COLUMNS, LAG, LENGTH, SUMS = _whole("COLUMNS"), _whole("LAG"), _whole("LENGTH"), _whole("SUMS")
PARTNER = slice(_whole("OF_PARTNER_IN_BANDS"), COLUMNS)
NOISE = slice(_whole("NOISE"), _whole("NOISE") + CHANNELS)
SWING = slice(_whole("SWING"), _whole("SWING") + 2)
BLOCK_TICKS = _whole("BLOCK_TICKS")  # a window's length goes by these
SPAN_TICKS = _whole("SPAN_TICKS")  # from one look at the pairs of sensors to the next
# What tells a pair's states: of its own signals (PAIR_OWN), of the newest span and of two longer means; of those with
# its partner's; speed and torque; what the rules were given; and correlations that swapped wires give.
PAIR_FEATURES, PAIR_OWN = _whole("PAIR_FEATURES"), _whole("PAIR_OWN")
MAX_FEATURE = constant("MAX_FEATURE")  # standard deviations
CERTAIN = constant("CERTAIN")  # log odds of a pair's state: no more than this is kept
SLOWEST_M_S = constant("SLOWEST_M_S")  # of a train whose axles are compared a wheelbase apart
MIN_FIRING, MIN_M = constant("MIN_FIRING"), constant("MIN_M")
HARSH_SHARE, GAPS_SHARE = constant("HARSH_SHARE"), constant("GAPS_SHARE")
MAX_JUMP = constant("MAX_JUMP")  # rad/s
LOG_SPREADS = constant("LOWEST_LOG_SPREAD"), constant("HIGHEST_LOG_SPREAD")  # of an interval, over the adhesion


class EstimateDoubt(IntEnum):
    """What of the estimate itself keeps it from being believed."""

    NONE = 0
    NO_RULE = 1  # too few rules fire
    BEYOND_TRAINING = 2  # residuals unlike any that the rules were made from
    HARSH = 3  # so many pulses that little of the window is left
    SHORT = 4  # of too little track to tell
    GAPS = 5  # so many lost measurements that little of the window is left


class PairState(IntEnum):
    """What a pair of sensors may be."""

    SOUND = 0
    REVERSED = 1
    GYRO_DEAD = 2  # it says nothing but its own noise
    ACCEL_DEAD = 3
    BOTH_DEAD = 4
    OTHER_AXLE = 5
    WRONG_UNIT = 6
    LATE = 7

    @property
    def words(self) -> str:
        """The same in words."""
        return _PAIR_STATES[self]


_PAIR_STATES = (
    "sound", "one the other way round", "the gyro dead", "the accelerometer dead", "both dead", "of different axles",
    "in a wrong unit", "one later than it says",
)  # fmt: skip


class Regime(IntEnum):
    """What goes on, by which an interval is wide. The last that applies counts."""

    STEADY = 0
    MOVING = 1  # the torque
    COASTING = 2
    CHANGED = 3  # the window was cut just now
    SATURATED = 4

    @property
    def words(self) -> str:
        """The same in words."""
        return _REGIMES[self]


_REGIMES = ("steady", "moving torque", "coasting", "just changed", "saturated")
