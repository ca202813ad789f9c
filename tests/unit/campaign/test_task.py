"""A job on a worker: answered with the code and the files that it was asked of, or refused."""

from pathlib import Path

import numpy as np
import pytest

from sim_ecu.campaign import job
from sim_ecu.campaign.job import Job, code, contents, versions
from sim_ecu.campaign.task import Refusal, Task, answer, plain_error
from tests.support.trial_kind import figures

JOB = Job("trial", {"x": 1.0, "seed": 2})


def refusal(task: Task) -> str:
    found = answer(task)
    assert isinstance(found, Refusal)
    return found.text


def test_job_is_answered() -> None:
    assert answer(Task(figures, JOB, {}, code())) == {"sum": 3.0, "letters": 0, "even": True}


def test_job_of_other_code_is_refused() -> None:
    assert "the sources of wrcd on " in refusal(Task(figures, JOB, {}, "other"))


def test_other_libraries_are_other_code(monkeypatch: pytest.MonkeyPatch) -> None:
    assert versions()["numpy"] == np.__version__
    here = code()
    assert code.__wrapped__() == here
    monkeypatch.setattr(job, "LIBRARIES", (*job.LIBRARIES, "a-library-that-nobody-has"))
    assert versions()["a-library-that-nobody-has"] == ""
    assert code.__wrapped__() != here


def test_job_whose_file_is_another_or_not_there_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "a.txt"
    file.write_text("one")
    task = Task(figures, JOB, {str(file): contents(file)}, code())
    assert isinstance(answer(task), dict)
    file.write_text("another")
    assert "is not as it was here when the campaign began" in refusal(task)
    file.unlink()
    assert "cannot be read: No such file or directory" in refusal(task)


def test_errors_text_does_not_depend_on_place_or_memory() -> None:
    text = "/home/me/c/own/a.toml: <object at 0x7f24fe9a6340>, 0x1F"
    assert plain_error(text, "/home/me/c") == "own/a.toml: <object at 0x…>, 0x1F"
