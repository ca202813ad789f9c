"""Each rule finds the consumer that breaks it, and only that one."""

import itertools
from types import ModuleType
from typing import Any

import pytest

from tests.support.contract import EXAMPLES, NAMES, example, on_virtual_time
from tests.support.processes import ROOT
from wrcd.config import load_config
from wrcd.core.configuration import Config
from wrcd.tools.contract import Frame, Use
from wrcd.tools.contract.every import CHECKS
from wrcd.tools.contract.rules import PAGE
from wrcd.tools.contract.saying import _round_trip

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
    ("MAX_DROPPED", 10, COUNTING),
    ("MAX_DROPPED", 6, COUNTING),
    (
        "MAX_LOST",
        14,
        {
            "stray-counter-is-dropped",
            "frame-out-of-order-is-dropped",
            "second-sender-falls-back",
            "counter-four-or-five-on-is-dropped",
        },
    ),
    ("MAX_LOST", 5, {"counter-four-or-five-on-is-dropped"}),
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
    ("RISE_US", 0, {"rise-is-followed-slowly"}),
    ("RISE_US", 600_000, {"rise-is-followed-slowly"}),
    (
        "TIMEOUT_US",
        100_000,
        {"silence-falls-back", "nothing-but-wrong-crcs-falls-back", "restart-falls-back-until-valid"},
    ),
    ("TIMEOUT_US", 79_000, {"silence-falls-back"}),
    ("TIMEOUT_US", 60_200, {"silence-falls-back"}),
    ("TIMEOUT_US", 59_800, {"silence-falls-back"}),
    ("TIMEOUT_US", 41_000, {"silence-falls-back", "counter-three-on-is-used"}),
]


@pytest.mark.parametrize(("name", "value", "rules"), FAULTS, ids=[f"{n}-{k}" for k, (n, _, _) in enumerate(FAULTS)])
def test_one_fault_breaks_its_rules_and_no_other(
    config: Config, careful: ModuleType, name: str, value: Any, rules: set[str]
) -> None:
    assert hasattr(careful, name)
    setattr(careful, name, value)
    assert set(on_virtual_time(careful.Careful, config)[0]) == rules


@pytest.mark.parametrize(("level", "width"), [("Within1pp", 0), ("Within3pp", 2), ("Within8pp", 5), ("Within12pp", 0)])
def test_each_level_of_confidence_counts(config: Config, careful: ModuleType, level: str, width: int) -> None:
    careful.HALF_WIDTHS[level] = width
    broken, _ = on_virtual_time(careful.Careful, config)
    assert "half-width-is-taken-off" in broken
    assert f"30 % {level}" in broken["half-width-is-taken-off"]


def test_consumer_that_never_uses_a_frame_is_told_apart(config: Config) -> None:
    class Timid:
        def hear(self, frame: Frame) -> None:
            """It does not listen."""

        def use(self, axle: int, now_us: int) -> Use:
            return Use(None, axle)

    broken, _ = on_virtual_time(Timid, config)
    assert set(broken) == NAMES
    assert broken["valid-is-used"].endswith("must use a Valid frame, at most 17.0 %, but it fell back")


def test_consumer_that_takes_every_axle_for_its_own_is_found(config: Config, careful: ModuleType) -> None:
    class Mixed(careful.Careful):  # type: ignore[misc, name-defined]  # a module read from its file has no types
        def hear(self, frame: Frame) -> None:
            for axle in self._axles.values():
                axle.hear(frame.data, frame.stamp_us)

    careful.__dict__["crc"] = lambda data_id, data: data[0]
    broken, _ = on_virtual_time(Mixed, config)
    assert {"other-axle-is-not-used", "other-id-is-dropped", "id-of-the-other-kind-is-dropped"} <= set(broken)


def test_consumer_that_takes_remote_frames_for_data_is_found(config: Config, careful: ModuleType) -> None:
    class Remote(careful.Careful):  # type: ignore[misc, name-defined]  # a module read from its file has no types
        def hear(self, frame: Frame) -> None:
            if frame.remote:
                self._axles[1]._limit = 0.0
            super().hear(frame)

    assert set(on_virtual_time(Remote, config)[0]) == {"remote-frame-is-dropped"}


def test_consumer_that_waits_for_a_person_after_a_fault_is_found(config: Config, careful: ModuleType) -> None:
    class Latched(careful.Careful):  # type: ignore[misc, name-defined]  # a module read from its file has no types
        def __init__(self) -> None:
            super().__init__()
            self._used = self._latched = False

        def use(self, axle: int, now_us: int) -> Use:
            use: Use = super().use(axle, now_us)
            self._latched |= self._used and use.limit_pct is None
            self._used |= use.limit_pct is not None
            return Use(None, axle) if self._latched else use

    broken, _ = on_virtual_time(Latched, config)
    assert {"degraded-falls-back", "silence-falls-back", "restart-falls-back-until-valid"} <= set(broken)
    assert "use it again" in broken["restart-falls-back-until-valid"]


def test_sentence_says_what_was_played_must_be_used_and_was_used(config: Config) -> None:
    broken, _ = on_virtual_time(example("careless_consumer").Careless, config)
    assert broken["degraded-falls-back"] == (
        "Degraded 20 % None after Valid 20 % Within3pp: the consumer must fall back at once, but it used 20.0 % 20 ms "
        "later"
    )
    assert broken["silence-falls-back"].startswith(
        "silence after Valid 20 % Within3pp: the consumer must fall back after"
    )
    assert "used 60.0 % and 14.0 % and 11.0 % and 8.0 %" in broken["wrong-crc-is-dropped"]


def test_every_rule_names_a_section_of_the_page() -> None:
    headings = {line.lstrip("# ") for line in (ROOT / PAGE).read_text().splitlines() if line.startswith("## ")}
    assert {c.section for c in CHECKS} <= headings
    assert len(NAMES) == len(CHECKS) >= 30


@pytest.mark.parametrize("states", [2, 3, 4])
def test_round_trip_takes_every_transition_once(states: int) -> None:
    trip = _round_trip(states)
    assert sorted(trip) == [(a, b) for a in range(states) for b in range(states) if a != b]
    assert all(a[1] == b[0] for a, b in itertools.pairwise(trip))
    assert trip[0][0] == trip[-1][1] == 0


def test_own_names_are_played_and_what_they_cannot_say_is_left(careful: ModuleType) -> None:
    config = load_config(EXAMPLES / "own-dbc" / "train.toml")
    broken, left = on_virtual_time(careful.Careful, config)
    assert "wrong-crc-is-dropped" in left
    assert left["wrong-crc-is-dropped"] == "WSP_Adhesion1 has no E2E: no base for a controller"
    assert broken["valid-is-used"].startswith("Valid 20 % Within3pp for 5 s")  # it listens to other ids
