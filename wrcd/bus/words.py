"""Words of value tables: which say that there is no measurement, which that a sender is well.

A word is cut where people cut it: at marks, and where small letters turn to capitals ("Not_Available" and
"NotAvailable" are two parts each). "Default" is one part, and no fault. English, German and French, in any case, with
or without accents.
"""

import re
import unicodedata
from collections.abc import Collection, Sequence

# Whole parts.
_GOOD = {
    "ok", "okay", "valid", "normal", "good", "available", "active", "healthy", "ready", "plausible",
    "gueltig", "gut", "bereit", "betriebsbereit", "verfuegbar", "aktiv", "plausibel", "ordnung", "inordnung",
    "io",
    "fehlerfrei", "fehlerlos", "stoerungsfrei", "noerror", "nofault",
    "valide", "bon", "bonne", "pret", "prete", "disponible", "actif",
}  # fmt: skip
_BAD = {
    "sna", "nok", "void", "offline", "defect", "defective", "broken", "missing", "timeout", "bad",
    "defekt", "gestoert", "ausgefallen", "fehlt", "kaputt", "unbekannt", "undefiniert", "reserviert", "kabelbruch",
    "leitungsbruch", "drahtbruch",
    "defaut", "panne", "erreur", "absent", "inconnu", "inconnue", "reserve",
}  # fmt: skip
_ABBREVIATIONS = ("na", "nd", "nan", "nio")  # a whole word, however it is cut: n/a, n.i.O.
# How a part begins, and how a compound ends.
_BAD_BEGIN = (
    "err", "fault", "fail", "init", "unknown", "reserved", "fehler", "stoer", "defekt", "malfunction",
)  # fmt: skip
_BAD_END = ("error", "fault", "failure", "fehler", "stoerung", "ausfall", "kurzschluss")
_INNOCENT_END = ("default",)
# Anywhere in the letters of a word: nothing harmless is spelt so.
_BAD_ANYWHERE = re.compile(
    "notavail|unavail|notvalid|invalid|notdefined|undefined|notsupp|unsupp|nodata|nosignal|novalue|notinstalled|notpresent"
    "|notconnected|disconnected|implausib|unplausib|nichtverf|nichtverbaut|nichtvorhanden|nichtunterst|nichtdefiniert"
    "|nichtbelegt|nichtbereit|nichtguelt|unguelt|keinedaten|keinsignal|keinwert|keinemess|nondispo|indispo|nonvalide"
    "|horsservice|nonsupp|outofrange|overrange|underrange|overflow|underflow"
)
# What turns the part behind it into its contrary.
_NOT = {
    "not",
    "no",
    "non",
    "nicht",
    "kein",
    "keine",
    "keiner",
    "keinen",
    "ohne",
    "without",
    "sans",
    "un",
    "pas",
    "aucun",
    "aucune",
}
_NOTHING_THERE = {
    "data",
    "daten",
    "signal",
    "value",
    "wert",
    "messwert",
    "messung",
    "measurement",
    "info",
    "in",
    "used",
}
_DEGRADED = {
    "degraded",
    "limited",
    "reduced",
    "degradiert",
    "eingeschraenkt",
    "vermindert",
    "beeintraechtigt",
    "degrade",
}
# May stand beside a good word and change nothing.
_NEUTRAL = {
    "signal", "sensor", "status", "state", "data", "value", "operation", "operating", "system", "is", "in", "quality",
    "measurement", "device", "mode", "daten", "wert", "messwert", "zustand", "betrieb", "geraet", "ist", "en", "i", "o",
    "service", "etat", "capteur", "mesure", "de",
}  # fmt: skip
_REVERSE_BEGIN = ("rev", "back", "rueck", "arriere")
_LETTERS = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss", "Ä": "Ae", "Ö": "Oe", "Ü": "Ue"})
_PART = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")


def unusable(label: object) -> bool:
    """Whether a word of a value table says that there is no measurement."""
    parts = _parts(label)
    letters = "".join(parts)
    if letters in _ABBREVIATIONS or _BAD_ANYWHERE.search(letters):
        return True
    return any(
        _is_bad(part) is not _negated(parts, at) if _is_bad(part) or part in _GOOD
        else part in _NOTHING_THERE and _negated(parts, at)
        for at, part in enumerate(parts)
        if not (part == "defaut" and at and parts[at - 1] == "par")
    )  # fmt: skip


def usable(label: object) -> bool:
    """Whether a word says that its sender is well: a good word, and beside it nothing that may change its meaning."""
    parts = _parts(label)
    if not parts or unusable(label) or degraded(label):
        return False
    good = [part in _GOOD or _is_bad(part) for part in parts]  # bad ones are negated here, or it would be unusable
    good[-1] |= parts[-2:] == ("i", "o")
    known = [g or part in _NEUTRAL or part in _NOT for g, part in zip(good, parts, strict=True)]
    return any(good) and all(known)


def degraded(label: object) -> bool:
    """Whether a word says that its sender works, but not as it should."""
    return not unusable(label) and any(part in _DEGRADED for part in _parts(label))


_NO_UNITS = {"", "-", "--", "1", "bool", "boolean", "bit", "enum", "flag", "none", "n/a"}
STATUS_NAMES = re.compile("status|state|valid|quality|health|zustand|guete|güte|qualitaet|qualität", re.IGNORECASE)


def tells_status(name: str, unit: str | None, labels: Collection[object]) -> bool:
    """Whether a signal tells how good others are: by its words, a good one and one of failure; or by its name, unless
    it has a unit, as a quality in percent or a speed that is valid."""
    by_name = bool(STATUS_NAMES.search(name)) and (unit or "").strip().lower() in _NO_UNITS
    return by_name or (any(map(usable, labels)) and any(map(unusable, labels)))


def no_measurement(label: object) -> bool:
    """Whether a word in the value table of a measured signal stands for no number."""
    return unusable(label) or degraded(label)


def is_reverse(label: object) -> bool:
    """Whether a word means that the train goes backwards."""
    return any(part == "r" or part.startswith(_REVERSE_BEGIN) for part in _parts(label))


def _parts(label: object) -> Sequence[str]:
    plain = unicodedata.normalize("NFKD", unicodedata.normalize("NFC", str(label)).translate(_LETTERS))
    return tuple(part.lower() for part in _PART.findall(plain.encode("ascii", "ignore").decode()))


def _is_bad(part: str) -> bool:
    if part in _BAD:
        return True
    if part in _GOOD:
        return False
    return part.startswith(_BAD_BEGIN) or (part.endswith(_BAD_END) and not part.endswith(_INNOCENT_END))


def _negated(parts: Sequence[str], at: int) -> bool:
    return at > 0 and parts[at - 1] in _NOT
