"""Makes the FMU: the scenario, a loader, a page and PythonFMU's binary in one zip archive."""

import hashlib
import json
import os
import sys
import tempfile
import uuid
import zipfile
from collections.abc import Iterable, Mapping
from importlib.metadata import distribution
from pathlib import Path

from pythonfmu.builder import FmuBuilder

from sim_ecu.loop.drive_scenario import DriveScenario, load_drive_scenario
from sim_ecu.loop.fmu.plant import Variable, digest, variables
from sim_ecu.loop.fmu.slave import MADE, SCENARIO
from sim_ecu.play.scenario import path_of
from sim_ecu.reporting.page import Page, PageSection, Part, html
from sim_ecu.reporting.table import Table
from wrcd import __version__
from wrcd.errors import InputError


def page(scenario: DriveScenario, variables: Iterable[Variable]) -> str:
    """The page as HTML."""
    parts: list[Part] = [
        "Simulation only. FMI 2.0 co-simulation; communication step 0.005 s or a multiple of it.",
        "It holds no Python: the importing side needs Linux on x86-64 and Python 3.11 or newer with "
        f"wrcd[bench] {__version__}. The scenario is resources/scenario.toml.",
        Table(
            ["name", "type", "causality", "unit", "what"],
            [[v.name, v.kind, v.causality, v.unit, v.what] for v in variables],
        ),
    ]
    return html(Page("wrcd's rig", f"wrcd's rig: {scenario.train.title}", [PageSection("", "", parts)], links=""))


MODULE = "wrcd_rig_fmu"
# For each instance, PythonFMU's binary imports this module, runs its source again, and takes the class that is deepest
# below Fmi2Slave. Then (up to version 0.7.0) it gives back a reference to the module's dictionary that it does not own:
# unless one is added, the second instance in a process finds no class in it, or the process crashes.
LOADER = '''"""Loads the rig of the wrcd that is installed in the importing Python."""

import ctypes
import sys

if locals() is not globals():  # run by the binary, not imported
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(globals()))  # the reference that the binary will give back
try:
    from sim_ecu.loop.fmu.slave import WrcdRig
except ImportError as e:
    raise ImportError(
        f"this FMU needs the package wrcd[bench] in the Python that loads it, {sys.executable}: {e}"
    ) from e
'''
PLATFORMS = ("linux64",)  # wrcd is for Linux: a binary for another system would promise what nobody has tried
OLDEST = (1980, 1, 1, 0, 0, 0)  # the date of a zip archive's entries


def pack(scenario: str, output: Path) -> tuple[DriveScenario, tuple[Variable, ...]]:
    """Write the FMU of a packaged scenario to drive, or of a file: the same bytes for the same scenario and versions.

    Returns the scenario and the variables. Raises InputError.
    """
    loaded = load_drive_scenario(scenario)
    text = path_of(scenario, to_drive=True).read_bytes()
    everything = variables(loaded.axles)
    version = distribution("pythonfmu").version
    parts = [text, digest(everything).encode(), __version__.encode(), version.encode(), LOADER.encode()]
    guid = str(uuid.uuid5(uuid.NAMESPACE_OID, hashlib.sha256(b"\0".join(parts)).hexdigest()))
    made = {"wrcd": __version__, "axles": loaded.axles, "variables": digest(everything), "guid": guid}
    with tempfile.TemporaryDirectory(prefix="wrcd-fmu-") as folder:
        built = _build(Path(folder), text, made, page(loaded, everything))
        try:
            _write(built, output)
        except OSError as e:
            raise InputError(
                f"cannot be written: {e.strerror}", file=output, hint="check the folder, your rights and the disk"
            ) from None
    return loaded, everything


def _build(folder: Path, text: bytes, made: Mapping[str, object], about: str) -> Path:
    """PythonFMU's own archive in a folder. What its builder leaves in this process is taken back."""
    script, resources, docs = folder / "src" / f"{MODULE}.py", folder / "resources", folder / "docs"
    for place in (script.parent, resources, docs / "licenses"):
        place.mkdir(parents=True)
    script.write_text(LOADER, encoding="utf-8")
    (resources / SCENARIO).write_bytes(text)
    (resources / MADE).write_text(json.dumps(made, indent=1) + "\n", encoding="utf-8")
    (resources / "requirements.txt").write_text(f"wrcd[bench]=={__version__}\n", encoding="utf-8")
    (docs / "index.html").write_text(about, encoding="utf-8")
    notice = distribution("pythonfmu").read_text("licenses/LICENSE") or distribution("pythonfmu").read_text("LICENSE")
    if notice:  # its binary and modules are in the FMU, too
        (docs / "licenses" / "pythonfmu.txt").write_text(notice, encoding="utf-8")
    path = list(sys.path)
    try:
        return Path(
            FmuBuilder.build_FMU(
                script, folder / "built.fmu", project_files=sorted(resources.iterdir()), documentation_folder=docs,
                canHandleVariableCommunicationStepSize="false",
            )
        )  # fmt: skip
    finally:
        sys.path[:] = path
        sys.modules.pop(MODULE, None)


def _write(built: Path, output: Path) -> None:
    """The archive anew, compressed, without dates and without binaries that are of no use; whole or not at all."""
    part = output.with_name(f"{output.name}.part")
    try:
        with zipfile.ZipFile(built) as old, zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED) as new:
            for name in sorted(old.namelist(), key=lambda name: (name != "modelDescription.xml", name)):
                if name.startswith("binaries/") and name.split("/")[1] not in PLATFORMS:
                    continue
                entry = zipfile.ZipInfo(name, OLDEST)
                entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
                new.writestr(entry, old.read(name))
        os.replace(part, output)
    finally:
        part.unlink(missing_ok=True)
