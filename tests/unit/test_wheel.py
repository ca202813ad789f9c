"""The wheel, installed elsewhere, brings what it needs along: the compiled library, for every Python."""

import os
import platform
import re
import subprocess
import sys
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from tests.support.scenarios import LogOf, held
from tests.support.tools import missing
from wrcd import native

ROOT = Path(__file__).parents[2]
PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check", "-q")
ZIG = ROOT / "build/zig"
ELF_MACHINE = {"x86_64": 62, "aarch64": 183}
GOLDEN = ("replay", "--design", "lone-wheelset", str(ROOT / "tests/golden/leaf-film.log"))
WRCD = "import sys, wrcd; print(wrcd.__file__, file=sys.stderr); from wrcd.cli.main import main; sys.exit(main())"


def build(folder: Path, **environment: str) -> Path:
    """A wheel of a copy of the tree, so that the build leaves nothing in it."""
    if lacks := missing("git"):
        pytest.skip(lacks)
    source = folder / "source"
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    for name in tracked:
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        (source / name).write_bytes((ROOT / name).read_bytes())
    subprocess.run(
        [*PIP, "wheel", "--no-deps", "--no-build-isolation", "-w", folder, source],
        env={**os.environ, **environment}, check=True, timeout=120,
    )  # fmt: skip
    (wheel,) = folder.glob("*.whl")
    return wheel


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="module", params=ELF_MACHINE)
def manylinux(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    """A machine, and the wheel for it of `make wheels`."""
    if not ZIG.exists():
        pytest.skip("ziglang missing; make build/zig/bin/cc")
    folder = tmp_path_factory.mktemp("manylinux")
    return request.param, build(folder, WRCD_MACHINE=request.param, PYTHONPATH=str(ZIG))


@pytest.fixture(scope="module")
def installed(wheel: Path) -> Path:
    site = wheel.parent / "site"
    subprocess.run([*PIP, "install", "--no-deps", "--no-index", "--target", site, wheel], check=True, timeout=120)
    return site


def library(wheel: Path) -> bytes:
    """The one that it brings."""
    with zipfile.ZipFile(wheel) as archive:
        (name,) = (n for n in archive.namelist() if n.endswith(".so"))
        assert name == "wrcd/_native.so"
        return archive.read(name)


def replayed_alone(wheel: Path, folder: Path) -> tuple[bytes, bytes]:
    """What the golden log gives in an environment of its own, where no program is found: the table and the frames."""
    subprocess.run([sys.executable, "-m", "venv", folder / "venv"], check=True, timeout=120)
    python = folder / "venv/bin/python"
    pip: tuple[str | Path, ...] = (
        python,
        "-m",
        "pip",
        "--disable-pip-version-check",
        "-q",
        "install",
        "--only-binary",
        ":all:",
    )
    subprocess.run([*pip, "--require-hashes", "-r", ROOT / "requirements-train.lock"], check=True, timeout=300)
    path = {**os.environ, "PATH": str(folder / "none")}
    subprocess.run([*pip, "--no-deps", "--no-index", wheel], env=path, check=True, timeout=120)
    return replayed(folder, [folder / "venv/bin/wrcd"], env=path)


def replayed(folder: Path, wrcd: Sequence[str | Path], **options: Any) -> tuple[bytes, bytes]:
    table, frames = folder / "out.csv", folder / "out.log"
    subprocess.run([*wrcd, *GOLDEN, "--csv", table, "-o", frames], cwd=folder, check=True, timeout=120, **options)
    return table.read_bytes(), frames.read_bytes()


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


def test_wheel_serves_every_python_of_its_machine(wheel: Path) -> None:
    assert re.fullmatch(r"wrcd-[\d.]+-py3-none-(many)?linux_.*\.whl", wheel.name)
    assert str(ROOT).encode() not in library(wheel)  # no folder of the machine that built it, to be searched or shown


def test_build_by_a_compiler_that_fails_fails_and_says_what_to_do(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "setup.py", "-q", "build_ext", "-b", tmp_path],
        cwd=ROOT, env={**os.environ, "CC": "false"}, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 1
    assert done.stderr.endswith("wrcd: false does not compile: install gcc and libc6-dev, or a wheel\n")


@pytest.mark.night
def test_wheel_in_an_empty_environment_without_a_compiler_replays_the_golden_log_to_its_bytes(
    wheel: Path, tmp_path: Path
) -> None:
    assert replayed_alone(wheel, tmp_path) == replayed(tmp_path, [sys.executable, "-m", "wrcd.cli"])


@pytest.mark.night
def test_manylinux_wheel_needs_the_c_library_of_its_name_and_no_other(manylinux: tuple[str, Path]) -> None:
    machine, wheel = manylinux
    assert wheel.name.endswith(f"-py3-none-manylinux_2_17_{machine}.manylinux2014_{machine}.whl")
    elf = library(wheel)
    assert int.from_bytes(elf[18:20], "little") == ELF_MACHINE[machine]
    assert set(re.findall(rb"\blib\w+\.so[.\d]*", elf)) == {b"libc.so.6", b"libm.so.6"}
    assert 12 <= max(int(minor) for minor in re.findall(rb"GLIBC_2\.(\d+)", elf)) <= 17


@pytest.mark.night
@pytest.mark.parametrize("manylinux", [platform.machine()], indirect=True)
def test_manylinux_wheel_replays_the_golden_log_to_the_bytes_of_this_compiler(
    manylinux: tuple[str, Path], tmp_path: Path
) -> None:
    assert replayed_alone(manylinux[1], tmp_path) == replayed(tmp_path, [sys.executable, "-m", "wrcd.cli"])


@pytest.mark.night
def test_wheel_brings_the_library_in_c(installed: Path) -> None:
    assert f"\nlibrary C11, compiled by {native.compiler()}\n" in run(installed, WRCD, "--version").stdout


@pytest.mark.night
def test_installed_wheel_says_what_this_computer_has_for_it(installed: Path) -> None:
    said = run(installed, "from wrcd.service.installation import report; report()").stdout
    assert re.search(rf"^ok +wrcd +.*{re.escape(str(installed))}$", said, re.MULTILINE)
    assert re.search(r"^ok +library in C +compiled by ", said, re.MULTILINE)
    assert re.search(r"^(ok|NO) +CAN in the kernel ", said, re.MULTILINE)


@pytest.mark.night
def test_kit_is_written_from_the_installed_wheel(installed: Path, tmp_path: Path) -> None:
    run(installed, WRCD, "kit", "-o", str(tmp_path / "kit"))
    assert (tmp_path / "kit" / "adhesion.c").stat().st_size > 10_000
    run(installed, WRCD, "kit", "--core", "-o", str(tmp_path / "core"))
    assert (tmp_path / "core" / "train.c").stat().st_size > 100_000


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
