"""The slave that PythonFMU's binary loads: FMI's calls onto a Plant. Everything that differs lies in the resources.

A Python exception in a call becomes fmi2Fatal, and PythonFMU 0.7.0 gives its objects back a second time when such an
instance is freed: the process may crash. So what a master does wrong is a discarded step with its reason, never an
exception. The constructor may raise: fmi2Instantiate fails, and there is no instance to free.
"""

import json
import sys
from functools import partial
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Integer, Real, String
from pythonfmu.default_experiment import DefaultExperiment
from pythonfmu.enums import Fmi2Status, Fmi2Variability

from sim_ecu.loop.drive_scenario import load_drive_scenario
from sim_ecu.loop.fmu.plant import OUTPUT, REFUSED, SAMPLE_S, UNITS, Plant, Variable, digest
from wrcd import __version__
from wrcd.errors import InputError

SCENARIO, MADE = "scenario.toml", "made.json"  # resources
KINDS = {"Real": Real, "Integer": Integer, "Boolean": Boolean, "String": String}


class WrcdRig(Fmi2Slave):  # type: ignore[misc]  # PythonFMU has no types
    """An instance. Raises InputError, which makes fmi2Instantiate fail, where it cannot be what its FMU describes."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        resources = Path(self.resources)
        made = json.loads((resources / MADE).read_text(encoding="utf-8"))
        if made["wrcd"] != __version__:
            raise InputError(
                f"this FMU was made by wrcd {made['wrcd']}, installed is {__version__}",
                hint="install that version, or make the FMU anew",
            )
        scenario = load_drive_scenario(str(resources / SCENARIO))
        if scenario.axles != made["axles"]:
            raise InputError(
                f"has the axles {scenario.axles}, the FMU describes {made['axles']}",
                file=resources / SCENARIO, key="axles", hint="make an FMU of this scenario with sim-ecu fmu",
            )  # fmt: skip
        self._plant, self._start_s = Plant(scenario), 0.0
        if digest(self._plant.variables) != made["variables"]:
            raise InputError("this FMU describes other variables than the wrcd that loads it has", hint="make it anew")
        self.guid, self.version, self.license = made["guid"], __version__, "MIT"
        self.description = f"wrcd's rig, simulation only: {scenario.train.title}"
        self.default_experiment = DefaultExperiment(0.0, scenario.train.duration_s, SAMPLE_S)
        self._cannot_start: InputError | None = None
        self._reported = False
        for v in self._plant.variables:
            self._register(v)

    def _register(self, v: Variable) -> None:
        setter = partial(self._plant.set, v.name) if v.name in self._plant.settable else None
        variable = KINDS[v.kind](
            v.name, description=v.what, causality=Fmi2Causality[v.causality],
            variability=Fmi2Variability[v.variability], getter=partial(self._plant.values.__getitem__, v.name),
            setter=setter,
        )  # fmt: skip
        self.register_variable(variable, nested=False)

    def setup_experiment(self, start_time: float, stop_time: float | None, tolerance: float | None) -> None:
        """Take the time that the simulation begins at; there is no end and no tolerance."""
        self._start_s = start_time

    def exit_initialization_mode(self) -> None:
        """Make the rig. A parameter that is wrong is reported here, and every step is discarded."""
        try:
            self._plant.start(self._start_s)
        except InputError as e:
            self._cannot_start = e
            self._refuse(e)

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Go on; False, which is fmi2Discard, where that can't be."""
        try:
            if self._cannot_start is not None:
                raise self._cannot_start
            self._plant.step(current_time, step_size)
        except InputError as e:
            self._refuse(e)
            return False
        self._plant.values[REFUSED.name] = ""
        return True

    def _refuse(self, error: InputError) -> None:
        """Say why: to the master's log, to a variable; once to stderr, for masters often have the log switched off."""
        self._plant.values[REFUSED.name] = str(error)
        self.log(str(error), Fmi2Status.discard)
        if not self._reported:
            self._reported = True
            print(f"{self.instance_name}: {error}", file=sys.stderr, flush=True)

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        """The model description, with units and what PythonFMU leaves out. Without a date: a file has its bytes."""
        root: Element = super().to_xml(model_options or {})
        del root.attrib["generationDateAndTime"]
        units = Element("UnitDefinitions")
        for name, base in UNITS.items():
            SubElement(SubElement(units, "Unit", name=name), "BaseUnit", {k: f"{x:g}" for k, x in base.items()})
        root.insert([e.tag for e in root].index("CoSimulation") + 1, units)
        described = root.find("ModelVariables")
        structure = root.find("ModelStructure")
        assert described is not None
        assert structure is not None
        unknowns = SubElement(structure, "InitialUnknowns")
        for place, (element, v) in enumerate(zip(described, self._plant.variables, strict=True), 1):
            if v.unit:
                element[0].set("unit", v.unit)
            if v.causality == OUTPUT:
                SubElement(unknowns, "Unknown", index=str(place))
        return root
