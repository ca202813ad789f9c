"""`--version`: the package, the packaged design, the formats of files, and what it runs with.

Every start of the daemon imports this: what only the lines need is imported for them.
"""

import argparse
from collections.abc import Sequence
from typing import Any

LIBRARIES = ("numpy", "cantools", "python-can")


class Version(argparse.Action):
    """An option that prints the lines and ends."""

    def __init__(self, option_strings: Sequence[str], dest: str, **kwargs: Any) -> None:
        super().__init__(option_strings, argparse.SUPPRESS, nargs=0, default=argparse.SUPPRESS, **kwargs)

    def __call__(self, parser: argparse.ArgumentParser, *_: object, **__: object) -> None:
        """Print and end with 0."""
        print("\n".join(lines(parser.prog)))
        parser.exit()


def lines(program: str) -> list[str]:
    """The first is the program and its version."""
    import json
    import platform

    from wrcd import __version__, resources
    from wrcd.recorder.state_file import FORMAT

    design = json.loads(resources.DESIGN.read_text(encoding="utf-8"))
    found = ", ".join(f"{name} {_installed(name)}" for name in LIBRARIES)
    return [
        f"{program} {__version__}",
        f"design  {design['name']} {design['checksum'][:12]}, {design['format']}",
        f"state   {FORMAT}",
        "log     candump -L",
        f"with    Python {platform.python_version()}, {found}, {platform.system()} {platform.release()}",
    ]


def _installed(name: str) -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version(name)
    except PackageNotFoundError:
        return "missing"
