"""`Recording`: all measured data of one run or of an imported file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np

from acquisition.recording.reaction import Reaction
from config.arrays import BoolArray, FloatArray, IntArray, PhaseArray, freeze, lock, release
from config.cell.torque_filter import ButterworthFilter
from config.column_file import ColumnFile, selected_rows
from config.errors import RecordingError

PIECE_ROWS: Final = 10_000


@dataclass(frozen=True, eq=False)
class Recording:
    """Measured positions and torques over time, with their origin.

    Attributes:
        joint_names: Joints from base to flange.
        time_s: Shape (samples,). Sampling time of each row [s], strictly increasing.
        position: Shape (samples, joints). Measured joint positions, link side [rad or m].
        torque_nm: Shape (samples, joints). Measured actuator torques, link side [N m or N].
        valid: Shape (samples,). False if a device delivered no values; the row then repeats the
            device's last values. In an import, False if the row is far from the measured rows.
        phase: Shape (samples,). `acquisition.motion.samples.Phase` of each row.
        sample_index: Shape (samples,). Row of the motion that was streamed; -1 outside the motion.
            In an import with uniform times, the number of the row; -1 without them.
        target_position, velocity_command: Shape (samples, joints). Commanded joint positions, and
            the speeds sent in each row's cycle.
        sample_period_s: Time between rows; None if the times are not uniform.
        samples_per_period: Number of rows of one period of a periodic motion.
        torque_filter: Analog filter of the measured torques.
        temperature_k: Shape (samples, joints). Temperature of each joint's drive [K].
        reaction: Readings of a force plate under the robot at the same times.
        answered: Shape (samples, joints). True if the joint's drive delivered values; None if
            `valid` applies to all joints.
        source: Origin of the data: measured by this program, or read from a file.
        cell_name, robot_name, run_id: Provenance; `cell_name` is empty for an import.
    """

    joint_names: tuple[str, ...]
    time_s: FloatArray
    position: FloatArray
    torque_nm: FloatArray
    valid: BoolArray
    phase: PhaseArray
    sample_index: IntArray
    source: Literal["cell", "import"]
    target_position: FloatArray | None = None
    velocity_command: FloatArray | None = None
    sample_period_s: float | None = None
    samples_per_period: int | None = None
    torque_filter: ButterworthFilter | None = None
    temperature_k: FloatArray | None = None
    reaction: Reaction | None = None
    answered: BoolArray | None = None
    cell_name: str = ""
    robot_name: str = ""
    run_id: str = ""

    def __post_init__(self) -> None:
        n = len(self.joint_names)
        if n == 0:
            raise RecordingError("recording: no joints", code="RID-API-ARGUMENT")
        freeze(self, RecordingError, (None,), "time_s", what="recording ")
        time_s, samples = self.time_s, len(self.time_s)
        rows, table = (samples,), (samples, n)
        further = ("target_position", "velocity_command", "temperature_k")
        freeze(self, RecordingError, table, "position", "torque_nm", *further)
        freeze(self, RecordingError, rows, "valid", dtype=np.bool_)
        freeze(self, RecordingError, rows, "phase", dtype=np.uint8)
        freeze(self, RecordingError, rows, "sample_index", dtype=np.int64)
        freeze(self, RecordingError, table, "answered", dtype=np.bool_)
        if self.answered is not None and (self.answered.all(axis=1) != self.valid).any():
            raise RecordingError(
                "recording: `valid` must be True exactly in the rows in which every joint has"
                " answered",
                code="RID-API-ARGUMENT",
            )
        back = np.asarray(time_s[1:] <= time_s[:-1])
        if back.any():
            row = int(np.argmax(back)) + 1
            raise RecordingError(
                f"recording: time stamps must increase; row {row} is at {time_s[row]:.6f} s after"
                f" {time_s[row - 1]:.6f} s",
                code="RID-RECORDING-CLOCK",
            )
        if self.sample_period_s is not None and not self.sample_period_s > 0.0:
            raise RecordingError(
                f"recording: sample_period_s {self.sample_period_s} is not positive",
                code="RID-API-ARGUMENT",
            )
        if self.samples_per_period is not None and self.sample_period_s is None:
            raise RecordingError(
                "recording: a periodic recording needs its sample_period_s", code="RID-API-ARGUMENT"
            )
        if self.reaction is not None and len(self.reaction) != samples:
            raise RecordingError(
                f"recording: {len(self.reaction)} rows of the force plate for {samples} samples",
                code="RID-API-ARGUMENT",
            )

    def __len__(self) -> int:
        return len(self.time_s)

    def part(self, rows: slice | BoolArray) -> Recording:
        """Return the recording of the selected rows, without the force plate."""
        columns = {name: getattr(self, name) for name in _COLUMNS}
        cut: dict[str, Any] = {
            name: values[rows] for name, values in columns.items() if values is not None
        }
        return replace(self, reaction=None, **cut)

    def pieces(self) -> Iterator[Recording]:
        """Yield the recording in parts of at most `PIECE_ROWS` rows, without the force plate."""
        columns = [getattr(self, name) for name in _COLUMNS]
        for first in range(0, max(len(self), 1), PIECE_ROWS):
            yield self.part(slice(first, first + PIECE_ROWS))
            release(*(values for values in columns if values is not None))

    def valid_rows(self, name: Literal["time_s", "position", "torque_nm"]) -> FloatArray:
        """Return a column's valid rows, without a copy if all rows are valid."""
        values: FloatArray = getattr(self, name)
        return values if self.valid.all() else lock(selected_rows(values, self.valid))

    @property
    def joint_valid(self) -> BoolArray:
        """True for each value that was measured in its own row, shape (samples, joints)."""
        if self.answered is not None:
            return self.answered
        return np.repeat(self.valid[:, np.newaxis], len(self.joint_names), axis=1)


_COLUMNS = (
    *("time_s", "position", "torque_nm", "valid", "phase", "sample_index"),
    *("target_position", "velocity_command", "temperature_k", "answered"),
)


def stored_recording(parts: Iterable[Recording], most_rows: int) -> Recording:
    """Return one recording, in files, from consecutive parts without force-plate readings.

    Args:
        parts: At least one; values that are not arrays are taken from the first part.
        most_rows: Largest number of rows of all parts together.

    Raises:
        RecordingError: There is no part, or the times of the parts do not increase.
    """
    first: Recording | None = None
    files: dict[str, ColumnFile] = {}
    for part in parts:
        first = first or part
        for name in _COLUMNS:
            values = getattr(part, name)
            if values is None:
                continue
            table = values.reshape(len(part), -1)
            if name not in files:
                files[name] = ColumnFile(table.shape[1], most_rows, values.dtype)
            files[name].append(table)
    if first is None:
        raise RecordingError("recording: contains no rows", code="RID-RECORDING-EMPTY")
    whole: dict[str, Any] = {}
    for name, file in files.items():
        table = lock(file.table())
        whole[name] = table[:, 0] if getattr(first, name).ndim == 1 else table
    return replace(first, **whole)


def concatenate_recordings(parts: Iterable[Recording]) -> Recording:
    """Return one recording from consecutive parts without force-plate readings.

    Args:
        parts: At least one; values that are not arrays are taken from the first part.

    Raises:
        RecordingError: There is no part, or the times of the parts do not increase.
    """
    first: Recording | None = None
    columns: dict[str, list[Any]] = {}
    for part in parts:
        first = first or part
        for name in _COLUMNS:
            if getattr(part, name) is not None:
                columns.setdefault(name, []).append(getattr(part, name))
    if first is None:
        raise RecordingError("recording: contains no rows", code="RID-RECORDING-EMPTY")
    whole: dict[str, Any] = {}
    for name in _COLUMNS:
        if name in columns:
            whole[name] = np.concatenate(columns.pop(name))  # `pop` frees the memory of the parts
            whole[name].setflags(write=False)
    return replace(first, **whole)
