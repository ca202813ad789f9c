"""The rig's packages are an extra: a train has none of them. Imports none."""

from collections.abc import Callable

from wrcd.errors import InputError

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
    "pythonfmu": ("fmi", "pythonfmu"),
    "pyarrow": ("campaign", "pyarrow"),
    "distributed": ("cluster", "distributed"),
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
            hint=f"pip install 'wrcd[{extra}]', or in the source's folder pip install '.[{extra}]'",
        ) from None
