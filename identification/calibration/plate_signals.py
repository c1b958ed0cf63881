"""Signals for the timing of a force plate: functions of the motion, and low-passed readings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline

from acquisition.processing.smoothing import low_pass, smooth_nonperiodic
from acquisition.recording.recording import Recording
from acquisition.signals.bins import filter_response
from config.arrays import BoolArray, FloatArray
from config.cell.torque_filter import ButterworthFilter
from config.errors import DataQualityError
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import base_wrench_regressor
from identification.model.drawn_arm import drawn_parameters
from identification.model.options import ModelOptions

STEPS_PER_CUTOFF: Final = 4.0
"""Samples per period of the cut-off frequency."""
NEGLIGIBLE: Final = 1e-3
"""Smallest size of a direction of the parameters, relative to the largest."""
FEWEST_SAMPLES: Final = 200
MOST_SAMPLES: Final = 6000
"""Number of samples from which on fewer samples per period of the cut-off frequency are used."""


@dataclass(frozen=True, eq=False)
class WrenchFunctions:
    """Base wrench of a motion as a function of the arm's parameters, on uniform times.

    Attributes:
        time_s: Shape (n,). Times on the recording's clock [s].
        wrench: Shape (n, 6, k). Wrench per unit of k combinations of the parameters, which are
            orthonormal over all samples.
        drawn: Shape (k,). These combinations for the robot's drawings.
    """

    time_s: FloatArray
    wrench: FloatArray
    drawn: FloatArray

    @classmethod
    def of(cls, recording: Recording, robot: RobotDescription, cutoff_hz: float) -> WrenchFunctions:
        """Return the functions on the longest part of a recording without a gap.

        Raises:
            DataQualityError: This part is too short.
        """
        signals = smooth_nonperiodic(recording, cutoff_hz)
        every = max(1, round(1.0 / (STEPS_PER_CUTOFF * cutoff_hz * signals.sample_period_s)))
        longest = int(np.argmax(np.bincount(signals.segment)))
        rows = np.flatnonzero(signals.segment == longest)
        rows = rows[:: max(every, len(rows) // MOST_SAMPLES)]
        if len(rows) < FEWEST_SAMPLES:
            raise DataQualityError(
                f"the motion has only {np.ptp(signals.time_s[rows]):.1f} s without a"
                " gap, too short for the delay of the force plate: record a longer motion",
                code="RID-PLATE-CLOCK",
            )
        model = ModelOptions(kind="external").build(robot)
        moved = (signals.position[rows], signals.velocity[rows], signals.acceleration[rows])
        phi = base_wrench_regressor(model, *moved)
        columns = phi.reshape(-1, phi.shape[2])
        size = np.linalg.norm(columns, axis=0)
        size[size == 0.0] = 1.0
        left, sizes, right = np.linalg.svd(columns / size, full_matrices=False)
        kept = sizes > NEGLIGIBLE * sizes[0]
        drawn = sizes[kept] * (right[kept] @ (size * drawn_parameters(model, robot)))
        wrench = left[:, kept].reshape(len(rows), 6, -1)
        return cls(signals.time_s[rows], wrench, drawn)

    def columns(self, theta: FloatArray) -> FloatArray:
        """Return a constant, a trend and the wrench for combinations `theta`, shape (n, 8)."""
        middle = float(self.time_s[0] + self.time_s[-1]) / 2.0
        trend = (self.time_s - middle) / max(float(np.ptp(self.time_s)), 1e-9)
        return np.column_stack([np.ones(len(trend)), trend, self.wrench @ theta])


@dataclass(frozen=True, eq=False)
class LowPassedReadings:
    """Low-passed readings as functions of the plate's stamps, each with the standard deviation 1.

    Attributes:
        curve: The readings over the stamps [s].
        first_s, last_s: First and last stamp [s].
        bad_s: Sorted stamps at which the readings are not valid [s].
    """

    curve: CubicSpline
    first_s: float
    last_s: float
    bad_s: FloatArray

    @classmethod
    def of(
        cls,
        stamp_s: FloatArray,
        readings: FloatArray,
        valid: BoolArray,
        of_amplifier: ButterworthFilter | None,
        cutoff_hz: float,
    ) -> LowPassedReadings:
        """Return the readings that are not constant, without the delay of the amplifier's filter.

        Args:
            stamp_s: Shape (rows,). Increasing stamps of the rows [s].
            readings: Shape (rows, c). Readings in any unit.
            valid: Shape (rows, c). False for readings that are saturated.
            of_amplifier: Low-pass of the amplifier.
            cutoff_hz: Cut-off of the low-pass [Hz].

        Raises:
            DataQualityError: No reading varies.
        """
        step_s = float(np.median(np.diff(stamp_s)))
        grid = np.arange(stamp_s[0], stamp_s[-1], step_s)
        columns = []
        for reading, good in zip(readings.T, valid.T, strict=True):
            if good.sum() > 2 and np.ptp(reading[good]) > 0.0:
                columns.append(np.interp(grid, stamp_s[good], reading[good]))
        if not columns:
            raise DataQualityError(
                "all readings of the force plate are constant or saturated: check the columns and"
                " `saturation` in the map",
                code="RID-PLATE-CHANNEL",
            )
        values = low_pass(np.column_stack(columns), step_s, cutoff_hz)
        if of_amplifier is not None:
            grid = grid - _group_delay(of_amplifier)
        values = values - values.mean(axis=0)
        values /= np.std(values, axis=0)
        gaps = np.flatnonzero(np.diff(stamp_s) > 3.0 * step_s)
        inside = [np.linspace(stamp_s[k], stamp_s[k + 1], 20) for k in gaps]
        bad_s = np.sort(np.concatenate([stamp_s[~valid.all(axis=1)], *inside]))
        return cls(CubicSpline(grid, values), float(grid[0]), float(grid[-1]), bad_s)

    def usable(self, at_s: FloatArray, margin_s: float) -> BoolArray:
        """Return True for stamps at which the readings are valid, with a margin [s]."""
        usable = (at_s >= self.first_s) & (at_s <= self.last_s)
        if not len(self.bad_s):
            return usable
        after = np.searchsorted(self.bad_s, at_s)
        left = self.bad_s[np.maximum(after - 1, 0)]
        right = self.bad_s[np.minimum(after, len(self.bad_s) - 1)]
        near = np.minimum(np.abs(at_s - left), np.abs(at_s - right))
        return np.asarray(usable & (near >= margin_s))


def _group_delay(of_amplifier: ButterworthFilter) -> float:
    """Return the delay of a low-pass at low frequencies [s]."""
    low_hz = 0.01 * of_amplifier.cutoff_hz
    phase = float(np.angle(filter_response(of_amplifier, np.array([low_hz]))[0]))
    return -phase / (2.0 * np.pi * low_hz)
