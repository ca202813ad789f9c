"""Logs of two trains, as text of the scenarios that they are of, and rows of a fleet that nobody drove."""

import json
from typing import Any

from sim_ecu.campaign.fleet.tally import CLASSES
from sim_ecu.campaign.kinds.log import CAUSES, cause_column, class_column
from sim_ecu.jobs.job import Ending, Job, JobRow, Scalar

SPEED_M_S, SECONDS = 25.0, 6.0
_RIDE = """
duration_s = {}
axles = [1, 2]
speed_m_s = {}
[[rail]]
curve = "A"
[drive]
creep_of_peak = [[0.0, 0.0], [1.0, 1.0]]
"""
SOUND = _RIDE.format(SECONDS, SPEED_M_S)
ONE_AXLE = """
[vehicle]
speed = "VehicleSpeed.Speed"
[[axle]]
number = 1
yaw_rate = "YawRate_A1.YawRate"
lateral_acceleration = "LatAccel_A1.LatAccel"
torque = "Torque_A1.Torque"
"""


def with_fault(kind: str, axle: int, seconds: float) -> str:
    """The same for so long, with a fault of a gyro throughout, and far from the peak: there a sound gyro is quiet."""
    fault = f'kind = "{kind}"\nof = "yaw_rate"\naxle = {axle}\nat_s = 0.0\nduration_s = {seconds}\n'
    ride = _RIDE.format(seconds, SPEED_M_S).replace("[1.0, 1.0]", "[1.0, 0.2]")
    return f"{ride}[[fault]]\n{fault}"


def job(train: str, name: str) -> Job:
    """A log of a train."""
    return Job("log", {"train": train, "log": f"{train}/{name}", "configuration": "", "channel": ""})


def row(
    key: str = "", valid: float = 0.8, km: float = 2.0, suspects: tuple[tuple[str, int, float], ...] = (),
    without_frame: tuple[int, ...] = (), begin_s: float = 1.79e9, steps: int = 20,
) -> JobRow:  # fmt: skip
    """Two axles for two hours: Valid on Dry for a share of it, else warming up. suspects: what, axle, seconds."""
    amounts = {"Dry": valid, "not Valid": 1 - valid}
    way = [[round(1000 * amounts.get(c, 0.0)) for c in CLASSES] for _ in range(steps)]
    axle: dict[str, Any] = {"seconds": 7200.0, "metres": 1000 * km, "valid": valid, "causes": {}, "step_m": 1000.0,
                            "way": way, "step_s": 60.0, "time": []}  # fmt: skip
    detail = {
        "axles": [{"axle": a} | axle for a in (1, 2)],
        "without_frame": list(without_frame),
        "suspects": [
            {"what": what, "axle": a, "text": f"{what} of {a}", "first_s": 1.0, "seconds": s, "times": 1}
            for what, a, s in suspects
        ],
        "refused": [],
        "warnings": [],
    }
    figures: dict[str, Scalar] = {
        "begin_s": begin_s, "hours": 2.0, "km": km, "axles": 2, "valid": valid, "read": 100, "accepted": 90,
        "refused": 10, "suspects": len(suspects),
        **{class_column("km", c): 2 * km * amounts.get(c, 0.0) for c in CLASSES},
        **{class_column("hours", c): 4 * amounts.get(c, 0.0) for c in CLASSES},
        **{cause_column(c): (1 - valid) * (c is CAUSES[0]) for c in CAUSES},
        "detail": json.dumps(detail),
    }  # fmt: skip
    return JobRow(key, Ending.DONE, figures)


def broken(key: str = "") -> JobRow:
    """One that could not be read."""
    return JobRow(key, Ending.FAILED, {}, "7401/broken.log: has not one readable frame", 2)
