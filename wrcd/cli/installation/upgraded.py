"""Whether the configurations in /etc/wrcd hold with this version, and which units run the one before.

python -m wrcd.cli.installation.upgraded: both, for a package manager that has upgraded the program.
"""

import re
import shlex
import sys
from dataclasses import dataclass
from pathlib import Path

from wrcd import __version__
from wrcd.cli.installation import system
from wrcd.cli.installation.lay_out import CONFIGURATIONS
from wrcd.cli.installation.tree import Tree
from wrcd.errors import InputError

SETTING = re.compile(r"^\s*([A-Z_]+)\s*=\s*(.*?)\s*$")


@dataclass(frozen=True, slots=True)
class Checked:
    """A configuration, the units that start with it, and its mistakes, if it has any."""

    file: Path
    units: tuple[str, ...]
    mistakes: tuple[str, ...]


def check_configurations(root: Path) -> list[Checked]:
    """Check every TOML file in etc/wrcd that is no scenario, and every configuration that an .env file there names."""
    tree = Tree(root)
    folder = tree.folder(CONFIGURATIONS)
    unread: list[Checked] = []
    users: dict[Path, list[str]] = {}
    scenarios: set[Path] = set()
    for file in sorted(folder.glob("*.env")):
        try:
            settings = _settings(file)
        except OSError as e:
            # its unit would start without what it sets
            unread.append(Checked(file, (_unit(file),), (f"{file}: cannot be read: {e.strerror}",)))
            continue
        for name, value in settings:
            if name == "WRCD_OPTIONS" and (config := _option(value, "--config")):
                users.setdefault(_below(tree, config), []).append(_unit(file))
            elif name == "SCENARIO":
                scenarios.add(_below(tree, value.strip("\"'")))
    files = sorted({*folder.glob("*.toml"), *users} - (scenarios - set(users)))
    return unread + [Checked(file, tuple(users.get(file, ())), _mistakes(file)) for file in files]


def _unit(file: Path) -> str:
    """The unit that an environment file is of."""
    return file.stem.replace("sim-ecu-", "sim-ecu@", 1) if file.stem.startswith("sim-ecu-") else f"wrcd@{file.stem}"


def _settings(file: Path) -> list[tuple[str, str]]:
    """Names and values of an environment file. Raises OSError."""
    lines = file.read_text(encoding="utf-8", errors="replace").splitlines()
    return [(m[1], m[2]) for m in map(SETTING.match, lines) if m]


def _option(value: str, name: str) -> str:
    """What an option is given among a unit's options; empty if it is not there."""
    try:
        words = shlex.split(value.strip("\"'"))
    except ValueError:
        return ""
    for at, word in enumerate(words):
        if word == name:
            return words[at + 1] if at + 1 < len(words) else ""
        if word.startswith(f"{name}="):
            return word.partition("=")[2]
    return ""


def _below(tree: Tree, name: str) -> Path:
    """A file that a unit names, which it does from the root on."""
    return tree.path(name.lstrip("/") if name.startswith("/") else f"{CONFIGURATIONS}/{name}")


def _mistakes(file: Path) -> tuple[str, ...]:
    from wrcd.config.config import load_config

    try:
        load_config(file)
    except InputError as e:
        return tuple(str(e).splitlines())
    return ()


def main(root: Path) -> int:
    """Print which configurations do not hold with this version, and which units run what was there before."""
    for c in check_configurations(root):
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
