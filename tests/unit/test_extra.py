"""`sim-ecu` where the rig's packages are missing: one line that names the extra."""

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from sim_ecu.cli.main import MODULES, explained
from wrcd.cli.main import main as wrcd

ROOT = Path(__file__).parents[2]
ON_THE_TRAIN = {"numpy", "cantools", "can", "wrcd", "sim_ecu"}
# without the packages that a train lacks
WITHOUT = """
import sys
for name in sys.argv.pop(1).split(","):
    sys.modules[name] = None
from sim_ecu.cli.main import main
sys.exit(main(sys.argv[1:]))
"""


def run(missing: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", WITHOUT, missing, *arguments],
        cwd=ROOT, timeout=120, check=False, capture_output=True, text=True,
    )  # fmt: skip


def top_level(source: Path) -> set[str]:
    """Packages that a file imports, anywhere in it."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(source.read_text())):
        if isinstance(node, ast.Import):
            found |= {a.name.partition(".")[0] for a in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found.add(node.module.partition(".")[0])
    return found


def test_every_package_that_the_rig_imports_belongs_to_a_known_extra() -> None:
    imported = set().union(*(top_level(s) for s in (ROOT / "sim_ecu").rglob("*.py")))
    assert imported - ON_THE_TRAIN - set(sys.stdlib_module_names) == set(MODULES) - {"packaging"}
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    for extra, package in MODULES.values():
        assert package in {re.split(r"[>=\[]", line)[0] for line in extras[extra]}


@pytest.mark.parametrize(
    "command", ["play leaf-patch --fast --log never.log", "design --explain", "score --quick", "demo"]
)
def test_command_without_the_extra_is_one_line_and_status_2(command: str) -> None:
    done = run(",".join(MODULES), *command.split())
    assert (done.returncode, done.stdout) == (2, "")
    assert re.fullmatch(
        r"sim-ecu: error: the package [a-z0-9-]+ is missing: sim-ecu needs the "
        r"extra 'bench' — in the source's folder pip install -e '\.\[bench\]', "
        r"of a wheel pip install 'WHEEL\[bench\]'\n",
        done.stderr,
    )


def test_help_and_version_need_no_extra() -> None:
    assert run(",".join(MODULES), "--help").returncode == 0
    assert run(",".join(MODULES), "--version").stdout.startswith("sim-ecu ")


@pytest.mark.parametrize(("module", "extra", "package"), [(m, *known) for m, known in MODULES.items()])
def test_missing_package_is_named_as_it_is_installed(module: str, extra: str, package: str) -> None:
    def command() -> int:
        raise ModuleNotFoundError(f"No module named '{module}.part'", name=f"{module}.part")

    with pytest.raises(Exception, match=rf"the package {package} is missing: .*\[{extra}\]") as caught:
        explained(command)
    assert getattr(caught.value, "status", None) == 2


def test_monitor_without_its_extra_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "textual", None)
    assert wrcd(["monitor", "ride.log"]) == 2
    assert capsys.readouterr().err.startswith("wrcd: error: monitor: needs the extra monitor")
