"""The sim-ecu command. The rig's packages are extras, and a train has none of them: this imports none."""

from collections.abc import Callable, Sequence

from wrcd.cli.program import Program
from wrcd.errors import InputError, install_hint

SIM_ECU = Program(
    "sim-ecu",
    "The rig: nonlinear wheelsets on a CAN bus.",
    "sim_ecu.cli",
    (
        "list",
        "play",
        "drive",
        "control",
        "calibrate",
        "design",
        "score",
        "figures",
        "campaign",
        "demo",
    ),
)
# extra and package, by the module that is imported
MODULES = {
    "numba": ("bench", "numba"),
    "scipy": ("bench", "scipy"),
    "filterpy": ("bench", "filterpy"),
    "skfuzzy": ("bench", "scikit-fuzzy"),
    "packaging": ("bench", "packaging"),
    "e2e": ("bench", "autosar-e2e"),
    "matplotlib": ("bench", "matplotlib"),
    "sklearn": ("learned", "scikit-learn"),
    "pyarrow": ("campaign", "pyarrow"),
    "pandas": ("campaign", "pandas"),
    "dask": ("bench", "dask"),
    "distributed": ("bench", "distributed"),
}


def explained(command: Callable[[], int]) -> int:
    """Run a command of the rig. Raises InputError that names the extra where a package of it is missing."""
    try:
        return command()
    except ModuleNotFoundError as e:
        known = MODULES.get((e.name or "").partition(".")[0])
        if known is None:
            raise
        extra, package = known
        raise InputError(
            f"the package {package} is missing: sim-ecu needs the extra {extra!r}",
            hint=install_hint(extra),
        ) from None


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point. Returns the exit status: see Status."""
    return SIM_ECU.run(argv, explained)
