"""`RepeatedError`: what a robot misses of a motion every time, apart from what is chance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.motion.samples import MotionSamples, Phase
from acquisition.processing.periods import average_periods
from acquisition.recording.recording import Recording
from compensation.feedforward.inverse import padding_rows, returned
from config.arrays import FloatArray, freeze
from config.errors import DataQualityError

FEWEST_RUNS: Final = 2


@dataclass(frozen=True, eq=False)
class RepeatedError:
    """The mean error of a motion's repetitions, and the noise left in that mean.

    Attributes:
        joint_names: Base to flange.
        sample_period_s: Time between rows [s].
        rows: The rows of the planned motion that it is of: its last measured period, or all of
            them.
        error: Shape (samples, n). Mean of q_d - q [rad or m].
        bin_variance: Shape (bins, n). Noise of the mean, E|N|^2 on each bin of the error (with its
            return to the first row, where the motion is not periodic).
        periodic: Whether it is of a period.
        repetitions: Periods, or runs, that were averaged.
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
        rows = len(self.error) + (0 if self.periodic else padding_rows(self.sample_period_s))
        freeze(self, DataQualityError, (rows // 2 + 1, n), "bin_variance")

    @property
    def rms(self) -> FloatArray:
        """RMS of the mean error of each joint [rad or m], shape (n,)."""
        return np.asarray(np.sqrt(np.square(self.error).mean(axis=0)))


def repeated_error(samples: MotionSamples, recordings: Sequence[Recording]) -> RepeatedError:
    """Average the repetitions of a motion: the periods of a run, or several runs.

    Args:
        samples: The motion as planned.
        recordings: One run of a periodic motion, or at least two runs of one that is not.

    Raises:
        DataQualityError: There are too few repetitions, or rows are missing.
    """
    for recording in recordings:
        if recording.joint_names != samples.joint_names:
            raise DataQualityError(
                "a run is of other joints than the motion", code="RID-ROBOT-OTHER"
            )
    if samples.samples_per_period is None:
        return _of_runs(samples, recordings)
    if len(recordings) != 1:
        raise DataQualityError(
            f"{len(recordings)} runs of a periodic motion are given: one is enough, its periods are"
            " the repetitions",
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
            "the motion is not periodic: give two runs of it or more with the same feedforward, so"
            " that what repeats can be told from noise",
            code="RID-REFINE-RUNS",
        )
    errors = np.array([samples.position - _position(samples, one) for one in recordings])
    count = len(errors)
    padded = np.array([returned(error, samples.sample_period_s) for error in errors])
    bins = np.fft.rfft(padded, axis=1) / padded.shape[1]
    noise = np.square(np.abs(bins - bins.mean(axis=0))).sum(axis=0) / (count - 1) / count
    # Of two or three runs a single bin says little: neighbours are taken together.
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
    """Return the measured position of every row of the motion."""
    there = recording.valid & (recording.sample_index >= 0)
    index = recording.sample_index[there]
    rows = np.arange(len(samples))
    missing = len(samples) - len(np.unique(index))
    if missing > 0.02 * len(samples):
        raise DataQualityError(
            f"run {recording.run_id} misses {missing} of {len(samples)} rows of the motion: record"
            " it again",
            code="RID-RECORDING-ROWS-LOST",
        )
    columns = [np.interp(rows, index, column) for column in recording.position[there].T]
    return np.stack(columns, axis=1)


def _rounding(position: FloatArray) -> FloatArray:
    """Return the variance that rounding to the encoders' steps has, shape (n,)."""
    steps = np.abs(np.diff(position, axis=0))
    smallest = np.where(steps > 1e-12, steps, np.inf).min(axis=0)
    return np.asarray(np.where(np.isfinite(smallest), smallest, 0.0) ** 2 / 12.0)
