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
from sim_ecu.score import statements as say
from sim_ecu.score.drawing import Drawing
from sim_ecu.score.figure_data import (
    LINEAR,
    OFF_PEAK,
    SATURATED,
    SETTLED_S,
    SPEED,
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


def run(
    folder: Path, design_file: Path | None = None, *, tracks: int = 6, seconds: float = 6.0, between: int = 1
) -> int:
    """Write fig01.png … fig13.png and figures.md into a folder. A statement that does not hold is no error.

    tracks: runs of each condition, on tracks of their own; seconds: of the runs over time; between: adhesion levels
    between two curves in Fig. 6.
    """
    subject = load_source(design_file or DESIGN)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise InputError(f"cannot be made: {e.strerror}", file=folder, key="-o", hint="give another folder") from None
    progress = Progress()
    data = gather(subject, tracks, seconds, between, progress.at)
    found = check(data)
    drawing = Drawing(subject, found)
    pictures = draw(data, drawing)
    for number, (name, figure) in enumerate(pictures.items()):
        progress.at("drawing", number / len(pictures))
        figure.savefig(folder / name, dpi=110)
    progress.end()
    with create(folder / "figures.md") as file:
        file.write(report(subject, drawing.captions, found, tracks))
    for statement in found:
        print(statement.line())
    false = sum(not s.holds for s in found)
    print(f"{len(found)} statements, {len(found) - false} hold, {false} do not; pictures and figures.md in {folder}")
    return 0


def gather(s: Source, tracks: int, seconds: float, between: int, at: At) -> Data:
    """Simulate and estimate: most of the time goes here."""
    below = s.points[-1].creep_of_peak
    wanted = [*((c, SATURATED) for c in OVER_TIME), ("A", LINEAR), ("A", below)]
    conditions = [c for curve, share in wanted for c in held(s.wheelset, CURVES[curve], share, tracks)]
    trace = observe(s, conditions, seconds, lambda _, share: at("runs over time", share))
    runs = [trace.runs(slice(i * tracks, (i + 1) * tracks)) for i in range(len(wanted))]
    saturated_levels, below_levels, *off_peak = (
        survey(s, share, between, tracks, lambda _, done: at("residuals over adhesion", done))
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


def draw(d: Data, drawing: Drawing) -> dict[str, Figure]:
    """The pictures by their file names."""
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
    pictures |= {n: drawing.estimate(n, c, d.at_peak[c]) for n, c in zip((11, 12, 13), OVER_TIME, strict=True)}
    return {f"fig{number:02d}.png": picture for number, picture in pictures.items()}


def report(s: Source, captions: dict[int, str], found: Sequence[Statement], tracks: int) -> str:
    """The text beside the pictures (Markdown)."""
    lines = [
        "# The paper's figures, from our data",
        "",
        f"Design {s.design.name}, checksum {s.design.checksum[:12]}; {SPEED:g} m/s, a good track, {s.sensors.name} "
        f"sensors, {tracks} tracks for each condition. Every verdict follows by arithmetic from the data drawn. "
        f'"Is the lowest" takes {100 * say.THROUGHOUT:.0f} % of the estimates from {SETTLED_S:g} s on, or of the '
        f'conditions; "almost equal" {say.RIGHT_PP:g} percentage point or {100 * say.RIGHT_SHARE:.0f} % of the truth.',
        "",
        "The rules do not see the residuals as they are, but residuals 1 to 3 over residual 4, and residual 4; the "
        "share of the sensors' noise is taken off first. Places in a range are of what they see: 0 is the centre of "
        "Low, 1 that of High. What is said of all that lies off the saturation points also takes conditions that are "
        f"not drawn: held at {', '.join(f'{share:g}' for share in OFF_PEAK)} of the peak's creep.",
    ]
    for number, caption in captions.items():
        lines += ["", f"## Fig. {number}", "", f"![Fig. {number}](fig{number:02d}.png)", "", caption, ""]
        lines += [f"- **{f.verdict}**: {f.says}: {f.numbers}" for f in found if f.figure == number]
    return "\n".join(lines) + "\n"
