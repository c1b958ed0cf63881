"""Columns in a temporary file: the same values as in memory, and memory that is given back."""

from __future__ import annotations

import resource
from pathlib import Path

import numpy as np
import pytest

from config import column_file
from config.arrays import lock, read_only, release
from config.column_file import ColumnFile, each_column, has_few_values, selected_rows
from config.errors import ConfigError

ROWS = 200_000


@pytest.fixture(autouse=True, params=[0, column_file.MEMORY_BYTES])
def memory_bytes(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> int:
    """Keep all tables in files, or small ones in memory."""
    most: int = request.param
    monkeypatch.setattr(column_file, "MEMORY_BYTES", most)
    return most


def resident_bytes() -> int:
    """Return the resident memory of this process [bytes]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def table_of(columns: int) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Return a table of consecutive numbers that was appended in blocks of different lengths."""
    file = ColumnFile(columns, ROWS)
    numbers = np.arange(ROWS * columns, dtype=np.float64).reshape(ROWS, columns)
    for part in np.split(numbers, [0, 1, 7000]):
        file.append(part)
    table: np.ndarray[tuple[int, int], np.dtype[np.float64]] = file.table()
    return table


def test_a_table_has_the_appended_values_in_contiguous_columns():
    table = table_of(3)
    assert np.array_equal(table, np.arange(3.0 * ROWS).reshape(ROWS, 3))
    assert table[:, 1].flags.c_contiguous


def test_selected_rows_are_those_of_the_mask():
    table, mask = table_of(2), np.arange(ROWS) % 3 == 1
    assert np.array_equal(selected_rows(table, mask), table[mask])
    assert np.array_equal(selected_rows(table[:, 0], mask), table[mask, 0])
    assert selected_rows(np.empty((0, 2)), np.empty(0, dtype=np.bool_)).shape == (0, 2)


def test_a_released_table_keeps_changed_values_but_no_memory():
    table = table_of(8)
    table[:] = 1.0
    held = resident_bytes()
    release(table)
    assert held - resident_bytes() > 0.9 * table.nbytes
    assert (table == 1.0).all()


def test_each_column_occupies_the_memory_of_one_column():
    table = table_of(8)
    before = resident_bytes()
    most = max(float(column.sum()) * 0.0 + resident_bytes() for column in each_column(table))
    assert most - before < 2.0 * table.nbytes / 8


def test_a_locked_table_is_frozen_without_a_copy():
    table = lock(table_of(2))
    frozen = read_only("table", table, float, (ROWS, 2), ConfigError)
    assert np.shares_memory(frozen, table)


def test_more_rows_than_announced_are_refused():
    file = ColumnFile(1, 1)
    with pytest.raises(IndexError):
        file.append(np.zeros((2, 1)))


@pytest.mark.parametrize("few", [1, 2, 3, 4])
def test_few_values_are_counted_over_the_whole_column(few: int):
    column = np.zeros(ROWS)
    column[-1], column[0] = 1.0, 2.0
    assert has_few_values(column, few) is (few > 3)
