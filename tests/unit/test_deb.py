"""The Debian package: what is in it, and that the same tree gives the same bytes."""

import gzip
import hashlib
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.tools import missing
from wrcd import __version__, native
from wrcd.cli.main import WRCD
from wrcd.config.config import DEFAULT

ROOT = Path(__file__).parents[2]
LACKS = missing("dpkg-deb", "/usr/bin/python3")
NEEDS_DPKG = pytest.mark.skipif(bool(LACKS), reason=LACKS)


def build(folder: Path, umask: int) -> Path:
    """The package of a small site: what is in the libraries does not matter here."""
    site = folder / "site"
    shutil.copytree(ROOT / "wrcd", site / "wrcd", ignore=shutil.ignore_patterns("__pycache__"))
    subprocess.run(
        [sys.executable, ROOT / "systemd/deb/build.py", "--site", site, "-o", folder, "--compress", "gzip"], check=True,
        timeout=120, env={**os.environ, "SOURCE_DATE_EPOCH": "1700000000"}, umask=umask, stdout=subprocess.DEVNULL,
    )  # fmt: skip
    (package,) = folder.glob("*.deb")
    return package


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("deb"), 0o022)


def listed(package: Path) -> dict[str, list[str]]:
    """Mode and owner of everything in it, by path."""
    lines = subprocess.run(["dpkg-deb", "--contents", package], capture_output=True, text=True, check=True).stdout
    return {words[5]: words[:2] for words in map(str.split, lines.splitlines())}


def field(package: Path, name: str) -> str:
    done = subprocess.run(["dpkg-deb", "--field", package, name], capture_output=True, text=True, check=True)
    return done.stdout.strip()


@NEEDS_DPKG
def test_package_is_named_after_version_and_architecture(package: Path) -> None:
    assert package.name == f"wrcd_{__version__}_{field(package, 'Architecture')}.deb"
    assert field(package, "Version") == __version__
    python = subprocess.run(
        ["/usr/bin/python3", "-c", "import sys; print('python%d.%d' % sys.version_info[:2])"],
        capture_output=True, text=True, check=True,
    ).stdout.strip()  # fmt: skip
    assert python in field(package, "Depends").split(", ")


@NEEDS_DPKG
def test_package_has_units_and_program_for_everybody_to_read_and_no_rig(package: Path) -> None:
    files = listed(package)
    assert "./usr/lib/systemd/system/wrcd@.service" in files
    assert files["./opt/wrcd/bin/wrcd"][0] == "-rwxr-xr-x"
    assert files["./etc/wrcd/"][0] == "drwxr-xr-x"
    assert {owner for _, owner in files.values()} == {"root/root"}
    assert {mode for mode, _ in files.values()} == {"drwxr-xr-x", "-rwxr-xr-x", "-rw-r--r--", "lrwxrwxrwx"}
    assert any("/wrcd/__pycache__/errors." in name for name in files)
    # no rig: it lacks what that needs
    assert not [name for name in files if "sim-ecu" in name and not name.startswith("./opt/wrcd/lib/")]


@NEEDS_DPKG
def test_package_brings_the_library_in_c(package: Path, tmp_path: Path) -> None:
    subprocess.run(["dpkg-deb", "--extract", package, tmp_path], check=True)
    (library,) = tmp_path.glob("opt/wrcd/lib/python3.*/site-packages/wrcd/_native.so")
    done = subprocess.run(
        ["/usr/bin/python3", "-c", "from wrcd import native; print(native.__file__, native.compiler())"],
        cwd=tmp_path, env={"PYTHONPATH": str(library.parents[1])}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout.strip() == f"{library.parent / 'native.py'} {native.compiler()}"
    # the newest symbol that it takes of the C library
    needs = max(int(minor) for minor in re.findall(rb"GLIBC_2\.(\d+)", library.read_bytes()))
    assert int(re.findall(r"libc6 \(>= 2\.(\d+)\)", field(package, "Depends"))[0]) >= needs


@NEEDS_DPKG
def test_package_without_the_library_in_c_is_not_built(tmp_path: Path) -> None:
    (tmp_path / "site/wrcd").mkdir(parents=True)
    words: list[str | Path] = [
        sys.executable,
        ROOT / "systemd/deb/build.py",
        "--site",
        tmp_path / "site",
        "-o",
        tmp_path / "out",
    ]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 1
    assert "has no library in C: install gcc" in done.stderr


# what readline would offer for the last word
COMPLETE = """
source "$1"
COMP_WORDS=("${@:2}") COMP_CWORD=$(($# - 2))
$(complete -p wrcd | sed 's/.*-F \\([^ ]*\\) .*/\\1/')
printf '%s\\n' "${COMPREPLY[@]}"
"""


def completed(script: Path, *words: str) -> list[str]:
    """What bash offers for the last word in the script's folder."""
    done = subprocess.run(
        ["bash", "--norc", "-c", COMPLETE, "bash", script, *words],
        cwd=script.parent, capture_output=True, text=True, timeout=30, check=False,
    )  # fmt: skip
    return done.stdout.split()


@NEEDS_DPKG
def test_package_brings_a_manual_page_completion_of_every_command_and_the_messages(
    package: Path, tmp_path: Path
) -> None:
    subprocess.run(["dpkg-deb", "--extract", package, tmp_path], check=True)
    page = gzip.decompress((tmp_path / "usr/share/man/man1/wrcd.1.gz").read_bytes()).decode()
    assert [line for line in page.splitlines() if line.startswith(".SH wrcd ")] == [f".SH wrcd {n}" for n in WRCD.names]
    script = tmp_path / "usr/share/bash-completion/completions/wrcd"
    assert completed(script, "wrcd", "") == list(WRCD.names)
    assert completed(script, "wrcd", "replay", "--ev") == ["--events"]
    assert completed(script, "wrcd", "run", "--config", "wr") == ["wrcd"]
    zsh = tmp_path / "usr/share/zsh/vendor-completions/_wrcd"
    assert zsh.read_text().startswith("#compdef wrcd\n")
    messages = (tmp_path / "usr/share/doc/wrcd/messages.md").read_text()  # with what the site puts there
    assert "{signals}" not in messages
    assert "\n| MuAvailable | 0.01 %, 0 … 100 | " in messages


@NEEDS_DPKG
def test_every_unit_starts_what_the_package_brings(package: Path, tmp_path: Path) -> None:
    subprocess.run(["dpkg-deb", "--extract", package, tmp_path], check=True)
    unit = (tmp_path / "usr/lib/systemd/system/wrcd@.service").read_text()
    assert re.findall(r"^Exec\w+=(\S+)", unit, re.MULTILINE) == ["/opt/wrcd/bin/wrcd"]
    assert (tmp_path / "opt/wrcd/bin/wrcd").stat().st_mode & 0o111


@pytest.mark.parametrize(
    "options",
    [
        "--config train.toml",
        "'--lock --config=train.toml'",
        '--config "train.toml"',
        '"--wait 3 \\\n --config train.toml"',
    ],
)
def test_upgrade_names_what_is_to_be_mended(tmp_path: Path, options: str) -> None:
    train = tmp_path / "etc/train.toml"
    train.parent.mkdir()
    train.write_text(DEFAULT + "[limits]\nmin_sped_m_s = 3\n")
    folder = tmp_path / "wrcd"
    folder.mkdir()
    (folder / "can0.env").write_text(f"# as many write it\nWRCD_OPTIONS={options.replace('train.toml', str(train))}\n")
    (folder / "sim-ecu-can1.env").write_text(f"SCENARIO={folder}/curve.toml\n")
    (folder / "curve.toml").write_text("duration_s = 3\n")
    (folder / "can2.toml").write_text(DEFAULT + "[advice]\n")
    (folder / "can3.toml").write_text(DEFAULT)
    done = subprocess.run(
        [sys.executable, ROOT / "systemd/deb/upgraded.py", folder],
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    last = DEFAULT.count("\n")
    refused, named, ended = done.stderr.splitlines()
    assert str(train) in refused
    assert named.startswith(f"{train}:{last + 2}: limits.min_sped_m_s: ")
    assert f" {folder}/can2.toml:{last + 1}: advice: " in ended


@NEEDS_DPKG
def test_only_files_below_etc_are_configuration_files(package: Path) -> None:
    control = subprocess.run(["dpkg-deb", "--info", package, "conffiles"], capture_output=True, text=True, check=True)
    files = {name[1:] for name in listed(package) if name.startswith("./etc/") and not name.endswith("/")}
    assert set(control.stdout.split()) == files == {"/etc/sysctl.d/80-wrcd.conf"}


@NEEDS_DPKG
def test_same_tree_gives_the_same_bytes(package: Path, tmp_path: Path) -> None:
    again = build(tmp_path, 0o077)
    assert hashlib.sha256(again.read_bytes()).digest() == hashlib.sha256(package.read_bytes()).digest()
