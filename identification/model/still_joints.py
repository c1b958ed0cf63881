"""`StillJoint`: a joint that no run of an identification moves.

Its own friction and inertia are not identifiable, and its link is one body with the link that
carries it. Only the parameters that affect the other joints are identified, and they are valid only
at this joint's position.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.column_file import each_column
from config.errors import EstimationError
from dynamics.model.robot_model import RobotModel
from dynamics.model.standstill import standstill_speed

SAME_POSITION: Final = 0.01
"""Largest difference of positions that count as equal [rad or m]."""

JERK_SHARE: Final = 0.01
"""Largest fraction of samples in which jerks of other joints move a joint at rest."""

STILL_MODEL: Final = "RID-MODEL-STILL"


@dataclass(frozen=True)
class StillJoint:
    """A joint that no run moves.

    Attributes:
        joint: Its name.
        positions: Its positions in the runs, at most one per run [rad or m].
    """

    joint: str
    positions: tuple[float, ...]

    def has_position(self, position: FloatArray) -> bool:
        """Return True if all positions, (samples,), are close to those of the identification."""
        near = np.abs(np.subtract.outer(position, np.array(self.positions))).min(axis=1)
        return bool(np.all(near <= SAME_POSITION))

    @property
    def words(self) -> str:
        """Text with the name and the positions of the joint."""
        return f"{self.joint} (at {', '.join(f'{p:.3g}' for p in self.positions)})"


def still_joints(
    model: RobotModel,
    motions: Iterable[tuple[FloatArray, FloatArray]],
    standstill_rad_s: float,
    moving_share: float = 0.0,
) -> tuple[StillJoint, ...]:
    """Return the joints that do not move in any run.

    Args:
        model: The robot.
        motions: Iterable of (ndarray, ndarray). Positions and velocities of each run, (samples, n)
            [rad or m, per s].
        standstill_rad_s: Speed above which a joint counts as moving [rad/s or m/s].
        moving_share: Fraction of a run's samples in which the joint may nevertheless be faster, for
            example because another joint starts abruptly.
    """
    slowest = standstill_speed(model, standstill_rad_s)
    still = np.ones(model.chain.n, dtype=bool)
    positions: list[list[float]] = [[] for _ in range(model.chain.n)]
    for q, v in motions:
        columns = zip(each_column(q), each_column(v), positions, strict=True)
        for j, (path, velocity, known) in enumerate(columns):
            still[j] &= np.mean(np.abs(velocity) >= slowest[j]) <= moving_share
            still[j] &= np.ptp(path) < SAME_POSITION
            position = float(path.mean())
            if all(abs(position - other) >= SAME_POSITION for other in known):
                known.append(position)
    return tuple(
        StillJoint(model.joint_names[j], tuple(positions[j])) for j in np.flatnonzero(still)
    )


def refuse_unmoved_joints(still: Sequence[StillJoint], of: str) -> None:
    """Refuse to use a model for motions of joints that did not move in its identification.

    Raises:
        EstimationError: There are such joints.
    """
    if still:
        raise EstimationError(
            f"{of}: {', '.join(each.words for each in still)} did not move in the runs of the"
            " identification, so its friction and inertia are unknown: record a motion that"
            " moves every joint, and include it in the identification",
            code=STILL_MODEL,
        )
