"""The plug-in as pytest runs it: options, fixtures, sentences."""

import subprocess
import sys
import tomllib

import pytest

from tests.support.contract import EXAMPLES, NAMES, outcomes, run_checks, run_pytest
from tests.support.processes import ROOT

pytest_plugins = ("pytester",)
CAREFUL, CARELESS = (f"{EXAMPLES / f'{name}_consumer.py'}:{name.capitalize()}" for name in ("careful", "careless"))


def test_careful_consumer_passes_every_check(pytester: pytest.Pytester) -> None:
    result = run_checks(pytester, "--wrcd-object", CAREFUL)
    assert result.ret == 0
    assert outcomes(result, "PASSED") == NAMES


def test_careless_consumer_fails_in_more_than_five_ways_with_a_sentence_each(pytester: pytest.Pytester) -> None:
    result = run_checks(pytester, "--wrcd-object", CARELESS)
    assert result.ret == 1
    failed = outcomes(result, "FAILED")
    assert failed >= {
        "degraded-falls-back",
        "not-available-number-falls-back",
        "wrong-crc-is-dropped",
        "repeated-counter-is-dropped",
        "silence-falls-back",
        "half-width-is-taken-off",
        "second-sender-falls-back",
    }
    text = result.stdout.str()
    assert text.count("the consumer must") >= len(failed)
    assert "docs/reference/what-a-controller-does.md, “Time-out”" in text
    assert "Traceback" not in text
    assert "During handling" not in text


def test_own_test_module_hands_its_consumer_over_and_plays_by_itself(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        test_mine=f"""
        import importlib.util
        import pytest
        from wrcd.contract import ObjectConsumer
        from wrcd.contract.checks import test_contract
        from wrcd.contract.frames import Says

        @pytest.fixture(scope="session")
        def wrcd_consumer():
            spec = importlib.util.spec_from_file_location("mine", {str(EXAMPLES / "careful_consumer.py")!r})
            mine = importlib.util.module_from_spec(spec)
            spec.loader.exec_module(mine)
            return ObjectConsumer(mine.Careful)

        def test_leaf_film(wrcd_player):
            wrcd_player.settle(Says(35.0, "Within2pp"))
            seen = wrcd_player.play(Says(3.0, "Within1pp"), 500_000)
            wrcd_player.must_be_at_most(seen, 2.0, "leaf film")
        """
    )
    result = run_pytest(pytester, "-k", "leaf_film or silence or orderly")
    result.assert_outcomes(passed=3, deselected=len(NAMES) - 2)


def test_own_configuration_skips_what_it_cannot_say(pytester: pytest.Pytester) -> None:
    # with "=" it is no path among the arguments, from which pytest takes its rootdir, and with it our pyproject.toml
    options = (f"--wrcd-config={EXAMPLES / 'own-dbc' / 'train.toml'}", "-k", "wrong-crc", "--wrcd-object", CAREFUL)
    result = run_checks(pytester, *options)
    assert result.ret == 0
    result.stdout.fnmatch_lines(["*SKIPPED*WSP_Adhesion1*"])


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ((), "--wrcd-object"),
        (("--wrcd-object", CAREFUL, "--wrcd-process", "true"), "which consumer?"),
        (("--wrcd-object", f"{EXAMPLES / 'careful_consumer.py'}:Missing"), "Missing"),
        (("--wrcd-object", CAREFUL, "--wrcd-axle", "7"), "--wrcd-axle 7:"),
        (("--wrcd-object", CAREFUL, "--wrcd-config", "absent.toml"), "absent.toml"),
        (("--wrcd-process", "true", "--wrcd-interface", "socketcan", "--wrcd-channel", "vcan77"), "vcan77"),
        (("--wrcd-process", "/no/program", "--wrcd-interface", "virtual"), "/no/program"),
        (("--wrcd-process", "false", "--wrcd-interface", "virtual"), "status 1"),
    ],
)
def test_wrong_option_ends_in_one_line(pytester: pytest.Pytester, options: tuple[str, ...], says: str) -> None:
    result = run_checks(pytester, "-k", "valid-is-used", *options)
    assert result.ret == 1
    assert says in result.stdout.str()
    assert "Traceback" not in result.stdout.str()


def test_plugin_is_an_entry_point_that_loads_nothing_heavy() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert project["project"]["entry-points"]["pytest11"] == {"wrcd_contract": "wrcd.contract.plugin"}
    code = (
        "import pytest, sys; before = set(sys.modules); import wrcd.contract.plugin\n"
        "print(*sorted(m for m in set(sys.modules) - before if not m.startswith('wrcd')))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert not {"numpy", "can", "cantools", "asyncio", "ssl"} & set(done.stdout.split())
