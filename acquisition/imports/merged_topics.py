"""`merge_topics`: interpolates a table's columns to the rows with a value in the first column.

Programs that export several topics into one file write each message in a separate row and leave
the cells of the other topics empty. A bag with the messages of two broadcasters of one robot has
the same form.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acquisition.imports.report import DamagedRow
from acquisition.imports.table import ImportTable, find_unordered
from acquisition.processing.smoothing import GAP_STEPS
from config.arrays import BoolArray, FloatArray
from config.column_file import selected_rows
from config.errors import DataQualityError

NO_NEIGHBOUR = "without a value of every other topic near its time"


def merge_topics(
    table: ImportTable, columns: Sequence[int], names: Sequence[str], damaged: list[DamagedRow]
) -> ImportTable:
    """Return the rows with a value in the first column; other columns are interpolated to them.

    Args:
        table: Rows in which NaN marks an empty cell.
        columns: Indices of the table's columns to interpolate; the first one selects the rows.
        names: Name of each column in messages.
        damaged: List to which rows are appended that are dropped, because a column has no value
            near their time.

    Raises:
        DataQualityError: A column is empty in every row, or in all rows but one.
    """
    if not columns or not np.isnan(table.values[:, columns]).any():
        return table
    kept = np.isfinite(table.values[:, columns[0]]) & np.isfinite(table.time_s)
    at_s, values = table.time_s[kept], selected_rows(table.values, kept)
    filled = int(np.count_nonzero(np.isnan(values[:, columns]).any(axis=1)))
    near = np.ones(len(at_s), dtype=np.bool_)
    for column, name in zip(columns, names, strict=True):
        if np.isfinite(values[:, column]).all() and len(values):
            continue
        sound = np.isfinite(table.time_s) & np.isfinite(table.values[:, column])
        sound[sound] = ~np.logical_or(*find_unordered(table.time_s[sound]))
        if np.count_nonzero(sound) < 2:
            raise DataQualityError(
                f"{name} is empty in every row, or in all rows but one: correct the map's columns,"
                " or remove this column",
                code="RID-IMPORT-ROWS",
            )
        stamps = table.time_s[sound]
        near &= rows_near(stamps, at_s)
        values[:, column] = np.interp(at_s, stamps, table.values[sound, column])
    rows = table.row[kept]
    damaged.extend(
        DamagedRow(int(row), NO_NEIGHBOUR, f"its time stamp is {stamp:.9g} s")
        for row, stamp in zip(rows[~near], at_s[~near], strict=True)
    )
    other = len(kept) - len(at_s)
    notes = (
        *table.notes,
        f"Several topics are merged: {len(at_s)} rows have {names[0]}, and other values are"
        f" interpolated in {filled} of them; {other} rows without {names[0]} only supply values for"
        " the interpolation",
    )
    return replace(
        table,
        row=rows[near],
        time_s=at_s[near],
        values=selected_rows(values, near),
        rows_read=table.rows_read - other,
        notes=notes,
    )


def rows_near(stamps: FloatArray, at_s: FloatArray) -> BoolArray:
    """Return True for times at which a signal can be interpolated.

    Args:
        stamps: Shape (rows,), at least 2. Increasing time stamps of the signal [s].
        at_s: Shape (n,). Times [s].
    """
    after = np.clip(np.searchsorted(stamps, at_s), 1, len(stamps) - 1)
    step_s = float(np.median(np.diff(stamps)))
    inside = (at_s >= stamps[0] - step_s / 2) & (at_s <= stamps[-1] + step_s / 2)
    return np.asarray(inside & (stamps[after] - stamps[after - 1] <= GAP_STEPS * step_s))
