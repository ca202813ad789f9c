"""What slides of a train have revealed: for a person, and as a text to keep over a restart and beside a dump."""

import json
import math
import re
from pathlib import Path
from typing import NamedTuple

from wrcd.core.design import Design
from wrcd.core.estimator import Estimator
from wrcd.errors import InputError
from wrcd.native import constant

FORMAT = "wrcd-slides/1"
SAYS, MOST = constant("SLIDE_SAYS"), 1.0 / (1.0 - constant("SLIDES_KEPT"))  # log of one slide, weight of all
_ROOM = 1.0 + 1e-9  # for what rounding makes of sums


class Slides(NamedTuple):
    """Their number, the older counting less, and the log by which the estimates before them were too high; 0 where that
    may be chance."""

    weight: float
    bias: float

    @property
    def sentence(self) -> str:
        """For a person; empty where there is nothing to report."""
        if self.bias == 0.0:
            return ""
        off_pct = 100.0 * abs(math.expm1(self.bias))
        return (
            f"{self.weight:.0f} slides show that the estimates before them were {off_pct:.0f} % too "
            f"{'high' if self.bias > 0.0 else 'low'}: intervals are wider by that"
        )


def slides_of(estimator: Estimator) -> Slides:
    """What they have revealed so far."""
    weight, _, _, bias = estimator.slides
    return Slides(weight, bias)


def kept_text(estimator: Estimator) -> str:
    """A line of JSON: sums over the slides, and the design whose estimates they judge."""
    sums = estimator.slides[:3]
    return json.dumps({"format": FORMAT, "design": estimator.design.checksum, "slides": sums}) + "\n"


def take_kept(estimator: Estimator, text: str, file: Path) -> None:
    """Go on from what such a text says. Raises InputError where it is damaged or of another design."""
    estimator.take_slides(_sums(text, file, estimator.design))


def _sums(text: str, file: Path, design: Design) -> tuple[float, float, float]:
    try:
        kept = json.loads(text)
        if kept["format"] != FORMAT:
            raise ValueError
        of, (weight, total, squares) = kept["design"], (0.0 + x for x in kept["slides"])
        bounds = 0.0 <= weight <= MOST * _ROOM and 0.0 <= squares <= SAYS**2 * weight * _ROOM
        if not (bounds and total * total <= weight * squares * _ROOM and re.fullmatch("[0-9a-f]{12,64}", of)):
            raise ValueError
    except (ArithmeticError, ValueError, KeyError, TypeError, RecursionError):
        raise InputError(f"is damaged, or no {FORMAT}", file=file) from None
    if of != design.checksum:
        raise InputError(f"is of the design {of[:12]}, not {design.checksum[:12]}", file=file)
    return weight, total, squares
