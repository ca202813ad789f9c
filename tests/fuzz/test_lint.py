"""Whatever a DBC says, lint finds something or nothing, or refuses it by an InputError; what init writes is TOML."""

import contextlib
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.fuzz.strategies import mutated
from wrcd import resources
from wrcd.dbc.dbc_lines import read
from wrcd.dbc.init.propose import propose
from wrcd.dbc.lint.lint_file import as_records, findings, lines
from wrcd.errors import InputError
from wrcd.estimator.design import load_design

DATA = Path(__file__).parents[1] / "data" / "dbc"
DESIGN = load_design(resources.DESIGN)
TEXTS = (
    (DATA / "sound.dbc").read_text(encoding="ascii"),
    (DATA / "third-party.dbc").read_text(encoding="cp1252"),
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("lint")


@given(st.sampled_from(TEXTS).flatmap(mutated))
def test_lint_and_init_of_a_mutated_dbc_work_or_say_why(folder: Path, text: str) -> None:
    file = folder / "train.dbc"
    file.write_text(text, encoding="utf-8", newline="")
    last = text.count("\n") + text.count("\r") + 1
    with contextlib.suppress(InputError):
        found = findings(file, DESIGN)
        assert all(1 <= f.line <= last for f in found)
        assert len(lines(file, found)) > len(found)
        assert as_records(file, found)["file"] == str(file)
    with contextlib.suppress(InputError):
        tomllib.loads(propose(read(file), folder, DESIGN).text())
