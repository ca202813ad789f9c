"""A campaign's folder: what is finished stays, and what is not its own is refused."""

import fcntl
import json
import math
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from sim_ecu.campaign import store
from sim_ecu.campaign.job import Ending, Job, Row
from sim_ecu.campaign.kind import Kind, Type
from sim_ecu.campaign.store import Asked, Store
from tests.support.trial_kind import TRIAL
from wrcd.errors import InputError

ASKED = Asked("Title", TRIAL, {"x": Type.NUMBER, "seed": Type.WHOLE}, "code")
JOBS = [Job("trial", {"x": 1.0, "seed": seed}) for seed in range(7)]


def row(job: Job, total: float = 1.0) -> Row:
    return Row(job.key("code"), Ending.DONE, {"sum": total, "letters": None, "even": True}, seconds=0.1)


def merged(folder: Path) -> bytes:
    return (folder / store.RESULTS).read_bytes()


def test_merged_result_does_not_depend_on_order_or_batches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with Store(tmp_path / "a", ASKED) as one:
        for k, job in enumerate(JOBS):
            one.add(row(job, k or math.nan))
        one.merge(JOBS)
    monkeypatch.setattr(store, "BATCH", 2)
    for part in ((6, 1, 4), (0, 2), (5, 3)):
        with Store(tmp_path / "b", ASKED) as other:
            for k in part:
                other.add(row(JOBS[k], k or math.nan))
    with Store(tmp_path / "b", ASKED) as other:
        assert len(other.rows) == 7
        other.merge(JOBS)
    assert merged(tmp_path / "a") == merged(tmp_path / "b")
    table = pq.read_table(tmp_path / "a" / store.RESULTS)
    assert table.column_names == ["key", "x", "seed", "ending", "error", "sum", "letters", "even"]
    assert table["seed"].to_pylist() == list(range(7))
    assert table["letters"].null_count == 7


def test_row_that_is_torn_is_not_there_and_the_others_are(tmp_path: Path) -> None:
    with Store(tmp_path, ASKED) as one:
        for job in JOBS[:3]:
            one.add(row(job))
    journal = tmp_path / store.JOURNAL
    journal.write_bytes(journal.read_bytes()[:-5])
    with Store(tmp_path, ASKED) as one:
        assert list(one.rows) == [job.key("code") for job in JOBS[:2]]
        one.add(row(JOBS[2]))
    with Store(tmp_path, ASKED) as one:
        assert len(one.rows) == 3


def test_process_that_ends_between_batch_and_journal_has_each_row_once(tmp_path: Path) -> None:
    with Store(tmp_path, ASKED) as one:
        for job in JOBS[:3]:
            one.add(row(job))
        lines = (tmp_path / store.JOURNAL).read_bytes()
        one.merge(JOBS)
    before = merged(tmp_path)
    (tmp_path / store.JOURNAL).write_bytes(lines)  # as if it had not been emptied
    with Store(tmp_path, ASKED) as one:
        one.merge(JOBS)
    assert merged(tmp_path) == before


def test_row_that_is_made_again_takes_the_place_of_the_old_one(tmp_path: Path) -> None:
    key = JOBS[0].key("code")
    with Store(tmp_path, ASKED) as one:
        one.add(Row(key, Ending.FAILED, error="no"))
        one.merge(JOBS)
        one.forget([key])
        assert key not in one.rows
        one.add(row(JOBS[0]))
    with Store(tmp_path, ASKED) as one:
        assert one.rows[key].ending is Ending.DONE


def test_folder_is_of_one_process_at_a_time(tmp_path: Path) -> None:
    with (
        Store(tmp_path, ASKED),
        pytest.raises(InputError, match="another campaign is at work in it"),
        Store(tmp_path, ASKED),
    ):
        pass
    with (tmp_path / store.LOCK).open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)  # it is free again


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (replace(ASKED, code="other"), "holds rows of another version of the code"),
        (replace(ASKED, kind=Kind("else", "", (), (), TRIAL.function)), "holds a campaign of another kind: trial"),
    ],
)
def test_folder_of_another_campaign_is_refused(tmp_path: Path, asked: Asked, words: str) -> None:
    with Store(tmp_path, ASKED) as one:
        one.add(row(JOBS[0]))
    with pytest.raises(InputError, match=words), Store(tmp_path, asked):
        pass
    with Store(tmp_path, ASKED) as one:
        assert len(one.rows) == 1


def test_other_title_without_a_common_job_is_refused(tmp_path: Path) -> None:
    with Store(tmp_path, ASKED) as one:
        one.add(row(JOBS[0]))
    other = replace(ASKED, title="Other")
    with Store(tmp_path, other) as one:
        with pytest.raises(InputError, match="holds another campaign: 'Title', with 1 rows"):
            one.claim(["never"])
        one.claim(["never", JOBS[0].key("code")])
    with Store(tmp_path, ASKED) as one:
        one.claim(["never"])


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        (store.JOURNAL, '{"key": "a"}\n', "journal.jsonl:1: is no row"),
        (store.JOURNAL, "\n", "journal.jsonl:1: is no row"),
        (f"{store.BATCHES}/000001.parquet", "no", "000001.parquet: cannot be read"),
        (store.CAMPAIGN, "{", "campaign.json: cannot be read"),
        (store.CAMPAIGN, "[]", "campaign.json: describes no campaign"),
    ],
)
def test_damaged_file_is_named(tmp_path: Path, name: str, text: str, words: str) -> None:
    with Store(tmp_path, ASKED):
        pass
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError) as e, Store(tmp_path, ASKED):
        pass
    assert words in str(e.value)


def test_folder_with_something_else_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="is no campaign's folder, and not empty"), Store(tmp_path, ASKED):
        pass
    with pytest.raises(InputError, match="cannot be written"), Store(tmp_path / "mine.txt" / "x", ASKED):
        pass


def test_folder_of_a_process_that_was_killed_at_its_begin_is_one(tmp_path: Path) -> None:
    with Store(tmp_path, ASKED):
        pass
    (tmp_path / store.CAMPAIGN).rename(tmp_path / "campaign.new")  # as if it had not taken its place
    with Store(tmp_path, ASKED) as one:
        one.add(row(JOBS[0]))
    assert (tmp_path / store.CAMPAIGN).exists()


def test_copy_of_a_batch_is_none_and_a_table_of_something_else_is_refused(tmp_path: Path) -> None:
    with Store(tmp_path, ASKED) as one:
        one.add(row(JOBS[0]))
        one.merge(JOBS)
    first = tmp_path / store.BATCHES / "000001.parquet"
    first.with_name("copy.parquet").write_bytes(first.read_bytes())
    with Store(tmp_path, ASKED) as one:
        one.add(row(JOBS[1]))
        one.merge(JOBS)
        assert len(one.rows) == 2
    pq.write_table(pa.table({"x": [1.0]}), first)
    with pytest.raises(InputError, match=r"000001\.parquet: cannot be read: KeyError: 'key'"), Store(tmp_path, ASKED):
        pass


def test_description_says_columns_and_figures(tmp_path: Path) -> None:
    with Store(tmp_path, ASKED):
        pass
    found = json.loads((tmp_path / store.CAMPAIGN).read_text())
    assert found["inputs"] == {"x": "number", "seed": "whole"}
    assert found["figures"][0] == {
        "name": "sum",
        "words": "x and seed",
        "unit": "m",
        "better": "less",
        "type": "number",
    }
    assert {k: found[k] for k in ("format", "title", "kind", "suite", "code")} == {
        "format": "wrcd-campaign/1", "title": "Title", "kind": "trial", "suite": "mode", "code": "code",
    }  # fmt: skip
