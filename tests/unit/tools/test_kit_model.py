"""What a kit's tables are made from: whole numbers for scales, time-outs, words, and what is refused."""

import random
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from tests.support.kit.trains import TOML, fd_message, odd_dbc, odd_train
from wrcd.bus.signals import OutputSignal
from wrcd.config import load_config
from wrcd.errors import InputError
from wrcd.tools.kit.model import kit_message, messages
from wrcd.tools.kit.weights import MAX_BITS, exact, weights

INT64 = 1 << 63


@pytest.mark.parametrize(("scale", "offset"), [(0.01, 0.0), (0.5, 0.0), (1.0, -40.0), (0.0015625, 0.1), (1 / 3, 0.0)])
def test_weights_give_the_value_rounded_down(scale: float, offset: float) -> None:
    per_raw, at_zero = 100 * exact(scale), 100 * exact(offset)
    found = weights(per_raw, at_zero, Fraction(0))
    for raw in range(0, 60_000, 7):
        value = per_raw * raw + at_zero
        if 0 <= value <= 10_000:
            assert (raw * found.weight + found.offset) // found.divisor in (
                value // 1,
                (value - Fraction(1, 1000)) // 1,
            )


def test_weights_of_any_scale_overflow_no_64_bits() -> None:
    rng = random.Random(1)
    for _ in range(2000):
        scale, offset = 10 ** rng.uniform(-9, 2), rng.choice((0.0, rng.uniform(-1e4, 1e4)))
        found = weights(exact(scale), exact(offset), Fraction(0))
        most = (1 << MAX_BITS) * found.weight + abs(found.offset)
        assert most < INT64
        assert 0 < found.divisor < INT64


@pytest.mark.parametrize("scale", [0.01, 1 / 3, 1.23456789e-7, 0.0015625, 99.7])
def test_weights_are_never_more_than_a_thousandth_too_small(scale: float) -> None:
    found = weights(exact(scale), Fraction(0), Fraction(0))
    for raw in {round(value / scale) for value in range(0, 10_001, 50)}:
        if raw < 1 << MAX_BITS:
            error = exact(scale) * raw - Fraction(raw * found.weight, found.divisor)
            assert 0 <= error <= Fraction(1, 1000)


def test_time_out_is_the_dbcs_or_three_cycles(tmp_path: Path) -> None:
    found = messages(load_config(odd_train(tmp_path)))
    assert [(m.name, m.axle, m.timeout_us) for m in found] == [("Odd_A1", 1, 90_000), ("Odd_A2", 7, 150_000)]


def test_time_out_within_a_cycle_is_refused(tmp_path: Path) -> None:
    config = odd_train(tmp_path)
    config.write_text(TOML.replace('message = "Odd_A1"', 'message = "Odd_A1"\ncycle_ms = 90'))
    with pytest.raises(InputError, match=r"odd\.toml: the time-out of Odd_A1, 90 ms, is not longer .* — mend"):
        messages(load_config(config))


def test_time_out_that_is_none_is_refused(tmp_path: Path) -> None:
    config = odd_train(tmp_path)
    (tmp_path / "odd.dbc").write_text(odd_dbc().replace("Mu 90;", "Mu 90000;"))
    with pytest.raises(InputError, match=r"time-out of Odd_A1\.Mu must lie within"):
        messages(load_config(config))


def test_number_of_more_than_32_bits_is_refused() -> None:
    message, output = fd_message()
    signal = next(s for s in message.signals if s.name == "Mu")
    signal.length = 40
    with pytest.raises(InputError, match=r"Odd_Fd\.Mu has 40 bits"):
        kit_message(message, output, 1, "odd.toml")


def test_words_that_share_a_raw_value_say_the_most_cautious_of_them() -> None:
    message, output = fd_message()
    levels = {"None": 0, "Wider": 0, "Within12pp": 1, "Within5pp": 1, "Within1pp": 2}
    signals = {**output.signals, "Confidence": OutputSignal("Level", words=levels)}
    found = kit_message(message, replace(output, signals=signals), 1, "odd.toml")
    assert found.confidence is not None
    assert found.confidence.by_raw == {0: "None", 1: "Within12pp", 2: "Within1pp"}
