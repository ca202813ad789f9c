"""What a kit's tables are made from: whole numbers for scales, time-outs, words, and what is refused."""

import random
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from tests.support.kit.trains import TOML, fd_message, odd_dbc, odd_train
from wrcd.bus.signals import OutputSignal
from wrcd.config.config import load_config
from wrcd.errors import InputError
from wrcd.kit.receiver import MAX_BITS, WordSignal, exact, kit_message, messages, weights

INT64 = 1 << 63


def test_weights_of_any_scale_overflow_no_64_bits() -> None:
    rng = random.Random(1)
    for _ in range(2000):
        scale, offset = 10 ** rng.uniform(-9, 2), rng.choice((0.0, rng.uniform(-1e4, 1e4)))
        found = weights(exact(scale), exact(offset), Fraction(0))
        most = (1 << MAX_BITS) * found.weight + abs(found.offset)
        assert most < INT64
        assert 0 < found.divisor < INT64


@pytest.mark.parametrize("offset", [0.0, -40.0, 0.1])
@pytest.mark.parametrize("scale", [0.01, 0.5, 1 / 3, 1.23456789e-7, 0.0015625, 99.7])
def test_weights_are_never_more_than_a_thousandth_too_small(scale: float, offset: float) -> None:
    found = weights(exact(scale), exact(offset), Fraction(0))
    for raw in {round((value - offset) / scale) for value in range(0, 10_001, 50)}:
        if raw < 1 << MAX_BITS:
            error = exact(scale) * raw + exact(offset) - Fraction(raw * found.weight + found.offset, found.divisor)
            assert 0 <= error <= Fraction(1, 1000)


def test_time_out_is_the_dbcs_or_three_cycles(tmp_path: Path) -> None:
    found = messages(load_config(odd_train(tmp_path)))
    assert [(m.name, m.axle, m.timeout_us) for m in found] == [("Odd_A1", 1, 90_000), ("Odd_A2", 7, 150_000)]


@pytest.mark.parametrize(
    ("cycle", "timeout", "why"), [("cycle_ms = 90", "90", r"odd\.toml: .*Odd_A1"), ("", "90000", r"Odd_A1\.Mu")]
)
def test_time_out_that_is_none_or_within_a_cycle_is_refused(cycle: str, timeout: str, why: str, tmp_path: Path) -> None:
    config = odd_train(tmp_path)
    config.write_text(TOML.replace('message = "Odd_A1"', f'message = "Odd_A1"\n{cycle}'))
    (tmp_path / "odd.dbc").write_text(odd_dbc().replace("Mu 90;", f"Mu {timeout};"))
    with pytest.raises(InputError, match=why):
        messages(load_config(config))


def test_number_of_more_than_32_bits_is_refused() -> None:
    message, output = fd_message()
    signal = next(s for s in message.signals if s.name == "Mu")
    signal.length = 40
    with pytest.raises(InputError, match=r"Odd_Fd\.Mu"):
        kit_message(message, output, 1, "odd.toml")


def test_words_that_share_a_raw_value_say_the_most_cautious_of_them() -> None:
    message, output = fd_message()
    levels = {"None": 0, "Wider": 0, "Within12pp": 1, "Within5pp": 1, "Within1pp": 2}
    signals = {**output.signals, "Confidence": OutputSignal("Level", words=levels)}
    found = kit_message(message, replace(output, signals=signals), 1, "odd.toml")
    confidence = found.fields["Confidence"]
    assert isinstance(confidence, WordSignal)
    assert confidence.by_raw == {0: "None", 1: "Within12pp", 2: "Within1pp"}
