"""`sim-ecu figures -o DIR`: the paper's figures from our data, and whether what it says of them is so there."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from sim_ecu.design.cases import Progress as At
from sim_ecu.design.linear import slope_and_secant
from sim_ecu.design.rules import PAPER_POLYNOMIAL
from sim_ecu.design.source import Source, load_source
from sim_ecu.physics.contact import CURVES, peak
from sim_ecu.resources import PAPER_DESIGN
from sim_ecu.score import statements as say
from sim_ecu.score.drawing import Drawing
from sim_ecu.score.figure_data import (
    LINEAR,
    OFF_PEAK,
    SATURATED,
    SETTLED_S,
    SPEED,
    HeldRuns,
    Levels,
    Trace,
    held,
    nearest,
    observe,
    survey,
)  # fmt: skip
from sim_ecu.score.statements import Statement
from wrcd.errors import InputError, create
from wrcd.resources import DESIGN
from wrcd.tools.progress import Progress

# Figs. 3 and 11, 4 and 12 show the same runs.
OVER_TIME = ("A", "C", "F")
NUMBERS = (1, 3, 4, 5, 6, 8, 9, 10, 11, 12, 13)
FORM_NAMES = {"wrcd": "wrcd's form", "paper": "the paper's own form"}


@dataclass(frozen=True, slots=True)
class Data:
    """All that is drawn. below is what is held at the share of the peak's creep that model 4 is designed at."""

    subject: Source
    at_peak: dict[str, Trace]  # by curve
    linear: Trace  # curve A
    below: Trace  # curve A
    saturated_levels: Levels
    below_levels: Levels
    off_peak: tuple[Levels, ...]  # between both; not drawn


@dataclass(frozen=True, slots=True)
class Judged:
    """A design with what it shows."""

    name: str
    data: Data
    found: list[Statement]

    @property
    def holding(self) -> str:
        """How many statements hold."""
        return f"{sum(f.holds for f in self.found)} of {len(self.found)} statements hold"


def run(
    folder: Path, design_file: Path | None = None, paper_file: Path | None = None, *, tracks: int = 6,
    seconds: float = 6.0, between: int = 1,
) -> int:  # fmt: skip
    """Write the pictures and figures.md into a folder. A statement that does not hold is no error.

    paper_file: a design in the paper's own form that is judged beside; without one the packaged one, if it is for the
    same wheelset. tracks: runs of each condition, on tracks of their own; seconds: of the runs over time; between:
    adhesion levels between two curves in Fig. 6.
    """
    subjects = sources(design_file, paper_file)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise InputError(f"cannot be made: {e.strerror}", file=folder, key="-o", hint="give another folder") from None
    progress = Progress()
    runs, every = HeldRuns(), []
    for name, subject in subjects.items():
        data = gather(subject, tracks, seconds, between, progress.at, runs)
        every.append(Judged(name, data, check(data)))
    captions: list[dict[int, str]] = []
    for judged in every:
        drawing = Drawing(judged.data.subject, judged.found)
        for number, picture in draw(judged.data, drawing).items():
            progress.at(f"drawing {judged.name}", number / max(NUMBERS))
            picture.savefig(folder / file_name(number, judged.data.subject), dpi=110)
        captions.append(drawing.captions)
    progress.end()
    with create(folder / "figures.md") as file:
        file.write(report(every, captions[0], tracks))
    for rows in zip(*(j.found for j in every), strict=True):
        print(rows[0].line())
        for other, row in zip(every[1:], rows[1:], strict=True):
            print(f"{'':8} {row.verdict:14} in {other.name}: {row.numbers}")
    print("; ".join(f"{j.name}: {j.holding}" for j in every) + f"; pictures and figures.md in {folder}")
    return 0


def sources(design_file: Path | None, paper_file: Path | None) -> dict[str, Source]:
    """The designs that are judged, by their names."""
    first = load_source(design_file or DESIGN)
    subjects = {FORM_NAMES[first.design.form]: first}
    if paper_file is not None or PAPER_DESIGN.exists():
        beside = load_source(paper_file or PAPER_DESIGN)
        if beside.wheelset == first.wheelset:
            subjects.setdefault(FORM_NAMES[beside.design.form], beside)
        elif paper_file is not None:
            raise InputError("is for another wheelset than the design", file=paper_file, key="--paper")
    return subjects


def file_name(number: int, s: Source) -> str:
    """Of a picture."""
    return f"fig{number:02d}{'-paper' if s.design.form == 'paper' else ''}.png"


def gather(s: Source, tracks: int, seconds: float, between: int, at: At, known: HeldRuns | None = None) -> Data:
    """Simulate and estimate: most of the time goes here. known: what has been simulated for another design."""
    known = known or HeldRuns()
    below = s.points[-1].creep_of_peak
    wanted = [*((c, SATURATED) for c in OVER_TIME), ("A", LINEAR), ("A", below)]
    conditions = [c for curve, share in wanted for c in held(s.wheelset, CURVES[curve], share, tracks)]
    trace = observe(s, conditions, seconds, lambda _, share: at("runs over time", share), known)
    runs = [trace.runs(slice(i * tracks, (i + 1) * tracks)) for i in range(len(wanted))]
    saturated_levels, below_levels, *off_peak = (
        survey(s, share, between, tracks, lambda _, done: at("residuals over adhesion", done), known)
        for share in (SATURATED, below, *OFF_PEAK)
    )
    at_peak = dict(zip(OVER_TIME, runs, strict=False))
    return Data(s, at_peak, runs[-2], runs[-1], saturated_levels, below_levels, tuple(off_peak))


def check(d: Data) -> list[Statement]:
    """Every statement on the data, in the figures' order."""
    s, sets = d.subject, d.subject.design.residual_sets
    settled = {name: trace.since(SETTLED_S) for name, trace in d.at_peak.items()}
    regions = (d.saturated_levels, d.below_levels)
    contact = s.wheelset.contact
    peaks = {name: peak(SPEED, contact, *c.row())[1] for name, c in CURVES.items()}
    slopes = {name: slope_and_secant(s.wheelset, c, SATURATED, SPEED) for name, c in CURVES.items()}
    last, dry = s.points[-1], CURVES["A"]
    design_points = [(nearest(p, *regions), 100 * peak(SPEED, contact, *p.curve.row())[1]) for p in s.points]
    out = say.creep_curves(slopes, peaks, s.points)
    out.append(
        say.straight(
            1,
            "model 4's design point lies in the linear region",
            *slope_and_secant(s.wheelset, last.curve, last.creep_of_peak, SPEED),
        )
    )
    out += say.lowest(3, "at the peak of curve A", 1, settled["A"])
    out += say.lowest(4, "at the peak of curve C", 2, settled["C"])
    out.append(say.increased(4, 1, settled["C"], settled["A"]))
    slope = slope_and_secant(s.wheelset, dry, LINEAR, SPEED)
    out.append(say.straight(5, f"(ours) {LINEAR:g} of the peak's creep is in the linear region of curve A", *slope))
    out += say.lowest(5, "in the linear region of curve A", 4, d.linear.since(SETTLED_S))
    out += say.lowest(5, f"(ours) at model 4's {last.creep_of_peak:g} of the peak's creep", 4, d.below.since(SETTLED_S))
    out += (
        say.matched(design_points, sets)
        + say.unsaturated((d.below_levels, *d.off_peak), sets)
        + say.paper_rules(*regions, sets)
    )
    for model in (1, 2):
        seen = np.concatenate([levels.seen[..., model - 1].ravel() for levels in regions])
        out.append(say.divided(7 + model, model, sets[model - 1], seen))
    out += say.output_map(s.design.bases, s.design.polynomial, np.array(PAPER_POLYNOMIAL))
    for figure, curve in zip((11, 12, 13), OVER_TIME, strict=True):
        out += say.right(figure, curve, d.at_peak[curve], settled[curve])
    return out


def draw(d: Data, drawing: Drawing) -> dict[int, Figure]:
    """The pictures by their numbers."""
    regions = (d.saturated_levels, d.below_levels)
    below = d.subject.points[-1].creep_of_peak
    pictures = {
        1: drawing.creep_curves(),
        3: drawing.residuals(3, "at the peak of curve A", {"": d.at_peak["A"]}),
        4: drawing.residuals(4, "at the peak of curve C", {"": d.at_peak["C"]}),
        5: drawing.residuals(
            5,
            "below the peak of curve A",
            {
                f"linear region: {LINEAR:g} of the peak's creep": d.linear,
                f"as model 4 is designed: {below:g} of the peak's creep": d.below,
            },
        ),
        6: drawing.levels(*regions),
        8: drawing.sets(8, 1, *regions),
        9: drawing.sets(9, 2, *regions),
        10: drawing.output(PAPER_POLYNOMIAL),
    }
    return pictures | {n: drawing.estimate(n, c, d.at_peak[c]) for n, c in zip((11, 12, 13), OVER_TIME, strict=True)}


def report(every: Sequence[Judged], captions: dict[int, str], tracks: int) -> str:
    """The text beside the pictures (Markdown): a column for each design."""
    s = every[0].data.subject
    lines = [
        "# The paper's figures, from our data",
        "",
        *(f"- {j.name}: design {j.data.subject.design.name}, checksum {j.data.subject.design.checksum[:12]}: "
          f"{j.holding}." for j in every),
        "",
        f"{SPEED:g} m/s, a good track, {s.sensors.name} "
        f"sensors, {tracks} tracks for each condition. Every verdict follows by arithmetic from the data drawn. "
        f'"Is the lowest" takes {100 * say.THROUGHOUT:.0f} % of the estimates from {SETTLED_S:g} s on, or of the '
        f'conditions; "almost equal" {say.RIGHT_PP:g} percentage point or {100 * say.RIGHT_SHARE:.0f} % of the truth.',
        "",
        f"The rules of {FORM_NAMES['wrcd']} do not see the residuals as they are, but residuals 1 to 3 over residual "
        "4, and residual 4; the share of the sensors' noise is taken off first. Those of the paper's own form see the "
        "residuals as they are, in units of the sensors' noise. Places in a range are of what they see: 0 is the "
        "centre of Low, 1 that of High. What is said of all that lies off the saturation points also takes conditions "
        f"that are not drawn: held at {', '.join(f'{share:g}' for share in OFF_PEAK)} of the peak's creep.",
    ]  # fmt: skip
    for number, caption in captions.items():
        lines += ["", f"## Fig. {number}", ""]
        for j in every:
            lines += [f"![Fig. {number}, {j.name}]({file_name(number, j.data.subject)})", ""]
        lines += [
            caption,
            "",
            f"| the paper says | {' | '.join(j.name for j in every)} |",
            "|---" * (1 + len(every)) + "|",
        ]
        for rows in zip(*(j.found for j in every), strict=True):
            if rows[0].figure == number:
                cells = " | ".join(f"**{f.verdict}**: {_cell(f.numbers)}" for f in rows)
                lines.append(f"| {_cell(rows[0].says)} | {cells} |")
    return "\n".join(lines) + "\n"


def _cell(text: str) -> str:
    """Text as a cell of a Markdown table: a bar within would end it."""
    return text.replace("|", "\\|")
