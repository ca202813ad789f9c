"""The manual pages, made from the parsers, the declared keys and the DBC: wrcd/data/man.

python -m tests.support.manual     writes them again
"""

from collections.abc import Callable
from functools import partial

from tests.support.manual_commands import manual
from tests.support.manual_formats import frames, toml
from wrcd import resources

MAKERS: dict[str, Callable[[], str]] = {
    "wrcd.1": partial(manual, "wrcd"),
    "sim-ecu.1": partial(manual, "sim-ecu"),
    "wrcd.toml.5": toml,
    "wrcd-frames.7": frames,
}


if __name__ == "__main__":
    resources.MANUAL.mkdir(exist_ok=True)
    for file, make in MAKERS.items():
        (resources.MANUAL / file).write_text(make(), encoding="utf-8")
