"""The demo's lines, of 80 columns at most: a legend, moments of each axle, and every change of Validity in words."""

import textwrap
from collections.abc import Iterable, Mapping

from sim_ecu.play.observer import ObservedTrace
from wrcd.core.causes import Validity
from wrcd.core.events import Change
from wrcd.core.vocabulary import CONFIDENCES

FULL_SCALE_PCT, WIDTH, COLUMNS = 50, 20, 80
HALF_WIDTHS = {name: f"{half_width:g}" for half_width, name in CONFIDENCES[:-1]}
HALF_WIDTHS[CONFIDENCES[-1][1]] = f">{CONFIDENCES[-2][0]:g}"

LEGEND = """\
Each line is a moment of an axle: adhesion (force over load), 0 to {full} %.
  =  in use     T  the truth: what is available; only the rig knows it
  E  wrcd's estimate of what is available     *  both in one place
  Valid: may be acted on. Degraded: may not. NotAvailable: no number."""


class Screen:
    """Prints. Of the changes those of some axles (numbers) only."""

    def __init__(self, numbers: Iterable[int]) -> None:
        self._numbers = set(numbers)

    def begin(self) -> None:
        """Print what the signs mean."""
        print(f"\n{LEGEND.format(full=FULL_SCALE_PCT)}\n", flush=True)

    def moment(self, traces: Mapping[int, ObservedTrace]) -> None:
        """Print a line for each axle."""
        for number, trace in traces.items():
            if trace.truth and trace.adhesion:
                print(_line(number, trace), flush=True)

    def changes(self, changes: Iterable[Change], first_s: float) -> None:
        """Print what has changed, when (s since first_s), and why."""
        for c in changes:
            if c.axle in self._numbers:
                why = f": {c.cause.words}" if c.after is not Validity.VALID else ""
                line = f"{c.time_us * 1e-6 - first_s:5.1f} s axle {c.axle}: {c.after}{why}"
                print(textwrap.fill(line, COLUMNS, subsequent_indent=" " * 8), flush=True)


def _line(number: int, trace: ObservedTrace) -> str:
    t, true = trace.truth[-1]
    a = trace.adhesion[-1][1]
    bar = ["·"] * (WIDTH + 1)
    for i in range(_place(float(true["MuUsed"])) + 1):
        bar[i] = "="
    bar[_place(float(true["MuAvailable"]))] = "T"
    shown = "–"
    if isinstance(mu := a["MuAvailable"], float):
        at = _place(mu)
        bar[at] = "*" if bar[at] == "T" else "E"
        width = f" ± {HALF_WIDTHS.get(str(a['Confidence']), '?')}" if "Confidence" in a else ""
        shown = f"{mu:.1f}{width} %"
    truth = f"truth {true['MuAvailable']:4.1f} %"
    return f"{t:5.1f} s A{number} |{''.join(bar)}| {truth}  wrcd {shown:>11}  {a['Validity']}"


def _place(pct: float) -> int:
    return min(max(round(pct / FULL_SCALE_PCT * WIDTH), 0), WIDTH)
