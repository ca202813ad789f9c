"""Each rule finds the consumer that breaks it, and only that one; a slow but right one breaks none."""

import itertools
import math
from collections.abc import Callable
from types import ModuleType
from typing import Any

import pytest

from tests.support.contract import EXAMPLES, NAMES, example, on_virtual_time
from tests.support.processes import ROOT
from wrcd.config.config import load_config
from wrcd.contract import ConsumerError, Frame, Use
from wrcd.contract.contract_rules import CHECKS, PAGE, round_trip
from wrcd.core.configuration import Config

CRC_RULES = {"wrong-crc-is-dropped", "crc-of-another-data-id-is-dropped", "nothing-but-wrong-crcs-falls-back"}
AGE_RULES = {"unknown-sample-age-falls-back", "high-sample-age-falls-back"}


@pytest.fixture(scope="module")
def database() -> Any:
    """wrcd's messages, read once."""
    return example("careful_consumer").database()


@pytest.fixture
def careful(database: Any) -> ModuleType:
    """The example, to be spoilt."""
    module = example("careful_consumer")
    module.__dict__["database"] = lambda: database
    return module


def test_careful_consumer_breaks_no_rule(config: Config, careful: ModuleType) -> None:
    assert on_virtual_time(careful.Careful, config) == ({}, {})


def test_careless_consumer_breaks_rules_of_every_section(config: Config) -> None:
    broken, _ = on_virtual_time(example("careless_consumer").Careless, config)
    assert len(broken) >= 20
    sections = {c.section for c in CHECKS if c.name in broken}
    assert sections >= {"In this order", "Time-out", "E2E", "Validity", "MuAvailable, MuUsed, SampleAge", "Confidence"}


COUNTING = {"more-than-five-dropped-frames-fall-back"}
# what is changed of the careful one, and all rules that it then breaks
FAULTS: list[tuple[str, Any, set[str]]] = [
    ("crc", lambda data_id, data: data[0], CRC_RULES | COUNTING),
    ("MAX_DROPPED", 10**6, {"second-sender-falls-back", "counter-that-stands-still-falls-back"} | COUNTING),
    ("MAX_DROPPED", 6, COUNTING),
    ("MAX_LOST", 14, {
        "stray-counter-is-dropped", "frame-out-of-order-is-dropped", "second-sender-falls-back",
        "counter-four-or-five-on-is-dropped",
    }),
    ("MAX_LOST", 3, {"counter-four-or-five-on-is-dropped"}),
    ("MAX_LOST", 1, {"counter-three-on-is-used"}),
    ("MAX_LOST", 0, {"lost-frames-are-no-fault", "counter-three-on-is-used"}),
    ("MAX_AGE_MS", 255, AGE_RULES),
    ("MAX_AGE_MS", 254, {"high-sample-age-falls-back"}),
    ("USABLE", {"Valid", "Degraded"}, {"degraded-falls-back"}),
    ("USABLE", {"Valid", "15"}, {"unknown-validity-falls-back", "every-transition-of-validity"}),
    ("UNKNOWN", "", {"unknown-surface-falls-back", "unknown-contact-state-falls-back"}),
    ("MAX_MU", 65533, {"number-beyond-100-percent-falls-back"}),
    ("MAX_MU", 65534, {"number-beyond-100-percent-falls-back", "error-number-falls-back"}),
    ("RISE_US", 600_000, {"rise-is-followed-slowly"}),
    ("TIMEOUT_US", 100_000, {
        "silence-falls-back", "nothing-but-wrong-crcs-falls-back", "restart-falls-back-until-valid"
    }),
    ("TIMEOUT_US", 60_200, {"silence-falls-back"}),
    ("TIMEOUT_US", 59_800, {"silence-falls-back"}),
    ("TIMEOUT_US", 41_000, {"silence-falls-back", "counter-three-on-is-used"}),
]  # fmt: skip


@pytest.mark.parametrize(("name", "value", "rules"), FAULTS, ids=[f"{n}-{k}" for k, (n, _, _) in enumerate(FAULTS)])
def test_one_fault_breaks_its_rules_and_no_other(
    config: Config, careful: ModuleType, name: str, value: Any, rules: set[str]
) -> None:
    assert hasattr(careful, name)
    setattr(careful, name, value)
    assert set(on_virtual_time(careful.Careful, config)[0]) == rules


def hearing(careful: ModuleType, hear: Callable[[Any, Frame], None]) -> Any:
    """The example, but that frames come to it by a function of the whole and the frame."""
    return lambda: type("Spoilt", (careful.Careful,), {"hear": hear})()


def using(careful: ModuleType, change: Callable[[float], float]) -> Any:
    """The example, but that it uses another limit."""

    def use(self: Any, axle: int, now_us: int) -> Use:
        limit = careful.Careful.use(self, axle, now_us).limit_pct
        return Use(None if limit is None else change(limit), axle)

    return lambda: type("Spoilt", (careful.Careful,), {"use": use})()


@pytest.mark.parametrize(("level", "width"), [("Within1pp", 0), ("Within3pp", 2), ("Within8pp", 5), ("Within12pp", 0)])
def test_each_level_of_confidence_counts(config: Config, careful: ModuleType, level: str, width: int) -> None:
    careful.HALF_WIDTHS[level] = width
    broken, _ = on_virtual_time(careful.Careful, config, {"half-width-is-taken-off"})
    assert f"30 % {level}" in broken["half-width-is-taken-off"]


def test_consumer_that_never_uses_a_frame_is_told_apart(config: Config) -> None:
    class Timid:
        def hear(self, frame: Frame) -> None:
            """It does not listen."""

        def use(self, axle: int, now_us: int) -> Use:
            return Use(None, axle)

    broken, _ = on_virtual_time(Timid, config)
    assert set(broken) == NAMES


def test_consumer_that_takes_every_axle_for_its_own_is_found(config: Config, careful: ModuleType) -> None:
    careful.__dict__["crc"] = lambda data_id, data: data[0]
    rules = {"other-axle-is-not-used", "other-id-is-dropped", "id-of-the-other-kind-is-dropped"}

    def hear(self: Any, frame: Frame) -> None:
        for axle in self._axles.values():
            axle.hear(frame.data, frame.stamp_us)

    assert set(on_virtual_time(hearing(careful, hear), config, rules)[0]) == rules


def test_consumer_that_takes_remote_frames_for_data_is_found(config: Config, careful: ModuleType) -> None:
    def hear(self: Any, frame: Frame) -> None:
        if frame.remote:
            self._axles[1]._limit = 0.0
        careful.Careful.hear(self, frame)

    assert set(on_virtual_time(hearing(careful, hear), config)[0]) == {"remote-frame-is-dropped"}


def test_consumer_that_takes_fd_frames_for_classical_ones_is_found(config: Config, careful: ModuleType) -> None:
    def hear(self: Any, f: Frame) -> None:
        careful.Careful.hear(self, Frame(f.stamp_us, f.can_id, f.data, f.extended, f.remote))

    assert set(on_virtual_time(hearing(careful, hear), config)[0]) == {"fd-frame-is-dropped"}


@pytest.mark.parametrize("factor", [0.01, 0.0, 0.5, 0.9, 100.0])
def test_consumer_that_counts_in_another_unit_is_found(config: Config, careful: ModuleType, factor: float) -> None:
    broken, _ = on_virtual_time(using(careful, lambda limit: factor * limit), config, {"valid-is-used"})
    assert f"{17 * factor:.4g} %" in broken["valid-is-used"]


@pytest.mark.parametrize("constant", [17.0, 20.0])
def test_limit_that_follows_no_rise_is_found(config: Config, careful: ModuleType, constant: float) -> None:
    broken, _ = on_virtual_time(using(careful, lambda limit: min(limit, constant)), config, {"valid-is-used"})
    assert "37.0 %" in broken["valid-is-used"]


@pytest.mark.parametrize("limit", [math.nan, math.inf, -math.inf])
def test_limit_that_is_no_number_cannot_be_judged(config: Config, careful: ModuleType, limit: float) -> None:
    with pytest.raises(ConsumerError, match=r"nan|inf"):
        on_virtual_time(using(careful, lambda _: limit), config, {"wrong-crc-is-dropped"})


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

    assert set(on_virtual_time(Fraction, config)[0]) == {"valid-is-used"}


class Slow:
    """Wants so many seconds of good frames after a fall-back: it takes more slowly than it must."""

    def __init__(self, careful: Any, needs_us: float) -> None:
        self._careful, self._needs_us = careful, needs_us
        self._since_us: float | None = -math.inf
        self._used = False  # the first time it waits for nothing

    def hear(self, frame: Frame) -> None:
        self._careful.hear(frame)

    def use(self, axle: int, now_us: int) -> Use:
        use: Use = self._careful.use(axle, now_us)
        if use.limit_pct is None:
            self._since_us = None if self._used else -math.inf
            return use
        self._used = True
        self._since_us = now_us if self._since_us is None else self._since_us
        return use if now_us - self._since_us >= self._needs_us else Use(None, axle)


def test_consumer_that_wants_good_frames_for_a_while_breaks_no_rule(config: Config, careful: ModuleType) -> None:
    assert on_virtual_time(lambda: Slow(careful.Careful(), 1_300_000), config) == ({}, {})


def test_consumer_that_returns_late_or_waits_for_a_person_is_found(config: Config, careful: ModuleType) -> None:
    rules = {"degraded-falls-back", "silence-falls-back", "restart-falls-back-until-valid"}
    late, _ = on_virtual_time(lambda: Slow(careful.Careful(), 3_300_000), config, rules)
    broken, _ = on_virtual_time(lambda: Slow(careful.Careful(), math.inf), config, rules)
    assert set(late) == set(broken) == rules


def test_sentence_says_what_was_played_must_be_used_and_was_used(config: Config) -> None:
    broken, _ = on_virtual_time(example("careless_consumer").Careless, config)
    assert broken["degraded-falls-back"] == (
        "Degraded 20 % None after Valid 20 % Within3pp: the consumer must fall back at once, but it used 20.0 % 20 ms "
        "later"
    )


def test_every_rule_names_a_section_of_the_page() -> None:
    headings = {line.lstrip("# ") for line in (ROOT / PAGE).read_text().splitlines() if line.startswith("## ")}
    assert {c.section for c in CHECKS} <= headings
    assert len(NAMES) == len(CHECKS) >= 30


@pytest.mark.parametrize("states", [2, 3, 4])
def test_round_trip_takes_every_transition_once(states: int) -> None:
    trip = round_trip(states)
    assert sorted(trip) == [(a, b) for a in range(states) for b in range(states) if a != b]
    assert all(a[1] == b[0] for a, b in itertools.pairwise(trip))
    assert trip[0][0] == trip[-1][1] == 0


def test_own_names_are_played_and_what_they_cannot_say_is_left(careful: ModuleType) -> None:
    config = load_config(EXAMPLES / "own-dbc" / "train.toml")
    broken, left = on_virtual_time(careful.Careful, config)
    assert "WSP_Adhesion1" in left["wrong-crc-is-dropped"]
    assert "valid-is-used" in broken  # it listens to other ids
