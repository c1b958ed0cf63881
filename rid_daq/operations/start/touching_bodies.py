"""Pairs of a robot's bodies that touch wherever it stands: by design, not by collision."""

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
"""A workspace's usual clearance, and what a planned motion keeps beyond it."""
POSES: Final = 150
FIRST_POSES: Final = 10
SUSPECT: Final = 0.6
"""Share of the first poses in which a pair must touch for a closer look."""
MOST_POSES: Final = 0.9
"""Share of the poses beyond which bodies that touch at rest too touch by design."""


def without_touching(
    robot: RobotDescription, rest: FloatArray
) -> tuple[RobotDescription, tuple[str, ...]]:
    """Return the robot with the pairs that touch by design in `may_touch`, and a note of them.

    Bodies closer than what motions are planned with count as touching.

    Args:
        rest: Shape (n,). The pose where it stands at first [rad or m].
    """
    clearances = Clearances.of(robot, Workspace(clearance_m=PLANNED_CLEARANCE_M))
    if not len(clearances):
        return robot, ()
    low, high = (
        [getattr(joint.limits, f"position_{end}") for joint in robot.joints]
        for end in ("min", "max")
    )
    poses = np.random.default_rng(0).uniform(low, high, (POSES, len(low)))
    often = _touch(clearances, poses[:FIRST_POSES]).mean(axis=0) > SUSPECT
    clearances = _only(clearances, often)
    touch = _touch(clearances, np.vstack([rest, poses]))
    share = touch[1:].mean(axis=0)
    by_design = _only(clearances, (share == 1.0) | (touch[0] & (share > MOST_POSES)))
    pairs = tuple((first.body, second.body) for first, second in by_design.pairs)
    if not pairs:
        return robot, ()
    told = ", ".join(f"{first} and {second}" for first, second in pairs)
    note = (
        f"these bodies touch wherever the robot stands, and are not held apart: {told} (`may_touch`"
        " in robot.yaml)"
    )
    return robot.model_copy(update={"may_touch": pairs}), (note,)


def _touch(clearances: Clearances, poses: FloatArray) -> BoolArray:
    """Return which pairs touch in which poses, (poses, pairs)."""
    near = [clearances.nearest(pose[np.newaxis]) for pose in poses]
    return np.asarray(np.array(near) < clearances.margin_m)


def _only(clearances: Clearances, chosen: BoolArray) -> Clearances:
    """Return the chosen pairs."""
    return replace(clearances, pairs=tuple(compress(clearances.pairs, chosen.tolist())))
