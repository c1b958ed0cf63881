"""`ImportTable`: rows of a file as numbers; `find_unordered`: finds rows out of time order."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass

import numpy as np

from config.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class ImportTable:
    """Rows whose columns are numbers.

    Attributes:
        row: Shape (rows,). Line numbers in the file, from 1; in the first file, if the columns of
            several files are joined.
        time_s: Shape (rows,). Time stamps, or row number divided by the rate [s].
        values: Shape (rows, columns). Requested columns, in the units of the files.
        rows_read: Number of rows with data, damaged ones included.
        notes: Problems of the files, one sentence each.
        origin_ns: Origin of the time stamps if they consist of whole nanoseconds, else 0 [ns].
    """

    row: IntArray
    time_s: FloatArray
    values: FloatArray
    rows_read: int
    notes: tuple[str, ...] = ()
    origin_ns: int = 0


def find_unordered(stamps: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Return the smallest set of rows to drop so that the time stamps increase.

    Args:
        stamps: Shape (rows,). Finite time stamps.

    Returns:
        `doubled, disordered`, shape (rows,). True for rows with the stamp of the previous row, and
        for the other rows to drop.
    """
    doubled = np.zeros(len(stamps), dtype=np.bool_)
    doubled[1:] = stamps[1:] == stamps[:-1]
    if (np.diff(stamps[~doubled]) > 0.0).all():
        return doubled, np.zeros_like(doubled)
    disordered = ~doubled
    # Longest increasing subsequence: ends[k] is the last row of the best subsequence with k + 1
    # rows.
    ends: list[int] = []
    end_stamps: list[float] = []
    before = np.full(len(stamps), -1)
    for row in np.flatnonzero(~doubled).tolist():
        stamp = float(stamps[row])
        length = bisect_left(end_stamps, stamp)
        before[row] = ends[length - 1] if length else -1
        ends[length : length + 1] = [row]
        end_stamps[length : length + 1] = [stamp]
    chain = ends[-1]
    while chain >= 0:
        disordered[chain] = False
        chain = int(before[chain])
    return doubled, disordered
