"""Comparison of a motion with that of the identification: extrapolation, and the same motion."""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import FloatArray
from dynamics.terms.spring import Spring
from identification.estimation.estimate import Estimate

MARGIN_SHARE: Final = 0.02
"""Distance by which a motion may leave the identified range, relative to the range."""
SAME_END: Final = 5e-4
"""Largest difference of equal ends of two ranges of positions, relative to the range."""
FEWEST_SAME_ENDS: Final = 2.0 / 3.0
"""Fraction of equal ends from which two motions are probably the same. Ends can differ because of a
way to the first pose, and be equal because of a limit.
"""


def repetition_findings(estimate: Estimate, position: FloatArray) -> tuple[str, ...]:
    """Report if a motion has the positions of the identification, so that it tests no other motion.

    Args:
        position: Shape (samples, n). The motion [rad or m].
    """
    if estimate.position_range is None:
        return ()
    ends = estimate.position_range
    own = np.column_stack([position.min(axis=0), position.max(axis=0)])
    same = np.abs(own - ends) <= SAME_END * np.ptp(ends, axis=1)[:, np.newaxis]
    if same.mean() < FEWEST_SAME_ENDS:
        return ()
    return (
        "The joints move between the same positions as in the identification, so this run probably"
        " repeats its motion. Other motions can have a larger error: validate on another motion.",
    )


def extrapolation_findings(estimate: Estimate, position: FloatArray) -> tuple[str, ...]:
    """Report if a motion leaves the positions at which a spring's Fourier series was identified.

    Args:
        position: Shape (samples, n). The motion [rad or m].
    """
    spring = next((term for term in estimate.model.terms if isinstance(term, Spring)), None)
    if spring is None or spring.distances_m is not None or estimate.position_range is None:
        return ()
    low, high = estimate.position_range[spring.joint].tolist()
    own, margin = position[:, spring.joint], MARGIN_SHARE * (high - low)
    outside = float(np.mean((own < low - margin) | (own > high + margin)))
    if outside == 0.0:
        return ()
    name = estimate.robot.joint_names[spring.joint]
    return (
        f"The spring of {name} is a Fourier series that was identified between {low:.3g} and"
        f" {high:.3g} rad. This motion moves from {own.min():.3g} to {own.max():.3g} rad, with"
        f" {100.0 * outside:.2g} % of its samples outside. There the series is an extrapolation,"
        f" and the predicted torque of {name} can be wrong. Identify a motion over the whole"
        " range, or set the spring's l_m and r_m in the robot file.",
    )
