"""The house's rules, read from the source: rooms and their budgets of lines, what none may import, which arrows there
are, no circle, and one name for one thing; arrows and circles of #include, too. `pytest -s` prints rooms and arrows."""

import ast
import re
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
OPERATING_SYSTEM = {
    "time",
    "datetime",
    "socket",
    "signal",
    "os",
    "logging",
    "subprocess",
    "select",
    "threading",
    "mmap",
}
DAEMONS_OWN_CODEC = {f"wrcd.bus.{name}" for name in ("e2e", "mapping", "positions", "words", "writers")}
# by folder or file: packages and modules that nothing in it imports
FORBIDDEN = {
    "wrcd": {"sim_ecu", "scipy", "filterpy", "skfuzzy", "numba", "matplotlib", "e2e", "pytest"},
    "wrcd/core": {"can", "cantools", *OPERATING_SYSTEM},
    "wrcd/bus": {"time", "datetime"},
    "sim_ecu/physics": {"wrcd", "can", "cantools", "sim_ecu.play", "sim_ecu.design"},
    "sim_ecu/play/encoder.py": {"wrcd.bus"},
    # the loop's rig and controllers hear and speak by libraries, as anyone on the bus; none of them reads a clock
    "sim_ecu/loop/rig_messages.py": {"wrcd.bus", *OPERATING_SYSTEM},
    "sim_ecu/loop/rig.py": {"wrcd.bus", *OPERATING_SYSTEM},
    # the rig encodes with libraries, and reads what is mapped: never what the daemon encodes and decodes with
    **{f"sim_ecu/play/{name}.py": DAEMONS_OWN_CODEC for name in ("mapped", "mapped_message")},
}
# What a room forbids and one module of it needs: it draws, on a computer that is no train's, and only when it is asked;
# or pytest loads it.
ALLOWED = {"wrcd/report/picture.py": {"matplotlib"}, "wrcd/contract/plugin.py": {"pytest"}}
# A room imports from itself and from rooms further down.
FLOORS = (
    {"sim_ecu/cli"},
    {"sim_ecu/campaign"},
    {"sim_ecu/loop"},
    {"sim_ecu/score"},
    {"sim_ecu/design"},
    {"sim_ecu/play"},
    {"sim_ecu/physics", "sim_ecu/reporting", "sim_ecu/jobs", "wrcd/cli"},
    {"wrcd/contract", "wrcd/kit", "wrcd/monitor", "wrcd/report"},
    {"wrcd/dbc"},
    {"wrcd/logs"},
    {"wrcd/service"},
    {"wrcd/recorder"},
    {"wrcd/config"},
    {"wrcd/core"},
    {"wrcd/bus", "wrcd/fit"},
    {"wrcd", "sim_ecu"},  # errors, resources, checksum, progress
)
# Lines of a room at most, of every language: what it had when this was written, and 3 %. To raise one, name in
# CHANGELOG.md the user who asked for what needs it.
BUDGETS = {
    "examples": 416,
    "sim_ecu": 10,
    "sim_ecu/campaign": 1330,
    "sim_ecu/cli": 760,
    "sim_ecu/design": 3700,
    "sim_ecu/jobs": 367,
    "sim_ecu/loop": 3214,
    "sim_ecu/physics": 2442,
    "sim_ecu/play": 3800,
    "sim_ecu/reporting": 264,
    "sim_ecu/score": 4100,
    "systemd": 593,
    "wrcd": 275,
    "wrcd/bus": 2710,
    "wrcd/cli": 1230,
    "wrcd/config": 2668,
    "wrcd/contract": 1312,
    "wrcd/core": 8345,
    "wrcd/dbc": 3270,
    "wrcd/fit": 850,
    "wrcd/kit": 3370,
    "wrcd/logs": 5080,
    "wrcd/monitor": 2554,
    "wrcd/recorder": 705,
    "wrcd/report": 2641,
    "wrcd/service": 730,
}
NO_LINES = {".json", ".dbc", ".so", ".pyc"}  # data, and what is built
BUILT = re.compile(r"/__pycache__/|\.egg-info/")
SAME = {"sim_ecu.resources"}
PRODUCT = ("wrcd", "sim_ecu", "systemd", "examples")
WITHOUT_FLOOR = {"systemd", "examples"}
# Of the estimator, each a file of C and one of its oracle
STAGES = ("signals", "bank", "residuals", "bands", "rules", "memory", "interval", "slides", "health", "estimator")
WITH_FILES = {"wrcd.core.design"}  # reads the design, before the first tick


@cache
def nodes(source: Path) -> list[ast.AST]:
    """Everything in a file."""
    return list(ast.walk(ast.parse(source.read_text())))


def imported(source: Path, *, types_too: bool = True) -> Iterator[str]:
    """Modules that a file imports, "package.name" for every name that it takes from one."""
    skipped: set[ast.AST] = set()
    for node in nodes(source):
        if node in skipped:
            continue
        if not types_too and isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            skipped |= {child for part in node.body for child in ast.walk(part)}
        elif isinstance(node, ast.Import | ast.ImportFrom):
            yield from imported_by(node)


def imported_by(node: ast.Import | ast.ImportFrom) -> Iterator[str]:
    """The same of one statement."""
    if isinstance(node, ast.Import):
        yield from (a.name for a in node.names)
    elif node.module:
        yield node.module
        yield from (f"{node.module}.{a.name}" for a in node.names)


def sources(place: str) -> list[Path]:
    found = ROOT / place
    return [found] if found.is_file() else sorted(found.rglob("*.py"))


def files_of_every_language() -> list[Path]:
    """What the product is made of, data and what is built left out."""
    return sorted(
        path
        for top in PRODUCT
        for path in (ROOT / top).rglob("*")
        if path.is_file() and path.suffix not in NO_LINES and not BUILT.search(path.as_posix())
    )


def included(source: Path) -> Iterator[str]:
    """Headers that a file of C, or a template of one, takes by their names."""
    return (m[1] for m in re.finditer(r'^#include "(.+)"$', source.read_text(), re.MULTILINE))


def module(source: Path) -> str:
    return ".".join(source.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


@cache
def graph() -> dict[str, set[str]]:
    """Our modules and which of ours each imports."""
    files = {module(s): s for package in ("wrcd", "sim_ecu") for s in sources(package)}
    return {
        name: {other for other in imported(source, types_too=False) if other in files and other != name}
        for name, source in files.items()
    }


@cache
def graph_of_c() -> dict[str, set[str]]:
    """Our files of C, each by its path, and which of our headers each includes."""
    files = [p for p in files_of_every_language() if p.suffix in (".c", ".h") or p.name.endswith((".c.in", ".h.in"))]
    headers = {p.name: p for p in files if p.suffix == ".h"}
    assert len(headers) == sum(p.suffix == ".h" for p in files), "two headers have one name"
    return {
        p.relative_to(ROOT).as_posix(): {
            headers[name].relative_to(ROOT).as_posix() for name in included(p) if name in headers
        }
        for p in files
    }


def room(path: str) -> str:
    """The folder below wrcd or sim_ecu that a file or module lies in, by its path; the program where it is in none."""
    if path.removesuffix(".py") == "sim_ecu/bench":
        return "sim_ecu/loop"  # its public side
    top, *rest = path.split("/")
    inner = "/".join((top, *rest[:1]))
    return inner if rest and top in ("wrcd", "sim_ecu") and (ROOT / inner).is_dir() and rest[0] != "data" else top


def all_arrows() -> Iterator[tuple[str, str]]:
    """Of modules and of C's files, by their paths."""
    for name, others in graph().items():
        yield from ((name.replace(".", "/"), other.replace(".", "/")) for other in others)
    yield from ((path, other) for path, others in graph_of_c().items() for other in others)


@pytest.mark.parametrize("place", FORBIDDEN)
def test_room_imports_nothing_forbidden(place: str) -> None:
    files = sources(place)
    assert files
    wrong = [
        f"{s.relative_to(ROOT)} imports {name}"
        for s in files
        for name in imported(s)
        for banned in FORBIDDEN[place] - ALLOWED.get(s.relative_to(ROOT).as_posix(), set())
        if name == banned or name.startswith(banned + ".")
    ]
    assert wrong == []


def test_module_with_leave_is_imported_by_no_other_as_it_loads() -> None:
    with_leave = {module(ROOT / place) for place in ALLOWED}
    loaded = [
        f"{module(s)} imports {name}"
        for s in sources("wrcd")
        for node in ast.parse(s.read_text()).body
        if isinstance(node, ast.Import | ast.ImportFrom)
        for name in imported_by(node)
        if name in with_leave
    ]
    assert loaded == []


def test_core_opens_no_file() -> None:
    opened = [
        f"{s.relative_to(ROOT)}:{node.lineno}"
        for s in sources("wrcd/core")
        if module(s) not in WITH_FILES
        for node in nodes(s)
        if isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] in {"open", "read_text", "read_bytes"}
    ]
    assert opened == []


def test_no_arrow_points_upwards() -> None:
    floor = {r: height for height, rooms in enumerate(FLOORS) for r in rooms}
    arrows = sorted({(room(a), room(b)) for a, b in all_arrows() if room(a) != room(b)})
    for start, end in arrows:
        print(f"{start} -> {end}")
    assert {r for arrow in arrows for r in arrow} <= set(floor)
    wrong = [f"{a} -> {b}" for a, b in all_arrows() if room(a) != room(b) and floor[room(a)] >= floor[room(b)]]
    assert wrong == []


def test_room_has_a_floor_and_keeps_its_budget_of_lines() -> None:
    lines = Counter[str]()
    for path in files_of_every_language():
        lines[room(path.relative_to(ROOT).as_posix())] += len(path.read_bytes().splitlines())
    for number, rooms in enumerate((*FLOORS, WITHOUT_FLOOR)):
        for place in sorted(rooms & set(lines)):
            print(f"floor {len(FLOORS) - number:2}  {place:20} {lines[place]:6} lines of {BUDGETS[place]:6}")
    print(f"{', '.join(PRODUCT)}: {lines.total()} lines")
    assert set(lines) == set().union(*FLOORS, WITHOUT_FLOOR) == set(BUDGETS)
    assert {place: (n, BUDGETS[place]) for place, n in lines.items() if n > BUDGETS[place]} == {}


def test_name_means_one_thing() -> None:
    """A command's module has the command's name; what both programs have is named alike in both."""
    modules = Counter(
        name.rpartition(".")[2] for name in graph() if "." in name and ".cli." not in name and name not in SAME
    )
    packages = {n.rpartition(".")[2] for n in graph() if (ROOT / Path(*n.split("."))).is_dir()}
    classes = Counter(
        node.name
        for package in ("wrcd", "sim_ecu")
        for source in sources(package)
        for node in nodes(source)
        if isinstance(node, ast.ClassDef)
    )
    assert [m for m, count in modules.items() if count > 1 and m not in packages] == []
    assert [c for c, count in classes.items() if count > 1] == []


@pytest.mark.parametrize("arrows", [graph, graph_of_c])
def test_graph_has_no_circle(arrows: Callable[[], dict[str, set[str]]]) -> None:
    state: dict[str, int] = {}

    def visit(name: str, path: tuple[str, ...]) -> None:
        assert state.get(name) != 1, " -> ".join((*path[path.index(name) :], name))
        if name not in state:
            state[name] = 1
            for other in sorted(arrows()[name]):
                visit(other, (*path, name))
            state[name] = 2

    for name in arrows():
        visit(name, ())


def test_test_module_imports_no_other_test_module() -> None:
    """What two of them share stands in tests/support, or beside them under a name that says what it is."""
    wrong = [
        f"{source.relative_to(ROOT)} imports {name}"
        for source in sources("tests")
        for name in imported(source)
        if name.startswith("tests.") and any(part == "conftest" or part.startswith("test_") for part in name.split("."))
    ]
    assert wrong == []


@pytest.mark.parametrize("stage", STAGES)
def test_oracle_shares_no_arithmetic_with_the_estimator(stage: str) -> None:
    """Only the design, records, and names with the sizes of what they name."""
    assert (ROOT / f"wrcd/core/c/{stage}.c").is_file()
    names = {n.removeprefix("wrcd.core.") for n in imported(ROOT / f"tests/oracle/{stage}.py") if n.startswith("wrcd")}
    assert {n for n in names if n.partition(".")[0] not in ("design", "records", "terms")} == set()
    of_terms = {n.partition(".")[2] for n in names if n.startswith("terms.")}
    assert of_terms <= {"CHANNELS", "COLUMNS", "INPUTS", "MODELS", "EstimateDoubt", "PairState", "Regime"}
