"""`InstrumentClock`: the clock of an instrument relative to a run, and a search for its offset."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.signal import correlate

from config.arrays import BoolArray, FloatArray
from config.errors import DataQualityError

CODE: Final = "RID-TRACKER-ALIGNMENT"
FEWEST_ROWS: Final = 20
FINEST_S: Final = 0.01
LEAST_OVERLAP: Final = 0.5
LEAST_SPEED: Final = 1e-3
"""Smallest RMS speed of a motion that shows the clock [m/s or rad/s]."""
LARGEST_GAP: Final = 2.5
"""Distance of neighbouring rows above which the path between them is unknown [median distances]."""
LONGEST_SPAN: Final = 10.0
"""Largest time from the first to the last stamp of an instrument, divided by the sum of two
durations: that of its rows without gaps, and that of the run. If the time is longer, the clock has
jumped."""
_PEAKS: Final = 4
_APART_S: Final = 0.2


@dataclass(frozen=True, eq=False)
class InstrumentClock:
    """Clock of an instrument relative to a run.

    Attributes:
        offset_s: Time of the instrument minus time of the run, in the middle of the rows [s].
        rate: Rate of the instrument's clock relative to the run's, minus 1.
        middle_s: Time of the instrument to which `offset_s` refers [s].
    """

    offset_s: float
    rate: float
    middle_s: float

    def run_time(self, time_s: FloatArray) -> FloatArray:
        """Return times of the run for times of the instrument [s]."""
        return time_s - self.offset_s - self.rate * (time_s - self.middle_s)


def is_covered(at_s: FloatArray, time_s: FloatArray) -> BoolArray:
    """Return True for times between rows that are not in a gap of the rows, shape of `at_s`.

    Args:
        at_s: The times to judge [s].
        time_s: Shape (rows,). Times of the rows, increasing; at least two.
    """
    steps = np.diff(time_s)
    after = np.clip(np.searchsorted(time_s, at_s), 1, len(steps))
    inside = (at_s >= time_s[0]) & (at_s <= time_s[-1])
    short = steps[after - 1] <= LARGEST_GAP * np.median(steps)
    return np.asarray(inside & short)


def clock_offsets(
    own_s: FloatArray, own: FloatArray, time_s: FloatArray, values: FloatArray
) -> list[float]:
    """Return the clock offsets at which the speeds of both motions correlate best, best first.

    Args:
        own_s: Shape (rows,). Times of the instrument, increasing.
        own: Shape (rows, any). The motion that the instrument measured.
        time_s: Shape (samples,). Times of the run, increasing.
        values: Shape (samples, any). The same motion in the run. The coordinates may differ, but
            not the speed.

    Raises:
        DataQualityError: The motion is too slow or too short, or the clock jumps.
    """
    step_s = float(np.median(np.diff(own_s)))
    _refuse_jump(own_s, step_s, float(np.ptp(time_s)))
    step = max(FINEST_S, 1.5 * step_s)
    here = np.arange(time_s[0], time_s[-1], step)
    there = np.arange(own_s[0], own_s[-1], step)
    if min(len(here), len(there)) < FEWEST_ROWS:
        raise DataQualityError(
            f"the measured motion has {len(own_s)} rows in {np.ptp(own_s):.3g} s, too few to find"
            " its clock: record the whole motion",
            code=CODE,
        )
    speeds = []
    for at, times, columns in ((here, time_s, values), (there, own_s, own)):
        seen = np.column_stack([np.interp(at, times, column) for column in columns.T])
        speeds.append(np.linalg.norm(np.diff(seen, axis=0), axis=1) / step)
    if min(float(np.sqrt(np.mean(speed**2))) for speed in speeds) < LEAST_SPEED:
        raise DataQualityError(
            "the measured point or joints hardly move, so the clock cannot be found: record a"
            " motion of them",
            code=CODE,
        )
    run, instrument = speeds
    product = correlate(instrument, run, method="fft")
    energies = [
        correlate(instrument**2, np.ones(len(run)), method="fft"),
        correlate(np.ones(len(instrument)), run**2, method="fft"),
    ]
    overlap = correlate(np.ones(len(instrument)), np.ones(len(run)), method="fft")
    score = product / np.sqrt(np.maximum(energies[0] * energies[1], 1e-12))
    score[overlap < LEAST_OVERLAP * min(len(run), len(instrument))] = -np.inf
    offsets = []
    for _ in range(_PEAKS):
        peak = int(np.argmax(score))
        if not np.isfinite(score[peak]):
            break
        lag = peak - (len(run) - 1)
        offsets.append(float(there[0] - here[0] + lag * step))
        near = round(_APART_S / step)
        score[max(0, peak - near) : peak + near + 1] = -np.inf
    return offsets


def _refuse_jump(own_s: FloatArray, step_s: float, run_s: float) -> None:
    """Refuse time stamps that span far more time than the rows and the run.

    Raises:
        DataQualityError: The clock of the instrument jumps.
    """
    if float(np.ptp(own_s)) <= LONGEST_SPAN * (len(own_s) * step_s + run_s):
        return
    row = int(np.argmax(np.diff(own_s)))
    raise DataQualityError(
        f"the time stamps jump from {own_s[row]:.9g} s to {own_s[row + 1]:.9g} s: remove the rows"
        " that do not belong to the run, or mark them by 0 in a column `valid`",
        code=CODE,
    )
