"""One motion recorded with and without a payload: the torque difference due to the payload."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from scipy.optimize import least_squares

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import FloatArray
from config.errors import EstimationError

SAME_MOTION_SHARE: Final = 0.02
SHORTEST_S: Final = 5.0


def torque_difference(loaded: SmoothedSignals, unloaded: SmoothedSignals) -> SmoothedSignals:
    """Return the loaded run minus the torques of the same motion without the payload.

    The recordings start at different times. The time shift that aligns their positions is
    determined to a fraction of a sample.

    Args:
        loaded, unloaded: The same motion with and without the payload, without gaps.

    Raises:
        EstimationError: A recording has gaps, or the robot moved differently.
    """
    for signals, which in ((loaded, "with"), (unloaded, "without")):
        if signals.segment[-1] > 0:
            raise EstimationError(
                f"the run {which} the payload has gaps, but torques can be subtracted only along"
                " whole motions: use the procedure `together`",
                code="RID-PAYLOAD-PROCEDURE",
            )
    late_s = _time_shift(loaded, unloaded)
    there = unloaded.time_s[0] <= loaded.time_s - late_s
    there &= loaded.time_s - late_s <= unloaded.time_s[-1]
    if np.count_nonzero(there) * loaded.sample_period_s < SHORTEST_S:
        raise EstimationError(
            _different_motions_text("overlap for less than five seconds"),
            code="RID-PAYLOAD-PROCEDURE",
        )
    time_s = loaded.time_s[there]
    position = _interpolate(unloaded, unloaded.position, time_s - late_s)
    difference = np.sqrt(np.mean((loaded.position[there] - position) ** 2, axis=0))
    worst = int(np.argmax(difference))
    if difference[worst] > SAME_MOTION_SHARE * loaded.position[there].std(axis=0).max():
        raise EstimationError(
            _different_motions_text(
                f"differ by {difference[worst]:.3g} rad or m (RMS) at {loaded.joint_names[worst]}"
            ),
            code="RID-PAYLOAD-PROCEDURE",
        )
    without = _interpolate(unloaded, unloaded.torque_nm, time_s - late_s)
    return replace(
        loaded,
        time_s=time_s,
        position=loaded.position[there],
        velocity=loaded.velocity[there],
        acceleration=loaded.acceleration[there],
        torque_nm=loaded.torque_nm[there] - without,
        segment=loaded.segment[there],
        temperature_k=None if loaded.temperature_k is None else loaded.temperature_k[there],
        unfiltered=None,  # the jumps of friction nearly cancel in the difference
        unfiltered_row=None,
    )


def _time_shift(loaded: SmoothedSignals, unloaded: SmoothedSignals) -> float:
    """Return the time by which the loaded run reaches the same positions later [s]."""
    from scipy.signal import correlate  # a slow import that few commands need

    step_s = unloaded.sample_period_s
    grid = np.arange(loaded.time_s[0], loaded.time_s[-1], step_s)
    own, other = _interpolate(loaded, loaded.velocity, grid), unloaded.velocity
    match = sum(
        correlate(own[:, j], other[:, j], mode="full", method="fft") for j in range(own.shape[1])
    )
    lag = int(np.argmax(match)) - (len(other) - 1)
    first_s = float(grid[0] - unloaded.time_s[0]) + lag * step_s
    middle = grid[len(grid) // 10 : -len(grid) // 10]

    def difference(late_s: FloatArray) -> FloatArray:
        there = _interpolate(unloaded, unloaded.position, middle - late_s[0])
        return np.asarray((_interpolate(loaded, loaded.position, middle) - there).ravel())

    found = least_squares(difference, [first_s], x_scale=step_s, diff_step=[1e-3])
    return float(found.x[0])


def _interpolate(signals: SmoothedSignals, values: FloatArray, time_s: FloatArray) -> FloatArray:
    return np.stack([np.interp(time_s, signals.time_s, column) for column in values.T], axis=1)


def _different_motions_text(how: str) -> str:
    return (
        f"the motions with and without the payload {how}, so the torques cannot be subtracted:"
        " use the procedure `together`"
    )
