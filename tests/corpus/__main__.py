"""Make the corpus again, and compare it with what was recorded: `make corpus`.

What is right was recorded before the core was changed. A log that is not the recorded one (another numba, another
processor's mathematics) shows nothing of the core; it is named, and counts as a failure. There, record what the commit
before gives (--write FILE), and compare with that (--with FILE).
"""

import argparse
import json
import sys
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from multiprocessing import get_context
from pathlib import Path

from tests.corpus.logs import digests_of
from tests.corpus.recipes import Recipe, recipes
from wrcd.progress import Progress

RECORDED = Path(__file__).with_name("digests.json")
Digests = dict[str, dict[str, str]]


def made(wanted: list[Recipe], here: bool) -> Digests:
    """The digests of recipes by their names, on every core or in this process."""
    progress = Progress()
    with nullcontext() if here else ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        out: Digests = {}
        for recipe, found in zip(wanted, (map if pool is None else pool.map)(digests_of, wanted), strict=True):
            out[recipe.name] = found
            progress.at(recipe.name, len(out) / len(wanted))
    progress.end()
    return out


def differences(recorded: Digests, found: Digests) -> list[str]:
    """A line for each log that is not as it was."""
    lines = []
    for name, now in found.items():
        before = recorded.get(name)
        if before is None:
            lines.append(f"{name}: is not recorded")
        elif before["log"] != now["log"]:
            lines.append(f"{name}: the log itself is another one: nothing is compared")
        elif before != now:
            of = sorted(key for key in before.keys() | now.keys() if before.get(key) != now.get(key))
            lines.append(f"{name}: {' '.join(of)}")
    return lines


def main() -> int:
    """0: all as recorded; 1: something differs."""
    parser = argparse.ArgumentParser(prog="python -m tests.corpus", description=__doc__)
    parser.add_argument("words", nargs="*", help="only recipes whose name has one of these words")
    parser.add_argument("--with", dest="recorded", type=Path, default=RECORDED, help="compare with this file")
    parser.add_argument("--write", type=Path, help="record what is made in this file, and compare nothing")
    parser.add_argument("--here", action="store_true", help="in this process")
    args = parser.parse_args()
    wanted = [r for r in recipes() if not args.words or any(w in r.name for w in args.words)]
    assert len({r.name for r in wanted}) == len(wanted)
    if not wanted:
        parser.error(f"no recipe's name has {' or '.join(args.words)}")
    found = made(wanted, args.here)
    if args.write is not None:
        rows = (f"{json.dumps(name)}: {json.dumps(found[name])}" for name in sorted(found))
        args.write.write_text("{\n" + ",\n".join(rows) + "\n}\n")
        print(f"{args.write}: {len(found)} logs")
        return 0
    recorded = json.loads(args.recorded.read_text())
    lines = differences(recorded, found)
    if not args.words:
        lines += [f"{name}: is recorded, and no longer made" for name in recorded.keys() - found.keys()]
    same = sum(recorded.get(name) == now for name, now in found.items())
    print(*lines, f"{same} of {len(found)} logs give what was recorded", sep="\n")
    return int(bool(lines))


if __name__ == "__main__":
    sys.exit(main())
