"""A campaign's folder: what is not its own is refused, and every row is in one part, whatever happens."""

import json
import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow.parquet as pq
import pytest

from sim_ecu.campaign import row_folder
from sim_ecu.campaign.definition import Campaign, jobs_of
from sim_ecu.campaign.kind import Job
from sim_ecu.campaign.row_folder import CAMPAIGN, ROWS, opened
from sim_ecu.jobs.pool import Stopped
from sim_ecu.reporting.result_files import save
from tests.support.trial_kind import TRIAL
from wrcd.errors import InputError

COLUMNS = {"x": float, "seed": int}


def campaign(*seeds: int, **other: Any) -> Campaign:
    jobs = list(jobs_of(TRIAL, {"x": 1.0}, Path("/"), seeds))
    return replace(Campaign("Title", TRIAL, COLUMNS, jobs, Path("/"), 1.0), **other)


ASKED = campaign(*range(7))


def row(job: Job, total: float = 1.0, ending: str = "done") -> Mapping[str, Any]:
    return {"key": job.key, **job.inputs, "ending": ending, "error": "", "sum": total, "even": True}


@pytest.fixture
def there(tmp_path: Path) -> Path:
    """A folder with the first two rows."""
    folder = tmp_path / "there"
    with opened(folder, ASKED) as rows:
        for job in ASKED.jobs[:2]:
            rows.add(row(job))
    return folder


def test_rows_have_the_campaigns_order_whatever_order_and_parts_they_came_in(there: Path) -> None:
    with opened(there, ASKED) as rows:
        for k in (6, 2, 4, 3, 5):
            rows.add(row(ASKED.jobs[k], math.nan if k == 3 else k + 0.1))
        found = rows.table()
    assert found["key"].tolist() == [job.key for job in ASKED.jobs]
    assert found["sum"].isna().tolist() == [False, False, False, True, False, False, False]
    assert found["sum"].tolist()[4:] == [4.1, 5.1, 6.1]
    assert list(found.columns) == ["key", "x", "seed", "ending", "error", "sum", "letters", "even"]
    assert found["letters"].isna().all()  # nobody gave it


def test_user_reads_the_folder_as_one_table_while_a_part_is_written(there: Path) -> None:
    (there / ROWS / ".part-000003.parquet.new").write_text("half of one")
    assert sorted(pd.read_parquet(there / ROWS)["seed"]) == [0, 1]


def test_parts_are_few_for_many_rows_and_a_kill_costs_a_fiftieth(tmp_path: Path) -> None:
    many = campaign(*range(2000))
    with opened(tmp_path, many) as rows:
        for done, job in enumerate(many.jobs, 1):
            rows.add(row(job))
            if done % 500 == 0:
                assert len(pd.read_parquet(tmp_path / ROWS)) >= 0.98 * done
    assert len(list((tmp_path / ROWS).iterdir())) < 300
    assert len(pd.read_parquet(tmp_path / ROWS)) == 2000


def test_slow_rows_are_written_after_a_while(there: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(row_folder, "PART", 1.0)
    with opened(there, ASKED) as rows:
        rows.add(row(ASKED.jobs[2]))
        assert len(pd.read_parquet(there / ROWS)) == 2
        monkeypatch.setattr(row_folder, "PART_S", 0.0)
        rows.add(row(ASKED.jobs[3]))
        assert len(pd.read_parquet(there / ROWS)) == 4


def test_ctrl_c_as_a_part_is_written_writes_no_row_twice(there: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def end(file: Path, write: Callable[[Path], object]) -> None:
        save(file, write)
        raise KeyboardInterrupt

    with suppress(KeyboardInterrupt), opened(there, ASKED) as rows:
        monkeypatch.setattr(row_folder, "save", end)
        rows.add(row(ASKED.jobs[2]))
    assert sorted(pd.read_parquet(there / ROWS)["seed"]) == [0, 1, 2]


def test_part_with_its_columns_in_another_order_is_read(there: Path) -> None:
    part = there / ROWS / "part-000001.parquet"
    found = pq.read_table(part)
    pq.write_table(found.select(found.column_names[::-1]), part)
    with opened(there, ASKED) as rows:
        assert rows.table()["seed"].tolist() == [0, 1]


def test_what_is_no_part_of_its_own_stands_beside(there: Path) -> None:
    (there / ROWS / "part-mine.parquet").write_text("")
    with opened(there, ASKED) as rows:
        rows.add(row(ASKED.jobs[2]))
        rows.write()
        assert len(rows.table()) == 3


def test_folder_is_of_one_process_at_a_time(there: Path) -> None:
    with opened(there, ASKED), pytest.raises(InputError, match="another process is at work"), opened(there, ASKED):
        pass


def test_row_that_is_dropped_may_come_again_and_is_there_once(there: Path) -> None:
    first, second = ASKED.jobs[:2]
    with opened(there, ASKED) as rows:
        rows.drop({second.key})
        assert rows.endings == {first.key: "done"}
        rows.add(row(second, 9.0))
    assert sorted(pd.read_parquet(there / ROWS)["sum"]) == [1.0, 9.0]


def test_campaign_may_grow_under_another_title(there: Path) -> None:
    with opened(there, campaign(*range(9), title="More")) as rows:
        assert len(rows.endings) == 2
    assert json.loads((there / CAMPAIGN).read_text())["title"] == "More"


def test_campaign_that_does_not_ask_for_a_row_is_refused_and_changes_nothing(there: Path) -> None:
    before = (there / CAMPAIGN).read_bytes()
    with pytest.raises(InputError, match="1 of its rows are not asked for"), opened(there, campaign(1, 2, title="B")):
        pass
    assert (there / CAMPAIGN).read_bytes() == before
    assert len(pd.read_parquet(there / ROWS)) == 2


def test_rows_that_are_not_asked_for_go_where_that_is_wanted(there: Path) -> None:
    with opened(there, campaign(1, 2, drops=True)) as rows:
        assert list(rows.endings) == [ASKED.jobs[1].key]
    assert pd.read_parquet(there / ROWS)["seed"].tolist() == [1]


@pytest.mark.parametrize(
    ("change", "word"),
    [({"kind": replace(TRIAL, name="other")}, "kind"), ({"columns": {**COLUMNS, "level": int}}, "inputs"),
     ({"kind": replace(TRIAL, figures={"sum": float})}, "figures")],
)  # fmt: skip
def test_folder_of_another_definition_is_refused(there: Path, change: dict[str, Any], word: str) -> None:
    with (
        pytest.raises(InputError, match=f"there: holds another campaign, of another {word}"),
        opened(there, replace(ASKED, **change)),
    ):
        pass


def test_folder_of_other_code_is_refused(there: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(row_folder, "code", lambda: "other")
    with pytest.raises(InputError, match="there: holds another campaign, of another code"), opened(there, ASKED):
        pass


@pytest.mark.parametrize("name", ["rows.sqlite", "journal.jsonl", "results.parquet"])
def test_folder_of_an_earlier_version_is_refused_and_left_as_it_is(tmp_path: Path, name: str) -> None:
    for file in (name, CAMPAIGN):
        (tmp_path / file).write_text("{}")
    with pytest.raises(InputError, match=name), opened(tmp_path, ASKED):
        pass
    assert {f.name for f in tmp_path.iterdir()} == {name, CAMPAIGN}


@pytest.mark.parametrize("name", ["thesis.tex", "rows.parquet"])
def test_folder_of_something_else_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("")
    with pytest.raises(InputError, match="is no campaign's folder"), opened(tmp_path, ASKED):
        pass
    assert [f.name for f in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize("text", ["{", "[]", ""])
def test_damaged_description_is_refused(there: Path, text: str) -> None:
    (there / CAMPAIGN).write_text(text)
    with pytest.raises(InputError, match=r"campaign\.json: cannot be read"), opened(there, ASKED):
        pass


def test_damaged_part_is_named(there: Path) -> None:
    (there / ROWS / "part-000001.parquet").write_text("half")
    with pytest.raises(InputError, match=r"part-000001\.parquet: cannot be read"), opened(there, ASKED):
        pass


def test_row_that_cannot_be_written_stops_it_and_is_not_there(there: Path) -> None:
    (there / ROWS / ".part-000003.parquet.new").mkdir()
    with pytest.raises(Stopped, match="cannot be written"), opened(there, ASKED) as rows:
        rows.add(row(ASKED.jobs[2]))
    (there / ROWS / ".part-000003.parquet.new").rmdir()
    with opened(there, ASKED) as rows:
        assert len(rows.endings) == 2
