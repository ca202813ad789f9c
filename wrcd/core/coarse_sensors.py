"""What a converter's coarse steps cost: how late the core finds such a sensor frozen."""

import math

from wrcd.native import library


def cost_of_step(steps: float) -> str:
    """What a converter's step of so many times the rms of the sensor's noise costs. A slow value repeats itself most
    where it stands in the middle of a step."""
    repeats = library().wrcd_repeats_doubted(math.erf(steps / math.sqrt(8.0)) / math.sqrt(2.0))
    if not repeats:
        return "a sound one is taken for frozen"
    return f"a frozen one is found after {repeats} repeats, and a sound one may be taken for it"
