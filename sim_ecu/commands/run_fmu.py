"""`sim-ecu fmu`: makes the file and says what it needs."""

from pathlib import Path

from sim_ecu.commands.outputs import check_output
from sim_ecu.loop.fmu.pack import pack
from wrcd import __version__
from wrcd.errors import InputError


def run(scenario: str, output: Path) -> int:
    """Make the FMU. Raises InputError."""
    if output.suffix != ".fmu":
        raise InputError("does not end in .fmu", file=output, key="-o", hint=f"write {output.stem or 'rig'}.fmu")
    check_output("-o", output)
    made = pack(scenario, output)
    axles = len(made.scenario.axles)
    print(
        f"{output}: {made.scenario.train.name}, {axles} axle{'s' * (axles > 1)}, {len(made.variables)} variables; "
        f"needs Linux on x86-64 and Python 3.11 or newer with wrcd[bench] {__version__}"
    )
    return 0
