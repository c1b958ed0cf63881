"""Kernels that set a model's parameters to the load at a time of the path.

A change begins at a stated time, or at a signal during the motion. Until the signal comes, the
times at which its change begins and ends are infinite, and it is not known which load the robot
will carry. The path's torques are therefore checked with every possible load.

A signal is noticed late: the input is sampled and debounced, and the path is already computed some
cycles ahead. The load then changes `CATCH_UP` times as fast, until it has reached the ramp that
began with the signal.
"""

from __future__ import annotations

from typing import Final, TypeAlias

import numpy as np

from config.arrays import FloatArray
from dynamics.kernels.simd import kernel
from dynamics.model.one_sample import ModelArrays, SampleTorque

# Columns of `times`.
BEGIN: Final = 0
END: Final = 1
NOTICED: Final = 2  # path time computed when a signal was noticed; -inf for a stated time
EARLIEST: Final = 3  # earliest possible begin
SETTLED: Final = 4  # latest possible end; inf if the change may never come
COLUMNS: Final = 5

CATCH_UP: Final = 4.0

LoadArrays: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]
"""Loads of a path, of which the first one applies at its beginning.

`times` (changes, 5): the columns named above, from the first point of the path [s]. `bodies`
(loads, n + 2, 10) and `terms` (loads, terms, 8): tables of `ModelArrays` with each load.
"""


def load_arrays(loads: tuple[SampleTorque, ...], times_s: FloatArray) -> LoadArrays:
    """Return the loads of a path; the models differ in parameter values only.

    Args:
        loads: The robot with its first load, and after each change.
        times_s: Shape (changes, 5). As in `LoadArrays` [s].
    """
    bodies, terms = (np.array([load.arrays[table] for load in loads]) for table in (3, 4))
    return np.array(times_s, dtype=np.float64).reshape(-1, COLUMNS), bodies, terms


def stated_times(begin_s: FloatArray, ramp_s: FloatArray) -> FloatArray:
    """Return `times` of `LoadArrays` for changes that begin at stated times, (changes, 5) [s]."""
    end_s, noticed_s = begin_s + ramp_s, np.full(len(begin_s), -np.inf)
    return np.stack([begin_s, end_s, noticed_s, begin_s, end_s], axis=1)


@kernel
def set_load(model: ModelArrays, loads: LoadArrays, time_s: float) -> None:
    """Set a model's parameters to those at a time of the path; they change linearly in a change.

    If a change begins before the previous one is complete, both are applied with their completed
    fractions. The fraction of the later change is limited to that of the earlier change. Therefore
    the parameters are continuous, and are always a weighted mean of the loads.

    Args:
        model: `SampleTorque.arrays`; its tables of parameters are overwritten.
        loads: Loads of the path. If there are no changes, nothing is written.
        time_s: Time from the first point of the path [s].
    """
    times = loads[0]
    if len(times) == 0:
        return
    set_whole_load(model, loads, 0)
    before = 0
    share = 1.0
    for k in range(len(times)):
        begin, end = times[k, BEGIN], times[k, END]
        if time_s > begin:
            caught_up = CATCH_UP * (time_s - times[k, NOTICED]) / (end - begin)
            share = min(share, (time_s - begin) / (end - begin), max(caught_up, 0.0))
            if share == 1.0:
                set_whole_load(model, loads, k + 1)
            else:
                _add_change(model, loads, before, k + 1, share)
            before = k + 1


@kernel
def set_whole_load(model: ModelArrays, loads: LoadArrays, load: int) -> None:
    """Set a model's parameters to those with one of the loads."""
    model[3][:] = loads[1][load]
    model[4][:] = loads[2][load]


@kernel
def _add_change(
    model: ModelArrays, loads: LoadArrays, before: int, after: int, share: float
) -> None:
    """Add a fraction `share` of the difference between two loads to a model's parameters."""
    _, bodies, terms = loads
    table = model[3]
    for i in range(table.shape[0]):
        for c in range(table.shape[1]):
            table[i, c] += share * (bodies[after, i, c] - bodies[before, i, c])
    table = model[4]
    for i in range(table.shape[0]):
        for c in range(table.shape[1]):
            table[i, c] += share * (terms[after, i, c] - terms[before, i, c])


@kernel
def possible_loads(loads: LoadArrays, time_s: float) -> tuple[int, int]:
    """Return the numbers of the first and the last load that are possible at a time of the path."""
    times = loads[0]
    first = last = 0
    for k in range(len(times)):
        if time_s >= times[k, SETTLED]:
            first = k + 1
        if time_s >= times[k, EARLIEST]:
            last = k + 1
    return first, last


def most_possible_loads(loads: LoadArrays) -> int:
    """Return the largest number of loads that are possible at the same time of the path."""
    ranges = [possible_loads(loads, time_s) for time_s in loads[0][:, EARLIEST].tolist()]
    return max((last - first + 1 for first, last in ranges), default=1)
