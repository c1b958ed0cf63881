"""`find_clipped_torques`: torques that stay constant where the other joints demand more.

An import finds a limit that a torque reaches exactly. With noise behind the limit, for example
behind a saturated amplifier, no value is exact. In the rows with the largest predictions, the
torque that a model predicts then varies far more than the recorded torque. Friction also has a
plateau, but the model predicts this plateau.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.processing.torque_channel import TorqueChannel
from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from identification.equations.candidate_equations import CandidateEquations
from identification.equations.compared_joints import (
    ComparedJoint,
    Links,
    compared_joints,
    links_of_others,
    residual,
)

REACH_S: Final = 0.06
TOP_SHARES: Final = (0.2, 0.1, 0.05, 0.02)
"""Fractions of the rows, those with the largest predictions, in which a torque is examined."""
LARGEST_RATIO: Final = 0.4
"""Largest ratio of the variations of recorded and predicted torque that shows a limit. Clipped
torques have 0.01 to 0.4; those of sound simulated arms and of a real UR10e have at least 0.7."""
FEWEST_TOP_ROWS: Final = 12
FEWEST_BLOCKS: Final = 2


@dataclass(frozen=True)
class ClippedTorque:
    """A torque that does not exceed a limit.

    Attributes:
        joint, unit: The joint, and the unit of its torque.
        limits_nm: The limits [N m or N].
    """

    joint: str
    unit: str
    limits_nm: tuple[float, ...]

    @property
    def sentence(self) -> str:
        """Finding, with the remedy."""
        where = " and ".join(f"{value:.3g} {self.unit}" for value in self.limits_nm)
        return (
            f"The recorded torque of {self.joint} does not exceed about {where}, although the"
            " motion demands more: its sensor, amplifier or logger is saturated, and the parameters"
            " are wrong. Enlarge its range, and record again."
        )


def find_clipped_torques(
    robot: RobotDescription, equations: CandidateEquations, coarse: Collection[str] = ()
) -> tuple[ClippedTorque, ...]:
    """Return the torques that are clipped, compared with the motion and with the other joints.

    Args:
        robot: The robot.
        equations: Result of `candidate_equations` for the recordings.
        coarse: Joints whose torques are rounded so coarsely that they are not examined.
    """
    none = TorqueChannel.none(equations.joints)
    known = [none.response(piece.frequency_hz) for piece in equations.pieces]
    joints = compared_joints(equations, known, REACH_S)
    if len(joints) < 2:
        return ()
    found = []
    for joint, links in zip(joints, links_of_others(joints, [0.0] * len(joints)), strict=True):
        own = robot.joints[joint.number]
        limits_nm = tuple(_limits(joint, links))
        if limits_nm and own.name not in coarse:
            found.append(ClippedTorque(own.name, own.torque_unit, limits_nm))
    return tuple(found)


def _limits(joint: ComparedJoint, links: Links) -> Iterator[float]:
    """Yield the limits of a joint's torque."""
    torque_nm = joint.rows.torque_nm
    rest = residual(joint.rows.columns, torque_nm[:, np.newaxis], links)[:, 0]
    for sign in (1.0, -1.0):
        limit_nm = _upper_limit(sign * torque_nm, sign * (torque_nm - rest), joint)
        if limit_nm is not None:
            yield sign * limit_nm


def _upper_limit(
    torque_nm: FloatArray, predicted_nm: FloatArray, joint: ComparedJoint
) -> float | None:
    """Return the value that a torque does not exceed; None if it follows the prediction."""
    for share in TOP_SHARES:
        top = predicted_nm >= np.quantile(predicted_nm, 1.0 - share)
        blocks = len(np.unique(joint.rows.block[top]))
        if np.count_nonzero(top) < FEWEST_TOP_ROWS or blocks < FEWEST_BLOCKS:
            return None
        if np.std(torque_nm[top]) < LARGEST_RATIO * np.std(predicted_nm[top]):
            return float(np.median(torque_nm[top]))
    return None
