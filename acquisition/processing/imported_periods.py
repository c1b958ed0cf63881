"""Periods of an imported recording: the map states the period, and the positions must repeat."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from acquisition.processing.smoothing import GAP_STEPS, temperature_at
from acquisition.recording.recording import Recording
from config.arrays import BoolArray, FloatArray
from config.errors import DataQualityError

REPEATED: Final = 0.03
"""Largest RMS deviation of a joint's positions between periods, relative to their variation."""
AT_REST: Final = 0.02
"""A joint with less variation than this fraction of the largest one is compared with this fraction.
"""


def resample_periods(recording: Recording, period_s: float) -> Recording:
    """Return a periodic recording, resampled to a uniform grid that divides its period.

    The first row is the start of the first period; rows after the last whole period are left out.
    Grid rows in a gap of more than 5 median steps are marked invalid.

    Args:
        recording: Whole periods from its first row on.
        period_s: True period [s]; it is not estimated from the recording.

    Raises:
        DataQualityError: The recording has fewer than two whole periods, or a period fewer than
            four rows; or the motion does not repeat after the period.
    """
    from scipy.interpolate import CubicSpline  # a slow import that few commands need

    time_s = recording.time_s[recording.valid]
    step_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else np.inf
    periods = int((time_s[-1] - time_s[0] + step_s) / period_s) if len(time_s) > 1 else 0
    if periods < 2:
        raise DataQualityError(
            f"the recording has {periods} whole periods of {period_s:g} s, but averaging needs"
            " at least 2: correct period_s and rows in the map, or leave period_s out",
            code="RID-IMPORT-RANGE",
        )
    if period_s < 4.0 * step_s:
        raise DataQualityError(
            f"a period of {period_s:g} s has {period_s / step_s:.3g} rows of the recording, but"
            " averaging needs at least 4: correct period_s in the map, or leave it out",
            code="RID-IMPORT-RANGE",
        )
    samples_per_period = round(period_s / step_s)
    sample_period_s = period_s / samples_per_period
    index = np.arange(periods * samples_per_period)
    grid = time_s[0] + index * sample_period_s
    n = len(recording.joint_names)
    commands = recording.velocity_command
    if commands is None:
        commands = np.empty((len(recording), 0))
    measured = np.hstack([recording.position, recording.torque_nm, commands])
    values = measured[recording.valid]
    resampled = CubicSpline(time_s, values)(np.minimum(grid, time_s[-1]))
    after = np.clip(np.searchsorted(time_s, grid), 1, len(time_s) - 1)
    valid = time_s[after] - time_s[after - 1] <= GAP_STEPS * step_s
    position = resampled[:, :n]
    _refuse_other_period(recording.joint_names, position, valid, samples_per_period, period_s)
    return Recording(
        joint_names=recording.joint_names,
        time_s=grid,
        position=position,
        torque_nm=resampled[:, n : 2 * n],
        velocity_command=None if recording.velocity_command is None else resampled[:, 2 * n :],
        valid=valid,
        phase=np.full(len(grid), recording.phase[0], dtype=np.uint8),
        sample_index=index,
        source=recording.source,
        sample_period_s=sample_period_s,
        samples_per_period=samples_per_period,
        torque_filter=recording.torque_filter,
        temperature_k=None if recording.temperature_k is None else temperature_at(recording, grid),
        cell_name=recording.cell_name,
        robot_name=recording.robot_name,
        run_id=recording.run_id,
    )


def _refuse_other_period(
    names: Sequence[str], position: FloatArray, valid: BoolArray, samples: int, period_s: float
) -> None:
    """Refuse a motion that does not repeat after its stated period.

    In each period, the positions are compared with the median of all periods. Half of the periods
    may differ, because some are rejected later.

    Args:
        names: Names of the joints.
        position: Shape (periods x samples, joints). Positions on the grid of the period [rad or m].
        valid: Shape (periods x samples,). False for rows in a gap.
        samples: Number of rows of a period.
        period_s: The stated period [s].

    Raises:
        DataQualityError: The motion does not repeat (RID-IMPORT-PERIOD).
    """
    there = valid.reshape(-1, samples)
    periods = np.where(valid[:, np.newaxis], position, np.nan).reshape(-1, samples, len(names))
    periods = periods[there.any(axis=1)][:, there.any(axis=0)]  # without gaps in all rows
    deviation = periods - np.nanmedian(periods, axis=0)
    rms = np.median(np.sqrt(np.nanmean(np.square(deviation), axis=1)), axis=0)
    variation = position.std(axis=0)
    share = rms / np.maximum(variation, max(AT_REST * float(variation.max()), 1e-9))
    worst = int(np.argmax(share))
    if share[worst] <= REPEATED:
        return
    found = _repetition(position[:, worst])
    hint = f"; they repeat after about {found * period_s / samples:.4g} s" if found else ""
    raise DataQualityError(
        f"the motion does not repeat after {period_s:g} s (`period_s`): from period to period, the"
        f" positions of {names[worst]} differ by {100.0 * share[worst]:.0f} % of their variation"
        f" (RMS){hint}. Correct period_s and rows in the map, or leave period_s out",
        code="RID-IMPORT-PERIOD",
    )


def _repetition(position: FloatArray) -> int | None:
    """Return the number of rows after which a joint's positions repeat; None if they do not.

    It is the smallest lag, of at most three quarters of the rows, at which the RMS difference of
    positions and later positions is small. Lags before the first maximum of this difference do not
    count, because neighbouring positions are always alike.
    """
    centred = position - position.mean()
    rows = len(centred)
    lags = np.arange(3 * rows // 4)
    spectrum = np.fft.rfft(centred, 2 * rows)
    products = np.fft.irfft(np.square(np.abs(spectrum)), 2 * rows)[lags]
    sums = np.concatenate([[0.0], np.cumsum(np.square(centred))])
    squares = sums[rows - lags] + sums[rows] - sums[lags] - 2.0 * products
    difference = np.sqrt(np.maximum(squares / (rows - lags), 0.0) / 2.0) / centred.std()
    first = int(np.argmax(difference > 1.0)) if (difference > 1.0).any() else rows
    alike = np.flatnonzero(difference[first:] <= REPEATED) + first
    if not len(alike):
        return None
    group = alike[alike - alike[0] == np.arange(len(alike))]
    return int(group[np.argmin(difference[group])])
