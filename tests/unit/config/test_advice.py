"""[advice]: the train's message, under whatever names it is sent, and the limits of its categories."""

from pathlib import Path
from typing import Any

import pytest

from wrcd import resources
from wrcd.bus.dbc import find_message
from wrcd.bus.writers import Writer
from wrcd.config.config import DEFAULT, load_config, load_config_to_run, load_packaged
from wrcd.config.describe import describe
from wrcd.core.advice import Advice
from wrcd.core.configuration import Config
from wrcd.core.vocabulary import CATEGORY_LIMITS, MESSAGES
from wrcd.errors import InputError
from wrcd.logs.decoder import decoders
from wrcd.logs.exports import sent_groups

ADVICE = "[advice]\n"
OWN_DBC = DEFAULT + '[dbc]\nfile = "own.dbc"\n[wheelset]\nname = "multiple-unit"\n'
# The train's own names, steps and words.
OWN_NAMES = {
    "BO_ 179 AdhesionAdvice": "BO_ 179 TCMS_BrakeAdvice",
    'SG_ Deceleration : 16|8@1+ (0.01,0) [0|2.5] "m/s^2"': 'SG_ a_mid : 16|8@1+ (0.01,0) [0|2.5] "m/s2"',
    'SG_ DecelerationLow : 24|8@1+ (0.01,0) [0|2.5] "m/s^2"': 'SG_ a_low : 24|8@1+ (0.0125,0) [0|3] "m/s2"',
    "SG_ Category : 48": "SG_ AdhCat : 48",
    " 179 DecelerationLow": " 179 a_low", " 179 Deceleration ": " 179 a_mid ", " 179 Category": " 179 AdhCat",
    '1 "Dry" 2 "DryMedium"': '1 "Good" 2 "Fair"',
}  # fmt: skip
OWN_ADVICE = """
[advice]
low_from_m_s2 = 0.5
[advice.message]
message = "TCMS_BrakeAdvice"
cycle_ms = 400
deceleration = "a_mid"
deceleration_low = "a_low"
category = { signal = "AdhCat", dry = "Good", dry_medium = "Fair" }
"""


def load(folder: Path, text: str, **others: str) -> Config:
    file = folder / "train.toml"
    file.write_text(text, encoding="utf-8")
    dbc = resources.DBC.read_text(encoding="utf-8")
    for ours, theirs in others.items():
        dbc = dbc.replace(ours, theirs)
    (folder / "own.dbc").write_text(dbc, encoding="utf-8")
    return load_config(file)


def test_without_its_section_nothing_is_sent() -> None:
    assert load_packaged(4).advice is None


def test_section_brings_the_message_and_our_limits(tmp_path: Path) -> None:
    for text in (ADVICE, '[advice]\nmessage = "AdhesionAdvice"\n'):
        advice = load(tmp_path, DEFAULT + text).advice
        assert advice is not None
        assert (advice.output.message, advice.output.cycle_us, advice.output.data_id) == (
            "AdhesionAdvice",
            200_000,
            0xB3,
        )
        assert set(advice.output.signals) == set(MESSAGES["advice"])
        assert advice.limits_m_s2 == tuple(limit for _, limit in CATEGORY_LIMITS) == (1.5, 1.0, 0.7, 0.4)
    assert load_config_to_run(tmp_path / "train.toml").advice == advice


@pytest.mark.parametrize(
    ("own", "said"),
    [
        ("dry_from_m_s2 = 1.0", "advice.dry_medium_from_m_s2: is 1, not less than dry_from_m_s2, 1"),
        ("low_from_m_s2 = 0.8", "advice.low_from_m_s2: is 0.8, not less than dry_low_from_m_s2, 0.7"),
        ("dry_from_m_s2 = 3", "advice.dry_from_m_s2: takes a number from 0.01 to 2.5, not 3"),
        ("low_from_m_s2 = 0", "advice.low_from_m_s2: takes a number from 0.01 to 2.5, not 0"),
        ("wet_from_m_s2 = 0.8", "advice.wet_from_m_s2: unknown key"),
        ('message = "Adhesion"', "advice.message: the DBC has no message 'Adhesion'"),
        ('message = "Adhesion_A1"', "message Adhesion_A1 has no signal 'DecelerationLow'"),
        ("message = { cycle_ms = 2 }", "advice.message.*: 2 ms is shorter than the design's tick of 5 ms"),
        ("message = 3", "advice.message: takes text or a table, not 3"),
        ('message = { category = "Ahead" }', "advice.message.category: the value table of AdhesionAdvice.Ahead lacks"),
        ('message = { deceleration = "Distance" }', "AdhesionAdvice.Distance is in 'm', not in m/s²"),
        ('message = { distance = "Age" }', "AdhesionAdvice.Age is in 'ms', not in m —"),
    ],
)  # fmt: skip
def test_mistake_is_told_with_its_key(tmp_path: Path, own: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        load(tmp_path, DEFAULT + ADVICE + own + "\n")


def test_dbc_without_the_message_is_refused_with_advice_alone(tmp_path: Path) -> None:
    load(tmp_path, OWN_DBC, AdhesionAdvice="Other")
    with pytest.raises(InputError, match=r"advice\.message: the DBC has no message 'AdhesionAdvice'"):
        load(tmp_path, OWN_DBC + ADVICE, AdhesionAdvice="Other")


def test_own_names_units_and_words_are_sent(tmp_path: Path) -> None:
    config = load(tmp_path, OWN_DBC + OWN_ADVICE, **OWN_NAMES)
    advice = config.advice
    assert advice is not None
    assert (advice.output.cycle_us, advice.limits_m_s2) == (400_000, (1.5, 1.0, 0.7, 0.5))
    message = find_message(config.database, "TCMS_BrakeAdvice")
    values = Advice("Valid", 1.236, 1.049, 39.0, "DryMedium", 200.0, "Suspected").values()
    said: Any = message.decode(Writer(message, advice.output).frame(0, 3, values).data)
    assert {name: said[name] for name in ("Validity", "a_mid", "a_low", "Distance", "AdhCat", "Age", "Ahead")} == {
        "Validity": "Valid", "a_mid": pytest.approx(1.24), "a_low": pytest.approx(1.0375), "Distance": 36,
        "AdhCat": "Fair", "Age": 200, "Ahead": "Suspected",
    }  # fmt: skip
    lines = "\n".join(describe(config))
    assert "0x0B3 TCMS_BrakeAdvice, every 400 ms, E2E data id 0xB3" in lines
    assert "DecelerationLow in a_low" in lines
    assert "Low 0.5 m/s², else VeryLow" in lines


def test_message_is_read_and_exported_as_the_others_are() -> None:
    config = load_packaged(2, advice=True)
    groups = {group.name: group for _, group in sent_groups(config)}
    assert [c.name for c in groups["AdhesionAdvice"].channels] == list(MESSAGES["advice"])
    assert "AdhesionAdvice" in {decoder.name for decoder in decoders(config)}
