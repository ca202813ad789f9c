"""`wrcd kit` writes its files whole, the same from the same input, and overwrites nothing that is another's."""

import hashlib
import re
import resource
import shlex
import sys
from pathlib import Path

import pytest

from tests.support.kit.trains import odd_train
from tests.support.pages import ROOT
from wrcd import __version__, resources
from wrcd.cli.main import main
from wrcd.errors import InputError, InputErrors
from wrcd.kit.write_kit import FILES, kit


def contents(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def test_kit_writes_every_file_with_version_and_checksum_of_the_dbc_in_its_head(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["kit", "-o", str(tmp_path / "a" / "b")]) == 0
    written = contents(tmp_path / "a" / "b")
    assert set(written) == set(FILES)
    checksum = hashlib.sha256(resources.DBC.read_bytes()).hexdigest()
    for name, content in written.items():
        head = content.decode().splitlines()[0]
        assert f"written by wrcd kit {__version__}; configuration: {checksum};" in head, name
        assert b"\r" not in content
        assert not re.search(rb"@[A-Z_]+@", content), name
    assert f'#define ADHESION_CONFIGURATION "{checksum}"' in written["adhesion.h"].decode()
    said = capsys.readouterr()
    assert "Adhesion_A1, Adhesion_A2, Adhesion_A3, Adhesion_A4" in said.out
    assert said.err == ""


def test_checksum_of_a_configuration_is_of_the_toml_and_the_dbc(tmp_path: Path) -> None:
    config = odd_train(tmp_path)
    kit(tmp_path / "kit", config, False)
    both = config.read_bytes() + (tmp_path / "odd.dbc").read_bytes()
    assert hashlib.sha256(both).hexdigest() in (tmp_path / "kit/adhesion.c").read_text()


def test_kit_is_written_over_its_own_files_and_the_same_input_gives_the_same_bytes(tmp_path: Path) -> None:
    kit(tmp_path / "a", None, False)
    for name in ("a", "b"):
        kit(tmp_path / name, ROOT / "examples/own-dbc/train.toml", False)
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


def test_edited_file_stops_the_kit_before_anything_is_written(tmp_path: Path) -> None:
    kit(tmp_path, None, False)
    edited = tmp_path / "adhesion.c"
    edited.write_text(edited.read_text().replace("5U, false}", "9U, true}"))
    before = contents(tmp_path)
    with pytest.raises(InputError, match=r"adhesion\.c: .*--force"):
        kit(tmp_path, ROOT / "examples/own-dbc/train.toml", False)
    assert contents(tmp_path) == before
    kit(tmp_path, None, True)
    assert "9U, true}" not in edited.read_text()


def test_files_of_others_are_named_and_kept(tmp_path: Path) -> None:
    (tmp_path / "Makefile").write_text("all:\n")
    (tmp_path / "README.md").write_text("Mine\n")
    with pytest.raises(InputErrors) as stopped:
        kit(tmp_path, None, False)
    assert [str(e.file) for e in stopped.value.errors] == [str(tmp_path / "Makefile"), str(tmp_path / "README.md")]
    assert set(contents(tmp_path)) == {"Makefile", "README.md"}


def test_file_in_the_place_of_the_folder_or_folder_in_the_place_of_a_file_is_bad_input(tmp_path: Path) -> None:
    (tmp_path / "kit").write_text("")
    with pytest.raises(InputError, match="-o:"):
        kit(tmp_path / "kit", None, False)
    (tmp_path / "fields.md").mkdir()
    with pytest.raises(InputError, match=r"fields\.md:"):
        kit(tmp_path, None, True)


@pytest.mark.parametrize("has_old", [False, True])
def test_disk_that_is_full_leaves_the_folder_as_it_was(
    tmp_path: Path, has_old: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # half a module would break later programs
    if has_old:
        kit(tmp_path, ROOT / "examples/own-dbc/train.toml", False)
    before = contents(tmp_path)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (15_000, hard))  # adhesion.h fits, adhesion.c does not
    try:
        with pytest.raises(InputError, match=r"adhesion\.c:"):
            kit(tmp_path, None, False)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert contents(tmp_path) == before


def test_command_that_is_told_can_be_pasted_whatever_the_folder_is_called(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "odd dir" / "ü $x"
    kit(folder, None, False)
    command = shlex.split(capsys.readouterr().out.partition("; ")[2])
    assert command == ["make", "-C", str(folder), "tests", "it"]


def test_what_a_receiver_cannot_do_is_said_on_standard_error_and_in_the_readme(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kit(tmp_path / "kit", odd_train(tmp_path), False)
    said = capsys.readouterr().err.splitlines()
    for line, lacks in zip(said, ("E2E", "SampleAge"), strict=True):
        assert "Odd_A2" in line
        assert lacks in line
        assert line.removeprefix("warning: ") in (tmp_path / "kit/README.md").read_text()


def test_fields_say_layout_scale_words_and_times_of_a_message(tmp_path: Path) -> None:
    kit(tmp_path / "kit", odd_train(tmp_path), False)
    page = (tmp_path / "kit/fields.md").read_text()
    for row in (
        "| 0x19000001 | 29 bits | 8 | 40 ms | 90 ms | 0x1234 |",
        "| 0x2A1 | 11 bits | 5 | 50 ms | 150 ms | none: not protected |",
        "| Mu | MuAvailable | 18, 13 | Motorola | unsigned | 0.0125, -2 | 0 … 100 % (raw 160 … 8160) "
        "| 8191 not available; beyond the range: none |",
        "| Mu | MuAvailable | 5, 14 | Intel | signed | 0.0001220703125, 0 | 0 … 99.98779296875 % (raw 0 … 8191) "
        "| -8192 not available, 5000 being calibrated; beyond the range: none |",
        "| Zustand | Validity | 15, 4 | Motorola | unsigned | 1, 0 |  | 3 Error (“gestoert”), 7 Valid (“gut”), "
        "9 Degraded (“maessig”), 14 NotAvailable (“nichts”); any other: fall back |",
        "| Within5pp | 5 | `ADHESION_LIMIT_FOLLOW` | MuAvailable less 5, at least 0 |",
        "| Within8pp | 8 | `ADHESION_LIMIT_ABOVE`: only a demand above it | MuAvailable less 8, at least 0 |",
    ):
        assert row in page
