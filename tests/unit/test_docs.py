"""The documentation agrees with the program: quoted output, tables, links, paths, names, numbers; its site is built."""

import ast
import json
import math
import re
import shlex
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import can
import pytest

from sim_ecu import bench
from sim_ecu.cli import main as rig_cli
from sim_ecu.reporting import verdicts
from sim_ecu.reporting.values import CHANCE, MET, MET_CHANCE, MISSED, TOO_FEW
from sim_ecu.score import SUITES, WORLDS
from sim_ecu.score.metrics.bootstrap import NOTHING
from sim_ecu.score.run_score import ScoreRequest, make_baselines, paper_form_of
from sim_ecu.score.score_goals import ACCUSED, SCORE_GOALS
from sim_ecu.score.suites.worlds import EVERY
from tests.matrix.expected import LONG_ROWS, ROWS
from tests.matrix.matrix import HEAD, Verdict, line, whole_axle
from tests.support import pages
from tests.support.bus_load import MAX_LOAD_PCT, bits, bits_per_s, of_axles
from tests.support.lone_wheelset import LONE_DESIGN
from tests.support.page_commands import steps
from wrcd import contract, resources
from wrcd.bus.dbc import load_dbc
from wrcd.bus.frame import Frame
from wrcd.bus.reasons import Reason
from wrcd.cli import main as cli
from wrcd.config.config import STALE_TICKS, load_config
from wrcd.contract.frames import Says
from wrcd.core import causes, configuration, core, inputs, plausibility, validity, vocabulary
from wrcd.core.core import Core
from wrcd.estimator import answer
from wrcd.estimator.design import load_design
from wrcd.estimator.signals import gate
from wrcd.service import journal

ROOT = pages.ROOT
DOCS = ROOT / "docs"
PAGES = [p for p in pages.pages() if p.name != "CHANGELOG.md"]
IN_WORLDS = "--suite worlds --beside was=lone-wheelset"
CHEAP = [b for b in pages.blocks() if not b.expensive]
NAMED = {p.relative_to(ROOT).as_posix(): p for p in pages.pages()}
# Paths that stand for something that a reader makes, or that the repository has only where it was built.
MADE = ("build/", ".venv/")
BENCH_RECORDS = (bench.Truth, bench.Sensors, bench.Adhesion, bench.Step, bench.Figures)
SOURCE = re.compile(
    r"(?:wrcd|sim_ecu|tests|docs|dbc|systemd|examples)/[\w@.*/-]+|[A-Z]{4,}\.md|Makefile|pyproject\.toml"
)


def text(page: str) -> str:
    return (ROOT / page).read_text(encoding="utf-8")


def rows(page: str, heading: str | None = None) -> list[list[str]]:
    """The cells of a page's tables, from a heading on; heads and rules left out."""
    lines = text(page).partition(f"\n{heading}\n")[2].splitlines() if heading else text(page).splitlines()
    found: list[list[str]] = []
    for at, row in enumerate(lines):
        is_head = at + 1 < len(lines) and re.fullmatch(r"\|[-| ]+\|", lines[at + 1])
        if row.startswith("|") and not is_head and not re.fullmatch(r"\|[-| ]+\|", row):
            found.append([cell.strip() for cell in row.strip("|").split("|")])
        elif heading and found and row.startswith("#"):
            break
    return found


# --- quoted output


@pytest.mark.parametrize("block", CHEAP, ids=lambda b: b.name)
def test_quoted_block_is_what_the_program_gives(block: pages.Block) -> None:
    assert block.text == pages.make(block), "make docs"


def test_every_marker_has_an_end_and_each_expensive_block_is_there_once() -> None:
    for page in PAGES:
        body = page.read_text(encoding="utf-8")
        assert len(re.findall(r"^<!-- (?:command|made): ", body, re.MULTILINE)) == len(pages.BLOCK.findall(body)), page
    assert sorted(b.what for b in pages.blocks() if b.expensive) == sorted([*pages.SECTIONS, "fault-matrix"])


# --- paths, commands


@pytest.mark.parametrize("page", [n for n in NAMED if n != "CHANGELOG.md"])
def test_path_in_backticks_exists(page: str) -> None:
    for quoted in re.findall(r"`([^`\n]+)`", text(page)):
        for word in quoted.split():
            if SOURCE.fullmatch(word) and not word.startswith(MADE):
                assert list(ROOT.glob(word)), f"{page}: {word}"


def commands() -> Iterator[tuple[str, str]]:
    """Every line of every page that calls one of the programs."""
    for page in PAGES:
        for step in steps(page):
            for said in re.findall(r"^(?:\.venv/bin/)?((?:wrcd|sim-ecu) [a-z].*)$", step.body, re.MULTILINE):
                yield page.name, re.sub(r"\s+(?:#|\||2?>|&).*", "", said)


@pytest.mark.parametrize(("page", "said"), list(commands()))
def test_command_in_a_page_is_one_that_the_program_takes(page: str, said: str) -> None:
    name, *arguments = shlex.split(said)
    parser = (cli.WRCD if name == "wrcd" else rig_cli.SIM_ECU).parser()
    parser.parse_args(arguments)


def test_make_target_in_a_page_is_there() -> None:
    targets = set(re.findall(r"^([\w-]+):", text("Makefile"), re.MULTILINE))
    for page in PAGES:
        body = page.read_text(encoding="utf-8")
        named = re.findall(r"`make ([a-z-]+)`", body) + re.findall(r"^ *make (?!-C )([a-z-]+)", body, re.MULTILINE)
        assert set(named) <= targets, page


def test_pre_commit_runs_what_make_lint_runs_and_fetches_nothing() -> None:
    hooks = text(".pre-commit-config.yaml")
    recipe = text("Makefile").partition("\nlint: $(READY)\n")[2].partition("\n\n")[0]
    assert re.findall(r"entry: \.venv/bin/(.+)", hooks) == re.findall(r"\$\(BIN\)/(.+)", recipe)
    assert re.findall(r"repo: (.+)", hooks) == ["local"]
    assert set(re.findall(r"language: (.+)", hooks)) == {"system"}


# --- README


def test_readme_has_at_most_150_lines() -> None:
    assert len(text("README.md").splitlines()) <= 150


@pytest.mark.parametrize("picture", [p.name for s in ("png", "svg") for p in sorted(DOCS.glob(f"*.{s}"))])
def test_picture_of_the_pages_is_made_by_make(picture: str) -> None:
    makers = [p.stem for p in (ROOT / "tests/support").glob("*picture*.py") if f'"{picture}"' in p.read_text()]
    assert [m for m in makers if f"-m tests.support.{m}\n" in text("Makefile")] == makers != []


def test_readme_says_simulation_only_in_its_first_lines() -> None:
    assert "Simulation only, never on a train" in "\n".join(text("README.md").splitlines()[:12])


def test_messages_in_readme_are_those_of_the_dbc() -> None:
    found = {m.name: m for m in load_dbc(resources.DBC).messages}
    for row in rows("README.md", "## Inputs and outputs"):
        cells = [c for c in row if re.fullmatch(r"[\d.]+ m?s", c)]
        usual, *exceptions = row[1].split("; ")
        for number, axle in re.findall(r"0x([0-9A-F]{3}) for \*a\* = (\d)", "; ".join(exceptions)):
            assert found[row[0].replace("*a*", axle)].frame_id == int(number, 16), row[0]
        ids = re.findall(r"0x([0-9A-F]{3})( \+ \*a\*)?", usual)
        for name, (number, axle) in zip(row[0].split(", "), ids, strict=True):
            message = found[name.replace("*a*", "1")]
            assert message.frame_id == int(number, 16) + bool(axle), name
            cycle_ms = message.cycle_time or 0
            assert cells in ([f"{cycle_ms} ms"], [f"{cycle_ms / 1000:g} s"]), name


# --- reference


def test_validity_table_is_that_of_the_code() -> None:
    found = [r for r in rows("docs/reference/validity.md", "## Causes") if len(r) == 6]
    assert [(r[0], r[1], r[2]) for r in found] == [(str(int(c)), c.label, c.words) for c in causes.Cause]
    given = set(causes.Cause) - causes.RESERVED - {causes.Cause.NONE}
    assert f"{len(given)} causes why it is not" in text("README.md")
    states = {v.value for v in causes.Validity}
    assert {r[4] for r in found} == states
    # what keeps a window from being full is before the first input that is not sound
    assert [r[4] for r in found] == [
        "Valid" if not c else "NotAvailable" if c < causes.Cause.INPUT_STALE else "Degraded" for c in causes.Cause
    ]


CONTROLLER = "docs/reference/what-a-controller-does.md"


def test_controller_page_has_every_cause() -> None:
    found = [r for r in rows(CONTROLLER, "## Causes") if len(r) == 4]
    assert [(r[0], r[1]) for r in found[:-1]] == [(str(int(c)), c.label) for c in causes.Cause]
    detail = next(m for m in load_dbc(resources.DBC).messages if m.name == "AdhesionDetail_A1")
    bits = next(s for s in detail.signals if s.name == "Cause").length
    assert found[-1][0] == f"{len(causes.Cause)} … {2**bits - 1}"


@pytest.mark.parametrize(
    ("heading", "signal", "classes"),
    [
        ("## Validity", "Validity", ()),
        ("## Confidence", "Confidence", vocabulary.CONFIDENCES),
        ("## Surface", "Surface", vocabulary.SURFACES),
        ("## ContactState", "ContactState", ()),
    ],
)
def test_controller_page_has_every_value(heading: str, signal: str, classes: tuple[tuple[float, str], ...]) -> None:
    said = vocabulary.MESSAGES["adhesion"][signal]
    assert isinstance(said, vocabulary.Words)
    found = {r[0]: r[1] for r in rows(CONTROLLER, heading)}
    assert set(found) - {"any other value"} == set(said.words)
    for bound, word in classes:
        if math.isfinite(bound):
            assert f"{bound:g}" in found[word]


@pytest.mark.parametrize(
    ("page", "of"),
    [
        *(("docs/how-to/script-the-rig.md", of) for of in BENCH_RECORDS),
        *(("docs/how-to/test-a-consumer.md", of) for of in (contract.Frame, contract.Use, contract.BusSettings, Says)),
    ],
    ids=lambda x: x.__name__ if isinstance(x, type) else "",
)  # fmt: skip
def test_page_has_every_field_of_a_record_with_its_unit_and_meaning(page: str, of: Any) -> None:
    table = text(page).partition(f"\n`{of.__name__}`")[2].partition("\n\n")[2].partition("\n\n")[0].splitlines()[2:]
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in table]
    assert [name for name, _, _ in cells] == [f"`{name}`" for name in of.__dataclass_fields__]
    assert all(unit and meaning for _, unit, meaning in cells)


def test_page_has_every_property_of_a_bench() -> None:
    listed = {name for name, value in vars(bench.Bench).items() if isinstance(value, property)}
    after = text("docs/how-to/script-the-rig.md").partition("\nOf the `Bench` itself:\n")[2]
    assert set(re.findall(r"^\| `(\w+)` \|", after, re.MULTILINE)) == listed


def test_frames_of_the_e2e_page_are_accepted(monkeypatch: pytest.MonkeyPatch) -> None:
    script = re.search(r"<!-- file: send_p11.py -->\n```python\n(.*?)```", text("docs/explanation/e2e.md"), re.DOTALL)
    assert script is not None
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(sys, "argv", ["send_p11.py", "virtual", "e2e-page"])
    monkeypatch.setattr(time, "sleep", lambda s: None)
    daemon = Core(load_config(None))
    with can.Bus(interface="virtual", channel="e2e-page") as heard:
        exec(script[1], {})  # the page's own words
        for k in range(50):
            m = heard.recv(0.0)
            assert m is not None
            daemon.feed(Frame(k * 20_000, m.arbitration_id, bytes(m.data)))
    assert (daemon.counts.accepted, daemon.counts.rejected.total()) == (50, 0)


def test_times_of_the_controller_page_are_those_of_the_dbc() -> None:
    named = {m.name.partition("_")[0]: m for m in load_dbc(resources.DBC).messages}
    for names, every, timeout, _ in rows(CONTROLLER, "## Time-out"):
        for name in names.split(", "):
            ms = named[name].cycle_time or 0
            assert (every, timeout) in {(f"{ms} ms", f"{3 * ms} ms"), (f"{ms // 1000} s", f"{3 * ms // 1000} s")}


def test_delays_of_the_controller_page_are_those_of_the_score() -> None:
    score = {name: value for name, value, *_ in pages.goals_of(score_block("--design lone-wheelset"))}
    body = text(CONTROLLER)
    figure = float(score["drops: Valid with the truth below the interval, 95th percentile, s"].split()[0])
    assert f"{figure:g} s at the 95th percentile" in body
    assert float(score["drops: settled, 95th percentile, s"].split()[0]) <= 2.0
    assert "over at least two seconds" in body


def test_numbers_of_the_validity_table_are_those_of_the_code() -> None:
    condition = {r[1]: r[3] + "; " + r[5] for r in rows("docs/reference/validity.md", "## Causes") if len(r) == 6}
    tick_ms = 5
    assert f"three ticks, {STALE_TICKS * tick_ms} ms" in condition["InputStale"]
    assert f"{validity.BRIDGED_TICKS * tick_ms} ms past it" in condition["InputStale"]
    assert "{:g} … {:g}".format(*validity.LOAD_SHARES) in condition["LoadBeyond"]
    assert "{:g} … {:g}".format(*validity.RADIUS_SHARES) in condition["RadiusBeyond"]
    assert f"{answer.MIN_M:g} m" in condition["TooLittleData"]
    assert f"{answer.HARSH_SHARE:g} of the window" in condition["Harsh"]
    noise = f"{100 * inputs.DEAD_SHARE:g} % of what the load carries"
    assert noise in condition["FrictionShareUnknown"]
    assert f"{inputs.TRACTION_HELD_US / 1000:g} ms" in condition["FrictionShareUnknown"]
    assert gate.MAX_NET_OUTLIERS.tolist() == [[2.0], [8.0]]
    assert f"first {gate.MIN_TICKS:g} samples" in condition["Restarted"]
    assert (validity.FREE_RESETS, validity.FIRST_WAIT_S, validity.LAST_WAIT_S) == (4, 1.0, 8.0)
    assert f"{math.exp(plausibility.DOUBTED):.0e}".replace("e-0", "e-") in condition["Unchanged"]
    assert (core.FORWARD_STEP_US, core.BACKWARD_STEP_US) == (1_000_000, 10_000)


def test_reasons_of_a_rejection_are_those_of_the_code() -> None:
    assert [r[0] for r in rows("docs/reference/validity.md", "## Why a frame is rejected")] == list(Reason)


def test_log_lines_have_every_state_and_counter() -> None:
    said = re.sub(r"\b\d+\b", "N", text("docs/reference/log-lines.md"))
    counters = [
        ast.literal_eval(node.args[1])
        for node in ast.walk(ast.parse(Path(journal.__file__).read_text()))
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "_RateLimitedCounter"
    ]
    assert counters
    for template in (*journal.STATES.values(), *counters):
        assert re.sub(r"\b\d+\b", "N", template.format(n="N")) in said


@pytest.mark.parametrize(
    "file",
    [
        "service/journal",
        "service/loop",
        "service/waiting",
        "recorder/recorder",
        "cli/run",
    ],
)
def test_log_lines_have_every_line_that_is_written(file: str) -> None:
    said = text("docs/reference/log-lines.md")
    for node in ast.walk(ast.parse(text(f"wrcd/{file}.py"))):
        if not (isinstance(node, ast.Call) and re.fullmatch(r"(self\._)?(log_line|write)", ast.unparse(node.func))):
            continue
        for part in (p for argument in node.args for p in ast.walk(argument)):
            if isinstance(part, ast.JoinedStr):
                words = [str(v.value).strip(" :;,") for v in part.values if isinstance(v, ast.Constant)]
                assert [w for w in words if w not in said] == [], file


def test_design_file_table_has_every_key() -> None:
    found = {k for r in rows("docs/reference/design-file.md") for k in re.findall(r"`(\w+)`", r[0])}
    assert found == {*json.loads(resources.DESIGN.read_text()), "worlds"}


def test_architecture_points_at_functions_that_are_there() -> None:
    found = rows("docs/explanation/architecture.md", "## Where to find it")
    assert len(found) > 10
    for question, file, names in found:
        tree = ast.parse(text(file.strip("`")))
        there = {
            f"{node.name}.{inner.name}"
            for node in tree.body
            if isinstance(node, ast.ClassDef)
            for inner in node.body
            if isinstance(inner, ast.FunctionDef)
        } | {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        assert set(re.findall(r"`([^`]+)`", names)) <= there, question


@pytest.mark.parametrize(("payload", "shortest", "longest"), [(0, 47, 55), (4, 79, 95), (5, 87, 105), (8, 111, 135)])
def test_frame_has_47_bits_besides_its_bytes_and_stuff_bits(payload: int, shortest: int, longest: int) -> None:
    assert (bits(payload, stuffed=False), bits(payload, stuffed=True)) == (shortest, longest)


def test_page_names_the_most_axles_of_each_bit_rate() -> None:
    production = load_dbc(resources.DBC)
    named = re.findall(r"^\| (\d+) ([kM])bit/s \| (\d) \|$", text("docs/reference/bus-load.md"), re.MULTILINE)
    assert len(named) == 3
    for number, unit, axles in named:
        rate = int(number) * {"k": 1_000, "M": 1_000_000}[unit]
        load = [
            100 * bits_per_s(of_axles(production, None, a), True) / rate for a in range(1, configuration.MAX_AXLES + 1)
        ]
        assert int(axles) == sum(x <= MAX_LOAD_PCT for x in load)


# --- what takes too long to print again here: its structure


def test_fault_matrix_has_the_rows_of_the_code() -> None:
    (block,) = (b for b in pages.blocks() if b.what == "fault-matrix")
    lines = block.text.strip().splitlines()
    assert lines[:2] == HEAD.splitlines()
    shown = [row for row in (*ROWS, *LONG_ROWS) if not whole_axle(row)]
    judged = [line(row, Verdict(None, None, None, None, "")) for row in shown]
    assert [x.split("|")[1:5] for x in lines[2:]] == [x.split("|")[1:5] for x in judged]
    assert {x.split("|")[-2].strip() for x in lines[2:]} == {"yes"}


def score_block(arguments: str) -> str:
    """What a page keeps of a score, which is of the design's file as it is, in the sections that are kept."""
    (block,) = (b for b in pages.blocks() if b.what == f"sim-ecu score {arguments}")
    design = json.loads((LONE_DESIGN if "--design" in arguments else resources.DESIGN).read_text())
    assert f"design {design['name']} {design['checksum'][:12]}," in block.text
    assert tuple(re.findall(r"^\*\*([\w-]+)\*\*: ", block.text, re.MULTILINE)) == pages.SECTIONS[block.what]
    return block.text


def test_score_of_a_train_has_every_world_and_goal() -> None:
    shown = score_block(IN_WORLDS)
    names = [line.split(" | ")[0].removeprefix("| ") for line in shown.splitlines() if " | wrcd | " in line]
    assert names == [w.name for w in EVERY]
    of_worlds = [goal for (suite, *_), goal in SCORE_GOALS.items() if suite == WORLDS]
    expected = [(g.what, verdicts.bound(g.record())) for g in (goal(figure=NOTHING) for goal in (*of_worlds, ACCUSED))]
    assert [(name, bound) for name, _, bound, _ in pages.goals_of(shown)] == expected


def test_score_has_the_suites_causes_and_baselines_of_the_code() -> None:
    shown = score_block("--design lone-wheelset")
    named = (name for row in rows("docs/reference/score.md") for name in row[0].split(", "))
    assert tuple(name for name in named if name in SUITES) == SUITES
    assert set(re.findall(r"([A-Z]\w+) \d+\.\d %", shown)) <= {c.label for c in causes.Cause}
    levels = [name for _, name in vocabulary.CONFIDENCES]
    assert re.findall(r"^\| (Wi\w+) \| [\d.]+ % \|", shown, re.MULTILINE) == levels
    papers = paper_form_of(LONE_DESIGN)
    assert papers is not None
    asked = ScoreRequest(LONE_DESIGN, (("the paper's own form", papers),))
    names = list(make_baselines(load_design(LONE_DESIGN), asked))
    grid = shown.partition("**grid**")[2].partition("**goals**")[0]
    assert [n for n in re.findall(r"^\| ([^|]+) \|.* better \|", grid, re.MULTILINE) if n in names] == names


def test_score_has_every_goal_with_its_bound_and_verdict() -> None:
    found = pages.goals_of(score_block("--design lone-wheelset"))
    of_the_whole = [goal for (suite, *_), goal in SCORE_GOALS.items() if suite != WORLDS]
    goals = [goal(figure=NOTHING) for goal in (*of_the_whole, ACCUSED)]
    assert [(name, shown) for name, _, shown, _ in found] == [(g.what, verdicts.bound(g.record())) for g in goals]
    assert {verdict for *_, verdict in found} <= {MET, MET_CHANCE, CHANCE, MISSED, TOO_FEW}


# --- the site, as `make docs` builds it


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built by the Makefile's own words."""
    folder = tmp_path_factory.mktemp("site")
    (words,) = re.findall(r"-m (sphinx .*) build/site$", text("Makefile"), re.MULTILINE)
    done = subprocess.run(
        [sys.executable, "-m", *words.split(), folder], cwd=ROOT, capture_output=True, text=True, timeout=300
    )
    assert (done.returncode, done.stderr) == (0, "")
    return folder


def test_every_page_is_in_the_site_and_fetches_nothing_and_the_first_is_the_readme(built: Path) -> None:
    for page in pages.pages():
        shown = (built / page.relative_to(ROOT)).with_suffix(".html").read_text()
        assert re.findall(r"<(?:img|script|link|iframe|source)\b[^>]*(?:href|src)=\"(?:https?:)?//", shown) == [], page
    assert (built / "index.html").read_text() == (built / "README.html").read_text()


def test_search_finds_words_of_a_page_without_a_server(built: Path) -> None:
    index = (built / "searchindex.js").read_text()
    assert index.startswith("Search.setIndex(")  # a script, which a page on a disk may load
    assert "docs/reference/validity" in index
    assert '"wheelsetunlik"' in index
