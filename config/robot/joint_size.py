"""`JointSize`: size and weight of the arm beyond a joint, for limits that a URDF does not state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.formats.urdf import UrdfJoint

GRAVITY_M_S2: Final = 9.81


@dataclass(frozen=True)
class JointSize:
    """Reach of the arm beyond a joint [m] and its gravity load there [N m; N if prismatic]."""

    reach_m: float
    weight: float


def joint_sizes(
    joints: Sequence[UrdfJoint],
    origins_m: FloatArray,
    tip_m: FloatArray,
    centres_m: FloatArray,
    masses_kg: FloatArray,
) -> list[JointSize]:
    """Return every joint's reach and gravity load for the fully stretched chain.

    Args:
        origins_m: Shape (n, 3). Origins of the joints at position zero.
        tip_m: Shape (3,). The tool point.
        centres_m: Shape (n, 3). The links' centres of gravity.
        masses_kg: Shape (n,). The links' masses.
    """
    n = len(origins_m)
    steps = np.linalg.norm(np.diff(np.vstack([origins_m, tip_m]), axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    beyond = np.linalg.norm(centres_m - origins_m, axis=1)
    sizes = []
    for i, joint in enumerate(joints):
        arms = along[i:n] - along[i] + beyond[i:]
        reach = max(float(along[-1] - along[i]), float(arms.max()))
        lever = np.ones(n - i) if joint.kind == "prismatic" else arms
        sizes.append(JointSize(reach, float(GRAVITY_M_S2 * masses_kg[i:] @ lever)))
    return sizes
