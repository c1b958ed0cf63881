"""`StillJoint`: a joint that no run of an identification moves.

Its own friction and inertia do not show, and its link is one body with the link that carries it:
only what the other joints show is identified, and it holds at the joint's position alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.errors import EstimationError
from dynamics.model.robot_model import RobotModel
from dynamics.model.standstill import standstill_speed

SAME_POSITION: Final = 0.01
"""Positions so close are one [rad or m]."""

JERK_SHARE: Final = 0.01
"""Share of its samples in which a joint that stands still may be moved by the jerks of others."""

STILL_MODEL: Final = "RID-MODEL-STILL"


@dataclass(frozen=True)
class StillJoint:
    """A joint that no run moves.

    Attributes:
        joint: Its name.
        positions: Where it stood, a position a run at most [rad or m].
    """

    joint: str
    positions: tuple[float, ...]

    def stands_there(self, position: FloatArray) -> bool:
        """Return whether positions, (samples,), are one of those at which it stood."""
        near = np.abs(np.subtract.outer(position, np.array(self.positions))).min(axis=1)
        return bool(np.all(near <= SAME_POSITION))

    @property
    def words(self) -> str:
        """Its name and where it stood."""
        return f"{self.joint} (at {', '.join(f'{p:.3g}' for p in self.positions)})"


def still_joints(
    model: RobotModel,
    motions: Iterable[tuple[FloatArray, FloatArray]],
    standstill_rad_s: float,
    moving_share: float = 0.0,
) -> tuple[StillJoint, ...]:
    """Return the joints that stand still throughout every run.

    Args:
        model: The robot.
        motions: Iterable of (ndarray, ndarray). Positions and velocities of each run, (samples, n)
            [rad or m, per s].
        standstill_rad_s: Speed from which on a joint moves.
        moving_share: Share of a run's samples in which it may be faster all the same, such as when
            another joint starts with a jerk.
    """
    slowest = standstill_speed(model, standstill_rad_s)
    still = np.ones(model.chain.n, dtype=bool)
    positions: list[list[float]] = [[] for _ in range(model.chain.n)]
    for q, v in motions:
        still &= np.mean(np.abs(v) >= slowest, axis=0) <= moving_share
        still &= np.ptp(q, axis=0) < SAME_POSITION
        for known, position in zip(positions, q.mean(axis=0).tolist(), strict=True):
            if all(abs(position - other) >= SAME_POSITION for other in known):
                known.append(position)
    return tuple(
        StillJoint(model.joint_names[j], tuple(positions[j])) for j in np.flatnonzero(still)
    )


def refuse_still(still: Sequence[StillJoint], of: str) -> None:
    """Refuse to use a model for motions of joints that stood still when it was identified.

    Raises:
        EstimationError: There are such joints.
    """
    if still:
        raise EstimationError(
            f"{of}: {', '.join(each.words for each in still)} stood still in the runs, which show"
            " neither its friction nor its inertia: record a motion that moves every joint, and"
            " identify it with them",
            code=STILL_MODEL,
        )
