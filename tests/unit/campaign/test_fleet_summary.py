"""Rows of logs to trains, suspicious sensors, and the page of them."""

import re
from typing import Any

import pytest

from sim_ecu.campaign.fleet.fleet_page import page, tables
from sim_ecu.campaign.fleet.summary import Summary, summary
from tests.support.fleet import broken, job, row


def fleet(*named: tuple[str, str, Any]) -> Summary:
    """Logs by train, name and row."""
    return summary("Logs of a fleet", [(job(train, name), r) for train, name, r in named])


def test_train_is_weighed_by_the_time_of_its_logs_and_the_broken_are_named() -> None:
    found = fleet(("7402", "a", row()), ("7401", "b", row(valid=0.5)), ("7401", "broken.log", broken()))
    assert [(g.name, len(g.logs)) for g in found.trains] == [("7401", 2), ("7402", 1)]
    assert found.every.share("valid") == pytest.approx(0.65)
    assert found.every.sum("km") == pytest.approx(4.0)
    assert found.trains[0].by_axle() == {1: pytest.approx(0.5), 2: pytest.approx(0.5)}
    assert [p.name for p in found.failed] == ["7401/broken.log"]


def test_logs_of_a_train_are_in_the_order_of_their_time_and_those_without_one_last() -> None:
    found = fleet(
        ("7401", "a", row(begin_s=0.5)), ("7401", "b", row(begin_s=1.79e9)), ("7401", "c", row(begin_s=1.78e9))
    )
    assert [p.name for p in found.trains[0].logs] == ["7401/c", "7401/b", "7401/a"]


def test_sensor_of_several_logs_is_one_suspicion() -> None:
    found = fleet(
        ("7401", "a", row(suspects=(("GyroDead", 2, 5.0),))),
        ("7401", "b", row(suspects=(("GyroDead", 2, 50.0), ("AccelSmall", 1, 60.0)))),
        ("7402", "c", row(suspects=(("GyroDead", 2, 1.0),))),
    )
    assert [(s.train, s.axle, s.what, s.seconds, len(s.logs)) for s in found.suspicions] == [
        ("7401", 1, "AccelSmall", 60.0, 1), ("7401", 2, "GyroDead", 55.0, 2), ("7402", 2, "GyroDead", 1.0, 1),
    ]  # fmt: skip


def test_suspicion_begins_where_its_first_log_says() -> None:
    named = (("GyroDead", 2, 5.0),)
    found = fleet(
        ("7401", "a", row(suspects=named, begin_s=1.79e9)), ("7401", "b", row(suspects=named, begin_s=1.78e9))
    )
    (one,) = found.suspicions
    assert one.first_s == 1.78e9 + 1.0
    assert "2026-05-28 20:26" in page(found, "/logs", {})


def test_axle_that_only_some_logs_have_is_suspicious_one_that_none_has_is_not() -> None:
    found = fleet(("7401", "a", row(without_frame=(3, 4))), ("7401", "b", row(without_frame=(4,))))
    assert [(s.what, s.axle, len(s.logs)) for s in found.suspicions] == [("NoFrame", 3, 1)]
    assert "No log of 7401 has a frame of axle 4" in "\n".join(tables(found))


def test_page_of_no_readable_log_is_a_page() -> None:
    text = page(fleet(("7401", "broken.log", broken())), "/logs", {})
    assert "none could be judged" in text
    assert "None was named" in text


def test_names_and_errors_are_text_in_the_page() -> None:
    text = page(
        fleet(("<b>", "a&b.log", row()), ("<b>", "broken.log", broken())), "/logs", {"<b>/a&b.log": "r/#1.html"}
    )
    assert "<b>/" not in text
    assert "&lt;b&gt;/a&amp;b.log" in text
    assert 'href="r/%231.html"' in text


def test_log_has_a_column_for_each_kilometre_until_they_are_too_narrow() -> None:
    for steps, words in ((20, "1 km"), (480, "10 km")):
        (label,) = re.findall('="a column for each ([^,]+),', page(fleet(("7401", "a", row(steps=steps))), "/", {}))
        assert label == words
