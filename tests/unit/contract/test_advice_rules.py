"""The contract of the train's advice: a careful consumer breaks no rule, and each fault the rules that it should."""

from collections.abc import Callable
from types import ModuleType
from typing import Any

import pytest

from tests.support.contract import example, run_checks
from tests.support.kit.trains import advised_train
from wrcd.bus.dbc import find_message
from wrcd.bus.units import G
from wrcd.config.config import load_packaged
from wrcd.contract import Frame, ObjectConsumer, Use
from wrcd.contract.benches import VirtualBench
from wrcd.contract.contract_player import BrokenRule, CannotPlay, ContractPlayer
from wrcd.contract.contract_rules import ADVICE_CHECKS, OF_EVERY_MESSAGE
from wrcd.contract.frames import AdviceMaker

pytest_plugins = ("pytester",)
CONFIG = load_packaged(2, advice=True)
assert CONFIG.advice is not None
MAKER = AdviceMaker(CONFIG, CONFIG.advice)
TIMEOUT_US = 600_000


@pytest.fixture
def careful() -> ModuleType:
    """The example for an axle's frames, to be spoilt."""
    module = example("careful_consumer")
    module.__dict__["TIMEOUT_US"] = TIMEOUT_US
    return module


def listener(module: Any, unknown: str = "Unknown") -> Callable[[], Any]:
    """A consumer of the advice alone: frames by the example's rules, read as the page says."""

    class Advised(module.Axle):  # type: ignore[misc]  # of a module that is loaded
        def _read(self, data: bytes, now_us: int) -> None:
            values: Any = self._message.decode(data)
            low = values["DecelerationLow"]
            self._usable = (
                str(values["Validity"]) in module.USABLE
                and isinstance(low, int | float)
                and str(values["Category"]) != unknown
            )
            self._limit = 100.0 * low / G if self._usable else None

    class Listener:
        def __init__(self) -> None:
            self._message = find_message(CONFIG.database, "AdhesionAdvice")
            self._train = Advised(self._message)

        def hear(self, frame: Frame) -> None:
            if frame.can_id == self._message.frame_id and frame.plain and not frame.extended:
                self._train.hear(frame.data, frame.stamp_us)

        def use(self, axle: int, now_us: int) -> Use:
            assert axle == 0
            return Use(self._train.use(now_us), axle)

    return Listener


def broken(make: Callable[[], Any]) -> set[str]:
    found = set()
    bench = VirtualBench(ObjectConsumer(make))
    for check in ADVICE_CHECKS:
        bench.start()
        try:
            check.run(ContractPlayer(bench, MAKER, 60))
        except BrokenRule:
            found.add(check.name)
        except CannotPlay as e:
            pytest.fail(str(e))
    return found


def test_careful_consumer_of_the_advice_breaks_no_rule(careful: ModuleType) -> None:
    assert {c.name for c in ADVICE_CHECKS} == OF_EVERY_MESSAGE | {"unknown-category-falls-back"}
    assert broken(listener(careful)) == set()


@pytest.mark.parametrize(("name", "wrong", "rules"), [
    ("USABLE", {"Valid", "Degraded"}, {"degraded-falls-back", "every-transition-of-validity"}),
    ("USABLE", {"Valid", "Error"}, {"unknown-validity-falls-back", "every-transition-of-validity"}),
    ("TIMEOUT_US", 1_000_000, {"silence-falls-back", "nothing-but-wrong-crcs-falls-back"}),
    ("TIMEOUT_US", 400_000, {"counter-three-on-is-used", "silence-falls-back"}),
    ("crc", lambda data_id, data: data[0], {"wrong-crc-is-dropped", "crc-of-another-data-id-is-dropped"}),
    ("MAX_LOST", 14, {"stray-counter-is-dropped", "counter-four-or-five-on-is-dropped"}),
])  # fmt: skip
def test_fault_breaks_its_rules(careful: ModuleType, name: str, wrong: Any, rules: set[str]) -> None:
    careful.__dict__[name] = wrong
    found = broken(listener(careful))
    assert rules <= found
    assert "valid-is-used" not in found


def test_category_that_is_not_looked_at_breaks_its_rule(careful: ModuleType) -> None:
    assert broken(listener(careful, unknown="")) == {"unknown-category-falls-back"}


def test_played_advice_has_its_category_by_the_lower_end() -> None:
    message = find_message(CONFIG.database, "AdhesionAdvice")
    said: Any = message.decode(MAKER.frame(3).data)  # 20 % Within3pp
    assert (said["Deceleration"], said["DecelerationLow"], said["Category"]) == (
        pytest.approx(1.96), pytest.approx(1.66), "Dry",
    )  # fmt: skip


def test_plugin_plays_the_advice_with_its_option_alone(pytester: pytest.Pytester) -> None:
    config = advised_train(pytester.path)
    pytester.makepyfile(
        deaf="""
        from wrcd.contract import Use
        class Deaf:
            def hear(self, frame): ...
            def use(self, axle, now_us): return Use(None, axle)
    """
    )
    options = ("--wrcd-object", "deaf.py:Deaf", "-k", "category or silence or surface")
    run_checks(pytester, *options, "--wrcd-advice", "--wrcd-config", config).assert_outcomes(failed=2)
    refused = run_checks(pytester, *options, "--wrcd-advice")
    refused.stdout.fnmatch_lines(["*--wrcd-advice: the configuration sends none*"])
