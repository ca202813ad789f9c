"""The plug-in wrcd_contract on a real kernel's vcan0, against both example consumers as processes."""

import shlex
import sys
import time

import pytest

from tests.support.contract import EXAMPLES, outcomes, run_pytest
from tests.support.pages import run_by

pytest_plugins = ("pytester",)
# a rule of each kind; all of them are played on virtual time, and take most of a minute on a bus
RULES = {
    "valid-is-used",
    "degraded-falls-back",
    "not-available-number-falls-back",
    "wrong-crc-is-dropped",
    "wrong-length-is-dropped",
    "id-of-the-other-kind-is-dropped",
    "repeated-counter-is-dropped",
    "lost-frames-are-no-fault",
    "late-frames-are-no-fault",
    "silence-falls-back",
    "restart-falls-back-until-valid",
    "drop-is-followed-at-once",
}
UNBROKEN = {"valid-is-used", "lost-frames-are-no-fault", "late-frames-are-no-fault", "drop-is-followed-at-once"}


(STEP,) = run_by("tests/hil/test_contract.py", "docs/how-to/test-a-consumer.md")
(COMMAND,) = STEP.commands


def played(pytester: pytest.Pytester, name: str) -> pytest.RunResult:
    """Run the page's command with some of the rules, and with another consumer."""
    begun = time.monotonic()
    _, *words = shlex.split(COMMAND)
    absolute = words[-1].replace("python examples/careful", f"{sys.executable} {EXAMPLES}/{name}")
    result = run_pytest(pytester, *words[:-1], absolute, "-k", " or ".join(RULES))
    print(f"{name}: {time.monotonic() - begun:.1f} s")
    return result


def test_careful_process_passes(pytester: pytest.Pytester) -> None:
    result = played(pytester, "careful")
    assert outcomes(result, "PASSED") == RULES
    assert result.ret == 0


def test_careless_process_is_caught_by_every_rule_that_it_breaks(pytester: pytest.Pytester) -> None:
    result = played(pytester, "careless")
    assert outcomes(result, "FAILED") == RULES - UNBROKEN
    assert outcomes(result, "PASSED") == UNBROKEN
