"""`FitGrade`: grade of a model's fit to a joint's torque, and its reason."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np

from config.arrays import FloatArray

GOOD_SHARE: Final = 0.1
BAD_SHARE: Final = 0.3


class Grade(StrEnum):
    """Reliability of a fit."""

    GOOD = "good"
    DOUBTFUL = "doubtful"
    BAD = "bad"


@dataclass(frozen=True)
class FitGrade:
    """Residual of one joint in several measures, and the grade.

    The grade depends on the residual that noise does not explain, relative to the torque:
    - Up to 10 % is good, more than 30 % is bad, in between is doubtful.
    - A doubtful fit becomes bad if the residual on held-out parts of the recording is more than 30
      %, combined with the noise. Then the parameters explain only the fitted torques, as for a
      robot with other lengths or axes.

    Recordings of industrial robots with the usual friction terms have 3 to 10 %, and the small
    joints of a wrist up to 20 %.

    Attributes:
        residual_nm, torque_nm: RMS of measured minus predicted torque, and of the measured torque
            [N m or N].
        noise_nm: RMS of the residual due to measured noise alone; None if it is not known.
        grade: None for a joint that does not move, or whose torque is not known.
        reason: Reason of the grade, in words.
    """

    joint: str
    residual_nm: float
    torque_nm: float
    noise_nm: float | None
    grade: Grade | None
    reason: str

    @property
    def percent(self) -> float | None:
        """The residual in percent of the torque."""
        known = math.isfinite(self.residual_nm) and self.torque_nm > 0.0
        return 100.0 * self.residual_nm / self.torque_nm if known else None

    @property
    def over_noise(self) -> float | None:
        """The residual relative to that of noise alone."""
        return self.residual_nm / self.noise_nm if self.noise_nm else None


def grade_fit(
    joint_names: Sequence[str],
    residual_nm: FloatArray,
    torque_nm: FloatArray,
    noise_nm: FloatArray | None = None,
    *,
    of: str = "torque",
    held_out_share: FloatArray | None = None,
) -> tuple[FitGrade, ...]:
    """Grade the fit of every joint.

    Args:
        joint_names: Joints from base to flange.
        residual_nm, torque_nm: Shape (n,). RMS of measured minus predicted torque, and of the
            measured torque [N m or N]; NaN for a joint that does not move.
        noise_nm: Shape (n,). RMS of the residual due to measured noise alone [N m or N].
        of: The quantity that the fit explains, in words.
        held_out_share: Shape (n,). Residual relative to the torque on held-out parts of the
            recording.
    """
    grades = []
    for j, joint in enumerate(joint_names):
        noise = None if noise_nm is None else float(noise_nm[j])
        residual, torque = float(residual_nm[j]), float(torque_nm[j])
        grade, reason = _grade(residual, torque, noise or 0.0, of)
        share = 0.0 if held_out_share is None else float(held_out_share[j])
        if grade is Grade.DOUBTFUL and share > np.hypot(BAD_SHARE, (noise or 0.0) / torque):
            grade = Grade.BAD
            reason += (
                f"; on parts of the recording that were left out of the fit it is"
                f" {100.0 * share:.0f} %, as if the lengths or axes in the robot file were wrong,"
                " or those of another robot"
            )
        grades.append(FitGrade(joint, residual, torque, noise, grade, reason))
    return tuple(grades)


def worst(grades: Sequence[FitGrade]) -> Grade | None:
    """Return the worst grade; None if no joint has a grade."""
    known = [each.grade for each in grades if each.grade is not None]
    return max(known, key=list(Grade).index, default=None)


def limit_share(torque_nm: FloatArray, noise_nm: FloatArray | None) -> FloatArray:
    """Return the residual relative to the torque above which a fit is bad, shape (n,).

    Args:
        torque_nm: Shape (n,). RMS of the measured torque [N m or N].
        noise_nm: Shape (n,). RMS of the residual due to measured noise alone [N m or N].
    """
    share = np.zeros_like(torque_nm)
    if noise_nm is not None:
        np.divide(noise_nm, torque_nm, out=share, where=torque_nm > 0.0)
    return np.hypot(BAD_SHARE, share)


def _grade(residual: float, torque: float, noise: float, of: str) -> tuple[Grade | None, str]:
    if not (math.isfinite(residual) and math.isfinite(torque)) or torque <= 0.0:
        return None, "the joint does not move, or its torque is not known"
    share = math.sqrt(max(residual**2 - noise**2, 0.0)) / torque
    if share <= GOOD_SHARE:
        if residual > GOOD_SHARE * torque:
            return Grade.GOOD, "the residual is explained by the measurement noise"
        return Grade.GOOD, f"the residual is at most {100.0 * GOOD_SHARE:g} % of the {of}"
    beyond = " beyond the noise" if noise > 0.1 * residual else ""
    grade = Grade.BAD if share > BAD_SHARE else Grade.DOUBTFUL
    limit = BAD_SHARE if grade is Grade.BAD else GOOD_SHARE
    return grade, (
        f"the residual{beyond} is {100.0 * share:.0f} % of the {of}, more than {100.0 * limit:g} %"
    )
