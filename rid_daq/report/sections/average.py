"""`AverageSection`: the averaged periods of a run, and their noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from config.robot.robot import RobotDescription
from rid_daq.report.sections.section import Section

if TYPE_CHECKING:
    from acquisition.processing.periods import PeriodAverage


class RejectedPeriod(Section):
    """A period that was left out of the average.

    Attributes:
        index: Number of the period, counted from 0.
        reason: Reason for the rejection.
    """

    index: int
    reason: str


class AxisNoise(Section):
    """Noise of one sample of an axis, estimated from the scatter between periods (1 sigma).

    Attributes:
        joint: Name of the joint.
        unit: Unit of the joint's position.
        torque_unit: Unit of the joint's torque.
        torque_noise: Standard deviation of one torque sample, in `torque_unit`.
        position_noise: Standard deviation of one position sample, in `unit`.
    """

    joint: str
    unit: str
    torque_unit: str
    torque_noise: float
    position_noise: float


class AverageSection(Section):
    """Averaged and rejected periods of a run, and the noise of its samples.

    Attributes:
        sentence: Summary in a sentence.
        periods_kept: Number of averaged periods.
        samples_per_period: Number of samples in one period.
        missing_samples: Number of single rows that were left out of the mean.
        rejected: The rejected periods.
        axes: Noise of each axis.
    """

    sentence: str
    periods_kept: int
    samples_per_period: int
    missing_samples: int
    rejected: tuple[RejectedPeriod, ...]
    axes: tuple[AxisNoise, ...]

    @classmethod
    def of(cls, average: PeriodAverage, robot: RobotDescription) -> AverageSection:
        """Return the section for averaged periods."""
        recorded = average.periods_kept + len(average.rejected)
        return cls.from_attributes(
            average,
            sentence=f"{average.periods_kept} of {recorded} periods averaged,"
            f" {average.samples_per_period} samples each; {average.missing_samples}"
            " single rows without a valid answer were left out of the"
            f" mean.{_plate_sentence(average)}",
            rejected=tuple(RejectedPeriod.from_attributes(period) for period in average.rejected),
            axes=AxisNoise.for_each(
                joint=robot.joint_names,
                unit=[joint.unit for joint in robot.joints],
                torque_unit=[joint.torque_unit for joint in robot.joints],
                torque_noise=np.sqrt(average.torque_variance),
                position_noise=np.sqrt(average.position_variance),
            ),
        )


def _plate_sentence(average: PeriodAverage) -> str:
    """Return a sentence on the plate's drift and rejected channels; empty without a plate."""
    plate = average.reaction
    if plate is None:
        return ""
    drift = 1e3 * float(np.abs(plate.drift_n_s).max())
    words = f" The force plate's channels drifted by up to {drift:.3g} mN/s, which was removed"
    if plate.left_out:
        words += (
            f"; {', '.join(plate.left_out)} were left out because of overload, loss, drift or a"
            " constant value"
        )
    return words + "."
