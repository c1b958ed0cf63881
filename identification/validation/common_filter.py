"""Choice of a zero-phase filter of the torque that is common to all joints.

Half a minute of data of one joint, with all columns of this joint free, does not determine a
filter. The equations of all joints together do, because they share the links' parameters. Loggers
and scripts that smooth torques without delay usually run a Butterworth filter forwards and
backwards. The filter's order and width are chosen for the smallest error on blocks left out of the
fit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from acquisition.processing.torque_channel import TorqueChannel
from config.arrays import FloatArray
from identification.equations.block_grams import Grams, Terms
from identification.equations.candidate_equations import CandidateEquations, Reach
from identification.equations.friction_columns import Column
from identification.regression.nested_choice import DISTINCT_SIGMAS, Gain, deviations

COMMON: Final[tuple[Column, ...]] = ("coulomb", "viscous", "offset")
ORDERS: Final = (1, 2, 4)
COMMON_WIDTHS_S: Final = tuple(0.012 * 1.35**k for k in range(11))
"""Candidate widths of a common filter: cut-offs from 13 to 0.7 Hz."""
MUCH_WORSE: Final = 2.0
"""Ratio of the error to that of the best width beyond which no wider filter is tried."""
COMMON_SIGMAS: Final = 3.0
COMMON_GAIN: Final = 0.2
AWAY: Final = Reach(0.1, 0.2)
"""Time around standstill that is left out to distinguish a filter from smooth friction."""


def common_filter(
    equations: CandidateEquations,
    terms: Sequence[Sequence[Column]] | None,
    block_s: float,
    known: TorqueChannel,
) -> TorqueChannel:
    """Return a zero-phase filter for all joints, or `known` if the filter is not clearly better.

    Args:
        equations: The recordings.
        terms: Friction columns of each joint; None for Coulomb, viscous and offset.
        block_s: Length of a block that is left out [s].
        known: The channel that was estimated joint by joint.

    Raises:
        np.linalg.LinAlgError: The rows do not identify the links' parameters.
    """
    n = equations.joints
    own: list[Terms] = [
        tuple(c for c in each if not (isinstance(c, tuple) and c[0] == "slope"))
        for each in terms or [COMMON] * n
    ]

    def errors(channel: TorqueChannel, reach: Reach | None) -> FloatArray:
        grams = Grams.of(equations, channel, block_s, [reach] * n)
        return np.asarray(grams.fit(own).errors * np.square(grams.scale_nm))

    none = errors(known, None)
    best, best_gain = known, Gain(0.0, 0.0)
    for order in ORDERS:
        profile: list[FloatArray] = []
        totals: list[float] = []
        for tried_s in COMMON_WIDTHS_S:
            own_errors = errors(_filter_of_all_joints(tried_s, 0.0, n, order), None)
            profile.append(np.log(own_errors / none))
            totals.append(float(np.nanmean(profile[-1])))
            if totals[-1] - min(totals) > math.log(MUCH_WORSE):
                break  # wider filters are worse still
        width_s, sigma_s = _best_width(np.array(profile))
        if width_s is None or width_s < DISTINCT_SIGMAS * sigma_s:
            continue
        channel = _filter_of_all_joints(width_s, sigma_s, n, order)
        gain = Gain.between(none, errors(channel, None))
        if gain.exceeds(COMMON_SIGMAS, COMMON_GAIN) and gain.mean > best_gain.mean:
            best, best_gain = channel, gain
    if best is known:
        return known
    # Smooth friction looks like a filter only near reversals, but a true filter acts everywhere.
    away = [errors(channel, AWAY) for channel in (known, best)]
    return best if Gain.between(*away).mean > 0.0 else known


def _filter_of_all_joints(width_s: float, sigma_s: float, joints: int, order: int) -> TorqueChannel:
    none = TorqueChannel.none(joints)
    return replace(
        none,
        width_s=np.full(joints, width_s),
        width_sigma_s=np.full(joints, sigma_s),
        order=order,
    )


def _best_width(log_errors: FloatArray) -> tuple[float | None, float]:
    """Return the width with the smallest error and its standard deviation by a jackknife [s].

    Args:
        log_errors: Shape (widths, blocks, n). Logarithms of the errors at `COMMON_WIDTHS_S`.
    """
    known = np.any(np.all(np.isfinite(log_errors), axis=0), axis=1)
    by_block = np.nanmean(log_errors[:, known], axis=2)
    total = by_block.sum(axis=1)
    at = int(np.argmin(total))
    if not 0 < at < len(total) - 1:
        return None, 0.0
    near = slice(at - 1, at + 2)
    left, middle, right = (total[:, np.newaxis] - by_block)[near]
    whole = total[near]

    def vertex(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
        return np.asarray(0.5 * (a - c) / (a - 2.0 * b + c))

    step = math.log(COMMON_WIDTHS_S[1] / COMMON_WIDTHS_S[0])
    found = float(vertex(whole[0], whole[1], whole[2]))
    moved = vertex(left, middle, right) - found
    width_s = COMMON_WIDTHS_S[at] * math.exp(step * found)
    sigma = float(deviations(step * moved[:, np.newaxis])[0])
    return width_s, width_s * sigma
