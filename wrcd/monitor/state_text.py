"""`wrcd dump --state`: the first lines of the monitor's screen as text: the bus, the daemon, and every axle."""

import time
from collections.abc import Iterator

from wrcd.monitor.board import Board, ScreenView
from wrcd.monitor.bus_model import BusModel
from wrcd.monitor.canvas import STYLES, Canvas, Rect
from wrcd.monitor.panels import SourceState, axle_at, draw_axles, draw_status
from wrcd.monitor.sources import FrameSource, ReaderProcess

CYCLES = 1.2  # of the slowest message of the daemon's, so that each comes once
STEP_S = 0.05
HEAD_LINES, NONE_CHOSEN = 2, -1
BOLD = {"good": "\033[1;32m", "warn": "\033[1;33m", "bad": "\033[1;31m"}
PLAIN = "\033[0m"


def listen(model: BusModel, source: FrameSource) -> None:
    """Give the model so much of a bus that each of the daemon's messages comes. Raises BusError where none opens."""
    if isinstance(source, ReaderProcess):
        source.wait_open()
    end = time.monotonic() + CYCLES * model.slowest_us / 1e6
    while time.monotonic() < end:
        time.sleep(STEP_S)
        for batch, until_us in source.take():
            model.take(batch, until_us)
    model.update()


def state_lines(model: BusModel, source: SourceState, width: int, colour: bool) -> Iterator[str]:
    """Yield the newest state of all that came: two lines, a head, a line for each axle."""
    axles, at_us = model.axles_that_came, model.now_us
    hidden = len(model.axles) - len(axles)
    canvas = Canvas(width, HEAD_LINES + 1 + len(axles) + (hidden > 0))
    clock, below = Board(model, ScreenView()).clock(at_us), Rect(0, HEAD_LINES, width, canvas.height - HEAD_LINES)
    draw_status(canvas, Rect(0, 0, width, HEAD_LINES), model, source, (source.kind.upper(), "title"), clock, at_us)
    draw_axles(canvas, below, [axle_at(model, a, at_us) for a in axles], NONE_CHOSEN, hidden)
    for y, line in enumerate(canvas.text().splitlines()):
        runs = ((text, BOLD.get(STYLES[style])) for text, style in canvas.runs(y))
        yield "".join(f"{bold}{text}{PLAIN}" if bold else text for text, bold in runs).rstrip() if colour else line
