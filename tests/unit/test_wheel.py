"""The wheel, installed elsewhere, brings what it needs along."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.scenarios import LogOf, held
from tests.support.tools import missing
from wrcd import native

ROOT = Path(__file__).parents[2]
WRCD = "import sys, wrcd; print(wrcd.__file__, file=sys.stderr); from wrcd.cli.main import main; sys.exit(main())"


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if lacks := missing("git"):
        pytest.skip(lacks)
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    # a copy, so that the build leaves nothing in the tree
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    for name in tracked:
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        (source / name).write_bytes((ROOT / name).read_bytes())
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "-q"]
    subprocess.run([*pip, "wheel", "--no-deps", "--no-build-isolation", "-w", folder, source], check=True, timeout=120)
    (wheel,) = folder.glob("*.whl")
    subprocess.run(
        [*pip, "install", "--no-deps", "--no-index", "--target", folder / "site", wheel], check=True, timeout=120
    )
    return folder / "site"


def run(installed: Path, code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=installed.parent, env={**os.environ, "PYTHONPATH": str(installed)}, capture_output=True,
        text=True, timeout=120, check=True,
    )  # fmt: skip


def test_replay_works_from_the_installed_wheel(installed: Path, log_of: LogOf, tmp_path: Path) -> None:
    table = tmp_path / "a.csv"
    done = run(installed, WRCD, "replay", str(log_of(held("C"))), "--csv", str(table))
    assert str(installed) in done.stderr
    assert table.read_text().splitlines()[-4].split(",")[2] == "Valid"


@pytest.mark.night
def test_wheel_brings_the_library_in_c(installed: Path) -> None:
    assert f"\nlibrary C11, compiled by {native.compiler()}\n" in run(installed, WRCD, "--version").stdout


@pytest.mark.night
def test_kit_is_written_from_the_installed_wheel(installed: Path, tmp_path: Path) -> None:
    run(installed, WRCD, "kit", "-o", str(tmp_path / "kit"))
    assert (tmp_path / "kit" / "adhesion.c").stat().st_size > 10_000
    run(installed, WRCD, "kit", "--estimator", "-o", str(tmp_path / "estimator"))
    assert (tmp_path / "estimator" / "design.c").stat().st_size > 100_000


@pytest.mark.night
def test_wheel_contains_the_rig(installed: Path) -> None:
    code = "import sys, sim_ecu; print(sim_ecu.__file__); from sim_ecu.cli.main import main; sys.exit(main())"
    done = run(installed, code, "list")
    assert str(installed) in done.stdout
    assert "leaf-patch" in done.stdout


@pytest.mark.night
def test_wheel_brings_the_dbcs_as_files_not_links(installed: Path) -> None:
    for package in ("wrcd", "sim_ecu"):
        dbc = installed / f"{package}/data/{package}.dbc"
        assert not dbc.is_symlink()
        assert dbc.read_bytes() == (ROOT / f"dbc/{package}.dbc").read_bytes()
