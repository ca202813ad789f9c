"""`sim-ecu figures -o DIR`: the paper's figures from our data, and whether what it says of them is so there."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from sim_ecu.design.brief import Recipe, load_source
from sim_ecu.design.linear import slope_and_secant
from sim_ecu.design.rules import PAPER_POLYNOMIAL
from sim_ecu.physics.contact import CURVES, peak
from sim_ecu.reporting.table import Table
from sim_ecu.resources import PAPER_DESIGN
from sim_ecu.score import paper_claims as say
from sim_ecu.score.drawing import draw
from sim_ecu.score.figure_data import (
    LINEAR,
    OFF_PEAK,
    OVER_TIME,
    SATURATED,
    SETTLED_S,
    SPEED,
    Data,
    Known,
    gather,
    nearest,
)
from sim_ecu.score.paper_claims import PaperClaim
from wrcd.errors import InputError, create
from wrcd.progress import Progress

FORM_NAMES = {"wrcd": "wrcd's form", "paper": "the paper's own form"}


@dataclass(frozen=True, slots=True)
class Judged:
    """A design with what it shows."""

    name: str
    data: Data
    found: list[PaperClaim]

    @property
    def holding(self) -> str:
        """How many statements hold."""
        return f"{sum(f.holds for f in self.found)} of {len(self.found)} statements hold"


def run(
    folder: Path, design_file: Path, paper_file: Path | None = None, *, tracks: int = 6,
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
    progress, known, every = Progress(), Known(), []
    for name, subject in subjects.items():
        data = gather(subject, tracks, seconds, between, progress.at, known)
        every.append(Judged(name, data, check(data)))
    captions: dict[int, str] = {}
    for judged in reversed(every):  # the captions are the first one's
        progress.at(f"drawing {judged.name}", 0.0)
        for number, caption, picture in draw(judged.data):
            captions[number] = caption
            verdicts = [f"  {c.verdict}: {c.says}" for c in judged.found if c.figure == number]
            picture.suptitle("\n".join((f"Fig. {number}: {caption}", *verdicts)), fontsize=8.5, x=0.01, ha="left")
            picture.savefig(folder / file_name(number, judged.data.subject), dpi=110)
            plt.close(picture)
    progress.end()
    with create(folder / "figures.md") as file:
        file.write(report(every, captions, tracks))
    for rows in zip(*(j.found for j in every), strict=True):
        print(rows[0].line())
        for other, row in zip(every[1:], rows[1:], strict=True):
            print(f"{'':8} {row.verdict:14} in {other.name}: {row.numbers}")
    print("; ".join(f"{j.name}: {j.holding}" for j in every) + f"; pictures and figures.md in {folder}")
    return 0


def sources(design_file: Path, paper_file: Path | None) -> dict[str, Recipe]:
    """The designs that are judged, by their names."""
    first = load_source(design_file)
    subjects = {FORM_NAMES[first.design.form]: first}
    if paper_file is not None or PAPER_DESIGN.exists():
        beside = load_source(paper_file or PAPER_DESIGN)
        if beside.wheelset == first.wheelset:
            subjects.setdefault(FORM_NAMES[beside.design.form], beside)
        elif paper_file is not None:
            raise InputError("is for another wheelset than the design", file=paper_file, key="--paper")
    return subjects


def file_name(number: int, s: Recipe) -> str:
    """Of a picture."""
    return f"fig{number:02d}{'-paper' if s.design.form == 'paper' else ''}.png"


def check(d: Data) -> list[PaperClaim]:
    """Every statement on the data, in the figures' order."""
    s, sets = d.subject, d.subject.design.residual_sets
    settled = {name: trace.since(SETTLED_S) for name, trace in d.at_peak.items()}
    contact, last = s.wheelset.contact, s.points[-1]

    def mu(curve: Sequence[float]) -> float:
        return peak(SPEED, contact, *curve)[1]

    def slope(curve: str, creep_of_peak: float) -> tuple[float, float]:
        return slope_and_secant(s.wheelset, CURVES[curve], creep_of_peak, SPEED)

    design_points = [(nearest(p, *d.regions), 100 * mu(p.curve.row())) for p in s.points]
    slopes = {name: slope(name, SATURATED) for name in CURVES}
    at_last = slope_and_secant(s.wheelset, last.curve, last.creep_of_peak, SPEED)
    share = f"(ours) {LINEAR:g} of the peak's creep is in the linear region of curve A"
    return [
        *say.creep_curves(slopes, {name: mu(c.row()) for name, c in CURVES.items()}, s.points),
        say.straight(1, "model 4's design point lies in the linear region", *at_last),
        *say.lowest(3, "at the peak of curve A", 1, settled["A"]),
        *say.lowest(4, "at the peak of curve C", 2, settled["C"]),
        say.increased(4, 1, settled["C"], settled["A"]),
        say.straight(5, share, *slope("A", LINEAR)),
        *say.lowest(5, "in the linear region of curve A", 4, d.linear.since(SETTLED_S)),
        *say.lowest(5, f"(ours) at model 4's {last.creep_of_peak:g} of the peak's creep", 4, d.below.since(SETTLED_S)),
        *say.matched(design_points, sets),
        *say.unsaturated((d.regions[1], *d.off_peak), sets),
        *say.paper_rules(*d.regions, sets),
        *(
            say.divided(7 + m, m, sets[m - 1], np.concatenate([r.seen[..., m - 1].ravel() for r in d.regions]))
            for m in (1, 2)
        ),
        *say.output_map(s.design.bases, s.design.polynomial, np.array(PAPER_POLYNOMIAL)),
        *(
            claim
            for figure, c in zip((11, 12, 13), OVER_TIME, strict=True)
            for claim in say.right(figure, c, d.at_peak[c], settled[c])
        ),
    ]


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
        lines += [caption, ""]
        claims = [rows for rows in zip(*(j.found for j in every), strict=True) if rows[0].figure == number]
        lines += Table(
            ["the paper says", *(j.name for j in every)],
            [[rows[0].says, *(f"**{f.verdict}**: {f.numbers}" for f in rows)] for rows in claims],
        ).markdown()
    return "\n".join(lines) + "\n"
