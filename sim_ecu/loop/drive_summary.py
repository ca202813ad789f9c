"""What a drive came to, for a person and for a program."""

import math
from dataclasses import asdict
from typing import Any

from sim_ecu.loop.counted import counted, down, times
from sim_ecu.loop.drive import Ride
from sim_ecu.loop.judge import MIN_SLIDE_SPEED_M_S, Figures, judge
from sim_ecu.loop.scenario import DriveScenario
from wrcd.errors import Status


def summary(scenario: DriveScenario, ride: Ride) -> list[str]:
    """Lines for a person."""
    train = scenario.train
    lines = [f"{train.name}: {train.title}"]
    early = ride.status is Status.STOPPED
    if not ride.steps:
        return [*lines, "  stopped before the first sample"]
    last = ride.steps[-1]
    ended = f"stopped early, of {train.duration_s:g} s" if early else "the scenario is over"
    return [
        *lines,
        f"  time      {last.due_us * 1e-6:.1f} s: {ended}",
        f"  train     {last.speed_m_s:.1f} m/s after {last.distance_m:.0f} m",
        *_figures(judge(ride.steps, scenario)),
        *_demands(ride.counts["demand"]),
        *_bus(ride.counts),
        *_too_slow(ride.counts),
    ]


def document(scenario: DriveScenario, ride: Ride) -> dict[str, Any]:
    """The same as a document; a figure that there is not is None."""
    out: dict[str, Any] = {"scenario": scenario.train.name, "over": ride.status is Status.DONE}
    if ride.steps:
        last = ride.steps[-1]
        figures = asdict(judge(ride.steps, scenario))
        out |= {"seconds": last.due_us * 1e-6, "speed_m_s": last.speed_m_s, "distance_m": last.distance_m}
        out["figures"] = {k: None if isinstance(v, float) and math.isnan(v) else v for k, v in figures.items()}
    return out | ride.counts


def _figures(f: Figures) -> list[str]:
    return [
        f"  demand    {f.seconds:.1f} s and {f.stop_m:.0f} m from when it came, impulse {f.impulse_kNs:.0f} kNs",
        f"  slip      {f.slides} slides above {MIN_SLIDE_SPEED_M_S:g} m/s, largest {f.max_slip_m_s:.2f} m/s, "
        f"beyond the rail's peak for {f.beyond_s:.2f} s, wheels locked for {f.locked_s:.2f} s",
        f"  wear      {f.slip_energy_kJ:.1f} kJ slip energy a wheel, {f.beyond_kJ:.1f} of them beyond the peak"
        + ("" if math.isnan(f.utilisation) else f"; {f.utilisation:.0%} of the available adhesion used"),
    ]


def _demands(demands: dict[int, dict[str, Any]]) -> list[str]:
    lines = []
    for n, d in demands.items():
        what = (
            "never came" if not d["heard"]
            else "never silent" if not d["silences"]
            else f"silent {times(d['silences'])}, {d['silent_s']:.2f} s in all, {d['longest_s']:.2f} s the longest"
        )  # fmt: skip
        lines.append(f"  axle {n}    demand {what}{counted(d['rejected'])}")
    return lines


def _too_slow(counts: dict[str, Any]) -> list[str]:
    """That the computer did not keep real time: a controller on the bus has lived through another stop."""
    if not counts["waits"]:
        return []
    return [
        f"  computer  too slow, or busy: up to {counts['latest_ms'] / 1000:.2f} s behind real time, "
        f"{counts['waited_s']:.2f} s in all; repeat the run on an idle one before it is judged"
    ]


def _bus(counts: dict[str, Any]) -> list[str]:
    return [
        f"  bus       {counts['frames']} frames, {counts['unsent']} not sent{down(counts['bus'])}",
        f"  rig       {counts['overruns']} overruns, latest {counts['latest_ms']:.1f} ms behind its deadline"
        + (f"; its time waited {times(counts['waits'])}, {counts['waited_s']:.2f} s" if counts["waits"] else ""),
    ]
