"""Columns of the monitor: they grow, and forget the oldest."""

import numpy as np
import pytest

from wrcd.tools.monitor.table import Table


@pytest.mark.parametrize("rows_at_once", [1, 7, 400])
def test_table_beyond_its_limit_keeps_the_newest_rows(rows_at_once: int) -> None:
    table = Table({"a": (np.int64, 0), "b": (np.float32, 2)}, 1000)
    for first in range(0, 5000, rows_at_once):
        a = np.arange(first, first + rows_at_once)
        table.append(a=a, b=np.stack([a, 2 * a], axis=1))
    end = -(-5000 // rows_at_once) * rows_at_once
    assert len(table) == 1000
    assert table["a"].tolist() == list(range(end - 1000, end))
    assert (table["b"][:, 1] == 2 * table["a"]).all()


def test_table_given_more_than_its_limit_at_once_keeps_the_newest() -> None:
    table = Table({"a": (np.int64, 0)}, 10)
    table.append(a=np.arange(25))
    assert table["a"].tolist() == list(range(15, 25))


def test_empty_rows_change_nothing() -> None:
    table = Table({"a": (np.int64, 0)}, 10)
    table.append(a=np.arange(3))
    table.append(a=np.arange(0))
    assert table["a"].tolist() == [0, 1, 2]
