"""Check for terms that are valid only at the positions of their identification."""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import FloatArray
from dynamics.terms.spring import Spring
from identification.estimation.estimate import Estimate

MARGIN_SHARE: Final = 0.02
"""Distance by which a motion may leave the identified range, relative to the range."""


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
