"""`AverageSection`: the periods of a run, averaged, and their noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from config.robot.robot import RobotDescription
from rid_daq.report.sections.section import Section, units

if TYPE_CHECKING:
    from acquisition.processing.periods import PeriodAverage


class RejectedPeriod(Section):
    """A period that was not averaged.

    Attributes:
        index: Counted from 0.
        reason: Why.
    """

    index: int
    reason: str


class AxisNoise(Section):
    """The noise of one sample of an axis, as the scatter between periods shows it (1 sigma).

    Attributes:
        joint, unit, torque_unit: Its name, and the units of its position and torque.
        torque_noise, position_noise: In these units.
    """

    joint: str
    unit: str
    torque_unit: str
    torque_noise: float
    position_noise: float


class AverageSection(Section):
    """How many periods were averaged, which were rejected and why, and the noise.

    Attributes:
        sentence: All of it in a sentence.
        periods_kept, samples_per_period, missing_samples: Averaged; of one; single rows that were
            left out of the mean.
        rejected: The other periods.
        axes: One an axis.
    """

    sentence: str
    periods_kept: int
    samples_per_period: int
    missing_samples: int
    rejected: tuple[RejectedPeriod, ...]
    axes: tuple[AxisNoise, ...]

    @classmethod
    def of(cls, average: PeriodAverage, robot: RobotDescription) -> AverageSection:
        """Return what is said of averaged periods."""
        recorded = average.periods_kept + len(average.rejected)
        return cls.from_attributes(
            average,
            sentence=f"{average.periods_kept} of {recorded} periods averaged,"
            f" {average.samples_per_period} samples each; {average.missing_samples} single rows"
            f" without a valid answer were left out of the mean.{_plate_sentence(average)}",
            rejected=tuple(RejectedPeriod.from_attributes(period) for period in average.rejected),
            axes=AxisNoise.for_each(
                joint=robot.joint_names,
                unit=[units(joint)[0] for joint in robot.joints],
                torque_unit=[units(joint)[1] for joint in robot.joints],
                torque_noise=np.sqrt(average.torque_variance),
                position_noise=np.sqrt(average.position_variance),
            ),
        )


def _plate_sentence(average: PeriodAverage) -> str:
    """Return what became of the force plate's channels, where there were any."""
    plate = average.reaction
    if plate is None:
        return ""
    drift = 1e3 * float(np.abs(plate.drift_n_s).max())
    words = f" The force plate's channels drifted by up to {drift:.3g} mN/s, which was removed"
    if plate.left_out:
        words += f"; {', '.join(plate.left_out)} left out for overload, loss or drift"
    return words + "."
