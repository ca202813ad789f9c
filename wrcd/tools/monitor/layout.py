"""Where everything is on a screen of a size."""

from dataclasses import dataclass

from wrcd.tools.monitor.canvas import Rect

MIN_WIDTH, MIN_HEIGHT = 60, 19
LEFT, RIGHT = 5, 20  # of the plot: scale, and values beside the curves
MIN_PLOT, MAX_AXLES = 5, 8
BOTTOM = 5  # residuals beside inputs, with their heads
WIDE = 120  # from here on words are told in full, and values of inputs


@dataclass(frozen=True, slots=True)
class Layout:
    """Rectangles."""

    status: Rect
    axles: Rect  # its head, and a line an axle
    plot: Rect  # the curves alone
    legend: Rect  # right of them
    scale_y: int  # the line of times
    strip_y: int  # the line of Validity
    events: Rect
    residuals: Rect
    inputs: Rect
    keys: Rect

    @property
    def is_wide(self) -> bool:
        """Whether there is room for words."""
        return self.status.width >= WIDE


def layout(width: int, height: int, axles: int, inputs: int) -> Layout | None:
    """None where the screen is too small."""
    if width < MIN_WIDTH or height < MIN_HEIGHT:
        return None
    bottom = max(BOTTOM, 1 + inputs if height >= 30 else BOTTOM)
    spare = (
        height - 2 - 2 - MIN_PLOT - 3 - 1 - bottom - 1
    )  # status, head and one axle, plot with its lines, event, keys
    shown = 1 + max(0, min(axles - 1, spare - 1 if axles > 4 else spare))
    spare -= shown - 1
    events = 1 + max(0, min(spare // 4, 9))
    spare -= events - 1
    y = 0
    status = Rect(0, y, width, 2)
    y += 2
    table = Rect(0, y, width, 1 + shown)
    y += 1 + shown + 1  # and the plot's head
    right = RIGHT if width < WIDE else RIGHT + 6
    plot = Rect(LEFT, y, width - LEFT - right, MIN_PLOT + max(spare, 0))
    legend = Rect(width - right, y, right, plot.height)
    y += plot.height
    scale_y, strip_y = y, y + 1
    y += 2
    told = Rect(0, y, width, events)
    y += events
    half = max(34, min(width * 2 // 5, 60))
    residuals, of_inputs = Rect(0, y, half, bottom), Rect(half + 1, y, width - half - 1, bottom)
    y += bottom
    return Layout(
        status, table, plot, legend, scale_y, strip_y, told, residuals, of_inputs, Rect(0, height - 1, width, 1)
    )
