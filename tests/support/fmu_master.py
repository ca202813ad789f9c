"""Drives FMUs with FMPy, as a master does; run as a process of its own, for what an FMU does to one lasts.

python -m tests.support.fmu_master FMU OTHER: prints what came of it as JSON.
"""

import json
import shutil
import sys
from pathlib import Path
from typing import Any

from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave, fmi2Discard

STEPS = 300
SAMPLE_S = 0.005


def demand(k: int, axle: int) -> tuple[float, int]:
    """Torque in N m and valve of an axle in a sample: what a controller might do, and more."""
    return -2000.0 * axle - 20.0 * k, k // 60 % 3


class Instance:
    """An instance of an FMU, and its variables by name."""

    def __init__(self, fmu: str, name: str, folder: str | None = None) -> None:
        self.folder = extract(fmu) if folder is None else folder
        described = read_model_description(fmu)
        self.variables = {v.name: v for v in described.modelVariables}
        self.outputs = [v.name for v in described.modelVariables if v.causality == "output"]
        self.axles = [int(v[4]) for v in self.variables if v.endswith(".valve")]
        self.slave = FMU2Slave(
            guid=described.guid, unzipDirectory=self.folder, instanceName=name,
            modelIdentifier=described.coSimulation.modelIdentifier,
        )  # fmt: skip
        self.slave.instantiate(loggingOn=True)

    def set(self, **values: float | int | bool) -> None:
        """Set variables; a double underscore in a name is its dot."""
        for name, value in values.items():
            v = self.variables[name.replace("__", ".")]
            getattr(self.slave, f"set{v.type}")([v.valueReference], [value])

    def begin(self, time_s: float = 0.0, **parameters: float | int | bool) -> None:
        self.slave.setupExperiment(startTime=time_s)
        self.set(**parameters)
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()

    def demand(self, k: int) -> None:
        for n in self.axles:
            torque, valve = demand(k, n)
            self.set(**{f"axle{n}__torque": torque, f"axle{n}__valve": valve})

    def get(self) -> list[float]:
        """Values of the outputs; true is 1."""
        out: dict[str, float] = {}
        for kind in ("Real", "Boolean"):
            names = [o for o in self.outputs if self.variables[o].type == kind]
            got = getattr(self.slave, f"get{kind}")([self.variables[o].valueReference for o in names])
            out |= dict(zip(names, map(float, got), strict=True))
        return [out[o] for o in self.outputs]

    def ride(self, steps: int = STEPS, begin_s: float = 0.0) -> list[list[float]]:
        """The outputs of each step of 5 ms."""
        rows = []
        for k in range(steps):
            self.demand(k)
            self.slave.doStep(begin_s + k * SAMPLE_S, SAMPLE_S)
            rows.append(self.get())
        return rows

    def refusal(self, time_s: float, step_s: float) -> list[object]:
        """Status of a step, why it was refused, and what stands still."""
        before = self.get()
        try:
            self.slave.doStep(time_s, step_s)
            status = 0
        except FMICallException as e:
            status = e.status
        (why,) = self.slave.getString([self.variables["refused"].valueReference])
        return [status, why.decode(), self.get() == before]

    def end(self) -> None:
        self.slave.terminate()
        self.slave.freeInstance()


def refusals(fmu: str) -> dict[str, list[object]]:
    """A step each that cannot be done, with what is set before it."""
    one = Instance(fmu, "refusals")
    early = one.refusal(0.0, SAMPLE_S)
    one.begin()
    one.slave.doStep(0.0, SAMPLE_S)
    here = SAMPLE_S
    out = {"before the start": early}
    for step_s in (0.004, 0.0075, 0.0, -SAMPLE_S, float("nan"), float("inf")):
        out[f"step {step_s:g}"] = one.refusal(here, step_s)
    out["elsewhere"] = one.refusal(1.0, SAMPLE_S)
    for name, wrong, right in (
        ("axle1__valve", 3, 0), ("axle1__torque", float("nan"), 0.0), ("axle2__torque", float("inf"), 0.0),
    ):  # fmt: skip
        one.set(**{name: wrong})
        out[name] = one.refusal(here, SAMPLE_S)
        one.set(**{name: right})
    out["none"] = one.refusal(here, SAMPLE_S)
    one.end()
    for name, wrong in (("seed", -1), ("start_speed", 500.0)):
        one = Instance(fmu, name)
        one.begin(**{name: wrong})
        out[name] = one.refusal(0.0, SAMPLE_S)
        one.end()
    return out


def broken(fmu: str, resource: str, old: str, new: str) -> str:
    """Why an FMU cannot be loaded whose resource somebody changed."""
    folder = extract(fmu)
    path = Path(folder, "resources", resource)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    try:
        Instance(fmu, resource, folder)
    except Exception as e:
        return str(e)
    finally:
        shutil.rmtree(folder)
    return "loaded"


def main(fmu: str, other: str) -> None:
    """Print one JSON object."""
    out: dict[str, Any] = {}
    first = Instance(fmu, "first")
    first.begin()
    out["outputs"], out["ride"] = first.outputs, first.ride()
    first.slave.reset()
    first.begin()
    out["after reset"] = first.ride()
    beside, stranger, same = Instance(fmu, "beside", first.folder), Instance(other, "other"), Instance(fmu, "again")
    beside.begin(seed=2, driver__is_input=True, driver__input=-0.25)
    stranger.begin(start_speed=12.5)
    same.begin(100.0)
    first.slave.reset()
    first.begin()
    rides: list[list[list[float]]] = [[], [], [], []]
    for k in range(40):  # step by step in turn
        for i, (instance, begin_s) in enumerate(((first, 0.0), (beside, 0.0), (stranger, 0.0), (same, 100.0))):
            instance.demand(k)
            instance.slave.doStep(begin_s + k * SAMPLE_S, SAMPLE_S)
            rides[i].append(instance.get())
    out["in turn"] = rides
    for instance in (first, beside, stranger, same):
        instance.end()
    wide = Instance(fmu, "wide")
    wide.begin()
    out["wide"] = []
    for k in range(0, 40, 4):
        wide.demand(k)
        wide.slave.doStep(k * SAMPLE_S, 4 * SAMPLE_S)
        out["wide"].append(wide.get())
    wide.end()
    out["refusals"] = refusals(fmu)
    result = simulate_fmu(fmu, stop_time=0.5, output=["truth.speed", "truth.distance"], output_interval=0.01)
    out["simulated"] = [float(result["time"][-1]), float(result["truth.speed"][-1])]
    out["version"] = broken(fmu, "made.json", '"wrcd": "', '"wrcd": "9.')
    out["variables"] = broken(fmu, "made.json", '"variables": "', '"variables": "0')
    out["axles"] = broken(fmu, "scenario.toml", "axles = [1, 2]", "axles = [1, 2, 3]")
    print("RESULT" + json.dumps(out))


if __name__ == "__main__":
    assert fmi2Discard == 2
    main(*sys.argv[1:])
