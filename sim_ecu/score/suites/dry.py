"""Hours of dry rail: how often, and for how long, is it called low?"""

from collections.abc import Iterator

import numpy as np

from sim_ecu.physics.contact import CURVES
from sim_ecu.physics.track import QUALITY
from sim_ecu.physics.wheelset import Wheelset
from sim_ecu.score.suites.run import AXLES, SPEEDS, TEST, UTILISATIONS, Lot, Run, axle, drive, one_rail, scenario

HOURS = 3.0  # of all axles together
RUN_S = 25.0
STEP_S = 5.0  # between the torques of a course
COASTING = 0.25  # of the axles, in the middle of their run


def dry_hours(w: Wheelset, scale: float, lot: Lot = TEST) -> Iterator[Run]:
    """Many short, poor tracks, each with another seed, at all utilisations and speeds, coasting included."""
    rng = lot.generator(7)
    for number in range(max(2, round(HOURS * 3600 / (RUN_S * AXLES) * scale))):
        v = float(rng.uniform(*SPEEDS))
        axles = []
        for i in range(AXLES):
            t = np.arange(0.0, RUN_S + 1.0, STEP_S)
            wanted = rng.uniform(*UTILISATIONS, len(t)) * float(rng.choice([1.0, 1.0, -1.0]))
            if rng.random() < COASTING:
                wanted[1:-1] = 0.0
            pulled = drive("utilisation", *zip(t.tolist(), wanted.tolist(), strict=True))
            axles.append(axle(lot, i, one_rail(CURVES["A"]), pulled, QUALITY["poor"], rng))
        yield Run("dry-hours", "dry, poor track", number, scenario(w, RUN_S, v, axles), ("A",) * AXLES)
