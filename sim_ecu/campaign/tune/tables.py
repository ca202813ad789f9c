"""What `sim-ecu tune` prints."""

from collections.abc import Mapping, Sequence

from sim_ecu.campaign.tune.candidates import Judging
from sim_ecu.campaign.tune.finalists import Finalist
from sim_ecu.campaign.tune.goals import GOALS, Difference

# what takes as long as so many candidates: to play a design on training runs; the whole design and the test
PLAYED_AS, TESTED_AS = 5, 60


def pace(seconds: float, left: int, jobs: int, played: int) -> str:
    """What the budget comes to on this computer, from the time that the start took."""
    minutes = seconds * left / jobs / 60.0
    after = seconds * (PLAYED_AS * played + TESTED_AS) / jobs / 60.0
    rest = f", the play-off and the test some {after:.0f} more" if played else ""
    return (
        f"the start took {seconds:.0f} s, its conditions included: {left} further candidates on {jobs} "
        f"{'process' if jobs == 1 else 'processes'} take {minutes:.0f} minutes at most{rest}"
    )


def said(words: str, first: float, best: float, budget: int, judging: Judging) -> str:
    """The first stage."""
    rate = f", {60.0 * judging.computed / judging.seconds:.1f} a minute" if judging.seconds else ""
    lost = f"; {len(judging.failed)} failed: {judging.failed[0]}" if judging.failed else ""
    count = "1 candidate" if budget == 1 else f"{budget} candidates"
    return f"{count}{rate}: {words} {best:.4f}; of the start {first:.4f}{lost}"


def front_table(every: Sequence[Finalist], front: Sequence[Finalist], chosen: Finalist) -> list[str]:
    """The designs that were played on training seeds, and which of them no other is ahead of in all goals."""
    rows = [["", *(f"{g.words}, {g.unit}" for g in GOALS), "operations", "over the start", ""]]
    for f in every:
        marks = ["front"] if f in front else []
        marks += ["chosen: least over the start"] if f is chosen else []
        values = [f"{v:.3f}" for v in f.figures.values]
        rows.append([f.name, *values, str(f.figures.cost), f"{f.against_start:+.3f}", ", ".join(marks)])
    head = (
        "Played on training seeds. Operations: an axle's, each tick. Over the start: the goals' logarithms by weight."
    )
    return ["", head, "", *_table(rows)]


def test_table(reference: str, found: Mapping[str, Sequence[Difference]], runs: int) -> list[str]:
    """On test seeds, each against the one to reach."""
    rows = [["on test seeds", "margin", reference, *(column for name in found for column in (name, "difference", ""))]]
    for goal in zip(*found.values(), strict=True):
        first = goal[0]
        row = [f"{first.words}{first.unit and ', '}{first.unit}", f"{first.margin:.3g}", f"{first.theirs:.3f}"]
        for d in goal:
            ends = f" ({d.low:+.3f} … {d.high:+.3f})" if d.low != d.high else ""
            row += [f"{d.ours:.3f}", f"{d.ours - d.theirs:+.3f}{ends}", d.verdict]
        rows.append(row)
    head = (
        f"{runs} runs, each design on the same frames. In brackets: intervals that hold all differences of a design at "
        "once with 90 %, if these lie about their mean as much to one side as to the other. Equal: the whole interval "
        "lies within the margin."
    )
    return ["", head, "", *_table(rows), ""]


def _table(rows: Sequence[Sequence[str]]) -> list[str]:
    head, *body = rows
    lines = [head, ["---"] * len(head), *body]
    return ["| " + " | ".join(row) + " |" for row in lines]
