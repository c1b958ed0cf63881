"""`Recording`: everything measured in one run, or read from someone else's file."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from acquisition.recording.reaction import Reaction
from config.arrays import BoolArray, FloatArray, IntArray, PhaseArray, freeze
from config.cell.cell import ButterworthFilter
from config.errors import RecordingError


@dataclass(frozen=True, eq=False)
class Recording:
    """Measured positions and torques over time, with where they come from.

    Attributes:
        joint_names: Base to flange.
        time_s: Shape (samples,). When each row was sampled [s], strictly increasing.
        position: Shape (samples, joints). Measured joint positions, link side [rad or m].
        torque_nm: Shape (samples, joints). Measured actuator torques, link side [N m or N].
        valid: Shape (samples,). False where a device did not deliver and the row holds its last
            values.
        phase: Shape (samples,). `acquisition.motion.samples.Phase` of each row.
        sample_index: Shape (samples,). Row of the motion that was streamed; -1 outside it.
        target_position, velocity_command: Shape (samples, joints). Commanded joint positions, and
            the speeds sent in each row's cycle.
        sample_period_s: Time between rows; None where the stamps are not uniform.
        samples_per_period: Rows of one period where the motion was periodic.
        torque_filter: The analog filter that the measured torques passed.
        temperature_k: Shape (samples, joints). Temperature of each joint's drive [K].
        reaction: What a force plate under the robot measured at the same times.
        answered: Shape (samples, joints). Which joints' drives delivered; None where `valid` says
            it of all of them.
        source: Measured by this program, or read from a file.
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
                "recording: valid is not where every joint has answered", code="RID-API-ARGUMENT"
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
        """Return the recording of some rows, without a force plate."""
        columns = {name: getattr(self, name) for name in _COLUMNS}
        cut: dict[str, Any] = {
            name: values[rows] for name, values in columns.items() if values is not None
        }
        return replace(self, reaction=None, **cut)

    @property
    def valid_of_joints(self) -> BoolArray:
        """Where each joint's values are of their own row, shape (samples, joints)."""
        if self.answered is not None:
            return self.answered
        return np.repeat(self.valid[:, np.newaxis], len(self.joint_names), axis=1)


_COLUMNS = (
    *("time_s", "position", "torque_nm", "valid", "phase", "sample_index"),
    *("target_position", "velocity_command", "temperature_k", "answered"),
)


def joined(parts: Iterable[Recording]) -> Recording:
    """Return one recording of parts that follow one another, none with a force plate.

    Args:
        parts: At least one; what is not an array is taken from the first.

    Raises:
        RecordingError: They do not follow one another.
    """
    first: Recording | None = None
    columns: dict[str, list[Any]] = {}
    for part in parts:
        first = first or part
        for name in _COLUMNS:
            if getattr(part, name) is not None:
                columns.setdefault(name, []).append(getattr(part, name))
    if first is None:
        raise RecordingError("recording: no row", code="RID-RECORDING-EMPTY")
    whole: dict[str, Any] = {}
    for name in _COLUMNS:
        if name in columns:
            whole[name] = np.concatenate(columns.pop(name))  # the parts go with their column
            whole[name].setflags(write=False)
    return replace(first, **whole)
