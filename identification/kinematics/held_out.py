"""`HeldOut`: errors at poses that a fit did not use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from acquisition.tracker.pose_file import MeasuredPoses
from config.arrays import FloatArray, IntArray, freeze
from config.errors import EstimationError
from identification.kinematics.arm import PlacedArm
from identification.kinematics.fit import ArmFit, fit_arm
from identification.kinematics.parameters import KinematicParameter

FOLDS: Final = 5
"""Parts into which the poses are divided; each part is predicted from the others."""
SAME_POSE: Final = 0.01
"""Largest difference of a joint position between repetitions of one pose [rad or m]."""


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Measured minus predicted points at poses that the fit did not use.

    Attributes:
        error_m: Shape (poses, 3).
        sigma: Shape (poses, 3). Standard deviation that the fit predicts for these errors, noise
            included [m].
    """

    error_m: FloatArray
    sigma: FloatArray

    def __post_init__(self) -> None:
        freeze(self, EstimationError, (None, 3), "error_m")
        freeze(self, EstimationError, (len(self.error_m), 3), "sigma")

    @property
    def distance_m(self) -> FloatArray:
        """Distance between measured and predicted point, (poses,)."""
        return np.asarray(np.linalg.norm(self.error_m, axis=1))

    @property
    def mean_m(self) -> float:
        """Mean distance."""
        return float(self.distance_m.mean())

    @property
    def rms_m(self) -> float:
        """RMS distance."""
        return float(np.sqrt(np.mean(self.distance_m**2)))

    @property
    def max_m(self) -> float:
        """Largest distance."""
        return float(self.distance_m.max())

    @property
    def excess(self) -> float:
        """RMS of the errors divided by their predicted standard deviations; ideally about 1."""
        return float(np.sqrt(np.mean((self.error_m / self.sigma) ** 2)))

    @property
    def ratio(self) -> FloatArray:
        """Length of each error over its prediction, relative to the median of all, (poses,)."""
        size = np.linalg.norm(self.error_m / self.sigma, axis=1)
        return np.asarray(size / np.median(size))


def cross_validate(
    start: PlacedArm, poses: MeasuredPoses, parameters: Sequence[KinematicParameter]
) -> HeldOut:
    """Return the error at each pose of a fit to the other parts of the poses.

    Distinct pose k belongs to part k modulo `FOLDS`, so that a part has loaded and unloaded poses.
    Repetitions of a pose, also with other loads, are in the part of their first row: otherwise the
    fit would contain a pose by which it is judged.

    Raises:
        EstimationError: A fit fails.
    """
    error, sigma = np.empty((2, len(poses), 3))
    part = distinct_poses(poses.position) % FOLDS
    for number in range(FOLDS):
        out = part == number
        found = judge(fit_arm(start, poses.keep(~out), parameters), poses.keep(out))
        error[out], sigma[out] = found.error_m, found.sigma
    return HeldOut(error, sigma)


def distinct_poses(position: FloatArray) -> IntArray:
    """Return for each row the number of its pose, (rows,), counted from 0 by first occurrence.

    Two rows have the same pose if they differ by at most `SAME_POSE`, or if a chain of such rows
    connects them.

    Args:
        position: Shape (rows, n). Joint positions [rad or m].
    """
    difference = np.abs(position[:, np.newaxis] - position).max(axis=2)
    _, group = connected_components(csr_array(difference <= SAME_POSE), directed=False)
    _, first, index = np.unique(group, return_index=True, return_inverse=True)
    return np.asarray(np.argsort(np.argsort(first))[index], dtype=np.int64)


def judge(fit: ArmFit, poses: MeasuredPoses) -> HeldOut:
    """Return the errors of a fit at poses that it did not use."""
    noise = np.ones(len(poses)) if poses.sigma_m is None else poses.sigma_m
    spread = fit.point_sigma(poses.position, poses.load_kg)
    return HeldOut(
        poses.point_m - fit.arm.points(poses.position, poses.load_kg),
        fit.scale * np.sqrt(spread**2 + noise[:, np.newaxis] ** 2),
    )
