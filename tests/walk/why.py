"""Why: "why did it fall at 9.3 s?", asked of the demo's log in one line, and the picture of it."""

import shutil

from tests.walk.demo import png_size
from tests.walk.walk import Step, Walk, expect, played

MOMENT = "9.3"  # the leaf film begins at 9 s


def take(walk: Walk) -> str:
    """wrcd why, wrcd plot."""
    log = played(walk)
    said = walk.wrcd("why", log, MOMENT)
    (walk.out / "why.txt").write_text(said)
    change = next((line for line in said.splitlines() if "fell from" in line), None)
    expect(change is not None, f"no fall is told:\n{said}")
    expect("rule" in said and "residual" in said, f"neither rule nor residual is told:\n{said}")
    picture = walk.folder / "fall.png"
    walk.wrcd("plot", log, "-o", picture.name, "--relative", "--from", "7", "--to", "12")
    width, height = png_size(picture)
    shutil.copy(picture, walk.out / "plot.png")
    return f"{' '.join((change or '').split())}; picture {width} × {height}"


STEP = Step("why", take)
