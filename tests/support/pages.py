"""What the pages quote from the program, and how it is made again.

    <!-- command: wrcd check -->      the output of a command, in a fence (Markdown tables without one)
    <!-- made: messages -->           a table made from the code or from a DBC
    <!-- end -->

python -m tests.support.pages           prints the names of the blocks that differ; exit 1 if there are any
python -m tests.support.pages --write   makes them again
python -m tests.support.pages --all     the expensive ones too: fault matrix and `sim-ecu score`, most of an hour; with
                                        --write first, for others quote them
"""

import argparse
import contextlib
import io
import itertools
import math
import re
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from sim_ecu import resources as rig
from sim_ecu.cli import main as rig_cli
from sim_ecu.loop import drive_scenario as drive_keys
from sim_ecu.physics.contact import CURVES
from sim_ecu.physics.stability import hunting_speed_m_s
from sim_ecu.physics.track import SPECTRA, deviation
from sim_ecu.physics.wheelset import GRAVITY
from sim_ecu.play import scenario_keys
from sim_ecu.play.vehicles import load_vehicle, packaged_vehicles
from sim_ecu.reporting.values import MISSED
from sim_ecu.reporting.verdicts import counted
from tests.matrix.matrix import HEAD, line, verdicts, whole_axle
from tests.support.bus_load import table as load_table
from tests.support.statuses import STATUSES
from wrcd import resources
from wrcd.bus.dbc import Message, load_dbc, timeout_ms
from wrcd.cli import main as cli
from wrcd.config import declared
from wrcd.config.keys import Key
from wrcd.core.configuration import MAX_AXLES
from wrcd.core.vocabulary import MESSAGES
from wrcd.dbc.lint.codes import CODES
from wrcd.dbc.lint.lint_file import findings
from wrcd.dbc.lint.lint_file import lines as lint_lines

ROOT = Path(__file__).parents[2]
# Their output is Markdown already. Of those with sections a page keeps the head and these; --html has the others.
SECTIONS: dict[str, tuple[str, ...]] = {
    "sim-ecu score --suite worlds --beside was=lone-wheelset": ("worlds", "goals"),
    "sim-ecu score --design lone-wheelset": ("grid", "goals"),
}
SECTION = re.compile(r"^\*\*([\w -]+)\*\*: ", re.MULTILINE)
BLOCK = re.compile(r"^<!-- (command|made): (.+?) -->\n(.*?)^<!-- end -->$", re.MULTILINE | re.DOTALL)
NUMBERED = re.compile(r"_A\d+$")
# What a comment of the DBC says of one input or of another; messages() has such signals in one row.
OF_AN_INPUT = re.compile(r"(Whether|of) the (?:yaw rate|lateral acceleration|torque|vehicle speed)( is past|:| within)")
HUNTS_ON = "ABCD"  # creep curves
WORD_BITS = 8  # a shorter signal with a value table takes no other values
MANY_WORDS = 10  # of a value table: it is printed once
Row = tuple[object, ...]
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
        return self.what in SECTIONS or self.what == "fault-matrix"

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
    return f"\n{short(block.what, output)}\n" if block.expensive else f"\n```text\n{output}```\n\n"


def short(command: str, output: str) -> str:
    """Return what a page keeps of an expensive command's output: its head and the sections of SECTIONS."""
    found = [*SECTION.finditer(output)]
    begins = [*(m.start() for m in found), len(output)]
    kept = (
        output[a:b] for m, (a, b) in zip(found, itertools.pairwise(begins), strict=True) if m[1] in SECTIONS[command]
    )
    return "".join((output[: begins[0]], *kept))


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


def table(head: tuple[str, ...], rows: Sequence[Row]) -> list[str]:
    """A Markdown table, line by line."""
    lines = ["| " + " | ".join(str(cell).replace("|", "\\|") for cell in row) + " |" for row in (head, *rows)]
    return [lines[0], "|" + "---|" * len(head), *lines[1:]]


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
        timeouts = {timeout_ms(first, s) for s in first.signals if not s.name.startswith(("Crc", "Counter"))}
        stale = ", ".join(f"{t} ms" for t in sorted(t for t in timeouts if t))
        facts = f"{first.length} bytes from {', '.join(first.senders)} every {first.cycle_time} ms, stale after {stale}"
        out += [f"Id {ids}: {facts}.", ""]
        named: dict[str, str] = {}  # the first signal that has these words
        rows: dict[tuple[str, str, str, str], list[tuple[str, int]]] = {}
        for s in sorted(first.signals, key=lambda s: s.start):
            if s.name in ("Crc", "Counter"):
                continue  # the same in every message: the page has them once
            step = f"{s.scale:g}" + (f" {s.unit}" if s.unit else "")
            text = _first_axle(s.comment or "") if several else s.comment or ""
            text = re.sub(r"^Refused since the last WrcdRejects: ", "", text)
            text = OF_AN_INPUT.sub(r"\1 an input\2", re.sub(r"of model \d", "of a model", text))
            words = ", ".join(f"{raw} {word}" for raw, word in sorted((s.choices or {}).items()))
            sign = " signed" if s.is_signed else ""
            span = "" if words and step == "1" and s.length < WORD_BITS else f"{step}, {s.minimum} … {s.maximum}"
            row = (f"{s.length}{sign}", span, text, words)
            rows.setdefault(row, []).append((s.name, s.start))
            named.setdefault(words, s.name)
        out += table(("signal", "start; length", "step, range", "what", "values"), [
            (", ".join(n for n, _ in of), f"{', '.join(str(at) for _, at in of)}; {length}", span, text,
             words if len(words.split()) <= MANY_WORDS or named[words] == of[0][0] else f"as {named[words]}")
            for (length, span, text, words), of in rows.items()
        ])  # fmt: skip
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


# --- configuration


def configuration(which: str) -> list[str]:
    """The keys of the configuration: of the file's own tables, of an input, of a message that is sent."""
    if which == "tables":
        named = [(f"{table}.{key.name}", key) for table, keys in declared.TABLES.items() for key in keys]
    elif which == "input":
        named = [(key.name, key) for key in (*declared.TORQUE_INPUT, declared.REVERSE)]
    else:
        own = declared.output_keys("adhesion")[: -len(MESSAGES["adhesion"])]
        fields = declared.field_keys(MESSAGES["adhesion"]["MuAvailable"])
        named = [(key.name, key) for key in own] + [(f"….{key.name}", key) for key in fields]
    rows: list[Row] = [(f"`{name}`", key.takes, key.shown_default, key.what) for name, key in named]
    return table(("key", "takes", "default", "what"), rows)


def scenario(which: str = "") -> list[str]:
    """The keys of a table of a scenario; its top level without a name. An axle's are those that the top level lacks."""
    top = scenario_keys.TABLES[""] if which == "axle.N" else ()
    return key_rows(key for key in scenario_keys.TABLES[which] if key not in top)


def key_rows(keys: Iterable[Key]) -> list[str]:
    """A table of keys; units stand behind what they take."""
    rows: list[Row] = [
        (f"`{key.name}`", f"{_takes(key.takes)} {getattr(key, 'unit', '')}".rstrip(", "), key.shown_default, key.what)
        for key in keys
    ]
    return table(("key", "takes", "default", "what"), rows)


def _takes(text: str) -> str:
    """Any positive number is no range that one reads."""
    return {"1e-09 … 1e+15": "> 0,", "0 … 1e+15": "≥ 0,"}.get(text, f"{text},")


def drive_scenario(which: str = "") -> list[str]:
    """The keys of a table of a scenario to drive that are not those of a scenario; its top level without a name."""
    others = scenario_keys.TABLES.get(which, ())
    return key_rows(key for key in drive_keys.TABLES[which] if key not in others)


def tracks() -> list[str]:
    """How rough the named tracks are: alignment in the band by which tracks are judged, the others as a whole."""
    rows: list[Row] = []
    for name, of in SPECTRA.items():
        roll, gauge = (deviation(parts, 0.1, 1e5) for parts in (of.cross_level, of.gauge))
        cells = (f"{1e3 * roll:.2f}", f"{GRAVITY * roll:.3f}", f"{1e3 * gauge:.2f}") if of.cross_level else ("–",) * 3
        rows.append((f"`{name}`", f"{1e3 * deviation(of.alignment):.2f}", *cells))
    head = ("track", "alignment, 3 to 25 m, mm", "cross-level, mrad", "g × roll, m/s²", "gauge, mm")
    return table(head, rows)


def vehicles() -> list[str]:
    """The packaged vehicles, and the speed from which each hunts, by creep curve."""
    rows: list[Row] = []
    for name in packaged_vehicles():
        w = load_vehicle(name)
        hunts = (hunting_speed_m_s(w, CURVES[letter], scan_m_s=5.0) for letter in HUNTS_ON)
        base = f"{w.bogie.wheelbase_m:.2f}" if w.bogie else "–"
        cells = ("–" if math.isinf(v) else f"{v:.1f}" for v in hunts)
        rows.append((f"`{name}`", f"{1e-3 * w.M_v:.1f}", base, f"{w.gamma:g}", *cells))
    return table(("vehicle", "on a wheelset, t", "wheelbase, m", "conicity", *HUNTS_ON), rows)


def bus_load() -> list[str]:
    """What the packaged DBCs take of a bus, by axles."""
    return load_table(load_dbc(resources.DBC), load_dbc(rig.TRUTH_DBC), MAX_AXLES)


COMMON = re.compile(  # what the page says of all commands
    r"^(?:bad input: file, line, key, reason and what to do(?:; or a package of the extra is missing)?|Ctrl-C|done|"
    r"(?:the bus|a configuration, a DBC|the scenario's file)[\w ]* cannot be opened"
    r"(?:: it may be there on the next try)?)(?:$|[:;] (?:or,? )?)"
)


def exit_codes(program: str) -> list[str]:
    """What each command of a program ends with: its statuses, and those that mean something of their own."""
    rows: list[Row] = []
    for command, statuses in STATUSES[program].items():
        own = [(int(s), COMMON.sub("", text)) for s, text in statuses.items()]
        found = " ".join(str(s) for s, _ in sorted(own))
        told = (f"{s}: {text}" for s, text in sorted(own) if text and s)
        rows.append((f"`{command}`", found, "<br>".join(told)))
    return table(("command", "ends with", "meaning, where it is not the common one"), rows)


def lint_codes() -> list[str]:
    """What lint can find."""
    return table(
        ("code", "found where"),
        [(f"`{word}`", code.found) for word, code in CODES.items()],
    )


def lint_of(file: str) -> list[str]:
    """The first findings of lint in a DBC that is not sound, and their count."""
    first, last = 7, -1
    lines = lint_lines(Path(file), findings(ROOT / file))
    return ["```text", *lines[:first], "...", lines[last], "```"]


HEADLINES = (
    "worlds: its own vehicle, mean error", "worlds: its own vehicle, its own interval holds the truth",
    "worlds: its own vehicle, Valid and wrong, share of frames", "worlds: slopes untied, mean error",
    "worlds: slopes untied, its own interval holds the truth",
    "worlds: slopes untied × 1.5, its own interval holds the truth",
    "worlds: track: china-hs, its own interval holds the truth",
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
    """The rows of the first of a page's goals: name, value, bound, verdict."""
    lines = page.partition("\n**goals**")[2].split("\n<!-- end -->")[0].splitlines()
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("| ")]
    return [(name, value, bound, verdict) for name, value, bound, verdict in rows[1:]]


def fault_matrix() -> list[str]:
    """The rows of single signals."""
    return [*HEAD.splitlines(), *(line(row, verdict) for row, verdict in verdicts() if not whole_axle(row))]


MAKERS: dict[str, Callable[..., list[str]]] = {
    "fault-matrix": fault_matrix,
    "messages": messages,
    "configuration": configuration,
    "bus-load": bus_load,
    "exit-codes": exit_codes,
    "lint-codes": lint_codes,
    "lint-of": lint_of,
    "scenario": scenario,
    "drive-scenario": drive_scenario,
    "tracks": tracks,
    "vehicles": vehicles,
    "accuracy": accuracy,
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
