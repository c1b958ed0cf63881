"""`find_late_torques`: torques that are later or earlier than any bus explains.

The delay of each joint's torque is tried in steps, with friction that is flexible enough for any
joint. A delay beyond the limit of `bus_delay` counts only if it predicts the torque distinctly
better than every delay within the limit. A slow filter of the torque looks like a delay: both are
compared, and a finding names the one that predicts the torque distinctly better, or both.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Final, Literal

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from acquisition.processing.torque_channel import ComplexArray, TorqueChannel
from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from identification.equations.bus_delay import longest_delay_s
from identification.equations.candidate_equations import CandidateEquations, JointRows, Reach
from identification.equations.friction_columns import FLEXIBLE
from identification.equations.segments import thin_rows
from identification.model.base_parameters import base_parameters
from identification.model.options import ModelOptions
from identification.regression.nested_choice import Gain

FURTHEST_S: Final = 0.2
STEP_S: Final = 0.01
FINE_STEP_S: Final = 0.001
BLOCK_S: Final = 2.0
LEAST_GAIN: Final = 0.2
"""Smallest decrease of the logarithm of the RMS error by a delay that is reported: 18 %."""
LEAST_DIFFERENCE: Final = 0.05
"""Smallest decrease of the logarithm of the RMS error by which a delay and a filter differ: 5 %."""
LAGS_S: Final = tuple(0.02 * 1.12**k for k in range(25))
"""Time constants of the filters that are compared with a delay: 8 to 0.5 Hz."""
SIGMAS: Final = 3.0
RIDGE: Final = 1e-9
REACH: Final = Reach(FURTHEST_S, FURTHEST_S)


@dataclass(frozen=True)
class LateTorque:
    """Late or early torque of a joint that no bus explains.

    Attributes:
        joint: Name of the joint.
        delay_s: Delay of the recorded torque; negative if it is early [s].
        lag_s: Time constant of the first-order filter that explains the torque best [s].
        kind: Effect that predicts the torque distinctly better; "either" if neither does.
        is_filtered: True if the delay is in addition to a filter that the model contains.
    """

    joint: str
    delay_s: float
    lag_s: float = 0.0
    kind: Literal["delay", "filter", "either"] = "delay"
    is_filtered: bool = False

    @property
    def sentence(self) -> str:
        """Finding, with the remedy."""
        late = f"about {1e3 * abs(self.delay_s):.0f} ms {'late' if self.delay_s > 0.0 else 'early'}"
        if self.is_filtered:
            late += ", in addition to the filter in the model"
        clock = "correct the time stamps of the torques or the logger's clock"
        if self.kind == "delay":
            return (
                f"The recorded torque of {self.joint} is {late}, and no bus explains this delay."
                f" The parameters contain its effect: {clock}. A filter of second or higher order"
                " has the same effect: if the logger or the drive has one, record without it."
            )
        filtered = f"low-passed at about {1.0 / (2.0 * np.pi * self.lag_s):.2g} Hz (first order)"
        remedy = "record the torques without this filter, or estimate it with `identify --choose`"
        if self.kind == "filter":
            return (
                f"The recorded torque of {self.joint} is {filtered}. The parameters contain the"
                f" filter's effect: {remedy}."
            )
        return (
            f"The recorded torque of {self.joint} is {late}, which no bus explains, or {filtered};"
            " the recording does not distinguish them. The parameters contain the effect: for a"
            f" delay, {clock}; for a filter, {remedy}."
        )


def find_late_torques(
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    options: ModelOptions,
    standstill_rad_s: float,
    channel: TorqueChannel | None = None,
) -> tuple[LateTorque, ...]:
    """Return the delays that no bus explains.

    Args:
        robot: The robot.
        signals: The recordings.
        options: The terms of the model besides friction.
        standstill_rad_s: Speed below which a joint does not count as moving [rad/s or m/s].
        channel: Delays and filters that the model contains; the delays are then in addition.
    """
    plain = replace(options, friction=False, friction_terms=None, nonlinear=None)
    model = plain.build(robot)
    try:
        equations = CandidateEquations.of(
            model,
            base_parameters(model),
            [thin_rows(run) for run in signals],
            standstill_rad_s,
        )
    except EstimationError:  # the recording is too short, or determines no parameters
        return ()
    limit_s = longest_delay_s(signals[0].sample_period_s)
    channel = channel or TorqueChannel.none(equations.joints)
    known = [channel.response(piece.frequency_hz) for piece in equations.pieces]
    found = []
    for j, name in enumerate(robot.joint_names):
        own = [each[:, j] for each in known]
        if delay_s := _late_joint(equations, j, own, limit_s):
            late = _delay_or_filter(equations, j, own, LateTorque(name, delay_s))
            is_filtered = bool(channel.lag_s[j] or channel.width_s[j])
            found.append(replace(late, is_filtered=is_filtered))
    return tuple(found)


def _delay_or_filter(
    equations: CandidateEquations, joint: int, known: Sequence[ComplexArray], late: LateTorque
) -> LateTorque:
    """Compare a joint's delay with first-order filters."""
    if late.delay_s < 0.0:
        return late

    def errors_with(response: Callable[[ComplexArray], ComplexArray]) -> FloatArray:
        return _filtered_errors(equations, joint, known, response)

    delayed = errors_with(lambda s: np.exp(-s * late.delay_s))
    lags = [errors_with(partial(_first_order, lag_s=lag_s)) for lag_s in LAGS_S]
    best = int(np.argmin([errors.mean() for errors in lags]))
    kind: Literal["delay", "filter", "either"] = "either"
    if Gain.between(delayed, lags[best]).exceeds(SIGMAS, LEAST_DIFFERENCE):
        kind = "filter"
    elif Gain.between(lags[best], delayed).exceeds(SIGMAS, LEAST_DIFFERENCE):
        kind = "delay"
    return replace(late, lag_s=LAGS_S[best], kind=kind)


def _first_order(s: ComplexArray, lag_s: float) -> ComplexArray:
    return np.asarray(1.0 / (1.0 + s * lag_s), dtype=np.complex128)


def _filtered_errors(
    equations: CandidateEquations,
    joint: int,
    known: Sequence[ComplexArray],
    response: Callable[[ComplexArray], ComplexArray],
) -> FloatArray:
    """Return the mean squared error of each block of time with filtered columns, (blocks,)."""
    responses: list[ComplexArray] = []
    for own, piece in zip(known, equations.pieces, strict=True):
        s = np.asarray(2j * np.pi * piece.frequency_hz, dtype=np.complex128)
        responses.append(np.asarray(own * response(s), dtype=np.complex128))
    rows = equations.rows(joint, FLEXIBLE, responses, REACH, BLOCK_S)
    own_rest = _residual(rows.columns, rows.torque_nm[:, np.newaxis])
    return np.asarray(_block_means(own_rest, rows)[0])


def _late_joint(
    equations: CandidateEquations, joint: int, known: Sequence[ComplexArray], limit_s: float
) -> float:
    """Return a joint's delay if it is beyond the limit and distinct; otherwise 0 [s]."""
    steps = round(FURTHEST_S / STEP_S)
    delays_s: FloatArray = STEP_S * np.arange(-steps, steps + 1, dtype=np.float64)
    rows = equations.rows(joint, FLEXIBLE, known, REACH, BLOCK_S)
    if len(rows.torque_nm) <= rows.columns.shape[1]:
        return 0.0
    errors = _block_errors(equations, joint, rows, delays_s)
    best_s = float(delays_s[np.argmin(errors.mean(axis=1))])
    further_s = np.array([*best_s + FINE_STEP_S * np.arange(-9, 10), -limit_s, limit_s])
    errors = np.vstack([errors, _block_errors(equations, joint, rows, further_s)])
    delays_s, mean = np.concatenate([delays_s, further_s]), errors.mean(axis=1)
    best = int(np.argmin(mean))
    best_s = float(delays_s[best])
    if not limit_s < abs(best_s) < FURTHEST_S:
        return 0.0
    within = int(np.argmin(np.where(np.abs(delays_s) <= limit_s, mean, np.inf)))
    gain = Gain.between(errors[within], errors[best])
    return best_s if gain.exceeds(SIGMAS, LEAST_GAIN) else 0.0


def _block_errors(
    equations: CandidateEquations, joint: int, rows: JointRows, delays_s: FloatArray
) -> FloatArray:
    """Return the mean squared error of each block of time with each delay, (delays, blocks).

    The torque is advanced, so that the columns are the same for all delays.
    """
    torque_nm = np.vstack(
        [
            piece.to_rows(
                piece.torque[:, joint, np.newaxis]
                * np.exp(2j * np.pi * np.outer(piece.frequency_hz, delays_s))
            )[equations.usable_rows(piece, joint, REACH)]
            for piece in equations.pieces
        ]
    )
    return _block_means(_residual(rows.columns, torque_nm), rows)


def _residual(columns: FloatArray, torque_nm: FloatArray) -> FloatArray:
    """Return the part of some torques, (rows, any), that the columns do not explain."""
    size = np.linalg.norm(columns, axis=0)
    scaled = columns / np.where(size > 0.0, size, 1.0)
    gram = scaled.T @ scaled + RIDGE * np.eye(scaled.shape[1])
    return np.asarray(torque_nm - scaled @ np.linalg.solve(gram, scaled.T @ torque_nm))


def _block_means(rest: FloatArray, rows: JointRows) -> FloatArray:
    """Return the mean squares of a residual, (rows, any), in each block of time, (any, blocks)."""
    numbers = np.unique(rows.block, return_inverse=True)[1]
    return np.array([np.bincount(numbers, each**2) for each in rest.T]) / np.bincount(numbers)
