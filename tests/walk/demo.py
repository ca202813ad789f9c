"""Demo: `make demo`, the first thing that the README asks for."""

import re
import shutil
import statistics
import struct
from pathlib import Path

from tests.walk.walk import Step, Walk, expect

MAX_S = 180.0  # 24 s of them play; the rest is compiling, and reporting, on a busy machine
MAX_MEDIAN_PP = 1.0  # the golden run's is 0.4


def take(walk: Walk) -> str:
    """Run it; look at its live lines, its log, its picture and its report."""
    said = walk.run("make", "demo", seconds=MAX_S)
    shown, error = judged(said, lines=40)
    log = walk.folder / "build/demo/leaf-patch.log"
    with log.open() as lines:
        frames = sum(1 for _ in lines)
    expect(frames > 15_000, f"{frames} frames are in {log.name}, too few for 24 s")
    width, height = png_size(log.with_suffix(".png"))
    shutil.copy(log.with_suffix(".png"), walk.out / "demo.png")
    report = log.with_suffix(".html")
    expect(report.exists(), f"it does not end with the report of its own log, {report.name}:\n{said}")
    return f"{shown}, {error}; {frames} frames logged, picture {width} × {height}, report {report.name}"


def judged(said: str, lines: int) -> tuple[str, str]:
    """How many of axle 1's live lines are Valid, and the error of their estimate, as a demo prints them.

    lines is the least number of live lines. Half of them must be Valid: it is played in real time, and inputs that a
    busy machine delays beyond their limit are rightly stale. Where nothing else runs it is nine of ten.
    """
    live = [line for line in said.splitlines() if re.match(r" *\d+\.\d s A1 ", line)]
    valid = [line for line in live if line.endswith(" Valid")]
    expect(len(live) >= lines, f"{len(live)} live lines, not {lines}:\n{said}")
    expect(len(valid) >= 0.5 * len(live), f"only {len(valid)} of {len(live)} live lines are Valid:\n{said}")
    pairs = [m for line in valid if (m := re.search(r"truth +([\d.]+) %  wrcd +([\d.]+)", line))]
    expect(len(pairs) == len(valid), f"a Valid live line has no estimate beside its truth:\n{said}")
    median = round(statistics.median(abs(float(m[1]) - float(m[2])) for m in pairs), 2)
    expect(median <= MAX_MEDIAN_PP, f"median error {median} percentage points")
    return f"{len(valid)} of {len(live)} live lines Valid", f"median error {median} percentage points"


def png_size(path: Path) -> tuple[int, int]:
    """Width and height of a PNG file, from its head."""
    head = path.read_bytes()[:24]
    expect(head[:8] == b"\x89PNG\r\n\x1a\n", f"{path} is no PNG file")
    width, height = struct.unpack(">II", head[16:])
    return int(width), int(height)


STEP = Step("demo", take, (("make", "make"),))
