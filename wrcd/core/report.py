"""What goes out: the values of an axle's frames, in the contract's terms."""

import math
from dataclasses import dataclass
from enum import StrEnum

from wrcd.bus.codec import Value
from wrcd.bus.dbc import Message, check_supported
from wrcd.core.causes import Cause

# MuAvailable (percent) from which a surface counts as that class.
SURFACES = ((25.0, "Dry"), (15.0, "Wet"), (8.0, "Reduced"), (4.0, "Low"), (-math.inf, "VeryLow"))
# Half-width of the 90 % interval (percentage points) up to which a level of Confidence holds.
CONFIDENCES = (
    (1.0, "Within1pp"), (2.0, "Within2pp"), (3.0, "Within3pp"), (5.0, "Within5pp"), (8.0, "Within8pp"),
    (12.0, "Within12pp"), (math.inf, "Wider"),
)  # fmt: skip


class Validity(StrEnum):
    """The labels of the DBC that are in use."""

    NOT_AVAILABLE = "NotAvailable"
    VALID = "Valid"
    DEGRADED = "Degraded"


@dataclass(frozen=True, slots=True)
class Report:
    """One axle at one slot. Adhesion in percent; None is not available."""

    validity: Validity
    mu_available_pct: float | None
    mu_used_pct: float | None
    sample_age_ms: int
    surface: str
    contact_state: str
    confidence: str
    cause: Cause  # of not being Valid

    def values(self) -> dict[str, Value]:
        """By signal name of the DBC."""
        return {
            "Validity": self.validity.value,
            "MuAvailable": self.mu_available_pct,
            "MuUsed": self.mu_used_pct,
            "SampleAge": float(self.sample_age_ms),
            "Surface": self.surface,
            "ContactState": self.contact_state,
            "Confidence": self.confidence,
        }


NOT_AVAILABLE_REPORT = Report(Validity.NOT_AVAILABLE, None, None, 255, "Unknown", "Unknown", "None", Cause.NONE)


def surface(mu_available_pct: float | None) -> str:
    """The DBC's class of an adhesion."""
    if mu_available_pct is None:
        return "Unknown"
    return next(name for low, name in SURFACES if mu_available_pct >= low)


def confidence(half_width_pp: float | None) -> str:
    """The DBC's level of a half-width."""
    if half_width_pp is None:
        return "None"
    return next(name for most, name in CONFIDENCES if half_width_pp <= most)


def nan_to_none(x: float) -> float | None:
    """NaN as None."""
    return float(x) if math.isfinite(x) else None


# In which unit a report's numbers are, and which words it uses.
UNITS = {"MuAvailable": "%", "MuUsed": "%", "SampleAge": "ms"}
WORDS = {
    "Validity": tuple(v.value for v in Validity),
    "Surface": ("Unknown", *(name for _, name in SURFACES)),
    "ContactState": ("Unknown", "Adhering", "Saturated"),
    "Confidence": ("None", *(name for _, name in CONFIDENCES)),
    "Cause": tuple(c.label for c in Cause),
}


def sendable(message: Message) -> None:
    """Raises ValueError where a value would go out in a message as something else than it is."""
    check_supported(message)
    for s in message.signals:
        if s.name in (*UNITS, *WORDS) and s.is_float:
            raise ValueError(f"{message.name}.{s.name} is coded as a float; only whole numbers can be sent")
        if s.name in UNITS and (s.unit or "") != UNITS[s.name]:
            raise ValueError(f"{message.name}.{s.name} is in {s.unit!r}; it is sent in {UNITS[s.name]!r}")
        missing = [w for w in WORDS.get(s.name, ()) if w not in {str(c) for c in (s.choices or {}).values()}]
        if missing:
            raise ValueError(f"the value table of {message.name}.{s.name} lacks {', '.join(missing)}")
