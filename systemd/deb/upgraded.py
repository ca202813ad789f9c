"""Say which configurations this version does not start with, and what it warns of in them: for the package's postinst.

python upgraded.py [FOLDER]: each TOML file in FOLDER (default /etc/wrcd) that is no scenario of the rig, and each that
WRCD_OPTIONS in an .env file there gives with --config. What a unit's drop-in gives is not seen.
"""

import sys
from pathlib import Path

from wrcd import __version__
from wrcd.config.config import load_config
from wrcd.errors import InputError, Status
from wrcd.service.installation import configurations


def main(folder: Path) -> None:
    """Print all that is to be mended, with file, line and key."""
    for file in configurations(folder)[0]:
        try:
            warnings = load_config(file).warnings
        except InputError as e:
            said = "does not start" if e.status == Status.BAD_INPUT else "could not start now"
            print(f"wrcd: {__version__} {said} with {file}:\n{e}", file=sys.stderr)
        else:
            for warning in warnings:
                print(f"wrcd: {warning}", file=sys.stderr)


if __name__ == "__main__":
    main(Path(*sys.argv[1:] or ("/etc/wrcd",)))
