"""The demo's lines: a legend, the moments of each axle, and every change of Validity in words."""

import shutil
import sys
from collections.abc import Iterable, Mapping

from sim_ecu.play.observer import Trace
from wrcd.core.causes import Validity
from wrcd.core.events import Change
from wrcd.core.vocabulary import CONFIDENCES

FULL_SCALE_PCT = 50
WIDE, NARROW, BESIDE = 50, 25, 62  # columns of the bar, and of what stands beside it
HALF_WIDTHS = {name: half_width for half_width, name in CONFIDENCES}

LEGEND = """\
Each line is a moment of one axle: adhesion (force between wheel and rail over load), from 0 to {full} %.
  =  in use: how hard the wheel pulls           T  the truth: what is available; only the rig knows it
  E  wrcd's estimate of what is available       *  truth and estimate in one place
  Valid: to be used. Degraded: to be used with care. NotAvailable: no estimate. It says why at once."""


class Screen:
    """Prints. Of the changes those of some axles (numbers) only."""

    def __init__(self, numbers: Iterable[int]) -> None:
        self._numbers = set(numbers)
        columns = shutil.get_terminal_size().columns if sys.stdout.isatty() else WIDE + BESIDE
        self._width = WIDE if columns >= WIDE + BESIDE else NARROW
        self._since: dict[int, Change] = {}  # the newest change of each axle

    def begin(self) -> None:
        """What the signs mean, and the scale."""
        print(f"\n{LEGEND.format(full=FULL_SCALE_PCT)}\n")
        scale = [" "] * (self._width + 4)
        for pct in range(0, FULL_SCALE_PCT + 1, 10):
            at = self._place(pct)
            scale[at : at + len(str(pct))] = str(pct)
        print(" " * 12 + "".join(scale).rstrip() + " %", flush=True)

    def moment(self, traces: Mapping[int, Trace]) -> None:
        """A line for each axle."""
        for number, trace in traces.items():
            if trace.truth and trace.adhesion:
                print(self._line(number, trace), flush=True)

    def _line(self, number: int, trace: Trace) -> str:
        t, true = trace.truth[-1]
        a = trace.adhesion[-1][1]
        bar = ["·"] * (self._width + 1)
        for i in range(self._place(float(true["MuUsed"])) + 1):
            bar[i] = "="
        bar[self._place(float(true["MuAvailable"]))] = "T"
        shown = "–"
        if isinstance(mu := a["MuAvailable"], float):
            at = self._place(mu)
            bar[at] = "*" if bar[at] == "T" else "E"
            half_width = HALF_WIDTHS.get(str(a.get("Confidence")), float("inf"))
            shown = f"{mu:.1f} ± {half_width:.0f} %" if half_width < float("inf") else f"{mu:.1f} ± ? %"
        contact, surface = (str(a.get(name, "–")) for name in ("ContactState", "Surface"))
        return (
            f"{t:5.1f} s A{number} |{''.join(bar)}| truth {true['MuAvailable']:4.1f} %  wrcd {shown:>11}  "
            f"{a['Validity']!s:12} {contact:9} {surface}"
        ).rstrip()

    def _place(self, pct: float) -> int:
        return min(max(round(pct / FULL_SCALE_PCT * self._width), 0), self._width)

    def changes(self, changes: Iterable[Change], first_s: float) -> None:
        """What has changed, when, and why."""
        for c in changes:
            if c.axle in self._numbers:
                print(f"{max(c.time_us * 1e-6 - first_s, 0.0):5.1f} s axle {c.axle}: {self._change(c)}", flush=True)
                self._since[c.axle] = c

    def _change(self, c: Change) -> str:
        before = self._since.get(c.axle)
        if c.after is Validity.VALID:
            if before is None:
                return "Valid"
            return f"Valid, after {(c.time_us - before.time_us) * 1e-6:.1f} s of {before.after}"
        words = f"{c.after}: {c.cause.words}" if c.cause else str(c.after)
        return words if c.detail in ("", c.cause.words) else f"{words} ({c.detail})"
