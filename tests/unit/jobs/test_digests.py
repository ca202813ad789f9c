"""What is another question: other contents, other code, other libraries."""

from pathlib import Path

import pytest

from sim_ecu.jobs import digests
from sim_ecu.jobs.digests import code, digest, key_of
from wrcd.errors import InputError


@pytest.mark.parametrize(("file", "other"), [("late.py", True), ("c/lane.c", True), ("d.json", True), ("a.md", False)])
def test_edit_of_sources_or_data_is_other_code_and_of_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, file: str, other: bool
) -> None:
    (tmp_path / "wrcd/c").mkdir(parents=True)
    for name in ("late.py", "c/lane.c", "d.json", "a.md"):
        (tmp_path / "wrcd" / name).write_text("")
    monkeypatch.setattr(digests, "ROOT", tmp_path)
    before = code.__wrapped__()
    (tmp_path / "wrcd" / file).write_text("# edited\n")
    assert (code.__wrapped__() != before) is other


def test_other_library_is_other_code(monkeypatch: pytest.MonkeyPatch) -> None:
    before = code.__wrapped__()
    monkeypatch.setattr(digests, "version", lambda name: f"{name} 0")
    assert code.__wrapped__() != before


def test_key_is_of_every_input_and_not_of_their_order() -> None:
    question = {"inputs": {"a": 1, "b": 2.5}, "files": {"x": "1", "y": "2"}}
    assert key_of(question) == key_of({"files": {"y": "2", "x": "1"}, "inputs": {"b": 2.5, "a": 1}})
    others = [question | {"inputs": {"a": 1, "b": 2.6}}, question | {"files": {"x": "2", "y": "1"}}]
    assert len({key_of(q) for q in (question, *others)}) == 3


def test_digest_is_of_contents_and_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    one, other = tmp_path / "one", tmp_path / "other"
    one.write_text("a")
    other.write_text("a")
    assert digest(one) == digest(other)
    other.write_text("ab")
    assert digest(one) != digest(other)
    with pytest.raises(InputError, match="never"):
        digest(tmp_path / "never")
