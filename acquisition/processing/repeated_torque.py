"""`RepeatedTorques`: torques whose source updates them less often than rows are recorded.

A drive that updates its torque at 25 Hz and a logger that writes at 500 Hz produce a staircase:
each value is repeated for twenty rows and is up to nineteen rows late. Each value is valid in its
first row. The model's columns are therefore held over the same rows as the torque.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.recording.recording import Recording
from config.arrays import FloatArray, IntArray, freeze
from config.column_file import each_column
from config.errors import DataQualityError

FEWEST_CHANGES: Final = 20
SELDOM_SHARE: Final = 0.02
"""Largest fraction of a held torque's changes that directly follow another change."""
COARSE_STEPS: Final = 3.0
"""Smallest median change of a held torque, in steps of its resolution. A torque with a coarse
resolution changes by single steps and does not count as held."""
MOVED_SHARE: Final = 0.5
"""Smallest fraction of held rows in which positions change; with a smaller fraction, whole rows are
repeated, not only torques."""


@dataclass(frozen=True, eq=False)
class RepeatedTorques:
    """Number of rows for which each joint's torque is held, and the row of each update.

    Attributes:
        rows: Shape (n,). Number of rows for which a torque stays the same; 1 if each row has a new
            value.
        update_row: Shape (samples, n). Row of the last update for each row.
    """

    rows: IntArray
    update_row: IntArray

    def __post_init__(self) -> None:
        freeze(self, DataQualityError, (None,), "rows", dtype=np.int64)
        freeze(self, DataQualityError, (None, len(self.rows)), "update_row", dtype=np.int64)


def find_repeated_torques(position: FloatArray, torque_nm: FloatArray) -> RepeatedTorques | None:
    """Return the rows for which torques are held; None if each row has new torques.

    Args:
        position, torque_nm: Shape (samples, n). Valid rows only.
    """
    held = np.array([_rows_per_update(position, own) for own in each_column(torque_nm)])
    if np.all(held == 1):
        return None
    update_row = np.repeat(np.arange(len(torque_nm))[:, np.newaxis], torque_nm.shape[1], axis=1)
    for j in np.flatnonzero(held > 1):
        changed = np.flatnonzero(np.diff(torque_nm[:, j])) + 1
        starts = np.concatenate([[0], changed])
        rows = np.arange(len(torque_nm))
        since = rows - starts[np.searchsorted(starts, rows, side="right") - 1]
        # a hold longer than `held` rows contains several updates with equal values
        update_row[:, j] = rows - since % held[j]
    return RepeatedTorques(held, update_row)


def repeated_torque_sentence(recording: Recording) -> str:
    """Return a sentence on held torques, their rates and the consequence, or an empty text."""
    position, torque_nm = recording.valid_rows("position"), recording.valid_rows("torque_nm")
    found = find_repeated_torques(position, torque_nm)
    if found is None:
        return ""
    step_s = float(np.median(np.diff(recording.valid_rows("time_s"))))
    own = [
        f"{name} at {1.0 / (rows * step_s):.3g} Hz"
        for name, rows in zip(recording.joint_names, found.rows.tolist(), strict=True)
        if rows > 1
    ]
    finding = (
        f"torques are updated less often than rows are recorded, at {1.0 / step_s:.3g} Hz, and"
        f" held in between: {', '.join(own)}"
    )
    if recording.samples_per_period is None:
        return f"{finding}. The model's torques are held in the same way"
    return (
        f"{finding}. The mean of the periods does not correct this: the torques are late by half of"
        " the hold time on average, which biases friction and inertia. Record again with torques"
        " that are updated in every row"
    )


def _rows_per_update(position: FloatArray, torque_nm: FloatArray) -> int:
    """Return the number of rows for which a joint's torque is held; 1 if it is not held."""
    changed = np.flatnonzero(torque_nm[1:] != torque_nm[:-1])
    if len(changed) < FEWEST_CHANGES:
        return 1
    lengths = np.diff(changed)
    if int(np.quantile(lengths, SELDOM_SHARE)) < 2:
        return 1
    steps = np.diff(torque_nm)
    sizes = np.abs(steps[changed])
    if np.median(sizes) < COARSE_STEPS * np.quantile(sizes, SELDOM_SHARE):
        return 1
    held = int(np.bincount(lengths).argmax())
    usual = np.repeat(lengths <= 2 * held, lengths)  # at rest a torque may stay constant for longer
    rows = np.arange(changed[0], changed[-1])[usual]
    same = rows[steps[rows] == 0.0]
    moved = np.any(position[same + 1] != position[same], axis=1)
    return held if np.mean(moved) >= MOVED_SHARE else 1
