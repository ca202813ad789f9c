"""`sim-ecu figures -o DIR`: the paper's figures from our data."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib.pyplot as plt

from sim_ecu.design.brief import Recipe, load_source
from sim_ecu.resources import PAPER_DESIGN
from sim_ecu.score.drawing import draw
from sim_ecu.score.figure_data import SPEED, Known, gather
from wrcd.errors import InputError, create
from wrcd.progress import Progress

FORM_NAMES = {"wrcd": "wrcd's form", "paper": "the paper's own form"}


def run(
    folder: Path, design_file: Path, paper_file: Path | None = None, *, tracks: int = 6,
    seconds: float = 6.0, between: int = 1,
) -> int:  # fmt: skip
    """Write the pictures and figures.md into a folder.

    paper_file: a design in the paper's own form that is drawn beside; without one the packaged one, if it is for the
    same wheelset. tracks: runs of each condition, on tracks of their own; seconds: of the runs over time; between:
    adhesion levels between two curves in Fig. 6.
    """
    subjects = sources(design_file, paper_file)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise InputError(f"cannot be made: {e.strerror}", file=folder, key="-o", hint="give another folder") from None
    progress, known = Progress(), Known()
    captions: dict[int, str] = {}
    for name, subject in reversed(subjects.items()):  # the captions are the first one's
        data = gather(subject, tracks, seconds, between, progress.at, known)
        progress.at(f"drawing {name}", 0.0)
        for number, caption, picture in draw(data):
            captions[number] = caption
            picture.suptitle(f"Fig. {number}: {caption}", fontsize=8.5, x=0.01, ha="left")
            picture.savefig(folder / file_name(number, subject), dpi=110)
            plt.close(picture)
    progress.end()
    with create(folder / "figures.md") as file:
        file.write(report(subjects, captions, tracks))
    print(f"pictures and figures.md in {folder}")
    return 0


def sources(design_file: Path, paper_file: Path | None) -> dict[str, Recipe]:
    """The designs that are drawn, by their names."""
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


def report(subjects: Mapping[str, Recipe], captions: Mapping[int, str], tracks: int) -> str:
    """The text beside the pictures (Markdown)."""
    sensors = next(iter(subjects.values())).sensors
    lines = [
        "# The paper's figures, from our data",
        "",
        *(f"- {name}: design {s.design.name}, checksum {s.design.checksum[:12]}." for name, s in subjects.items()),
        "",
        f"{SPEED:g} m/s, a good track, {sensors.name} sensors, {tracks} tracks for each condition.",
        "",
        f"The rules of {FORM_NAMES['wrcd']} do not see the residuals as they are, but residuals 1 to 3 over residual "
        "4, and residual 4; the share of the sensors' noise is taken off first. Those of the paper's own form see the "
        "residuals as they are, in units of the sensors' noise. Places in a range are of what they see: 0 is the "
        "centre of Low, 1 that of High.",
    ]  # fmt: skip
    for number, caption in captions.items():
        lines += ["", f"## Fig. {number}", ""]
        for name, s in subjects.items():
            lines += [f"![Fig. {number}, {name}]({file_name(number, s)})", ""]
        lines += [caption]
    return "\n".join(lines) + "\n"
