"""The rail along the distance: creep curve, curvature and cant."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim_ecu.physics.compiled import compiled
from sim_ecu.physics.contact import CreepCurve

FloatArray = NDArray[np.float64]

# Columns of a rail table: from where (m), the creep curve's five numbers, curvature (1/m, right-hand curves positive:
# they push to the left), cant (rad, positive with the left rail higher). Between two rows everything is linear.
RAIL_COLUMNS = 8
# What `rail_at` gives: the columns without the distance, then the slope of the curvature (1/m2).
CURVATURE, CANT, CURVATURE_SLOPE = 5, 6, 7
# A rail changes from one state to the next over this length, about the wheel's own contact and the film's edge.
BLEND_M = 0.5


class RailSection(NamedTuple):
    """A rail from a distance on, to the next section."""

    from_m: float
    curve: CreepCurve
    curvature: float = 0.0  # 1/m
    cant: float = 0.0  # rad
    # over which curvature and cant change from those of the section before, linearly: a clothoid with its cant ramp
    transition_m: float = BLEND_M
    edge_m: float = BLEND_M  # over which the creep curve changes: a film's edge may be long

    @property
    def settled_m(self) -> float:
        """From where on the section is its own: the next one begins beyond."""
        return self.from_m + max(self.transition_m, self.edge_m)


def rail_table(sections: Sequence[RailSection | tuple[float, CreepCurve, float, float]]) -> FloatArray:
    """The sections as one table (n, RAIL_COLUMNS). Each change begins where its section does; the creep curve changes
    over BLEND_M. What the first section says holds before it, too. Raises ValueError where one begins before the
    previous one is settled."""
    parts = [RailSection(*s) for s in sections]
    curve_m, curves = [parts[0].from_m], [parts[0].curve.row()]
    shape_m, shapes = [parts[0].from_m], [(parts[0].curvature, parts[0].cant)]
    for k, part in enumerate(parts[1:], 1):
        before = parts[k - 1]
        if part.from_m <= (before.settled_m if k > 1 else before.from_m):
            raise ValueError(f"a section of rail from {part.from_m:g} m begins before the one before it is settled")
        curve_m += [part.from_m, part.from_m + part.edge_m]
        curves += [before.curve.row(), part.curve.row()]
        shape_m += [part.from_m, part.from_m + max(part.transition_m, BLEND_M)]
        shapes += [(before.curvature, before.cant), (part.curvature, part.cant)]
    at = np.union1d(curve_m, shape_m)
    columns = [np.interp(at, curve_m, c) for c in np.array(curves).T]
    columns += [np.interp(at, shape_m, c) for c in np.array(shapes).T]
    return np.column_stack([at, *columns])


@compiled
def rail_at(rail: FloatArray, distance_m: float) -> FloatArray:
    """The rail at a distance: the table's row there without the distance, linear between rows and flat outside, and
    the slope of its curvature."""
    out = np.empty(RAIL_COLUMNS)
    read_rail(rail, 0, rail.shape[0], distance_m, out, 0, 1)
    return out


@compiled
def read_rail(
    rails: FloatArray, first: int, end: int, distance_m: float, out: FloatArray, place: int, stride: int
) -> None:
    """The same of the table rails[first:end], written to out[place], out[place + stride], … : nothing is allocated
    where the integration reads it at every stage."""
    i = first
    while i < end - 1 and rails[i + 1, 0] <= distance_m:
        i += 1
    if i == end - 1 or distance_m <= rails[first, 0]:
        for j in range(CURVATURE_SLOPE):
            out[place + j * stride] = rails[i, j + 1]
        out[place + CURVATURE_SLOPE * stride] = 0.0
        return
    length = rails[i + 1, 0] - rails[i, 0]
    share = (distance_m - rails[i, 0]) / length
    for j in range(CURVATURE_SLOPE):
        out[place + j * stride] = rails[i, j + 1] + share * (rails[i + 1, j + 1] - rails[i, j + 1])
    out[place + CURVATURE_SLOPE * stride] = (rails[i + 1, CURVATURE + 1] - rails[i, CURVATURE + 1]) / length
