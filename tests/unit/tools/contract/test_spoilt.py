"""Consumers that are spoilt in a way that leaves most rules kept: each is found, and a slow but right one is not."""

import math
from types import ModuleType
from typing import Any

import pytest

from tests.support.contract import example, on_virtual_time
from wrcd.core.configuration import Config
from wrcd.tools.contract import ConsumerError, Frame, Use


@pytest.fixture(scope="module")
def careful() -> ModuleType:
    """The example."""
    module = example("careful_consumer")
    database = module.database()
    module.__dict__["database"] = lambda: database
    return module


@pytest.mark.parametrize("factor", [0.01, 0.0, 0.5, 0.9, 100.0])
def test_consumer_that_counts_in_another_unit_is_found(config: Config, careful: ModuleType, factor: float) -> None:
    class Scaled(careful.Careful):  # type: ignore[misc, name-defined]  # a module read from its file has no types
        def use(self, axle: int, now_us: int) -> Use:
            limit = super().use(axle, now_us).limit_pct
            return Use(None if limit is None else factor * limit, axle)

    broken, _ = on_virtual_time(Scaled, config, {"valid-is-used"})
    assert broken["valid-is-used"] == (
        "Valid 20 % Within3pp for 3 s: the consumer must come to 17.0 %, but it used "
        f"{17 * factor:.4g} %: is the unit percent?"
    )


def test_careless_fraction_without_crc_and_ramp_is_found(config: Config, careful: ModuleType) -> None:
    class Fraction:
        def __init__(self) -> None:
            self._careful = careful.Careful()
            self._limit = 0.0

        def hear(self, frame: Frame) -> None:
            self._careful.hear(frame)
            if frame.can_id == 0x091 and not frame.extended and len(frame.data) == 8:
                self._limit = int.from_bytes(frame.data[2:4], "little") / 10_000

        def use(self, axle: int, now_us: int) -> Use:
            return Use(None if self._careful.use(axle, now_us).limit_pct is None else self._limit, axle)

    broken, _ = on_virtual_time(Fraction, config)
    assert set(broken) == {"valid-is-used"}


@pytest.mark.parametrize("constant", [17.0, 20.0])
def test_limit_that_follows_no_rise_is_found(config: Config, careful: ModuleType, constant: float) -> None:
    class Constant(careful.Careful):  # type: ignore[misc, name-defined]  # a module read from its file has no types
        def use(self, axle: int, now_us: int) -> Use:
            limit = super().use(axle, now_us).limit_pct
            return Use(None if limit is None else min(limit, constant), axle)

    broken, _ = on_virtual_time(Constant, config, {"valid-is-used"})
    assert broken["valid-is-used"].startswith("Valid 40 % Within3pp for 3 s: the consumer must come to 37.0 %")


def test_consumer_that_takes_fd_frames_for_classical_ones_is_found(config: Config, careful: ModuleType) -> None:
    class Fd(careful.Careful):  # type: ignore[misc, name-defined]  # a module read from its file has no types
        def hear(self, frame: Frame) -> None:
            super().hear(Frame(frame.stamp_us, frame.can_id, frame.data, frame.extended, frame.remote))

    assert set(on_virtual_time(Fd, config)[0]) == {"fd-frame-is-dropped"}


class Slow:
    """Wants so many seconds of good frames after a fall-back: it takes more slowly than it must."""

    def __init__(self, careful: Any, needs_us: int) -> None:
        self._careful, self._needs_us = careful, needs_us
        self._since_us: int | None = None

    def hear(self, frame: Frame) -> None:
        self._careful.hear(frame)

    def use(self, axle: int, now_us: int) -> Use:
        use: Use = self._careful.use(axle, now_us)
        if use.limit_pct is None:
            self._since_us = None
            return use
        self._since_us = now_us if self._since_us is None else self._since_us
        return use if now_us - self._since_us >= self._needs_us else Use(None, axle)


def test_consumer_that_wants_good_frames_for_a_while_breaks_no_rule(config: Config, careful: ModuleType) -> None:
    assert on_virtual_time(lambda: Slow(careful.Careful(), 1_300_000), config) == ({}, {})


def test_consumer_that_returns_after_more_than_three_seconds_is_found(config: Config, careful: ModuleType) -> None:
    rules = {"degraded-falls-back", "silence-falls-back"}
    broken, _ = on_virtual_time(lambda: Slow(careful.Careful(), 3_300_000), config, rules)
    assert set(broken) == rules
    assert broken["silence-falls-back"].startswith("Valid 20 % Within3pp for 3 s after silence: the consumer must use")


@pytest.mark.parametrize("limit", [math.nan, math.inf, -math.inf])
def test_limit_that_is_no_number_cannot_be_judged(config: Config, careful: ModuleType, limit: float) -> None:
    class Nonsense(careful.Careful):  # type: ignore[misc, name-defined]  # a module read from its file has no types
        def use(self, axle: int, now_us: int) -> Use:
            return Use(None if super().use(axle, now_us).limit_pct is None else limit, axle)

    with pytest.raises(ConsumerError, match=r"the consumer used -?(nan|inf) %, which is no number"):
        on_virtual_time(Nonsense, config, {"wrong-crc-is-dropped"})
