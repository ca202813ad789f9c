"""A job on a worker: answered with the code and the files that it was asked of, or refused."""

from pathlib import Path

import numpy as np
import pytest

from sim_ecu.campaign.definition import KINDS
from sim_ecu.jobs import job
from sim_ecu.jobs.job import Job, Refusal, Task, answer, code, digest, plain_error, sources, versions
from tests.support.trial_kind import figures

JOB = Job("trial", {"x": 1.0, "seed": 2})
CODE = code(figures.__module__)


def refusal(task: Task) -> str:
    found = answer(task)
    assert isinstance(found, Refusal)
    return found.text


def test_job_is_answered_and_refused_where_it_is_of_other_code() -> None:
    assert answer(Task(figures, JOB, {}, CODE)) == {"sum": 3.0, "letters": 0, "even": True}
    assert "the sources of wrcd on " in refusal(Task(figures, JOB, {}, "other"))


def test_other_libraries_are_other_code(monkeypatch: pytest.MonkeyPatch) -> None:
    assert versions()["numpy"] == np.__version__
    assert code.__wrapped__(figures.__module__) == CODE
    monkeypatch.setattr(job, "LIBRARIES", (*job.LIBRARIES, "a-library-that-nobody-has"))
    assert versions()["a-library-that-nobody-has"] == ""
    assert code.__wrapped__(figures.__module__) != CODE


@pytest.mark.parametrize("kind", [k.name for k in KINDS])
def test_code_of_a_kind_is_what_it_plays_and_judges_and_no_page_or_other_kind(kind: str) -> None:
    (function,) = (k.function for k in KINDS if k.name == kind)
    found = sources(function.__module__)
    assert {function.__module__, "wrcd.core.core", "wrcd.estimator.paper.fuzzy", "wrcd.config", "wrcd"} <= set(found)
    assert not [m for m in found if m.startswith(("sim_ecu.cli", "sim_ecu.campaign.comparison"))]
    assert not [m for m in found if any(word in m for word in ("page", "style", "plots", "reporting.table"))]
    others = {k.function.__module__ for k in KINDS} - {function.__module__}
    assert others.isdisjoint(found)


@pytest.mark.parametrize(
    ("file", "other"), [("used.py", True), ("late.py", True), ("lone.py", False), ("d.json", True)]
)
def test_edit_of_what_is_imported_is_other_code_and_no_other_edit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, file: str, other: bool
) -> None:
    package = tmp_path / "wrcd"
    package.mkdir()
    texts = {"__init__": "", "asked": "from wrcd import used\n", "used": "def f():\n    import wrcd.late\n"}
    for name, text in (texts | {"late": "", "lone": ""}).items():
        (package / f"{name}.py").write_text(text)
    (package / "d.json").write_text("{}")
    monkeypatch.setattr(job, "ROOT", tmp_path)
    before = code.__wrapped__("wrcd.asked")
    (package / file).write_text("# edited\n")
    assert (code.__wrapped__("wrcd.asked") != before) is other


def test_job_whose_file_is_another_or_not_there_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "a.txt"
    file.write_text("one")
    task = Task(figures, JOB, {str(file): digest(file)}, CODE)
    assert isinstance(answer(task), dict)
    file.write_text("another")
    assert "is not as it was here when the campaign began" in refusal(task)
    file.unlink()
    assert "cannot be read: No such file or directory" in refusal(task)


def test_errors_text_does_not_depend_on_place_or_memory() -> None:
    text = "/home/me/c/own/a.toml: <object at 0x7f24fe9a6340>, 0x1F"
    assert plain_error(text, "/home/me/c") == "own/a.toml: <object at 0x…>, 0x1F"
