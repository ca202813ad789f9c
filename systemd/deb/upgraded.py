"""Say which configurations this version does not start with, and what it warns of in them: for the package's postinst.

python upgraded.py [FOLDER]: each TOML file in FOLDER (default /etc/wrcd) that is no scenario of the rig, and each that
WRCD_OPTIONS in an .env file there gives with --config. What a unit's drop-in gives is not seen.
"""

import re
import shlex
import sys
from itertools import pairwise
from pathlib import Path

from wrcd import __version__
from wrcd.config.config import load_config
from wrcd.errors import InputError, Status

SETTING = re.compile(r"^\s*(WRCD_OPTIONS|SCENARIO)\s*=\s*(.*?)\s*$", re.MULTILINE)


def main(folder: Path) -> None:
    """Print all that is to be mended, with file, line and key."""
    for file in _configurations(folder):
        try:
            warnings = load_config(file).warnings
        except InputError as e:
            said = "does not start" if e.status == Status.BAD_INPUT else "could not start now"
            print(f"wrcd: {__version__} {said} with {file}:\n{e}", file=sys.stderr)
        else:
            for warning in warnings:
                print(f"wrcd: {warning}", file=sys.stderr)


def _configurations(folder: Path) -> list[Path]:
    """Each once, those that an .env file names beside those that lie there."""
    named, scenarios = set[Path](), set[Path]()
    for file in sorted(folder.glob("*.env")):
        # systemd goes on after a backslash at a line's end
        text = file.read_text(encoding="utf-8", errors="replace").replace("\\\n", "")
        for name, value in SETTING.findall(text):
            if value[:1] in ("'", '"') and value[-1:] == value[:1]:
                value = value[1:-1]
            if name == "SCENARIO":
                scenarios.add(folder / value)
            else:
                named.update(folder / config for config in _given(value))
    return sorted({*folder.glob("*.toml"), *named} - (scenarios - named))


def _given(options: str) -> list[str]:
    """What --config is given. Nothing where quotes do not end."""
    try:
        words = shlex.split(options)
    except ValueError:
        return []
    found = [word.partition("=")[2] for word in words if word.startswith("--config=")]
    return found + [after for word, after in pairwise(words) if word == "--config"]


if __name__ == "__main__":
    main(Path(*sys.argv[1:] or ("/etc/wrcd",)))
