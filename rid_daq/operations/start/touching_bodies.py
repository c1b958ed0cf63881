"""Find pairs of a robot's bodies that touch by design: at rest and in more than 90 % of poses."""

from __future__ import annotations

from dataclasses import replace
from itertools import compress
from typing import Final

import numpy as np

from config.arrays import BoolArray, FloatArray
from config.robot.bodies import Workspace
from config.robot.robot import RobotDescription
from dynamics.geometry.clearances import Clearances

PLANNED_CLEARANCE_M: Final = 0.03
"""Default clearance of a workspace, plus the margin of planned motions [m]."""
POSES: Final = 150
FIRST_POSES: Final = 10
SUSPECT: Final = 0.6
"""Fraction of the first poses in which a pair must touch to be tested in all poses."""
MOST_POSES: Final = 0.9
"""If bodies touch at rest and in a larger fraction of the poses, they touch by design."""


def allow_touching_pairs(
    robot: RobotDescription, rest: FloatArray
) -> tuple[RobotDescription, tuple[str, ...]]:
    """Return the robot with `may_touch` set to pairs that nearly always touch, and a note on them.

    Such a pair touches in all random poses, or at rest and in more than `MOST_POSES` of them.
    Bodies closer than the clearance of planned motions count as touching.

    Args:
        rest: Shape (n,). Initial pose of the robot [rad or m].
    """
    clearances = Clearances.of(robot, Workspace(clearance_m=PLANNED_CLEARANCE_M))
    if not len(clearances):
        return robot, ()
    low, high = (
        [getattr(joint.limits, f"position_{end}") for joint in robot.joints]
        for end in ("min", "max")
    )
    poses = np.random.default_rng(0).uniform(low, high, (POSES, len(low)))
    often = _find_contacts(clearances, poses[:FIRST_POSES]).mean(axis=0) > SUSPECT
    clearances = _select_pairs(clearances, often)
    touch = _find_contacts(clearances, np.vstack([rest, poses]))
    share = touch[1:].mean(axis=0)
    by_design = _select_pairs(clearances, (share == 1.0) | (touch[0] & (share > MOST_POSES)))
    pairs = tuple((first.body, second.body) for first, second in by_design.pairs)
    if not pairs:
        return robot, ()
    names = ", ".join(f"{first} and {second}" for first, second in pairs)
    note = (
        "these bodies touch, or nearly touch, in nearly all poses, so no distance between them is"
        f" required: {names} (`may_touch` in robot.yaml)"
    )
    return robot.model_copy(update={"may_touch": pairs}), (note,)


def _find_contacts(clearances: Clearances, poses: FloatArray) -> BoolArray:
    """Return True for each pose and pair whose bodies touch, (poses, pairs)."""
    near = [clearances.nearest(pose[np.newaxis]) for pose in poses]
    return np.asarray(np.array(near) < clearances.margin_m)


def _select_pairs(clearances: Clearances, chosen: BoolArray) -> Clearances:
    return replace(clearances, pairs=tuple(compress(clearances.pairs, chosen.tolist())))
