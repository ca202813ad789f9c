"""The demo's lines: a legend, the moments of each axle, and every change of Validity in words."""

import shutil
import sys
import textwrap
from collections.abc import Iterable, Mapping, Sequence

from sim_ecu.play.observer import ObservedTrace
from wrcd.core.causes import Cause, Validity
from wrcd.core.events import Change
from wrcd.core.vocabulary import CONFIDENCES

FULL_SCALE_PCT = 50
WIDE, NARROW = 50, 20  # columns of the bar
FULL_LINE = 126  # columns of a line with the wide bar and every word; a narrow one fits into 80
SHOWN = ("Confidence", "ContactState", "Surface")  # of Adhesion, what a configuration may leave out
AGAIN_US = 1_000_000  # the same Validity for the same cause is reported once in this time
HALF_WIDTHS = {name: half_width for half_width, name in CONFIDENCES}

LEGEND = """\
Each line is a moment of one axle: adhesion (force between wheel and rail over load), from 0 to {full} %.
  =  in use: how hard the wheel pulls           T  the truth: what is available; only the rig knows it
  E  wrcd's estimate of what is available       *  truth and estimate in one place
  Valid: may be acted on. Degraded: may not, its number is a guess. NotAvailable: no number. It says why at once."""


class Screen:
    """Prints. Of the changes those of some axles (numbers) only. unmapped: of SHOWN, what is not sent."""

    def __init__(self, numbers: Iterable[int], unmapped: Sequence[str] = ()) -> None:
        self._unmapped = unmapped
        self._numbers = set(numbers)
        self._columns = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
        self._wide = self._columns is None or self._columns >= FULL_LINE
        self._width = WIDE if self._wide else NARROW
        self._reported_us: dict[tuple[int, Validity, Cause], int] = {}  # when
        self._lost: dict[int, Change] = {}  # by axle: with what it ceased to be Valid

    def begin(self) -> None:
        """Print what the signs mean, what is not shown, and the scale."""
        print(f"\n{LEGEND.format(full=FULL_SCALE_PCT)}\n")
        if self._unmapped:
            so = ": no interval is shown" if "Confidence" in self._unmapped else ": not shown"
            print(f"This configuration sends no {', '.join(self._unmapped)}{so}.\n")
        scale = [" "] * (self._width + 4)
        for pct in range(0, FULL_SCALE_PCT + 1, 10):
            at = self._place(pct)
            scale[at : at + len(str(pct))] = str(pct)
        print(" " * 12 + "".join(scale).rstrip() + " %", flush=True)

    def moment(self, traces: Mapping[int, ObservedTrace]) -> None:
        """A line for each axle."""
        for number, trace in traces.items():
            if trace.truth and trace.adhesion:
                print(self._line(number, trace), flush=True)

    def _line(self, number: int, trace: ObservedTrace) -> str:
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
            shown = f"{mu:.1f} %"
            half_width = HALF_WIDTHS.get(str(a.get("Confidence")), float("inf"))
            if "Confidence" not in self._unmapped:
                shown = f"{mu:.1f} ± {half_width:.0f} %" if half_width < float("inf") else f"{mu:.1f} ± ? %"
        line = (
            f"{t:5.1f} s A{number} |{''.join(bar)}| truth {true['MuAvailable']:4.1f} %  wrcd {shown:>11}  "
            f"{a['Validity']!s:12}"
        )
        contact, surface = (str(a.get(name, "–")) for name in ("ContactState", "Surface"))
        return f"{line} {contact:9} {surface}" if self._wide else line.rstrip()

    def _place(self, pct: float) -> int:
        return min(max(round(pct / FULL_SCALE_PCT * self._width), 0), self._width)

    def changes(self, changes: Iterable[Change], first_s: float) -> None:
        """Print what has changed, when, and why; what comes again at once is not reported again."""
        for c in changes:
            if c.axle not in self._numbers:
                continue
            text = self._change(c)
            key = c.axle, c.after, c.cause
            if c.time_us - self._reported_us.get(key, -AGAIN_US) >= AGAIN_US:
                self._reported_us[key] = c.time_us
                self._print(c.time_us * 1e-6 - first_s, f"axle {c.axle}: {text}")

    def daemon(self, line: str, time_s: float) -> None:
        """A line of the daemon's log, at a time after the first frame."""
        self._print(time_s, f"daemon: {line}")

    def _print(self, time_s: float, text: str) -> None:
        line = f"{max(time_s, 0.0):5.1f} s {text}"
        print(textwrap.fill(line, self._columns, subsequent_indent=" " * 8) if self._columns else line, flush=True)

    def _change(self, c: Change) -> str:
        if c.after is Validity.VALID:
            lost = self._lost.pop(c.axle, c)
            return f"Valid, after {(c.time_us - lost.time_us) * 1e-6:.1f} s"
        self._lost.setdefault(c.axle, c)
        words = f"{c.after}: {c.cause.words}" if c.cause else str(c.after)
        return words if c.detail in ("", c.cause.words) else f"{words} ({c.detail})"
