"""Drift of a run's friction from period to period, as while motors warm up."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import stdtr

from acquisition.motion.samples import Phase
from acquisition.recording.recording import Recording, concatenate_recordings
from config.arrays import FloatArray

FEWEST_PERIODS: Final = 4
SIGNIFICANT_P: Final = 0.01
WORTH_TELLING: Final = 0.01


@dataclass(frozen=True)
class FrictionDrift:
    """Trend of one joint's friction over the periods of a run.

    Attributes:
        first, last: Mean of torque times the sign of the speed, in the first and the last period,
            on the fitted line [N m or N].
        p_value: Probability of such a slope without any drift.
    """

    joint: str
    first: float
    last: float
    p_value: float

    @property
    def share(self) -> float:
        """Change over the run, relative to the friction."""
        size = max(abs(self.first), abs(self.last), 1e-300)
        return (self.last - self.first) / size

    @property
    def significant(self) -> bool:
        """True if the drift is statistically significant and at least 1 %."""
        return self.p_value < SIGNIFICANT_P and abs(self.share) >= WORTH_TELLING

    @property
    def sentence(self) -> str:
        """The drift of the joint's friction, in one sentence."""
        way, cause = "fell", "was probably still warming up"
        if self.share > 0.0:
            way, cause = "rose", "probably cooled down"
        return (
            f"{self.joint}'s friction {way} by {100.0 * abs(self.share):.2g} % over the run: it"
            f" {cause}; move the joint until its friction is constant, then record again"
        )


def friction_drift(parts: Iterable[Recording]) -> tuple[FrictionDrift, ...]:
    """Return each joint's trend of friction over the main periods of a recording.

    The mean of torque times the sign of the speed measures friction: other torques add about the
    same amount in every period, and so hardly change the trend. The result is empty for fewer than
    four periods.

    Args:
        parts: Recording of a periodic motion, whole or in parts.
    """
    means: dict[int, FloatArray] = {}
    joint_names: tuple[str, ...] = ()
    start: int | None = None
    begun, rows = -1, np.empty((0, 0))
    for part, work in _works(parts):
        if part.samples_per_period is None:
            return ()
        joint_names = part.joint_names
        start = int(part.sample_index[0]) if start is None else start
        period = (part.sample_index - start) // part.samples_per_period
        for number in np.unique(period).tolist():
            own = work[period == number]
            rows = np.concatenate([rows, own]) if number == begun else own
            begun = number
            # A period with missing rows does not cover the whole path: it is not used.
            if len(rows) == part.samples_per_period:
                means[number] = rows.mean(axis=0)
    if len(means) < FEWEST_PERIODS:
        return ()
    numbers, table = np.array(list(means), dtype=np.float64), np.array(list(means.values()))
    return tuple(_trend(joint, numbers, table[:, j]) for j, joint in enumerate(joint_names))


def _works(parts: Iterable[Recording]) -> Iterator[tuple[Recording, FloatArray]]:
    """Yield main rows, and their torques times the signs of their speeds.

    The speed of a row depends on its neighbours, so that the last row of a part is yielded with the
    next part.
    """
    kept: Recording | None = None
    begin = 0  # index of the first kept row that was not yielded
    for part in parts:
        main = part.part(part.phase == Phase.MAIN)
        main = main if kept is None else concatenate_recordings([kept, main])
        if len(main) < 3:
            kept = main
            continue
        yield main.part(slice(begin, -1)), _work(main)[begin:-1]
        kept, begin = main.part(slice(-2, None)), 1
    if kept is not None and len(kept) > 1:
        yield kept.part(slice(begin, None)), _work(kept)[begin:]


def _work(rows: Recording) -> FloatArray:
    velocity = np.gradient(rows.position, rows.sample_period_s or 1.0, axis=0)
    return np.asarray(np.sign(velocity) * rows.torque_nm)


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
