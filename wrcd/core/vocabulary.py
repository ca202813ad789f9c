"""What the daemon tells: every signal by our name, with its words, or with unit, range and resolution that a field must
have to carry it.

The configuration gives them other names and words (wrcd/config/outputs.py); wrcd/core/c/slot.c fills them.
"""

import re
from collections.abc import Mapping
from typing import NamedTuple

from wrcd.bus.reasons import Reason
from wrcd.core.causes import Cause, Validity

# MuAvailable (percent) from which a surface counts as that class.
SURFACES = ((25.0, "Dry"), (15.0, "Wet"), (8.0, "Reduced"), (4.0, "Low"), (float("-inf"), "VeryLow"))
# Half-width of the 90 % interval (percentage points) up to which a level of Confidence holds.
CONFIDENCES = (
    (1.0, "Within1pp"), (2.0, "Within2pp"), (3.0, "Within3pp"), (5.0, "Within5pp"), (8.0, "Within8pp"),
    (12.0, "Within12pp"), (float("inf"), "Wider"),
)  # fmt: skip


class Numeric(NamedTuple):
    """A number. A field must reach from low to high in steps of at most step (all in unit); absent: it must also be
    able to say that there is none. limits: beyond what nothing is sent, where the DBC states no range."""

    low: float
    high: float
    step: float = 1.0
    unit: str = ""
    absent: bool = False
    round_down: bool = False
    limits: tuple[float, float] | None = None
    exact: bool = False  # a count, a number of something or bits: the step must divide 1


class Words(NamedTuple):
    """One of some words. extra: words that a field may have beside them.

    apart: pairs that must not have one raw value, for the first claims more than the second.
    """

    words: tuple[str, ...]
    extra: tuple[str, ...] = ()
    apart: tuple[tuple[str, str], ...] = ()


def _nothing(word: str, others: tuple[str, ...]) -> tuple[tuple[str, str], ...]:
    return tuple((other, word) for other in others)


def _count(modulo: int) -> Numeric:
    return Numeric(0, modulo - 1, exact=True)


VALID, DEGRADED, NOT_AVAILABLE = Validity.VALID.value, Validity.DEGRADED.value, Validity.NOT_AVAILABLE.value
_CLASSES = tuple(name for _, name in SURFACES)
_LEVELS = tuple(name for _, name in CONFIDENCES)
_REASONS = ("None", *(r.label for r in Reason))
_INPUTS = ("YawRate", "LatAccel", "Torque", "Speed")
_PERCENT = Numeric(0, 50, 1.0, "%", absent=True, limits=(0, 100))
_ROUNDED_DOWN = _PERCENT._replace(round_down=True)
_LEVEL = Numeric(-40, 20, 1.0, "dB", absent=True, limits=(-70, 30))
# Whether calm running says that the design is this train's, by wrcd/core/c/fit.c.
FITS = ("Unknown", "Like", "Unsure", "Unlike")
_BIT, _BITS = Numeric(0, 1, exact=True), Numeric(0, 255, exact=True)

# By the configuration's key of the message. Adhesion beyond 50 % is sent as the most that the field can say.
MESSAGES: Mapping[str, Mapping[str, Numeric | Words]] = {
    "adhesion": {
        "Validity": Words(
            (NOT_AVAILABLE, VALID, DEGRADED), ("Error",), ((VALID, DEGRADED), (VALID, NOT_AVAILABLE), (VALID, "Error"))
        ),
        "MuAvailable": _ROUNDED_DOWN,
        "MuUsed": _ROUNDED_DOWN,  # as what it must not exceed
        "SampleAge": Numeric(0, 255, 10.0, "ms", limits=(0, 255)),
        "Surface": Words(("Unknown", *_CLASSES), (), _nothing("Unknown", _CLASSES)),
        "ContactState": Words(
            ("Unknown", "Adhering", "Saturated"), (), (("Adhering", "Saturated"), ("Adhering", "Unknown"))
        ),
        "Confidence": Words(("None", *_LEVELS), (), _nothing("None", _LEVELS[:-1])),
    },
    "detail": {
        "WinningModel": Numeric(0, 4, exact=True),
        **{f"Stale{name}": _BIT for name in _INPUTS},
        "DominantRule": Numeric(0, 254, exact=True, absent=True, limits=(0, 254)),
        **{f"Residual{m}": _LEVEL for m in range(1, 5)},
        "Cause": Words(tuple(c.label for c in Cause)),
    },
    "inputs": {
        "Plausibility": Words(("Unknown", "Consistent", "Saturated", "Contradiction")),
        "Outlier": _BIT,
        "Unchanged": _BIT,
        **{f"Reach{name}": _BITS for name in _INPUTS},
        **{f"Refused{name}": Words(_REASONS) for name in _INPUTS},
    },
    "own": {
        "MuAvailableOwn": _ROUNDED_DOWN,
        "HalfWidthOwn": _PERCENT,
        "AxlesFused": Numeric(0, 8, exact=True),
        "MuUsedMost": _ROUNDED_DOWN,
        "MuUsedMostAxle": Numeric(0, 8, exact=True),
    },
    "status_message": {
        "State": Words(("Running", "LinkDown", "Stopping")),
        "DesignFit": Words(FITS, (), _nothing("Like", FITS[2:])),
        "Overruns": _count(256),
        "RejectedFrames": _count(1024),
        "LastReason": Words(_REASONS),
        "ReceiveDrops": _count(64),
        "Reopens": _count(16),
        "DesignChecksum": _count(65536),
    },
    "rejects_message": {**{f"Rejected{r.label}": _count(16) for r in Reason}, "ForeignFrames": _count(16)},
    "link_message": {
        "LinkState": Words(("Up", "Down", "Gone", "ErrorPassive", "BusOff")),
        "ErrorFrames": _count(4096),
        "BusOffs": _count(16),
        "Unsent": _count(256),
        "TimeSteps": _count(16),
        "LateFrames": _count(16),
        "Outliers": _count(256),
        "Restarts": _count(256),
    },
}


def snake(name: str) -> str:
    """A name or word of ours as the configuration's keys spell it: mu_available for MuAvailable."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()


def words_of(message: str, signal: str) -> tuple[str, ...]:
    """Return the words of a signal of ours, by their places; a number has none."""
    found = MESSAGES[message][signal]
    return found.words if isinstance(found, Words) else ()
