"""The plug-in wrcd_contract under test: its checks without pytest, and runs of pytest within a test."""

import importlib.util
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

from tests.support.processes import ROOT
from wrcd.contract import Hearing, ObjectConsumer
from wrcd.contract.benches import Bench, VirtualBench
from wrcd.contract.contract_player import BrokenRule, CannotPlay, ContractPlayer
from wrcd.contract.contract_rules import CHECKS
from wrcd.contract.frames import FrameMaker
from wrcd.core.configuration import Config

EXAMPLES = ROOT / "examples"
NAMES = {c.name for c in CHECKS}


def example(name: str) -> ModuleType:
    """A program of examples/ as a module of its own."""
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def judged(bench: Bench, config: Config, names: set[str] = NAMES) -> tuple[dict[str, str], dict[str, str]]:
    """Sentences of the broken rules, and reasons of those that cannot be played, by name."""
    broken, left = {}, {}
    makers = [FrameMaker(config, a) for a in config.axles]
    for check in CHECKS:
        if check.name in names:
            bench.start()
            try:
                check.run(ContractPlayer(bench, makers[0], 60, *makers[1:2]))
            except BrokenRule as e:
                broken[check.name] = str(e)
            except CannotPlay as e:
                left[check.name] = str(e)
    return broken, left


def on_virtual_time(
    make: Callable[[], Hearing], config: Config, names: set[str] = NAMES
) -> tuple[dict[str, str], dict[str, str]]:
    """The same of a Python object."""
    return judged(VirtualBench(ObjectConsumer(make)), config, names)


def run_checks(pytester: pytest.Pytester, *options: str | Path) -> pytest.RunResult:
    """Run pytest with the ready-made checks, in this process."""
    return run_pytest(pytester, "--pyargs", "wrcd.contract.checks", *options)


def run_pytest(pytester: pytest.Pytester, *options: str | Path) -> pytest.RunResult:
    """Run pytest with the plug-in and no other that is installed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
        patch.delenv("PYTEST_ADDOPTS", raising=False)
        patch.delenv("PYTEST_PLUGINS", raising=False)
        plugin = ("-p", "wrcd.contract.plugin", "-p", "no:cacheprovider", "-rA")
        return pytester.runpytest_inprocess(*plugin, *map(str, options))


def outcomes(result: pytest.RunResult, how: str) -> set[str]:
    """Names of the rules that ended so: PASSED, FAILED, SKIPPED, ERROR."""
    lines = [line for line in result.outlines if line.startswith(f"{how} ") and "test_contract[" in line]
    return {line.partition("test_contract[")[2].partition("]")[0] for line in lines}
