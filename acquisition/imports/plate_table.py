"""`PlateTable`: readings of a force plate from another program's file, on their own times.

The plate's rows are read from the whole file, also outside the range of rows of the run: readings
before and after the run are needed for the offset at rest and for resampling.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from acquisition.imports.report import DamagedRow
from acquisition.imports.table import find_unordered
from acquisition.imports.tables import read_table
from acquisition.journal.plate import SATURATION
from acquisition.maps.import_map import ImportMap, RowRange
from acquisition.maps.import_plate import ImportPlate
from acquisition.maps.time_column import numbered
from acquisition.processing.plate_alignment import SETTLING_CYCLES, find_settling
from acquisition.recording.plate_geometry import base_wrench_matrix
from acquisition.recording.reaction import Reaction
from acquisition.signals.resampling import resample
from config.arrays import BoolArray, FloatArray
from config.errors import ConfigError, DataQualityError

FEWEST_ROWS: Final = 100
SAME_TIME: Final = 1e-3
"""Largest difference of the times of a row of the plate and one of the robot that count as
simultaneous [median steps of the plate]."""
FLAT_ROWS: Final = 20
"""Smallest number of successive rows at the extreme of a reading that looks saturated."""


@dataclass(frozen=True, eq=False)
class PlateTable:
    """Readings of a plate in SI units, exerted on the plate.

    Attributes:
        plate: Columns, units and description of the plate.
        time_s: Shape (rows,). Increasing time stamps of the plate's clock [s].
        readings: Shape (rows, c). Readings [N, N m]; only `without_offset` subtracts their offset.
        valid: Shape (rows, c). False while a reading is saturated, and until its filter has
            settled.
        rows_read: Number of rows with data in the file.
        findings: Oddities of the rows, one sentence each.
    """

    plate: ImportPlate
    time_s: FloatArray
    readings: FloatArray
    valid: BoolArray
    rows_read: int
    findings: tuple[str, ...]

    @property
    def step_s(self) -> float:
        """Median time between rows [s]."""
        return float(np.median(np.diff(self.time_s)))

    @property
    def gaps(self) -> int:
        """Number of places at which rows are missing."""
        return int(np.count_nonzero(np.diff(self.time_s) > 1.5 * self.step_s))

    @property
    def saturated_share(self) -> FloatArray:
        """Fraction of the rows in which each reading is not valid, (c,)."""
        return np.asarray(1.0 - self.valid.mean(axis=0))

    def without_offset(self, first_row_s: float) -> tuple[PlateTable, FloatArray | None]:
        """Return the readings without their offset, and the offset (c,) [N, N m] or None.

        The offset is stated in the map, or is the mean of the readings while the robot is at rest
        (`rest_s`). If the map has neither, the readings are unchanged.

        Args:
            first_row_s: Time of the run's first row on the plate's clock [s].

        Raises:
            DataQualityError: The rest of the robot has too few valid rows.
        """
        plate = self.plate
        if plate.offset is not None:
            offset = np.array(plate.offset) * plate.factors
        elif plate.rest_s is not None:
            since = self.time_s - first_row_s
            at_rest = (since >= plate.rest_s[0]) & (since <= plate.rest_s[1])
            counts = np.count_nonzero(self.valid[at_rest], axis=0)
            if counts.min() < FEWEST_ROWS:
                few = plate.reading_names[int(counts.argmin())]
                raise DataQualityError(
                    f"plate.rest_s of the map: {few} has {counts.min()} valid rows between"
                    f" {plate.rest_s[0]:g} and {plate.rest_s[1]:g} s, but {FEWEST_ROWS} are needed:"
                    f" the plate's rows are from {since[0]:.4g} to {since[-1]:.4g} s, relative to"
                    " the first row of the run",
                    code="RID-IMPORT-ROWS",
                )
            kept = np.where(self.valid[at_rest], self.readings[at_rest], 0.0)
            offset = kept.sum(axis=0) / counts
        else:
            return self, None
        return replace(self, readings=self.readings - offset), offset

    def reaction(self, row_s: FloatArray, at_s: FloatArray) -> Reaction:
        """Return the readings at the recording's times.

        If every row of the recording has a row of the plate at the same time, these rows are used.
        Otherwise the readings are resampled.

        Args:
            row_s: Shape (rows,). Times of the plate's rows on the recording's clock [s].
            at_s: Shape (samples,). Times of the recording [s].

        Raises:
            DataQualityError: The rows are not on a regular grid.
        """
        nearest = np.clip(np.searchsorted(row_s, at_s), 1, len(row_s) - 1)
        nearest -= (at_s - row_s[nearest - 1]) < (row_s[nearest] - at_s)
        if np.abs(row_s[nearest] - at_s).max() < SAME_TIME * self.step_s:
            channels, valid = self.readings[nearest], self.valid[nearest]
        else:
            rate_hz = 1.0 / float(np.median(np.diff(at_s)))
            channels, valid = resample(row_s, self.readings, self.valid, at_s, rate_hz)
        return Reaction(
            channel_names=self.plate.reading_names,
            channels_n=channels,
            valid=valid,
            base_wrench_matrix=base_wrench_matrix(self.plate.description),
            low_pass=self.plate.low_pass,
            drift_limit_n_s=self.plate.drift_limit_n_s,
        )


def read_plate(files: Sequence[Path], layout: ImportMap, origin_ns: int) -> PlateTable:
    """Read the rows of a map's plate.

    Args:
        files: The first file, then the `further_files` of the map.
        layout: Map without names of columns (`number_columns`), with a plate.
        origin_ns: Origin of the recording's time stamps [ns].

    Raises:
        ConfigError: The plate's file cannot be read, or its columns are in several files.
        DataQualityError: Too few rows are readable.
    """
    plate = layout.plate
    assert plate is not None
    number = _file_number(layout)
    columns = [numbered(column) for column in plate.columns]
    whole = layout.model_copy(update={"rows": RowRange()})
    if plate.rate_hz is not None:
        further = tuple(each.model_copy(update={"time": None}) for each in layout.further_files)
        whole = whole.model_copy(
            update={"rate_hz": plate.rate_hz, "time": None, "further_files": further}
        )
    damaged: list[DamagedRow] = []
    origin = None if plate.clock == "own" else origin_ns
    table = read_table(files[number], whole, number, columns, damaged, (), origin)
    finite = np.isfinite(table.time_s) & np.isfinite(table.values).all(axis=1)
    time_s, values = table.time_s[finite], table.values[finite]
    ordered = ~np.logical_or(*find_unordered(time_s))
    time_s, values = time_s[ordered], values[ordered]
    if len(time_s) < FEWEST_ROWS:
        why = damaged[0].detail if damaged else "the file is short"
        if not ordered.all():
            why = "the time stamps of the other rows do not increase (column and resolution?)"
        raise DataQualityError(
            f"{files[number]}: only {len(time_s)} of {table.rows_read} rows of the force plate can"
            f" be used, but {FEWEST_ROWS} are needed: {why}",
            code="RID-IMPORT-ROWS",
        )
    valid = np.ones(values.shape, dtype=np.bool_)
    if plate.saturation is not None:
        over = np.abs(values) >= SATURATION * np.array(plate.saturation)
        cutoff_hz = np.inf if plate.low_pass is None else plate.low_pass.cutoff_hz
        valid = ~find_settling(over, time_s, SETTLING_CYCLES / cutoff_hz)
    return PlateTable(
        plate=plate,
        time_s=time_s,
        readings=values * plate.factors,
        valid=valid,
        rows_read=table.rows_read,
        findings=(
            *_findings(plate, values, valid, table.rows_read),
            *_filter_findings(plate, time_s),
        ),
    )


def _findings(
    plate: ImportPlate, values: FloatArray, valid: BoolArray, rows_read: int
) -> list[str]:
    found = []
    if len(values) < rows_read:
        found.append(
            f"Force plate: {rows_read - len(values)} of {rows_read} rows cannot be read or are out"
            " of time order"
        )
    for name, reading, good in zip(plate.reading_names, values.T, valid.T, strict=True):
        if np.ptp(reading) == 0.0:
            found.append(f"Force plate: {name} has the same value in all rows: check its column")
            continue
        share = 1.0 - good.mean()
        if share > 0.0:
            found.append(f"Force plate: {name} is saturated on {100.0 * share:.2g} % of the rows")
            continue
        for extreme in (reading.min(), reading.max()):
            longest = _longest_run(reading == extreme)
            if longest >= FLAT_ROWS:
                found.append(
                    f"Force plate: {name} stays at its extreme {extreme:.6g} {plate.unit} for"
                    f" {longest} rows, as if it were saturated: state its range as"
                    " plate.saturation in the map"
                )
    return found


def _filter_findings(plate: ImportPlate, time_s: FloatArray) -> list[str]:
    """Report a low-pass that does not prevent aliasing at the rate of the plate's rows."""
    half_hz = 0.5 / float(np.median(np.diff(time_s)))
    if plate.low_pass is None or plate.low_pass.cutoff_hz <= half_hz:
        return []
    return [
        f"Force plate: plate.low_pass.cutoff_hz is {plate.low_pass.cutoff_hz:g} Hz, above half the"
        f" rate of its rows, {half_hz:.4g} Hz: forces between them appear at lower frequencies"
        " (aliasing). Correct it, or record at a higher rate"
    ]


def _longest_run(mask: BoolArray) -> int:
    """Return the length of the longest run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return int(np.max(edges[1::2] - edges[::2], initial=0))


def _file_number(layout: ImportMap) -> int:
    """Return the number of the file that has all columns of the plate.

    Raises:
        ConfigError: The columns are in several files.
    """
    assert layout.plate is not None
    starts = np.array(layout.first_columns[1:-1])
    found = {int(np.searchsorted(starts, numbered(c), "right")) for c in layout.plate.columns}
    if len(found) > 1:
        raise ConfigError(
            f"map {layout.name!r}: the columns of the force plate are in several files: put these"
            " columns into one file",
            code="RID-IMPORT-HEADER",
        )
    return found.pop()
