"""What the help page says."""

KEYS = (
    ("space", "pause, or live again; while paused nothing is lost"),
    ("← →", "cursor by a column; with Shift, or PgUp and PgDn, by ten"),
    ("Home End", "to the oldest that is held; to the newest"),
    ("+ -", "zoom in and out, around the cursor"),
    ("n p", "next and previous event: fall, rise, change of Validity"),
    ("w Enter", "why it is so at the cursor: model, rule, residuals before and after"),
    ("1 … 8 ↑ ↓", "choose the axle"),
    ("e", "all events with how long they took"),
    ("s", "save: what is held as a log, and a picture, to this folder"),
    ("Esc", "cursor away"),
    ("t", "colours: the terminal's own, on dark, on light"),
    ("? q", "keys and signs; quit"),
)
SIGNS = (
    ("● Valid", "may be used"),
    ("◐ Degraded", "something speaks against it; the cause tells what"),
    ("○ NotAvailable", "no estimate"),
    ("· Silent", "no Adhesion frame comes"),
    ("⠒⠒ ░░ ▄▄ ╌╌", "available, its 90 % interval, in use, the rig's truth (--dbc)"),
    ("▼ ▲", "the available adhesion fell, rose"),
    ("▮▮▮▮▯▯▮▮", "reach: the last eight time-outs of an input, filled where a good frame came"),
    ("29 ms !", "an input past its time-out"),
    ("damaged", "frames of the daemon's with a wrong CRC or length: they are counted, not shown"),
)


def lines() -> list[tuple[str, str]]:
    """Texts and their styles."""
    out = [(f"{key:<15} {what}", "plain") for key, what in KEYS]
    return [*out, ("", "plain"), *((f"{sign:<15} {what}", "dim") for sign, what in SIGNS)]
