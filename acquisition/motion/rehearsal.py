"""`rehearsal`: the motion once at reduced speed, as a check before the real motion."""

from __future__ import annotations

import math

import numpy as np

from acquisition.motion.samples import MotionSamples, Phase
from config.errors import ConfigError

SLOWER = 4.0
"""Duration of a rehearsal divided by that of the motion; the rehearsal has a quarter of the speed.
"""


def rehearsal(samples: MotionSamples, slower: float = SLOWER) -> MotionSamples:
    """Return the path of a motion at a fraction of its speed, with a single period.

    Args:
        samples: The motion.
        slower: Factor that divides the velocities; accelerations are divided by its square.

    Raises:
        ConfigError: `slower` is below 1 or not finite.
    """
    if not 1.0 <= slower < math.inf:
        raise ConfigError(
            f"invalid rehearsal: slower is {slower:g}, but must be at least 1 and finite",
            code="RID-OPTION-RANGE",
        )
    from scipy.interpolate import CubicHermiteSpline  # a slow import that few motions need

    rows = _rows_of_one_period(samples)
    period_s = samples.sample_period_s
    path = CubicHermiteSpline(
        period_s * np.arange(len(rows)), samples.position[rows], samples.velocity[rows]
    )
    count = math.ceil((len(rows) - 1) * slower) + 1
    time_s = np.linspace(0.0, period_s * (len(rows) - 1), count)
    rate = float(time_s[1] - time_s[0]) / period_s
    nearest = np.minimum(np.round(time_s / period_s).astype(int), len(rows) - 1)
    return MotionSamples(
        samples.joint_names,
        period_s,
        path(time_s),
        path(time_s, 1) * rate,
        path(time_s, 2) * rate**2,
        samples.phase[rows][nearest],
    )


def _rows_of_one_period(samples: MotionSamples) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Return the indices of a motion's rows, with one period; omitting periods leaves no gap."""
    everything = np.arange(len(samples.position))
    if samples.samples_per_period is None:
        return everything
    periodic = np.flatnonzero(np.isin(samples.phase, (Phase.TRANSIENT, Phase.MAIN)))
    return np.setdiff1d(everything, periodic[samples.samples_per_period :])
