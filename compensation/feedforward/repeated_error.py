"""`RepeatedError`: the part of a tracking error that repeats, separated from noise.

With a coupled wrist it is the motors' error, because loops, torques and encoders belong to the
motors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from acquisition.motion.samples import MotionSamples, Phase
from acquisition.processing.periods import average_periods
from acquisition.recording.recording import Recording
from compensation.feedforward.inverse import append_return, count_padding_rows
from config.arrays import FloatArray, freeze
from config.errors import DataQualityError
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import convert_to_motors

FEWEST_RUNS: Final = 2


@dataclass(frozen=True, eq=False)
class RepeatedError:
    """Mean error over a motion's repetitions, and the noise that remains in this mean.

    Attributes:
        joint_names: Base to flange.
        sample_period_s: Time between rows [s].
        rows: Rows of the planned motion that the error covers: the last period of the main phase,
            or all rows.
        error: Shape (samples, n). Mean of desired minus measured position; with a coupled wrist, of
            the motors, link side [rad or m].
        bin_variance: Shape (bins, n). Variance E|N|^2 of the mean's noise at each bin of the error.
            If the motion is not periodic, the bins are those of the error with an appended return
            to its first row.
        periodic: True if the error covers one period.
        repetitions: Number of averaged periods or runs.
    """

    joint_names: tuple[str, ...]
    sample_period_s: float
    rows: slice
    error: FloatArray
    bin_variance: FloatArray
    periodic: bool
    repetitions: int

    def __post_init__(self) -> None:
        n = len(self.joint_names)
        freeze(self, DataQualityError, (None, n), "error", what="mean ")
        rows = len(self.error) + (0 if self.periodic else count_padding_rows(self.sample_period_s))
        freeze(self, DataQualityError, (rows // 2 + 1, n), "bin_variance")

    @property
    def rms(self) -> FloatArray:
        """RMS of the mean error of each joint or motor [rad or m], shape (n,)."""
        return np.asarray(np.sqrt(np.square(self.error).mean(axis=0)))


def repeated_error(
    robot: RobotDescription, samples: MotionSamples, recordings: Sequence[Recording]
) -> RepeatedError:
    """Average the repetitions of a motion: the periods of one run, or several runs.

    Args:
        robot: The robot, with its wrist coupling if it has one.
        samples: The motion as planned.
        recordings: One run of a periodic motion, or at least two runs of any other motion.

    Raises:
        DataQualityError: A recording has other joints, there are too few repetitions or several
            runs of a periodic motion, or too many rows are missing.
    """
    for recording in recordings:
        if recording.joint_names != samples.joint_names:
            raise DataQualityError(
                f"run {recording.run_id} has other joints than the motion: use runs of this motion",
                code="RID-ROBOT-OTHER",
            )
    samples = replace(samples, position=convert_to_motors(robot, samples.position))
    recordings = [
        replace(one, position=convert_to_motors(robot, one.position)) for one in recordings
    ]
    if samples.samples_per_period is None:
        return _of_runs(samples, recordings)
    if len(recordings) != 1:
        raise DataQualityError(
            f"{len(recordings)} runs of a periodic motion were given: give exactly one, because"
            " its periods are the repetitions",
            code="RID-REFINE-RUNS",
        )
    average = average_periods(recordings[0])
    last = int(np.flatnonzero(samples.phase == Phase.MAIN)[-1]) + 1
    rows = slice(last - samples.samples_per_period, last)
    rounding = _rounding(recordings[0].position) / samples.samples_per_period
    return RepeatedError(
        joint_names=samples.joint_names,
        sample_period_s=samples.sample_period_s,
        rows=rows,
        error=samples.position[rows] - average.position,
        bin_variance=average.position_bin_variance / average.periods_kept + rounding,
        periodic=True,
        repetitions=average.periods_kept,
    )


def _of_runs(samples: MotionSamples, recordings: Sequence[Recording]) -> RepeatedError:
    if len(recordings) < FEWEST_RUNS:
        raise DataQualityError(
            "the motion is not periodic: give two or more runs with the same feedforward, so that"
            " the repeated error can be separated from noise",
            code="RID-REFINE-RUNS",
        )
    errors = np.array([samples.position - _position(samples, one) for one in recordings])
    count = len(errors)
    padded = np.array([append_return(error, samples.sample_period_s) for error in errors])
    bins = np.fft.rfft(padded, axis=1) / padded.shape[1]
    noise = np.square(np.abs(bins - bins.mean(axis=0))).sum(axis=0) / (count - 1) / count
    # The noise of a single bin is uncertain with two or three runs: average over neighbouring bins.
    wide = max(1, 2 * round(len(noise) / 40) + 1)
    smooth = np.array([np.convolve(one, np.full(wide, 1.0 / wide), "same") for one in noise.T]).T
    rounding = np.mean([_rounding(one.position) for one in recordings], axis=0) / padded.shape[1]
    return RepeatedError(
        joint_names=samples.joint_names,
        sample_period_s=samples.sample_period_s,
        rows=slice(0, len(samples)),
        error=errors.mean(axis=0),
        bin_variance=smooth + rounding,
        periodic=False,
        repetitions=count,
    )


def _position(samples: MotionSamples, recording: Recording) -> FloatArray:
    """Return the measured position in each row of the motion; missing rows are interpolated.

    Raises:
        DataQualityError: More than 2 % of the rows are missing.
    """
    usable = recording.valid & (recording.sample_index >= 0)
    index = recording.sample_index[usable]
    rows = np.arange(len(samples))
    missing = len(samples) - len(np.unique(index))
    if missing > 0.02 * len(samples):
        raise DataQualityError(
            f"run {recording.run_id}: {missing} of {len(samples)} rows of the motion are missing:"
            " record it again",
            code="RID-RECORDING-ROWS-LOST",
        )
    columns = [np.interp(rows, index, column) for column in recording.position[usable].T]
    return np.stack(columns, axis=1)


def _rounding(position: FloatArray) -> FloatArray:
    """Return the variance of rounding to encoder increments, shape (n,)."""
    steps = np.abs(np.diff(position, axis=0))
    smallest = np.where(steps > 1e-12, steps, np.inf).min(axis=0)
    return np.asarray(np.where(np.isfinite(smallest), smallest, 0.0) ** 2 / 12.0)
