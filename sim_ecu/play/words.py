"""What the words of a train's value tables mean to the rig: its own opinion beside the daemon's."""

from collections.abc import Iterable

from cantools.database.can import Signal

# letters only, lower case
NO_MEASUREMENT = (
    "notavail", "unavail", "notsupported", "notinstalled", "notvalid", "invalid", "sna", "error", "fault", "fail",
    "init", "undefined", "notdefined", "nodata", "nosignal", "unknown", "reserved", "fehler", "ungueltig", "ungültig",
    "nichtverbaut", "nichtverfuegbar", "nichtverfügbar", "stoerung", "störung", "defekt", "selftest", "selbsttest",
)  # fmt: skip
FAILED = ("error", "fault", "fail", "fehler", "stoerung", "störung", "defekt")
FORWARD, BACKWARD = ("forw", "fwd", "ahead", "vorw"), ("rev", "back", "rück", "rueck")


def letters(label: object) -> str:
    """A word of a value table as lower-case letters."""
    return "".join(c for c in str(label).lower() if c.isalpha())


def says(label: object, words: Iterable[str]) -> bool:
    """Whether a label has one of some words in it."""
    text = letters(label)
    return any(word in text for word in words)


def no_measurement(s: Signal) -> frozenset[int]:
    """The raw values whose label says that there is no measurement."""
    return frozenset(
        int(raw)
        for raw, label in (s.choices or {}).items()
        if letters(label) == "na" or (says(label, NO_MEASUREMENT) and letters(label) != "default")
    )


def forward(s: Signal) -> int | None:
    """The raw value of a direction signal that says forwards; None where it has no value table."""
    labelled = {int(raw): label for raw, label in (s.choices or {}).items()}
    for raw, label in labelled.items():
        if says(label, FORWARD):
            return raw
    unusable = no_measurement(s)
    return next((raw for raw, label in labelled.items() if raw not in unusable and not says(label, BACKWARD)), None)


def backward(s: Signal) -> int | None:
    """The one that says backwards; None where none does."""
    return next((int(raw) for raw, label in (s.choices or {}).items() if says(label, BACKWARD)), None)
