"""Words of value tables, as trains' files spell them."""

import pytest

from wrcd.bus.words import degraded, is_reverse, tells_status, unusable, usable

GOOD = (
    "Ok", "OK", "okay", "Valid", "Normal", "Good", "NoError", "No_Error", "no fault", "kein_Fehler", "keine Störung",
    "fehlerfrei", "in_Ordnung", "i.O.", "gueltig", "Gültig", "bereit", "betriebsbereit", "Sensor_OK", "Data_Valid",
    "NormalOperation", "available", "active", "prêt", "en_service_normal", "sans_défaut",
)  # fmt: skip
BAD = (
    "Fehler", "Stoerung", "Störung", "ungueltig", "ungültig", "nicht_verbaut", "Not_Supported", "NotSupported",
    "nicht_verfuegbar", "defekt", "SNA", "NaN", "keine_Daten", "offline", "N/A", "NA", "n.i.O.", "NotAvailable",
    "NOT_AVAILABLE", "Signal not available", "SensorFault", "SENSORFAULT", "Fault", "Error14", "Init", "Initialising",
    "undefined", "Reserved", "unknown", "NoSignal", "no_data", "Leitungsbruch", "Sensorfehler", "Error_Active",
    "Not_OK", "nicht bereit", "nicht_in_Ordnung", "invalid", "défaut", "hors_service", "Implausible", "not_connected",
)  # fmt: skip
NEITHER = ("Default", "DEFAULT", "Default value", "par défaut", "Forward", "Off", "Stop", "Banana", "Information", "7")


@pytest.mark.parametrize("word", GOOD)
def test_good_word_is_usable(word: str) -> None:
    assert (usable(word), unusable(word), degraded(word)) == (True, False, False)


@pytest.mark.parametrize("word", BAD)
def test_word_of_failure_is_unusable(word: str) -> None:
    assert (usable(word), unusable(word), degraded(word)) == (False, True, False)


@pytest.mark.parametrize("word", NEITHER)
def test_other_word_is_neither_usable_nor_a_failure(word: str) -> None:
    assert (usable(word), unusable(word), degraded(word)) == (False, False, False)


@pytest.mark.parametrize("word", ["Degraded", "eingeschraenkt", "eingeschränkt_gueltig", "Limited"])
def test_degraded_word_is_not_usable(word: str) -> None:
    assert (usable(word), unusable(word), degraded(word)) == (False, False, True)


@pytest.mark.parametrize("word", ["Valid_but_old", "OK after restart", "gueltig_alt"])
def test_good_word_beside_an_unknown_one_is_not_usable(word: str) -> None:
    assert not usable(word)


@pytest.mark.parametrize(
    ("word", "expected"),
    [("Reverse", True), ("Backwards", True), ("rückwärts", True), ("R", True), ("Forward", False), ("Rest", False)],
)
def test_reverse_is_told_by_its_word(word: str, expected: bool) -> None:
    assert is_reverse(word) is expected


@pytest.mark.parametrize(
    ("name", "unit", "labels", "is_status"),
    [
        ("Status", None, (), True),
        ("Status", "-", ("Ok", "Error"), True),
        ("ImuState", "bool", (), True),
        ("Zustand_A1", "", (), True),
        ("Flags", "1", ("valid", "failure"), True),
        ("Flags", "%", ("Ok", "Error"), True),
        ("SignalQuality", "%", (), False),
        ("ValidSpeed", "km/h", ("SNA",), False),
        ("Gear", "", ("first", "second"), False),
        ("YawRate", "rad/s", ("Error",), False),
    ],
)
def test_status_is_told_by_name_or_words_whatever_stands_for_no_unit(
    name: str, unit: str | None, labels: tuple[str, ...], is_status: bool
) -> None:
    assert tells_status(name, unit, labels) is is_status
