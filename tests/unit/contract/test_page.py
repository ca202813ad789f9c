"""The command of docs/how-to/test-a-consumer.md: both example consumers as processes, on a bus between processes."""

import os
import shlex
import subprocess
import sys

import pytest

from tests.support.own_network import own_network
from tests.support.pages import run_by
from tests.support.processes import BIN, ROOT

# A rule of each kind: all of them are played on virtual time, and take most of a minute on a bus. The careful consumer
# keeps to every one, the careless one breaks three of these four.
CAREFUL = {
    "valid-is-used", "degraded-falls-back", "wrong-crc-is-dropped", "id-of-the-other-kind-is-dropped",
    "lost-frames-are-no-fault", "silence-falls-back",
}  # fmt: skip
BROKEN, KEPT = {"degraded-falls-back", "wrong-crc-is-dropped", "silence-falls-back"}, {"valid-is-used"}
(STEP,) = run_by("tests/unit/contract/test_page.py", "docs/how-to/test-a-consumer.md")
(COMMAND,) = STEP.commands


@pytest.mark.parametrize(
    ("name", "kept", "broken"),
    [
        pytest.param("careful", CAREFUL, set[str](), id="careful", marks=pytest.mark.night),
        pytest.param("careless", KEPT, BROKEN, id="careless"),
    ],
)
def test_consumer_as_a_process_is_caught_by_every_rule_that_it_breaks(
    name: str, kept: set[str], broken: set[str]
) -> None:
    prefix, bus = own_network()
    _, interface, _, channel = bus.split()
    words = shlex.split(COMMAND.replace("python examples/careful", f"{sys.executable} examples/{name}"))
    options = ["--wrcd-interface", interface, "--wrcd-channel", channel, "-k", " or ".join(kept | broken)]
    only_ours = ["-p", "wrcd.contract.plugin", "-p", "no:cacheprovider", "-rA"]
    env = {k: v for k, v in os.environ.items() if not k.startswith(("CAN_", "PYTEST_"))}
    done = subprocess.run(
        [*prefix, BIN / words[0], *words[1:], *options, *only_ours], cwd=ROOT, capture_output=True, text=True,
        env={**env, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}, timeout=300, check=False,
    )  # fmt: skip
    found = {how: set[str]() for how in ("PASSED", "FAILED")}
    for line in done.stdout.splitlines():
        how, _, rest = line.partition(" ")
        if how in found and "test_contract[" in rest:
            found[how].add(rest.partition("test_contract[")[2].partition("]")[0])
    assert found == {"PASSED": kept, "FAILED": broken}, done.stdout
    assert done.returncode == bool(broken)
