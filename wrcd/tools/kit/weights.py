"""Scales of a DBC as whole numbers: a raw value to 0.01 % or ms without floating point."""

import math
from decimal import Decimal
from fractions import Fraction
from typing import NamedTuple

MAX_BITS = 32  # of a signal; a weight and an offset below these bounds then overflow no 64 bits
MAX_WEIGHT, MAX_DIVISOR = 1 << 30, 1 << 60
MAX_OFFSET = 1 << 61


class Weights(NamedTuple):
    """(raw * weight + offset) / divisor, rounded towards zero."""

    weight: int
    offset: int
    divisor: int


def exact(number: float) -> Fraction:
    """The number that a DBC's text says: 0.01 is a hundredth."""
    return Fraction(Decimal(str(number)))


def weights(scale: Fraction, offset: Fraction, rounding: Fraction) -> Weights:
    """Whole numbers for raw * scale + offset + rounding; scale is positive.

    Exact where they fit. Else the divisor is a power of two, and the result at most 0.001 too small.
    """
    divisor = math.lcm(scale.denominator, (offset + rounding).denominator)
    found = _with(divisor, scale, offset + rounding)
    if found.weight < MAX_WEIGHT and abs(found.offset) < MAX_OFFSET and divisor < MAX_DIVISOR:
        return found
    bits = 0
    while (scale * (2 << bits)) < MAX_WEIGHT and abs(offset) * (2 << bits) < MAX_OFFSET and bits < MAX_BITS + 10:
        bits += 1
    return _with(1 << bits, scale, offset + rounding)


def _with(divisor: int, scale: Fraction, offset: Fraction) -> Weights:
    return Weights(math.floor(scale * divisor), math.floor(offset * divisor), divisor)
