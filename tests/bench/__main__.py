"""Measure and print: `python -m tests.bench`."""

import argparse
import json
import os
import platform
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tests.bench.timing import Row

MARKER, END = (
    "<!-- measured: make bench -->\n",
    "<!-- end of what was measured -->\n",
)  # of a page's part that is measured
PARTS = ("bank", "frames", "core", "start", "replay", "rig", "offline")


def main() -> int:
    """Entry point. Always 0: a figure that misses its goal is shown, not an error."""
    p = argparse.ArgumentParser(prog="python -m tests.bench", description=__doc__)
    p.add_argument("--json", type=Path, metavar="FILE", help="write every figure")
    p.add_argument("--markdown", type=Path, metavar="FILE", help="write the tables, or their place in such a page")
    p.add_argument("--before", type=Path, metavar="DIR", help="an older checkout, measured in turn with this one")
    p.add_argument("--only", choices=PARTS, action="append", help="this part; again for more")
    args = p.parse_args()
    # as `wrcd run` does: products of a few hundred numbers gain nothing by threads. Before numpy is imported.
    for library in ("OPENBLAS", "OMP", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    from tests.bench import timing
    from tests.bench.core import GROUP, OURS, table

    begin = time.monotonic()
    on = f"{machine()}; {timing.yardstick()}; {time.strftime('%Y-%m-%d')}"
    rows: list[Row] = []
    for name, part in _parts(args.before).items():
        if args.only is None or name in args.only:
            rows += part()
    print(f"{on}; {time.monotonic() - begin:.0f} s")
    print("times are of the shortest and the median block; a ratio is the median of the blocks' own\n")
    print(timing.text(rows))
    if args.json is not None:
        document = {"measured": on, "rows": [r.document() for r in rows]}
        args.json.write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n")
    if args.markdown is not None:
        core_us = [
            (int(r.name.split()[0]), r.times[OURS])
            for r in rows
            if r.group == GROUP and OURS in r.times and r.name.endswith(" axles")
        ]
        by_axles = "\n".join(table(core_us)) + "\n\n" if core_us else ""
        write_page(args.markdown, f"Measured on {on}.\n\n{by_axles}{timing.markdown(rows)}\n")
    return 0


def _parts(before: Path | None) -> "dict[str, Callable[[], Iterator[Row]]]":
    from tests.bench import bank, core, frames, offline, replay, rig, start

    return {
        "bank": bank.rows,
        "frames": frames.rows,
        "core": lambda: core.rows(before),
        "start": lambda: start.rows(before),
        "replay": lambda: replay.rows(before),
        "rig": rig.rows,
        "offline": lambda: offline.rows(before),
    }


def write_page(page: Path, text: str) -> None:
    """Write a page, or the part of it between the markers where it has them."""
    old = page.read_text(encoding="utf-8") if page.exists() else ""
    before, marker, rest = old.partition(MARKER)
    _, end, after = rest.partition(END)
    whole = f"{before}{marker}\n{text}\n{end}{after}" if marker and end else text
    page.write_text(whole, encoding="utf-8")


def machine() -> str:
    """What measured: the CPU's model, how many cores, Python."""
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    model = next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), "unknown CPU")
    return f"{model}, {os.cpu_count()} cores, Python {platform.python_version()}"


if __name__ == "__main__":
    sys.exit(main())
