"""What the pages quote from the program, and how it is made again.

    <!-- command: wrcd check -->      the output of a command, in a fence (Markdown tables without one)
    <!-- made: messages -->           a table made from the code or from a DBC
    <!-- end -->

python -m tests.support.pages           prints the names of the blocks that differ; exit 1 if there are any
python -m tests.support.pages --write   makes them again
python -m tests.support.pages --all     the expensive ones too: `sim-ecu faults`, both of `score`, and `loop`, an hour;
                                        with --write first, for others quote them
"""

import argparse
import contextlib
import io
import re
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from sim_ecu import cli as rig_cli
from sim_ecu import resources as rig
from sim_ecu.campaign import keys as campaign_keys
from sim_ecu.campaign.kind import Factor, Kind
from sim_ecu.campaign.kinds import KINDS
from sim_ecu.commands.statuses import STATUSES as RIG
from sim_ecu.loop import scenario_keys as drive_scenario_keys
from sim_ecu.loop.fmu.variables import VALID, variables
from sim_ecu.play import scenario_keys
from sim_ecu.play.expected import LONG_ROWS, ROWS
from sim_ecu.play.expected_lines import expected_lines
from sim_ecu.play.judge import which
from sim_ecu.score.goals import MISSED, counted
from tests.support.bus_load import table as load_table
from tests.support.interval_coverage import rows as coverage_rows
from wrcd import declared, resources
from wrcd.bus.dbc import Message, load_dbc, timeout_ms
from wrcd.core.configuration import MAX_AXLES
from wrcd.core.vocabulary import MESSAGES
from wrcd.keys import Key
from wrcd.tools import cli
from wrcd.tools.lint.codes import CODES
from wrcd.tools.lint.run import findings
from wrcd.tools.lint.run import lines as lint_lines
from wrcd.tools.monitor.screen import help as monitor_help
from wrcd.tools.statuses import STATUSES as WRCD

ROOT = Path(__file__).parents[2]
# Their output is Markdown already.
EXPENSIVE = ("sim-ecu faults", "sim-ecu loop", "sim-ecu score", "sim-ecu score --suite fusion")
BLOCK = re.compile(r"^<!-- (command|made): (.+?) -->\n(.*?)^<!-- end -->$", re.MULTILINE | re.DOTALL)
NUMBERED = re.compile(r"_A\d+$")
_MAINS: dict[str, Callable[[list[str]], int]] = {"wrcd": cli.main, "sim-ecu": rig_cli.main}


@dataclass(frozen=True, slots=True)
class Block:
    """What stands between two markers: kind "command" or "made", what is asked for, and the text, end of line
    included."""

    page: Path
    kind: str
    what: str
    text: str

    @property
    def expensive(self) -> bool:
        """Whether making it takes minutes."""
        return self.what in EXPENSIVE

    @property
    def name(self) -> str:
        """For a person."""
        return f"{self.page.relative_to(ROOT)}: {self.what}"


def pages() -> list[Path]:
    """Every page of the project's documentation."""
    return [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md")), *sorted(ROOT.glob("examples/*.md"))]


def blocks() -> Iterator[Block]:
    """Every marked block of every page."""
    for page in pages():
        for kind, what, text in BLOCK.findall(page.read_text(encoding="utf-8")):
            yield Block(page, kind, what, text)


def make(block: Block) -> str:
    """Return the text that belongs between the markers."""
    if block.kind == "made":
        maker, _, argument = block.what.partition(" ")
        return "\n" + "\n".join(MAKERS[maker](*([argument] if argument else []))) + "\n\n"
    output = run(block.what)
    return f"\n{output}\n" if block.expensive else f"\n```text\n{output}```\n\n"


def run(command: str) -> str:
    """Run `wrcd …` or `sim-ecu …` in this process and return its standard output; `| head -N` keeps N lines.

    Paths below the repository lose its folder. Raises AssertionError for an exit status other than 0.
    """
    line, _, head = command.partition(" | head -")
    name, *arguments = shlex.split(line)
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()), contextlib.chdir(ROOT):
        status = _MAINS[name](arguments)
    assert status == 0, f"{command}: exit {status}"
    text = out.getvalue().replace(f"{ROOT}/", "")
    return "".join(text.splitlines(keepends=True)[: int(head)]) if head else text


def table(head: tuple[str, ...], rows: list[tuple[object, ...]]) -> list[str]:
    """A Markdown table, line by line."""
    lines = [head, tuple("---" for _ in head), *rows]
    return ["| " + " | ".join(str(cell).replace("|", "\\|") for cell in row) + " |" for row in lines]


# --- the interface, from the DBCs


def messages(which: str = "wrcd") -> list[str]:
    """Every message of a DBC with its signals; those of several axles once, with id and name of the first axle's."""
    found = load_dbc(resources.DBC if which == "wrcd" else rig.TRUTH_DBC).messages
    groups: dict[str, list[Message]] = {}
    for m in sorted(found, key=lambda m: m.name):  # axles by number: there are fewer than ten
        groups.setdefault(NUMBERED.sub("_A*a*", m.name), []).append(m)
    out: list[str] = []
    for name, group in sorted(groups.items(), key=lambda item: item[1][0].frame_id):
        first = group[0]
        several = len(group) > 1
        ids = _ids([m.frame_id for m in group]) + (f" (a = 1…{len(group)})" if several else "")
        of = _first_axle(first.comment or "") if several else first.comment
        out += [*([""] if out else []), f"### {name}", "", f"{of}.", ""]
        out += [f"- id {ids}, {first.length} bytes, sender {', '.join(first.senders)}"]
        out += [f"- every {first.cycle_time} ms"]
        timeouts = {timeout_ms(first, s) for s in first.signals if not s.name.startswith(("Crc", "Counter"))}
        out += [f"- stale after {', '.join(f'{t} ms' for t in sorted(t for t in timeouts if t))}", ""]
        rows: list[tuple[object, ...]] = []
        for s in sorted(first.signals, key=lambda s: s.start):
            step = f"{s.scale:g}" + (f" {s.unit}" if s.unit else "")
            text = _first_axle(s.comment or "") if several else s.comment
            words = ", ".join(f"{raw} {word}" for raw, word in sorted((s.choices or {}).items()))
            sign = " signed" if s.is_signed else ""
            rows.append((s.name, f"{s.start}, {s.length}{sign}", step, f"{s.minimum} … {s.maximum}", text, words))
        out += table(("signal", "start, length", "step", "range", "what", "values"), rows)
    return out


def _ids(ids: list[int]) -> str:
    """Runs of ids: "0x101 … 0x104, 0x0A0"."""
    runs: list[list[int]] = []
    for i in ids:
        if runs and i == runs[-1][-1] + 1:
            runs[-1].append(i)
        else:
            runs.append([i])
    return ", ".join(f"0x{run[0]:03X}" + (f" … 0x{run[-1]:03X}" if len(run) > 1 else "") for run in runs)


def _first_axle(comment: str) -> str:
    return re.sub(r"wheelset 1\b", "wheelset *a*", comment)


# --- commands


def options(program: str) -> list[str]:
    """Every command of a program with its arguments, defaults and help."""
    parser = (cli._parser if program == "wrcd" else rig_cli._parser)()
    out = table(("option", "what"), [_row(a) for a in parser._actions if a.option_strings and a.dest != "help"])
    choices = next(a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    said = {c.dest: c.help for c in choices._choices_actions}
    for name, command in choices.choices.items():
        out += ["", f"### {program} {name}", "", f"{_sentence(said[name] or '')}.", ""]
        rows = [_row(a) for a in command._actions if a.dest != "help"]
        out += table(("argument", "what"), rows) if rows else ["It takes no arguments."]
    return out


def _row(a: argparse.Action) -> tuple[object, ...]:
    metavar = a.metavar or ("{" + ", ".join(map(str, a.choices)) + "}" if a.choices else a.dest.upper())
    takes = "" if a.nargs == 0 else f" {metavar}" if a.nargs != "?" else f" [{metavar}]"
    names = ", ".join(a.option_strings) + takes if a.option_strings else str(a.metavar or a.dest)
    # a default of all cores is this machine's
    return f"`{names}`", re.sub(r"\s+", " ", a.help or "")


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def monitor_keys() -> list[str]:
    """The keys of `wrcd monitor`, and its signs."""
    keys = table(("key", "does"), [(f"`{key}`", what) for key, what in monitor_help.KEYS])
    return [*keys, "", *table(("sign", "means"), [(sign, what) for sign, what in monitor_help.SIGNS])]


# --- configuration


def configuration(which: str) -> list[str]:
    """The keys of the configuration: of the file's own tables, of an input, of a message that is sent."""
    if which == "tables":
        named = [(f"{table}.{key.name}", key) for table, keys in declared.TABLES.items() for key in keys]
    elif which == "input":
        keys = {key.name: key for keys in declared.INPUTS.values() for key in keys}
        named = [(key.name, key) for key in (*declared.TORQUE_INPUT, declared.REVERSE) if keys[key.name] is key]
    else:
        own = declared.output_keys("adhesion")[: -len(MESSAGES["adhesion"])]
        fields = declared.field_keys(MESSAGES["adhesion"]["MuAvailable"])
        named = [(key.name, key) for key in own] + [(f"….{key.name}", key) for key in fields]
    rows: list[tuple[object, ...]] = [
        (f"`{name}`", key.takes, key.shown_default, "yes" if key.reload else "", key.what) for name, key in named
    ]
    return table(("key", "takes", "default", "reload", "what"), rows)


def scenario(which: str = "") -> list[str]:
    """The keys of a table of a scenario; its top level without a name."""
    return key_rows(scenario_keys.TABLES[which])


def key_rows(keys: Iterable[Key]) -> list[str]:
    """A table of keys with their units."""
    rows: list[tuple[object, ...]] = [
        (f"`{key.name}`", key.takes, key.shown_default, getattr(key, "unit", ""), key.what) for key in keys
    ]
    return table(("key", "takes", "default", "unit", "what"), rows)


def drive_scenario(which: str = "") -> list[str]:
    """The keys of a table of a scenario to drive; its top level without a name."""
    return key_rows(drive_scenario_keys.TABLES[which])


def bus_load() -> list[str]:
    """What the packaged DBCs take of a bus, by axles."""
    return load_table(load_dbc(resources.DBC), load_dbc(rig.TRUTH_DBC), MAX_AXLES)


def exit_codes(program: str) -> list[str]:
    """What each command of a program ends with."""
    out: list[str] = []
    for command, statuses in (WRCD if program == "wrcd" else RIG).items():
        out += [*([""] if out else []), f"### {program} {command}", ""]
        out += table(("status", "meaning"), [(int(s), text) for s, text in sorted(statuses.items())])
    return out


def lint_codes() -> list[str]:
    """What lint can find."""
    return table(
        ("code", "found where", "why it matters", "how to mend it"),
        [(f"`{word}`", code.found, code.why, code.mend) for word, code in CODES.items()],
    )


def lint_of(file: str) -> list[str]:
    """What lint finds in a DBC that is not sound."""
    return ["```text", *lint_lines(Path(file), findings(ROOT / file)), "```"]


def fault_lines() -> list[str]:
    """What the journal says of every row of the fault matrix."""
    rows: list[tuple[object, ...]] = [(*which(row), expected_lines(row)) for row in (*ROWS, *LONG_ROWS)]
    return table(("fault", "of", "s", "the journal"), rows)


def fmu_variables() -> list[str]:
    """Variables of the FMU, those of axle 1 for those of every axle; a sensor's validity stands with the sensor."""
    rows: list[tuple[object, ...]] = [
        (f"`{v.name}`", v.causality, v.kind, v.unit, v.what) for v in variables([1]) if not v.name.endswith(VALID)
    ]
    return table(("name", "causality", "type", "unit", "what"), rows)


def campaign_kinds() -> list[str]:
    """Every kind of job with its factors and figures."""
    out: list[str] = []
    for kind in KINDS:
        out += [*([""] if out else []), f"### {kind.name}", "", f"{_sentence(kind.words)}.", ""]
        out += [*_factors(kind), "", *_figures(kind)]
        grouped = f"Rows are compared by `{kind.suite}`." if kind.suite else ""
        out += ["", " ".join(filter(None, (grouped, _seeded(kind))))]
    return out


def _seeded(kind: Kind) -> str:
    return "" if kind.seeded else "It has no `seed`: `seeds` and `first_seed` are not of it."


def _factors(kind: Kind) -> list[str]:
    rows: list[tuple[object, ...]] = [
        (f"`{f.name}`", ", ".join(f.choices) or f.type.value, _default(f), f.unit, f.words) for f in kind.factors
    ]
    rows += [(f"`{prefix}KEY`", "the key's own", "–", "", "any key, see above") for prefix in kind.open_factors]
    return table(("factor", "takes", "default", "unit", "what"), rows)


def _default(factor: Factor) -> str:
    if factor.needed:
        return "needed"
    if isinstance(factor.default, bool):
        return str(factor.default).lower()
    return "–" if factor.default in (None, "") else str(factor.default)


def _figures(kind: Kind) -> list[str]:
    rows: list[tuple[object, ...]] = [(f"`{f.name}`", f.unit, f.better or "–", f.words) for f in kind.figures]
    return table(("figure", "unit", "better", "what"), rows)


HEADLINES = (
    "grid: mean error", "robust: mean error", "robust: the interval holds the truth",
    "grid: error over that of the paper's own form", "transitions: median delay, s",
)  # fmt: skip


def accuracy() -> list[str]:
    """A few goals of the score's page, how many of all are met, and every one that is missed, by suite."""
    found = goals_of((ROOT / "docs/reference/score.md").read_text(encoding="utf-8"))
    out = table(("goal", "value", "bound", ""), [g for name in HEADLINES for g in found if g[0] == name])
    out += ["", counted([g[3] for g in found])]
    missed: dict[str, list[str]] = {}
    for name, value, bound, verdict in found:
        if verdict == MISSED:
            suite, _, what = name.partition(": ")
            missed.setdefault(suite, []).append(f"{what} {value}, not {bound}")
    return [*out, *(["Missed:", ""] if missed else []), *(f"- {s}: {'; '.join(m)}" for s, m in missed.items())]


def goals_of(page: str) -> list[tuple[str, str, str, str]]:
    """The rows of a score's goals: name, value, bound, verdict."""
    lines = page.partition("\n**goals**")[2].split("\n<!-- end -->")[0].splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("| ")]
    return [(name, value, bound, verdict) for name, value, bound, verdict in rows[1:]]


def interval_coverage() -> list[str]:
    """How often the intervals of few runs hold the truth, by simulation."""
    return table(("values of runs", "runs", "mean, percentiles", "mean", "median"), coverage_rows())


MAKERS: dict[str, Callable[..., list[str]]] = {
    "messages": messages,
    "options": options,
    "configuration": configuration,
    "bus-load": bus_load,
    "exit-codes": exit_codes,
    "lint-codes": lint_codes,
    "lint-of": lint_of,
    "fault-lines": fault_lines,
    "scenario": scenario,
    "drive-scenario": drive_scenario,
    "monitor-keys": monitor_keys,
    "fmu-variables": fmu_variables,
    "accuracy": accuracy,
    "interval-coverage": interval_coverage,
    "campaign-keys": lambda: key_rows(campaign_keys.HEAD),
    "campaign-range": lambda: key_rows(campaign_keys.RANGE),
    "campaign-kinds": campaign_kinds,
}


def main() -> int:
    """Compare, or write; 1 if something differs and is not written."""
    p = argparse.ArgumentParser(prog="python -m tests.support.pages", description=__doc__.partition("\n")[0])
    p.add_argument("--write", action="store_true", help="make the blocks again")
    p.add_argument("--all", action="store_true", help="the expensive ones too")
    args = p.parse_args()
    differ = 0
    for block in sorted(blocks(), key=lambda b: not b.expensive):  # others quote what the expensive ones print
        if block.expensive and not args.all:
            continue
        text = make(block)
        if text == block.text:
            continue
        differ += 1
        print(block.name)
        if args.write:
            page = block.page.read_text(encoding="utf-8")
            marker = f"<!-- {block.kind}: {block.what} -->\n"
            block.page.write_text(page.replace(marker + block.text, marker + text), encoding="utf-8")
    return 1 if differ and not args.write else 0


if __name__ == "__main__":
    sys.exit(main())
