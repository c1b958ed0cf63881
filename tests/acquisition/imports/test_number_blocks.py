"""Blocks of plain lines are converted together; the result is the same as line by line."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.imports.number_blocks import NumberBlocks
from acquisition.imports.report import DamagedRow
from acquisition.imports.table import ImportTable
from acquisition.imports.tables import read_tables
from acquisition.maps.import_map import ImportMap

ROWS = 40
JOINTS = (
    {"joint": "a", "position": 1, "torque": 3},
    {"joint": "b", "position": 2, "torque": 4, "velocity": 5},
)


def import_map(**changes: Any) -> ImportMap:
    """Return a map of seven columns; the last one is not used."""
    content: dict[str, Any] = {
        "name": "table",
        "robot": "none",
        "columns": 7,
        "time": {"column": 0, "unit": "s"},
        "units": {"position": "rad", "velocity": "rad/s", "torque": "Nm"},
        "joints": JOINTS,
    }
    return ImportMap.model_validate({**content, **changes})


def rows_of_cells() -> list[list[str]]:
    """Return rows of cells: the texts of a time stamp and of six numbers."""
    random = np.random.default_rng(1)
    values = random.normal(size=(ROWS, 6)) * 10.0 ** random.integers(-300, 300, (ROWS, 6))
    return [
        [f"{0.01 * row:.3f}", *(repr(float(value)) for value in values[row])] for row in range(ROWS)
    ]


def read(path: Path, layout: ImportMap) -> tuple[ImportTable, list[DamagedRow]]:
    damaged: list[DamagedRow] = []
    columns = [1, 2, 3, 4, 1, 5]
    return read_tables([path], layout, columns, damaged, optional={5}), damaged


def assert_same_as_single_lines(
    path: Path, layout: ImportMap, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The reference converts every line separately."""
    table, damaged = read(path, layout)
    with monkeypatch.context() as patched:
        patched.setattr(NumberBlocks, "convert", lambda *_: None)
        expected, expected_damaged = read(path, layout)
    assert damaged == expected_damaged
    assert (table.rows_read, table.origin_ns) == (expected.rows_read, expected.origin_ns)
    for name in ("row", "time_s", "values"):
        np.testing.assert_array_equal(getattr(table, name), getattr(expected, name))


@pytest.fixture
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("acquisition.imports.lines.BLOCK_CHARACTERS", 700)


@pytest.mark.usefixtures("small_blocks")
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize(
    ("separator", "delimiter", "decimal"),
    [(",", ",", "."), (";", ";", ","), ("\t", "tab", "."), ("  ", "space", ".")],
)
def test_all_numbers_are_converted_in_blocks(
    tmp_path: Path, separator: str, delimiter: str, decimal: str, end: str
) -> None:
    cells = rows_of_cells()
    text = end.join(separator.join(row) for row in [["header"] * 7, *cells]) + end
    path = tmp_path / "table.csv"
    path.write_bytes(text.replace(".", decimal).encode())
    layout = import_map(delimiter=delimiter, decimal=decimal, header_rows=1)
    table, damaged = read(path, layout)
    assert not damaged
    numbers = np.array([[float(cell) for cell in row] for row in cells])
    np.testing.assert_array_equal(table.values, numbers[:, [1, 2, 3, 4, 1, 5]])
    np.testing.assert_array_equal(table.time_s, numbers[:, 0])
    np.testing.assert_array_equal(table.row, np.arange(2, ROWS + 2))


@pytest.mark.usefixtures("small_blocks")
@pytest.mark.parametrize("column", [0, 2, 5, 6])
@pytest.mark.parametrize(
    "cell",
    [
        *("nan", "-inf", "infinity", "1e400", "1_5", "0x10", "+1", " 1 ", "", "nan(1)", "1 2"),
        *("1,5", "1.", "-.5E-3", "1d5", "1e", ".", "é", '"1"', "\t", "1\t2", "\0", "1\x1f", "1;2"),
    ],
)
@pytest.mark.parametrize("delimiter", [",", "space"])
def test_an_odd_cell_is_read_as_in_a_single_line(
    tmp_path: Path, cell: str, column: int, delimiter: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    cells = rows_of_cells()
    cells[20][column] = cell
    path = tmp_path / "table.csv"
    separator = " " if delimiter == "space" else ","
    path.write_text("".join(f"{separator.join(row)}\n" for row in cells))
    assert_same_as_single_lines(path, import_map(delimiter=delimiter), monkeypatch)


@pytest.mark.usefixtures("small_blocks")
@pytest.mark.parametrize("line", ["", "  ", "1,2", "1,2,3,4,5,6,7,8", ",,,,,,", "text"])
@pytest.mark.parametrize("rows", [{}, {"first": 7, "last": 30}])
def test_an_odd_line_is_read_as_a_single_line(
    tmp_path: Path, line: str, rows: dict[str, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    text = [",".join(row) for row in rows_of_cells()]
    text.insert(15, line)
    path = tmp_path / "table.csv"
    path.write_text("\n".join(text))
    assert_same_as_single_lines(path, import_map(rows=rows), monkeypatch)


@pytest.mark.usefixtures("small_blocks")
@pytest.mark.parametrize(
    ("time", "stamps"),
    [
        ({"column": 0, "unit": "ns"}, ["1700000000000000001", "1.7e18", "007", "0x11", "9" * 30]),
        ({"column": 0, "unit": "ms"}, ["12.5", "nan", ""]),
        ({"column": 0, "unit": "iso"}, ["2026-11-26T08:00:00.5Z", "2026-11-26"]),
        ({"column": 0, "nanoseconds": 6}, ["1700000000", "1700000000.0", "9" * 18]),
    ],
)
def test_time_stamps_are_read_as_in_single_lines(
    tmp_path: Path, time: dict[str, Any], stamps: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    cells = rows_of_cells()
    for number, row in enumerate(cells):
        row[0] = str(1_700_000_000_000_000_000 + number)
        if "nanoseconds" in time:
            row[0], row[6] = str(1_700_000_000 + number), str(number)
    path = tmp_path / "table.csv"
    for stamp in ("", *stamps):
        if stamp:
            cells[20][0] = stamp
        path.write_text("".join(f"{','.join(row)}\n" for row in cells))
        assert_same_as_single_lines(path, import_map(time=time), monkeypatch)
