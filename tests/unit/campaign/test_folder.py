"""A campaign's folder: what is not its own is refused, and its results are the same bytes however they were made."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from sim_ecu.campaign import campaign_folder
from sim_ecu.campaign.campaign_folder import CampaignRequest, merge, opened_store
from sim_ecu.campaign.kind import Kind, Type
from sim_ecu.jobs.job import Ending, Job, JobRow
from tests.support.trial_kind import TRIAL
from wrcd.errors import InputError

ASKED = CampaignRequest("Title", TRIAL, {"x": Type.NUMBER, "seed": Type.WHOLE}, "code")
JOBS = [Job("trial", {"x": 1.0, "seed": seed}) for seed in range(7)]
KEYS = [job.key("code") for job in JOBS]


def row(job: Job, total: float = 1.0) -> JobRow:
    return JobRow(job.key("code"), Ending.DONE, {"sum": total, "letters": None, "even": True}, seconds=0.1)


@pytest.fixture
def there(tmp_path: Path) -> Path:
    """A folder with one row."""
    with opened_store(tmp_path, ASKED, KEYS) as store:
        store.add(row(JOBS[0]))
    return tmp_path


def test_merged_result_does_not_depend_on_order_or_goes(tmp_path: Path) -> None:
    found = []
    for name, parts in (("a", [range(7)]), ("b", [(6, 1, 4), (0, 2), (5, 3)])):
        for part in parts:
            with opened_store(tmp_path / name, ASKED, KEYS) as store:
                for k in part:
                    store.add(row(JOBS[k], k or math.nan))
        with opened_store(tmp_path / name, ASKED, KEYS) as store:
            found.append(merge(tmp_path / name, ASKED, [(j, store.rows[k]) for j, k in zip(JOBS, KEYS, strict=True)]))
    assert found[0].read_bytes() == found[1].read_bytes()
    table = pq.read_table(found[0])
    assert table.column_names == ["key", "x", "seed", "ending", "error", "sum", "letters", "even"]
    assert table["seed"].to_pylist() == list(range(7))
    assert table["letters"].null_count == 7


@pytest.mark.parametrize(
    ("asked", "keys", "words"),
    [
        (replace(ASKED, code="other"), KEYS, "holds rows of another version of the code"),
        (
            replace(ASKED, kind=Kind("else", "", (), (), TRIAL.function)),
            KEYS,
            "holds a campaign of another kind: trial",
        ),
        (replace(ASKED, title="Other"), ["never"], "holds another campaign: 'Title', with 1 rows"),
    ],
)
def test_folder_of_another_campaign_is_refused_and_stays(
    there: Path, asked: CampaignRequest, keys: list[str], words: str
) -> None:
    with pytest.raises(InputError, match=words), opened_store(there, asked, keys):
        pass
    with opened_store(there, ASKED, ["never"]) as store:
        assert list(store.rows) == KEYS[:1]


def test_other_title_with_a_common_job_goes_on(there: Path) -> None:
    with opened_store(there, replace(ASKED, title="Other"), ["never", KEYS[0]]) as store:
        assert len(store.rows) == 1


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        (campaign_folder.ROWS, "no" * 1000, "rows.sqlite: cannot be used"),
        (campaign_folder.CAMPAIGN, "{", "campaign.json: cannot be read"),
        (campaign_folder.CAMPAIGN, "[]", "campaign.json: describes no campaign"),
        (campaign_folder.CAMPAIGN, '{"format": "wrcd-campaign/1"}', "holds a campaign of an earlier version"),
    ],
)
def test_file_that_cannot_be_used_is_named(there: Path, name: str, text: str, words: str) -> None:
    (there / name).write_text(text)
    with pytest.raises(InputError) as e, opened_store(there, ASKED, KEYS):
        pass
    assert words in str(e.value)
    assert "another folder" in e.value.hint


def test_folder_with_something_else_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    for place, words in ((tmp_path, "is no campaign's folder, and not empty"),
                         (tmp_path / "mine.txt" / "x", "cannot be written")):  # fmt: skip
        with pytest.raises(InputError, match=words), opened_store(place, ASKED, KEYS):
            pass


def test_folder_of_a_process_that_was_killed_at_its_begin_is_one(there: Path) -> None:
    (there / campaign_folder.CAMPAIGN).rename(there / "campaign.new")  # as if it had not taken its place
    with opened_store(there, ASKED, KEYS):
        assert (there / campaign_folder.CAMPAIGN).exists()


def test_description_says_columns_and_figures(there: Path) -> None:
    found = json.loads((there / campaign_folder.CAMPAIGN).read_text())
    assert found["inputs"] == {"x": "number", "seed": "whole"}
    assert found["figures"][0] == {
        "name": "sum", "words": "x and seed", "unit": "m", "better": "less", "type": "number",
    }  # fmt: skip
    assert {k: found[k] for k in ("format", "title", "kind", "suite", "code")} == {
        "format": "wrcd-campaign/2", "title": "Title", "kind": "trial", "suite": "mode", "code": "code",
    }  # fmt: skip
