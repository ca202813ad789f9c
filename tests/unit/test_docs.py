"""The documentation agrees with the program: tables, links, paths, names, numbers; it has a size; its site is built."""

import argparse
import ast
import json
import math
import re
import shlex
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import can
import pytest

from sim_ecu import bench
from sim_ecu import resources as rig_resources
from sim_ecu.campaign.definition import KINDS
from sim_ecu.cli import main as rig_cli
from sim_ecu.loop import drive_scenario
from sim_ecu.physics.contact import CURVES
from sim_ecu.physics.stability import hunting_speed_m_s
from sim_ecu.play import scenario_keys
from sim_ecu.play.vehicles import load_vehicle, packaged_vehicles
from sim_ecu.reporting import verdicts
from sim_ecu.score import ON_REQUEST, SUITES
from sim_ecu.score.low_rail import RULE, RULE_OF_THREE
from sim_ecu.score.metrics.bootstrap import NOTHING
from sim_ecu.score.metrics.map_metrics import AS_DRIVEN, ONE, THREE
from sim_ecu.score.score_goals import ACCUSED, SCORE_GOALS
from sim_ecu.score.suites.map_passages import IN_WORLDS, PLACE_KINDS
from sim_ecu.score.suites.worlds import EVERY
from tests.matrix.expected import LONG_ROWS, ROWS
from tests.matrix.matrix import which, whole_axle
from tests.oracle import signals
from tests.support.bus_load import MAX_LOAD_PCT, bits, bits_per_s, of_axles, table
from tests.support.lone_wheelset import LONE_DESIGN
from tests.support.pages import ROOT, blocks, pages
from tests.support.statuses import STATUSES
from wrcd import __version__, contract, resources
from wrcd.bus.dbc import load_dbc
from wrcd.bus.frame import Frame
from wrcd.cli import main as cli
from wrcd.config import declared
from wrcd.config.config import STALE_TICKS, load_config
from wrcd.config.keys import Key
from wrcd.contract.frames import Says
from wrcd.core import causes, configuration, core, terms, vocabulary
from wrcd.core.core import Core
from wrcd.dbc.lint.codes import CODES
from wrcd.native import constant
from wrcd.service import journal

DOCS = ROOT / "docs"
sys.path.insert(0, str(DOCS))
from tables import with_tables  # noqa: E402  # it stands beside the pages, for Sphinx

NAMED = {p.relative_to(ROOT).as_posix(): p for p in pages()}
MAX_PAGES, MAX_WORDS = 36, 32_000  # of README and docs, as `wc -w` counts them
# Paths that stand for something that a reader makes, or that the repository has only where it was built.
MADE = ("build/", ".venv/")
BENCH_RECORDS = (bench.Truth, bench.Sensors, bench.Adhesion, bench.Step, bench.Figures)
SOURCE = re.compile(
    r"(?:wrcd|sim_ecu|tests|docs|dbc|systemd|examples)/[\w@.*/-]+|[A-Z]{4,}\.md|Makefile|pyproject\.toml"
)
CONFIGURATION, SCENARIO = "docs/reference/configuration.md", "docs/reference/scenario.md"
MESSAGES, SCORE = "docs/reference/messages.md", "docs/reference/score.md"
STATUS_PAGE = "docs/reference/exit-codes.md"


def text(page: str) -> str:
    return (ROOT / page).read_text(encoding="utf-8")


def rows(page: str, heading: str | None = None) -> list[list[str]]:
    """The cells of a page's tables, from a heading on; heads and rules left out."""
    lines = text(page).partition(f"\n{heading}\n")[2].splitlines() if heading else text(page).splitlines()
    found: list[list[str]] = []
    for at, row in enumerate(lines):
        is_head = at + 1 < len(lines) and re.fullmatch(r"\|[-| ]+\|", lines[at + 1])
        if row.startswith("|") and not is_head and not re.fullmatch(r"\|[-| ]+\|", row):
            found.append([cell.strip() for cell in re.split(r"(?<!\\)\|", row[1:-1])])
        elif heading and found and row.startswith("#"):
            break
    return found


# --- size, paths, commands


def test_readme_and_docs_have_at_most_so_many_pages_and_words() -> None:
    counted = [n for n in NAMED if n == "README.md" or n.startswith("docs/")]
    words = sum(len(text(n).split()) for n in counted)
    assert (len(counted) <= MAX_PAGES, words <= MAX_WORDS) == (True, True), f"{len(counted)} pages, {words} words"


# Words that have to be read twice, each with what stands for it.
GONE = {
    r"said|told|heard": "says, reports, came; is known", r"owed|befalls?|onward": "plain English",
    r"who decides": "the thing that does", r"on end": "consecutive, in a row", r"is none's": "nobody's",
}  # fmt: skip


def texts() -> Iterator[tuple[str, str]]:
    """What a user reads: pages, help of every command, and an example of every message."""
    yield from ((page, with_tables(text(page))) for page in NAMED)
    yield from ((file.name, file.read_text(encoding="utf-8")) for file in sorted((ROOT / "tests/data").glob("*.txt")))
    for program in (cli.WRCD, rig_cli.SIM_ECU):
        parsers = [program.parser()]
        while parsers:
            parser = parsers.pop()
            yield parser.prog, parser.format_help()
            of = (a.choices for a in parser._actions if isinstance(a, argparse._SubParsersAction))
            parsers += [p for choices in of for p in choices.values()]


def test_words_that_the_glossary_replaced_do_not_come_back() -> None:
    found = [
        f"{name}: {match[0]!r}; write {better}"
        for name, body in texts()
        for words, better in GONE.items()
        for match in re.finditer(rf"\b(?:{words})\b", body, re.IGNORECASE)
    ]
    assert found == []


def test_glossary_has_forty_terms() -> None:
    terms = re.findall(r"\*\*([^*]+)\*\*", text("docs/README.md").partition("## Glossary")[2])
    assert len({t.lower() for t in terms}) == len(terms) >= 40


@pytest.mark.parametrize("page", NAMED)
def test_page_begins_with_what_it_is_for(page: str) -> None:
    head, _, first = text(page).partition("\n")
    assert head.startswith("# ")
    assert re.match(r"\n(?!#|\||-|```)\S", first), page


@pytest.mark.parametrize("page", NAMED)
def test_path_in_backticks_exists(page: str) -> None:
    for quoted in re.findall(r"`([^`\n]+)`", text(page)):
        for word in quoted.split():
            if SOURCE.fullmatch(word) and not word.startswith(MADE):
                assert list(ROOT.glob(word)), f"{page}: {word}"


def commands() -> Iterator[tuple[str, str]]:
    """Every line of every page that calls one of the programs."""
    for page in NAMED.values():
        for block in blocks(page):
            for said in re.findall(r"^(?:\.venv/bin/)?((?:wrcd|sim-ecu) [a-z].*)$", block.body, re.MULTILINE):
                yield page.name, re.sub(r"\s+(?:#|\||2?>|&).*", "", said)


@pytest.mark.parametrize(("page", "said"), list(commands()))
def test_command_in_a_page_is_one_that_the_program_takes(page: str, said: str) -> None:
    name, *arguments = shlex.split(said)
    parser = (cli.WRCD if name == "wrcd" else rig_cli.SIM_ECU).parser()
    parser.parse_args(arguments)


def test_make_target_in_a_page_is_there() -> None:
    targets = set(re.findall(r"^([\w-]+):", text("Makefile"), re.MULTILINE))
    for page in NAMED.values():
        body = page.read_text(encoding="utf-8")
        named = re.findall(r"`make ([a-z-]+)`", body) + re.findall(r"^ *make (?!-C )([a-z-]+)", body, re.MULTILINE)
        assert set(named) <= targets, page


def test_pre_commit_runs_what_make_lint_runs_and_fetches_nothing() -> None:
    hooks = text(".pre-commit-config.yaml")
    recipe = text("Makefile").partition("\nlint: $(TESTS)\n")[2].partition("\n\n")[0]
    assert re.findall(r"entry: \.venv/bin/(.+)", hooks) == re.findall(r"\$\(BIN\)/(.+)", recipe)
    assert re.findall(r"repo: (.+)", hooks) == ["local"]
    assert set(re.findall(r"language: (.+)", hooks)) == {"system"}


@pytest.mark.parametrize("picture", [p.name for s in ("png", "svg") for p in sorted(DOCS.glob(f"*.{s}"))])
def test_picture_of_the_pages_is_made_by_make(picture: str) -> None:
    makers = [p.stem for p in (ROOT / "tests/support").glob("*picture*.py") if f'"{picture}"' in p.read_text()]
    assert [m for m in makers if f"-m tests.support.{m}\n" in text("Makefile")] == makers
    assert makers or f" docs/{picture}\n" in text("Makefile")


# --- README


def test_readme_has_at_most_100_lines_and_says_simulation_only_in_its_first() -> None:
    lines = text("README.md").splitlines()
    assert len(lines) <= 100
    assert "Simulation only, never on a train" in "\n".join(lines[:12])
    assert f"version {__version__.rpartition('.')[0]}," in "\n".join(lines[:12])


def test_messages_in_readme_are_those_of_the_dbc() -> None:
    found = {m.name: m for m in load_dbc(resources.DBC).messages}
    for row in rows("README.md", "## Inputs and outputs"):
        cells = [c for c in row if re.fullmatch(r"[\d.]+ m?s", c)]
        usual, _, exceptions = row[1].partition(" (")
        for axle, number in re.findall(r"axle (\d): 0x([0-9A-F]{3})", exceptions):
            assert found[row[0].replace("*a*", axle)].frame_id == int(number, 16), row[0]
        ids = re.findall(r"0x([0-9A-F]{3})( \+ \*a\*)?", usual)
        for name, (number, axle) in zip(row[0].split(", "), ids, strict=True):
            message = found[name.replace("*a*", "1")]
            assert message.frame_id == int(number, 16) + bool(axle), name
            assert cells == [duration(message.cycle_time or 0)], name


def duration(ms: int) -> str:
    """As the pages write a cycle or a time-out."""
    return f"{ms} ms" if ms % 1000 else f"{ms // 1000} s"


# --- reference: tables of what the code declares


def defaults(keys: Iterable[Key]) -> dict[str, str]:
    return {key.name: key.shown_default for key in keys}


def test_configuration_page_has_every_key_with_its_default() -> None:
    def shown(heading: str) -> dict[str, str]:
        return {r[0].strip("`"): r[2] for r in rows(CONFIGURATION, heading)}

    tables = {f"{t}.{name}": default for t, keys in declared.TABLES.items() for name, default in defaults(keys).items()}
    assert shown("## Tables") == tables
    assert shown("## A signal that is read") == defaults((*declared.TORQUE_INPUT, declared.REVERSE))
    own = declared.output_keys("adhesion")[: -len(vocabulary.MESSAGES["adhesion"])]
    fields = defaults(declared.field_keys(vocabulary.MESSAGES["adhesion"]["MuAvailable"]))
    assert shown("## A message that is sent") == defaults(own) | {f"….{name}": d for name, d in fields.items()}


def test_scenario_page_has_every_table() -> None:
    named = [name for name, _ in re.findall(r"^```\{keys\} (.+)\n(```)$", text(SCENARIO), re.MULTILINE)]
    played = {f"scenario {table}".strip() for table in scenario_keys.TABLES}
    driven = {f"drive {table}".strip() for table in drive_scenario.TABLES if table != "axle.N"}
    assert sorted(named) == sorted(played | driven)


def test_messages_page_has_every_message_and_signal_of_both_dbcs() -> None:
    body = text(MESSAGES)
    head = {name: r for r in rows(MESSAGES) if len(r) == 6 for name in r[0].split(", ")}
    for message in (*load_dbc(resources.DBC).messages, *load_dbc(rig_resources.TRUTH_DBC).messages):
        number = re.search(r"_A(\d)$", message.name)
        row = head[re.sub(r"_A\d$", "_A*a*", message.name)]
        if number is None or number[1] in ("1", "8"):  # the ends of its row of ids
            assert f"0x{message.frame_id:03X}" in row[1], message.name
        ms = message.cycle_time or 0
        assert (row[2], row[3], row[4], row[5]) == (
            *message.senders, str(message.length), duration(ms), duration(3 * ms)
        ), message.name  # fmt: skip
        assert (number is not None and number[1] != "1") or f"\n```{{signals}} {message.name}\n```\n" in body, (
            message.name
        )


def test_readme_names_the_most_axles_of_each_bit_rate() -> None:
    words = {"three": 3, "six": 6, "eight": 8}
    (named,) = re.findall(
        r"At 250 kbit/s a bus carries (\w+) axles, at 500 kbit/s (\w+), at 1 Mbit/s (\w+)\.", text("README.md")
    )
    dbc = load_dbc(resources.DBC)
    for rate, axles in zip((250_000, 500_000, 1_000_000), named, strict=True):
        load = [100 * bits_per_s(of_axles(dbc, None, a), True) / rate for a in range(1, terms.MAX_AXLES + 1)]
        assert words[axles] == sum(x <= MAX_LOAD_PCT for x in load)


def test_bus_load_is_that_of_the_dbcs() -> None:
    made = table(load_dbc(resources.DBC), load_dbc(rig_resources.TRUTH_DBC), terms.MAX_AXLES)
    assert "\n".join(made) in text(MESSAGES)


@pytest.mark.parametrize(("payload", "shortest", "longest"), [(0, 47, 55), (4, 79, 95), (5, 87, 105), (8, 111, 135)])
def test_frame_has_47_bits_besides_its_bytes_and_stuff_bits(payload: int, shortest: int, longest: int) -> None:
    assert (bits(payload, stuffed=False), bits(payload, stuffed=True)) == (shortest, longest)


def test_exit_statuses_of_every_command_are_those_of_the_code() -> None:
    found = [r for r in rows(STATUS_PAGE) if len(r) == 2 and re.fullmatch(r"\d[\d ]*", r[0])]
    shown = {command: statuses for statuses, named in found for command in re.findall(r"`([^`]+)`", named)}
    assert shown == {
        f"{program} {command}": " ".join(str(int(s)) for s in sorted(statuses))
        for program, commands in STATUSES.items()
        for command, statuses in commands.items()
    }


def test_dbc_page_has_every_code_of_lint() -> None:
    assert {c for r in rows("docs/reference/dbc.md", "## Lint") for c in re.findall(r"`([\w-]+)`", r[0])} == set(CODES)


def test_campaign_page_has_every_factor_and_kind() -> None:
    body = text("docs/reference/campaign.md")
    assert [k.name for k in KINDS if not re.search(rf"^### .*\b{k.name}\b", body, re.MULTILINE)] == []
    assert [f.name for k in KINDS for f in k.factors if f"`{f.name}`" not in body] == []


def test_vehicle_page_has_every_vehicle_and_where_it_hunts() -> None:
    shown = {r[0].strip("`"): r[4:] for r in rows("docs/explanation/vehicle.md", "## The packaged vehicles")}
    for name in packaged_vehicles():
        vehicle = load_vehicle(name)
        hunts = (hunting_speed_m_s(vehicle, CURVES[letter], scan_m_s=5.0) for letter in "ABCD")
        assert shown.pop(name) == ["–" if math.isinf(v) else f"{v:.1f}" for v in hunts]
    assert shown == {}


def test_validity_table_is_that_of_the_code() -> None:
    found = [r for r in rows("docs/reference/validity.md", "## Causes") if len(r) == 4]
    assert [(r[0], r[1]) for r in found] == [(str(int(c)), c.label) for c in causes.Cause]
    given = set(causes.Cause) - causes.RESERVED - {causes.Cause.NONE}
    assert f"{len(given)} causes why it is not" in text("README.md")
    # what keeps a window from being full is before the first input that is not sound
    assert f"1 to {causes.Cause.INPUT_STALE - 1} are NotAvailable" in text("docs/reference/validity.md")


def test_numbers_of_the_validity_table_are_those_of_the_code() -> None:
    condition = {r[1]: r[2] + "; " + r[3] for r in rows("docs/reference/validity.md", "## Causes") if len(r) == 4}
    tick_ms = 5
    assert f"three ticks, {STALE_TICKS * tick_ms} ms" in condition["InputStale"]
    assert f"{int(constant('BRIDGED_TICKS')) * tick_ms} ms past it" in condition["InputStale"]
    assert "{:g} … {:g}".format(*configuration.LOAD_SHARES) in condition["LoadBeyond"]
    assert "{:g} … {:g}".format(*configuration.RADIUS_SHARES) in condition["RadiusBeyond"]
    assert f"{terms.MIN_M:g} m" in condition["TooLittleData"]
    assert f"{terms.HARSH_SHARE:g} of the window" in condition["Harsh"]
    assert f"{terms.GAPS_SHARE:g} of the window" in condition["TooLittleData"]
    noise = f"{100 * constant('DEAD_SHARE'):g} % of what the load carries"
    assert noise in condition["FrictionShareUnknown"]
    assert f"{constant('TRACTION_HELD_US') / 1000:g} ms" in condition["FrictionShareUnknown"]
    assert signals.MAX_NET_OUTLIERS.tolist() == [[2.0], [8.0]]
    assert f"first {signals.GATE_MIN_TICKS:g} samples" in condition["Restarted"]
    assert [constant(name) for name in ("FREE_RESETS", "FIRST_WAIT_S", "LAST_WAIT_S")] == [4.0, 1.0, 8.0]
    assert f"{constant('DOUBTED'):.0e}".replace("e-0", "e-") in condition["Unchanged"]
    assert (core.FORWARD_STEP_US, core.BACKWARD_STEP_US) == (1_000_000, 10_000)


CONTROLLER = "docs/reference/what-a-controller-does.md"


def test_controller_page_has_every_cause() -> None:
    found = [name for row in rows(CONTROLLER, "## Causes") for name in row[0].split(", ")]
    assert sorted(found) == sorted(c.label for c in causes.Cause if c)
    detail = next(m for m in load_dbc(resources.DBC).messages if m.name == "AdhesionDetail_A1")
    length = next(s for s in detail.signals if s.name == "Cause").length
    assert f"- {len(causes.Cause)} … {2**length - 1} are" in text(CONTROLLER)


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
    found = {word: r[1] for r in rows(CONTROLLER, heading) for word in r[0].split(", ")}
    assert set(found) - {"any other value"} == set(said.words)
    assert all(f"{bound:g}" in found[word] for bound, word in classes if math.isfinite(bound))


def test_times_of_the_controller_page_are_those_of_the_dbc() -> None:
    named = {m.name.partition("_")[0]: m for m in load_dbc(resources.DBC).messages}
    for names, every, timeout, _ in rows(CONTROLLER, "## Time-out"):
        for name in names.split(", "):
            ms = named[name].cycle_time or 0
            assert (every, timeout) == (duration(ms), duration(3 * ms))


@pytest.mark.parametrize(
    ("page", "of"),
    [
        *(("docs/how-to/script-the-rig.md", of) for of in BENCH_RECORDS),
        *(("docs/how-to/test-a-consumer.md", of) for of in (contract.Frame, contract.Use, contract.BusSettings, Says)),
    ],
    ids=lambda x: x.__name__ if isinstance(x, type) else "",
)  # fmt: skip
def test_page_has_every_field_of_a_record(page: str, of: Any) -> None:
    (row,) = (r for r in rows(page, "## Fields") if r[0].startswith(f"`{of.__name__}`"))
    assert set(of.__dataclass_fields__) <= set(re.findall(r"`(\w+)`", row[1]))


def test_page_has_every_property_of_a_bench() -> None:
    (row,) = (r for r in rows("docs/how-to/script-the-rig.md", "## Fields") if r[0] == "`Bench`")
    listed = {name for name, value in vars(bench.Bench).items() if isinstance(value, property)}
    assert listed <= set(re.findall(r"`(\w+)`", row[1]))


def test_frames_of_the_e2e_section_are_accepted(monkeypatch: pytest.MonkeyPatch) -> None:
    script = re.search(r"```python\n(.*?)```", text(MESSAGES), re.DOTALL)
    assert script is not None
    monkeypatch.chdir(ROOT)
    daemon = Core(load_config(None))
    with can.Bus(interface="virtual", channel="bench") as heard:
        exec(script[1], {})  # the page's own words
        for k in range(50):
            m = heard.recv(0.0)
            assert m is not None
            daemon.feed(Frame(k * 20_000, m.arbitration_id, bytes(m.data)))
    assert (daemon.counts.accepted, daemon.counts.rejected.total()) == (50, 0)


def test_log_lines_have_every_state_and_counter() -> None:
    said = re.sub(r"\b\d+\b", "N", text(STATUS_PAGE))
    counters = [
        ast.literal_eval(node.args[1])
        for node in ast.walk(ast.parse(Path(journal.__file__).read_text()))
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "_RateLimitedCounter"
    ]
    assert counters
    for template in (*journal.STATES.values(), *counters):
        assert re.sub(r"\b\d+\b", "N", template.format(n="N")) in said


@pytest.mark.parametrize("file", ["service/journal", "service/loop", "service/waiting", "recorder/recorder", "cli/run"])
def test_log_lines_have_every_line_that_is_written(file: str) -> None:
    said = text(STATUS_PAGE)
    for node in ast.walk(ast.parse(text(f"wrcd/{file}.py"))):
        if not (isinstance(node, ast.Call) and re.fullmatch(r"(self\._)?(log_line|write)", ast.unparse(node.func))):
            continue
        for part in (p for argument in node.args for p in ast.walk(argument)):
            if isinstance(part, ast.JoinedStr):
                words = [str(v.value).strip(" :;,") for v in part.values if isinstance(v, ast.Constant)]
                assert [w for w in words if w not in said] == [], file


def test_design_file_table_has_every_key() -> None:
    shown = rows("docs/explanation/estimator.md", "## The design file")
    found = {k for r in shown for k in re.findall(r"`(\w+)`", r[0])}
    assert found == {*json.loads(resources.DESIGN.read_text()), "worlds"}


def test_architecture_points_at_functions_that_are_there() -> None:
    found = rows("docs/explanation/architecture.md", "## Where to find it")
    assert len(found) > 10
    for question, file, names in found:
        if (source := file.strip("`")).endswith(".c"):
            assert all(re.search(rf"\b{n}\(", text(source)) for n in re.findall(r"`(\w+)`", names)), question
            continue
        tree = ast.parse(text(file.strip("`")))
        there = {
            f"{node.name}.{inner.name}"
            for node in tree.body
            if isinstance(node, ast.ClassDef)
            for inner in node.body
            if isinstance(inner, ast.FunctionDef)
        } | {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        assert set(re.findall(r"`([^`]+)`", names)) <= there, question


# --- what takes too long to print again here: its structure


def test_fault_matrix_has_the_faults_of_the_code() -> None:
    shown = [(f, r[1]) for r in rows("docs/reference/fault-matrix.md") if len(r) > 3 for f in r[0].split(", ")]
    played = [which(row)[:2] for row in (*ROWS, *LONG_ROWS) if not whole_axle(row)]
    assert sorted(shown) == sorted(played)


def test_score_has_the_designs_worlds_suites_and_goals_of_the_code() -> None:
    body = text(SCORE)
    for file in (resources.DESIGN, LONE_DESIGN):
        design = json.loads(file.read_text())
        assert f"design {design['name']} {design['checksum'][:12]}" in body
    worlds = [w.name for w in EVERY if not (w.name.startswith("vibration of") or w.together)]
    assert [r[0] for r in rows(SCORE, "## Axles on one rail")] == [w.name for w in EVERY if w.together]
    assert [r[0] for r in rows(SCORE, "## A train") if len(r) == 6 and r[1]] == worlds
    named = (name for row in rows(SCORE) for name in row[0].split(", "))
    assert tuple(name for name in named if name in SUITES) == SUITES
    goals = [goal for (suite, *_), goal in SCORE_GOALS.items() if suite not in ON_REQUEST]
    made = [goal(figure=NOTHING) for goal in (*goals, ACCUSED)]
    expected = [(g.what, verdicts.bound(g.record())) for g in made]
    assert [(r[0], r[2]) for r in rows(SCORE, "Goals of all suites; *chance* is met, within chance:")] == expected


def test_map_of_low_rail_has_the_places_worlds_and_rule_of_the_code() -> None:
    found = {r[0]: r for r in rows(SCORE, "## The map of low rail")}
    assert list(found) == [ONE, THREE, *(k.name for k in PLACE_KINDS[1:]), AS_DRIVEN, f"{AS_DRIVEN}, no wheel slid"]
    body = text(SCORE).partition("## The map of low rail")[2].partition("\n## ")[0]
    assert all(name.partition(": ")[2] in body or name in body for name in IN_WORLDS)
    rule = text("docs/how-to/find-low-rail.md").partition("## When a block is low")[2]
    numbers = [f"{n:g}" for n in (RULE.upper_pct, *RULE_OF_THREE)]
    stated = re.search(
        r"below (\d+) %, and below the adhesion on .*, below (\d+) % and ([\d.]+) times", rule, re.DOTALL
    )
    assert stated is not None
    assert (list(stated.groups()), RULE.of_rest) == (numbers, 1.0)
    said = text("README.md").partition("**low-adhesion rail**")[2].partition("## ")[0]
    shares = [found[row][column] for column in (1, 2) for row in (ONE, THREE)]
    assert re.findall(r"\d+ \(\d+–\d+\)", said) == shares
    alarms = [found[row][column].partition(" ")[0] for column in (4, 5) for row in (ONE, THREE)]
    assert re.findall(r"\d+\.\d", said) == alarms


def test_figures_of_the_score_stand_elsewhere_as_they_are_there() -> None:
    world = {r[0]: r for r in rows(SCORE, "## A train")}
    readme = {r[0]: r[1:] for r in rows("README.md", "## How good it is") if len(r) == 5}
    situations = {
        "the design's vehicle": "its own vehicle", "curves with cant": "curves with cant",
        "axle boxes shaken": "sampled inside, shaken", "another vehicle's bogie": "vehicle: another one's bogie",
        "… once noticed: intervals are wider": "… after minutes of calm running",
    }  # fmt: skip
    assert list(readme) == list(situations)
    for situation, name in situations.items():
        mean, _, holds, valid, wrong = (cell.split()[0] for cell in world[name][1:])
        expected = [f"{float(mean):.1f}", *(f"{share} %" for share in (valid, holds, wrong))]
        assert readme[situation] == expected, situation
    lone = {r[0]: r[1].split()[0] for r in rows(SCORE, "Goals of all suites; *chance* is met, within chance:")}
    contract = text("docs/reference/what-a-controller-does.md")
    lie_s = float(lone["drops: Valid with the truth below the interval, 95th percentile, s"])
    assert f"{lie_s:g} s at the 95th percentile" in contract
    assert float(lone["drops: settled, 95th percentile, s"]) <= 2.0
    assert "over at least two seconds" in contract


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
    for page in pages():
        shown = (built / page.relative_to(ROOT)).with_suffix(".html").read_text()
        assert re.findall(r"<(?:img|script|link|iframe|source)\b[^>]*(?:href|src)=\"(?:https?:)?//", shown) == [], page
    assert (built / "index.html").read_text() == (built / "README.html").read_text()


def test_tables_of_a_scenario_are_in_the_site_with_every_key_and_its_default(built: Path) -> None:
    page = (built / "docs/reference/scenario.html").read_text().replace("’", "'")
    of_rows = (re.findall(r"<td>(.*?)</td>", row, re.DOTALL) for row in page.split("<tr"))
    shown = {
        (re.sub(r"<[^>]+>", "", cells[0]), re.sub(r"<[^>]+>", "", cells[2])) for cells in of_rows if len(cells) == 4
    }
    for tables in (scenario_keys.TABLES, drive_scenario.TABLES):
        assert {(key.name, key.shown_default) for keys in tables.values() for key in keys} <= shown


def test_signals_are_in_the_site_with_their_words(built: Path) -> None:
    page = (built / "docs/reference/messages.html").read_text()
    for message in (*load_dbc(resources.DBC).messages, *load_dbc(rig_resources.TRUTH_DBC).messages):
        if not re.search(r"_A[2-8]$", message.name):
            for signal in message.signals:
                words = ", ".join(f"{raw} {word}" for raw, word in sorted((signal.choices or {}).items()))
                is_shown = f"<td><p>{signal.name}</p></td>" in page and words in page
                assert f"<strong>{message.name.removesuffix('_A1')}</strong>" in page
                assert is_shown or signal.name in ("Crc", "Counter", "Status"), signal.name


def test_search_finds_words_of_a_page_without_a_server(built: Path) -> None:
    index = (built / "searchindex.js").read_text()
    assert index.startswith("Search.setIndex(")  # a script, which a page on a disk may load
    assert "docs/reference/validity" in index
    assert '"wheelsetunlik"' in index
