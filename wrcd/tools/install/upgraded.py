"""python -m wrcd.tools.install.upgraded: what a person must know after a package manager has upgraded the program."""

import sys
from pathlib import Path

from wrcd import __version__
from wrcd.errors import InputError
from wrcd.tools.install import configurations, system


def main(root: Path) -> int:
    """Print which configurations do not hold with this version, and which units run what was there before."""
    for c in configurations.check(root):
        for mistake in c.mistakes:
            print(f"wrcd: does not hold with wrcd {__version__}: {mistake}", file=sys.stderr)
    try:
        units = [r.unit for r in system.running()]
    except InputError as e:
        print(f"wrcd: {e}", file=sys.stderr)
        return e.status
    if units:
        print(system.restart_advice(units))
    return 0


if __name__ == "__main__":
    sys.exit(main(Path("/")))
