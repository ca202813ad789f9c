"""What a design was made from: the rig's half of a design file."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sim_ecu.design.linear import Point
from sim_ecu.physics.contact import CreepCurve
from sim_ecu.physics.sensors import SENSOR_SETS, SensorSet
from sim_ecu.physics.wheelset import Wheelset
from wrcd.errors import InputError
from wrcd.estimator.design import Design, load_design


@dataclass(frozen=True, slots=True)
class Source:
    """A loaded design with the inputs it was made from, and how well its rules describe their own training data.

    seed and roughness (times the good track's spectral density, from … to) are of the training conditions; support is
    how many windows speak for each rule; windows and mean_error_pp are of the fit.
    """

    file: Path
    design: Design
    wheelset: Wheelset
    sensors: SensorSet
    points: tuple[Point, ...]
    seed: int
    roughness: tuple[float, float]
    support: tuple[float, ...]
    windows: int
    mean_error_pp: float


def load_source(file: Path) -> Source:
    """Read a design file for the rig. Raises InputError where it lacks what the rig needs."""
    design = load_design(file)
    document: Any = json.loads(file.read_text(encoding="utf-8"))
    try:
        inputs, plan, fit = document["inputs"], document["inputs"]["plan"], document["fit"]
        low, high = plan["roughness_range"]
        return Source(
            file=file,
            design=design,
            wheelset=Wheelset(**design.wheelset),
            sensors=SENSOR_SETS[inputs["sensors"]["name"]],
            points=tuple(_point(m) for m in document["bank"]["models"]),
            seed=int(plan["seed"]),
            roughness=(float(low), float(high)),
            support=tuple(float(s) for s in document["fuzzy"]["support"]),
            windows=int(fit["windows"]),
            mean_error_pp=float(fit["mean_error_pp"]),
        )
    except (KeyError, TypeError, ValueError) as e:
        raise InputError(
            f"lacks what the rig needs of it: {e!r}",
            file=file,
            key="inputs",
            hint="make the design again with `sim-ecu design`",
        ) from None


def _point(m: dict[str, Any]) -> Point:
    track, yaw, lateral = (float(q) for q in m["noise"])
    return Point(
        str(m["name"]), CreepCurve(**m["curve"]), float(m["creep_of_peak"]), (track, yaw, lateral),
        float(m["yaw_rate_weight"]),
    )  # fmt: skip
