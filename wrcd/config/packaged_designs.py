"""Designs by their names: those that come along lie in one folder as NAME.design.json."""

import json
import re
from pathlib import Path

from wrcd import resources
from wrcd.config.section import suggest
from wrcd.errors import InputError

_SUFFIX = ".design.json"
PATH = r"/|\.json$"  # what else is given is a name


def packaged_designs() -> list[str]:
    """Return the names of the designs that come along."""
    return sorted(p.name.removesuffix(_SUFFIX) for p in resources.DESIGNS.glob(f"*{_SUFFIX}"))


def designs_for(wheelset: object) -> list[str]:
    """Return the names of the packaged designs whose wheelset has this name."""
    found = ((one, json.loads(design_path(one).read_text("utf-8"))) for one in packaged_designs())
    return [one for one, document in found if document["inputs"]["wheelset"].get("name") == wheelset]


def design_path(given: str, folder: Path = Path()) -> Path:
    """Return the file of a packaged design by its name, or a path from a folder on; it is not looked for.

    What has neither a slash nor the suffix .json is a name. Raises InputError for one that is none.
    """
    if re.search(PATH, given):
        return folder / given
    known = packaged_designs()
    if given not in known:
        hint = f"packaged: {', '.join(known)}; or give a path to a .json file"
        near = suggest(given, known)
        raise InputError(f"there is no design {given!r}", key="design", hint=f"{near} {hint}" if near else hint)
    return resources.DESIGNS / f"{given}{_SUFFIX}"
