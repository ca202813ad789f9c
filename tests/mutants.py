"""Change every number and comparison in the C that decides what is believed, one at a time, and see whether a test
fails: `make mutants`. What survives is explained in tests/mutants.md.

Each change is compiled by itself and linked with the rest, in a copy of the tree for each core.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

from wrcd.progress import Progress

ROOT = Path(__file__).parents[1]
FILES = ("frames", "e2e", "plausibility", "inputs", "validity")
TESTS = ("tests/unit/bus", "tests/unit/core", "tests/golden")
SLOW_S = 240  # a change that never ends is noticed, too
COPIED = ("wrcd", "sim_ecu", "dbc", "tests", "examples", "docs", "pyproject.toml", "README.md")
SKIPPED = shutil.ignore_patterns("__pycache__", "*.so", "digests.json")
# comments, texts, includes, and tables of numbers; then what is changed
_NO_CODE = re.compile(r'/\*.*?\*/|"[^"\n]*"|^#[^\n]*$|CRC\[256\] = \{.*?\};', re.DOTALL | re.MULTILINE)
_CHANGED = re.compile(
    r"(?<![\w.])(\d+\.\d+(?:e-?\d+)?|\d+e-?\d+|0x[0-9A-Fa-f]+|\d+)(?=U?\b)|(?<=[\w) ])(<=|>=|==|!=|<|>)(?= )"
)
_OTHERWISE = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "=="}
CC = ("cc", "-std=c11", "-O1", "-ffp-contract=off", "-fPIC", "-Iwrcd/core/c", "-Iwrcd/bus/c")


@dataclass(frozen=True, slots=True)
class Mutant:
    """Another word at a place of a file."""

    file: Path  # in the tree
    begin: int
    end: int
    word: str

    def of(self, text: str) -> str:
        """The file's text with it."""
        return text[: self.begin] + self.word + text[self.end :]

    def told(self, text: str) -> str:
        """Line and change, for a person."""
        line = text.count("\n", 0, self.begin)
        change = f"{text[self.begin : self.end]} -> {self.word}"
        return f"{self.file.name}:{line + 1}: {change}: {text.splitlines()[line].strip()}"


def mutants(file: Path) -> Iterator[Mutant]:
    """Those of a file of C."""
    text = (ROOT / file).read_text()
    code = _NO_CODE.sub(lambda m: re.sub(r"[^\n]", " ", m[0]), text)
    for m in _CHANGED.finditer(code):
        yield Mutant(file, m.start(), m.end(), _OTHERWISE.get(m[0]) or _another(m[0]))


def _another(number: str) -> str:
    if re.fullmatch(r"\d+|0x\w+", number):
        return str(int(number, 0) + 1)
    return repr(float(number) * 1.1 or 0.1)


class Tree:
    """A copy of the tree, in which one change stands at a time."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        shutil.rmtree(folder, ignore_errors=True)
        for name in COPIED:
            here = ROOT / name
            if here.is_dir():
                shutil.copytree(here, folder / name, ignore=SKIPPED)
            else:
                folder.mkdir(parents=True, exist_ok=True)
                shutil.copy(here, folder / name)
        self._sources = sorted(p.relative_to(folder) for p in folder.glob("wrcd/*/c/*.c"))
        for source in self._sources:
            self._compile(source)

    def _compile(self, source: Path) -> bool:
        digest = self._run(sys.executable, "-c", "from wrcd.native import sources; print(sources())").stdout.strip()
        return self._run(*CC, f'-DWRCD_SOURCES="{digest}"', "-c", str(source), "-o", f"{source.stem}.o").returncode == 0

    def _run(self, *command: str) -> "subprocess.CompletedProcess[str]":
        env = os.environ | {"PYTHONPATH": str(self._folder), "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        return subprocess.run(
            command, cwd=self._folder, env=env, capture_output=True, text=True, timeout=SLOW_S, check=False
        )

    def survives(self, mutant: Mutant | None) -> bool:
        """Whether no test fails with a change; None: without one."""
        text = "" if mutant is None else (ROOT / mutant.file).read_text()
        if mutant is not None:
            (self._folder / mutant.file).write_text(mutant.of(text))
        try:
            changed = [] if mutant is None else [mutant.file]
            if not all(map(self._compile, [*changed, Path("wrcd/core/c/binding.c")])):
                return False
            objects = [f"{source.stem}.o" for source in self._sources]
            self._run(CC[0], "-shared", *objects, "-o", "wrcd/_native.so", "-lm").check_returncode()
            words = ("-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", *TESTS)
            return self._run(sys.executable, "-P", *words).returncode == 0
        except subprocess.TimeoutExpired:
            return False
        finally:
            if mutant is not None:
                (self._folder / mutant.file).write_text(text)
                self._compile(mutant.file)


def main() -> int:
    """0 where at least 95 % are noticed."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("--of", nargs="*", default=FILES, help="files of wrcd/core/c, without their suffix")
    parser.add_argument("--every", type=int, default=1, help="only every n-th change")
    args = parser.parse_args()
    wanted = [m for name in args.of for m in mutants(Path(f"wrcd/core/c/{name}.c"))][:: args.every]
    trees: SimpleQueue[Tree] = SimpleQueue()
    cores = os.cpu_count() or 1
    for k in range(cores):
        trees.put(Tree(ROOT / f"build/mutants/{k}"))
    progress, survivors = Progress(), list[str]()

    def tried(mutant: Mutant | None) -> bool:
        tree = trees.get()
        try:
            return tree.survives(mutant)
        finally:
            trees.put(tree)

    if not tried(None):
        raise SystemExit("the tests fail without a change")
    with ThreadPoolExecutor(cores) as pool:
        for number, (mutant, survived) in enumerate(zip(wanted, pool.map(tried, wanted), strict=True), 1):
            progress.at(f"{mutant.file.name}, {len(survivors)} survived", number / len(wanted))
            if survived:
                survivors.append(mutant.told((ROOT / mutant.file).read_text()))
                print(survivors[-1], flush=True)
    progress.end()
    noticed = 1 - len(survivors) / len(wanted)
    print(f"{len(wanted)} changes, {len(survivors)} survive: {noticed:.1%} are noticed")
    return int(noticed < 0.95)


if __name__ == "__main__":
    sys.exit(main())
