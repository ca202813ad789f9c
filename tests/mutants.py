"""Change every number and comparison in the C that decides what is believed, one at a time, and see whether a test
fails: `make mutants`. What survives is explained in tests/mutants.md.

Each change is compiled by itself and linked with the rest, in a copy of the tree for each core. There pytest, of which
this file is a plugin, too, collects the tests once, and runs them in a fork for each change: first the one that failed
last.
"""

import _ctypes
import argparse
import os
import re
import resource
import shutil
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

import pytest
from hypothesis import Phase, settings

from wrcd.native import library
from wrcd.progress import Progress

ROOT = Path(__file__).parents[1]
FILES = ("frames", "e2e", "plausibility", "inputs", "validity")
# In bus, core; the quick and sharp first. What others there notice, of the estimator and of files, these do too.
BUS = ("e2e", "fd", "codec", "statuses", "multiplexed", "batch", "independent_decoder", "codec_layouts")
CORE = ("core", "inputs", "input_buffers", "clipping", "events", "j1939", "messages", "validity", "plausibility")
TESTS = (
    *(f"tests/unit/bus/test_{name}.py" for name in BUS), *(f"tests/unit/core/test_{name}.py" for name in CORE),
    "tests/golden",
)  # fmt: skip
FAILED, NONE = "failed: ", "none"
SLOW_S = 60  # of processor time for a test: a change that never ends is noticed, too
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
        self._env = os.environ | {"PYTHONPATH": str(folder), "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
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
            self._compile(source, f"{source.stem}.o")
        self._link()
        words = ("-m", "pytest", "-sq", "-p", "no:cacheprovider", "-p", "no:xdist", "-p", "tests.mutants", *TESTS)
        self._tests = subprocess.Popen(
            (sys.executable, "-P", *words),
            cwd=folder,
            env=self._env,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def _compile(self, source: Path, into: str, *more: str) -> bool:
        return self._run(*CC, *more, "-c", str(source), "-o", into).returncode == 0

    def _link(self, changed: Path | None = None) -> None:
        digest = self._run(sys.executable, "-c", "from wrcd.native import sources; print(sources())").stdout.strip()
        self._compile(Path("wrcd/core/c/binding.c"), "binding.o", f'-DWRCD_SOURCES="{digest}"')
        objects = ["changed.o" if source == changed else f"{source.stem}.o" for source in self._sources]
        self._run(CC[0], "-shared", *objects, "-o", "wrcd/_native.so", "-lm").check_returncode()

    def _run(self, *command: str) -> "subprocess.CompletedProcess[str]":
        return subprocess.run(command, cwd=self._folder, env=self._env, capture_output=True, text=True, check=False)

    def told(self) -> str:
        """The first test that fails; NONE."""
        assert self._tests.stdin is not None
        assert self._tests.stdout is not None
        print(file=self._tests.stdin, flush=True)
        return next(line for line in self._tests.stdout if line.startswith(FAILED)).removeprefix(FAILED).strip()

    def failed(self, mutant: Mutant) -> str:
        """The first test that fails with a change; none: it survives."""
        file, text = self._folder / mutant.file, (ROOT / mutant.file).read_text()
        file.write_text(mutant.of(text))
        try:
            if not self._compile(mutant.file, "changed.o"):
                return "the compiler"
            self._link(mutant.file)
            return self.told()
        finally:
            file.write_text(text)


def pytest_runtestloop(session: pytest.Session) -> bool:
    """In a copy: run the tests for each line that comes, until one fails, and tell which."""
    items = session.items
    session.config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined]  # logs that one fork makes are for all
    for _ in sys.stdin:
        end, begin = os.pipe()
        child = os.fork()
        if child == 0:
            _run_anew(session, items, begin)
        os.close(begin)
        with os.fdopen(end) as pipe:
            failed = pipe.read()
        status = os.waitpid(child, 0)[1]
        items.sort(key=lambda item: item.nodeid != failed)
        told = failed or (NONE if status == 0 else f"a process that ended with {os.waitstatus_to_exitcode(status)}")
        print(f"\n{FAILED}{told}", flush=True)
    return True


def _run_anew(session: pytest.Session, items: list[pytest.Item], begin: int) -> None:
    """With the library that is there now; ends the process."""
    settings.register_profile("quick", settings.default, phases=(Phase.explicit, Phase.generate))
    settings.load_profile("quick")  # the first example that fails is enough
    _ctypes.dlclose(library()._handle)
    library.cache_clear()
    for item, after in zip(items, [*items[1:], None], strict=True):
        resource.setrlimit(resource.RLIMIT_CPU, (int(time.process_time()) + SLOW_S, resource.RLIM_INFINITY))
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=after)
        if session.testsfailed:
            os.write(begin, item.nodeid.encode())
            break
    os._exit(0)


def main() -> int:
    """0 where every change that no test notices is one that tests/mutants.md explains."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("--of", nargs="*", default=FILES, help="files of wrcd/core/c, without their suffix")
    parser.add_argument("--every", type=int, default=1, help="only every n-th change")
    args = parser.parse_args()
    wanted = [m for name in args.of for m in mutants(Path(f"wrcd/core/c/{name}.c"))][:: args.every]
    cores = os.cpu_count() or 1
    copies = [Tree(ROOT / f"build/mutants/{k}") for k in range(cores)]
    trees: SimpleQueue[Tree] = SimpleQueue()
    for tree in copies:
        trees.put(tree)
    progress, survivors = Progress(), list[str]()

    def tried(mutant: Mutant) -> str:
        tree = trees.get()
        try:
            return tree.failed(mutant)
        finally:
            trees.put(tree)

    with ThreadPoolExecutor(cores) as pool:
        for unchanged in pool.map(Tree.told, copies):  # each makes its own logs in it, and what numba compiles
            if unchanged != NONE:
                raise SystemExit(f"without a change fails {unchanged}")
        for number, (mutant, failed) in enumerate(zip(wanted, pool.map(tried, wanted), strict=True), 1):
            progress.at(f"{mutant.file.name}, {len(survivors)} survived", number / len(wanted))
            said = mutant.told((ROOT / mutant.file).read_text())
            print(f"{said} | {failed}", flush=True)
            survivors += [said] if failed == NONE else []
    progress.end()
    explained = Counter((ROOT / "tests/mutants.md").read_text().splitlines())  # each line excuses one change
    new = list((Counter(re.sub(r":\d+:", ":", said, count=1) for said in survivors) - explained).elements())
    noticed = 1 - len(survivors) / len(wanted)
    print(*new, f"{len(wanted)} changes, {noticed:.1%} are noticed, {len(new)} neither that nor explained", sep="\n")
    return int(bool(new))


if __name__ == "__main__":
    sys.exit(main())
