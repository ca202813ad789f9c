"""Texts that are kept whole in tests/data/NAME.txt: a title in brackets, and below it what is said.

WRCD_WRITE_TEXTS=1 .venv/bin/python -m pytest TEST writes what is said now, and fails: a person reads the difference.
"""

import os
from collections.abc import Iterable

from tests.support.processes import ROOT


def assert_kept(name: str, title: str, said: Iterable[str]) -> None:
    """What is said under a title is what is kept; a line that ends a file's block is blank."""
    file, lines = ROOT / f"tests/data/{name}.txt", "\n".join(said).splitlines()
    kept = dict[str, list[str]]()
    for line in file.read_text(encoding="utf-8").splitlines() if file.exists() else ():
        if line.startswith("[") and line.endswith("]"):
            kept[line[1:-1]] = []
        else:
            kept[next(reversed(kept))].append(line)
    if os.environ.get("WRCD_WRITE_TEXTS"):
        kept[title] = [*lines, ""]
        file.write_text("\n".join(x for t, of in kept.items() for x in (f"[{t}]", *of)) + "\n", encoding="utf-8")
        raise AssertionError(f"{file.name}: [{title}] is written")
    assert [*lines, ""] == kept.get(title, [])
