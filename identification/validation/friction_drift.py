"""How the friction of a run drifted from period to period: motors that were still warming up."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import stdtr

from acquisition.motion.samples import Phase
from acquisition.recording.recording import Recording

FEWEST_PERIODS: Final = 4
SIGNIFICANT_P: Final = 0.01
WORTH_TELLING: Final = 0.01


@dataclass(frozen=True)
class FrictionDrift:
    """The trend of one joint's friction over the periods of a run.

    Attributes
    ----------
    joint : str
        The joint.
    first, last : float
        Mean torque along the motion, its sign turned with the speed's, in the first and the last
        period on the fitted line [N m or N].
    p_value : float
        Probability of such a slope without any drift.
    """

    joint: str
    first: float
    last: float
    p_value: float

    @property
    def share(self) -> float:
        """Change over the run, as a share of the friction."""
        size = max(abs(self.first), abs(self.last), 1e-300)
        return (self.last - self.first) / size

    @property
    def significant(self) -> bool:
        """Whether it is a drift that matters."""
        return self.p_value < SIGNIFICANT_P and abs(self.share) >= WORTH_TELLING

    @property
    def sentence(self) -> str:
        """The finding in words."""
        way = "fell" if self.share < 0.0 else "rose"
        return (
            f"{self.joint}'s friction {way} by {100.0 * abs(self.share):.2g} % over the run: it was"
            " still warming up; run it until that stops, then record again"
        )


def friction_drift(recording: Recording) -> tuple[FrictionDrift, ...]:
    """Return each joint's trend of friction over the main periods of a recording.

    The work that friction takes is the mean of torque times the sign of the speed: what conserves
    energy gives none of it over a whole period. Empty where there are fewer than four periods.

    Parameters
    ----------
    recording : Recording
        Of a periodic motion.
    """
    samples = recording.samples_per_period
    if samples is None or recording.sample_period_s is None:
        return ()
    main = recording.phase == Phase.MAIN
    index = recording.sample_index[main]
    if len(index) == 0:
        return ()
    period = (index - index[0]) // samples
    velocity = np.gradient(recording.position[main], recording.sample_period_s, axis=0)
    work = np.sign(velocity) * recording.torque_nm[main]
    # A period that misses rows would show another part of the path: it does not count.
    whole = [p for p in range(int(period[-1]) + 1) if np.sum(period == p) == samples]
    if len(whole) < FEWEST_PERIODS:
        return ()
    means = np.array([work[period == p].mean(axis=0) for p in whole])
    numbers = np.array(whole, dtype=np.float64)
    return tuple(
        _trend(joint, numbers, means[:, j]) for j, joint in enumerate(recording.joint_names)
    )


def _trend(joint: str, numbers: np.ndarray, means: np.ndarray) -> FrictionDrift:
    (slope, start), residual, *_ = np.polyfit(numbers, means, 1, full=True)
    freedom = len(numbers) - 2
    spread = float(residual[0]) / freedom if len(residual) else 0.0
    sigma = math.sqrt(spread / float(np.sum((numbers - numbers.mean()) ** 2)))
    p_value = 2.0 * float(stdtr(freedom, -abs(slope) / sigma)) if sigma > 0.0 else 1.0
    return FrictionDrift(
        joint=joint,
        first=float(start + slope * numbers[0]),
        last=float(start + slope * numbers[-1]),
        p_value=p_value,
    )
