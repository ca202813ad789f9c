"""What is saved on a key: the frames that are held, as a log, and a picture of the screen."""

import re
from collections.abc import Iterable
from pathlib import Path

from wrcd.bus.log import format_line
from wrcd.tools.monitor.batch import Batch

_ELSEWHERE = re.compile(r"@font-face \{.*?\}\s*|<!--.*?-->", re.DOTALL)
MAX_TRIES = 1000


def free_name(folder: Path, stem: str, suffixes: tuple[str, ...]) -> str:
    """The stem, or with a number behind it, under which there is no file yet."""
    for number in range(1, MAX_TRIES):
        name = stem if number == 1 else f"{stem}-{number}"
        if not any((folder / f"{name}{suffix}").exists() for suffix in suffixes):
            return name
    raise FileExistsError(f"{stem} and {MAX_TRIES} more")


def plain_stem(text: str) -> str:
    """A name of letters, digits, dots and dashes."""
    return re.sub(r"[^A-Za-z0-9.]+", "-", text).strip("-")


def without_fonts(svg: str) -> str:
    """A picture that fetches nothing: in whatever fixed-width font there is."""
    return _ELSEWHERE.sub("", svg).replace("Fira Code", "DejaVu Sans Mono, Menlo, Consolas")


def write_picture(path: Path, svg: str) -> None:
    """A new file."""
    with path.open("x", encoding="utf-8") as f:
        f.write(without_fonts(svg))


def write_log(path: Path, batches: Iterable[Batch], channel: str) -> int:
    """A new candump log. Returns how many frames it holds."""
    n = 0
    with path.open("x", encoding="ascii") as f:
        for batch in batches:
            f.writelines(f"{format_line(frame, channel)}\n" for frame in batch.frames())
            n += len(batch)
    return n
