"""`find_late_torques`: torques that are later or earlier than the positions.

The delay of each joint's torque is tried in steps, with friction that is flexible enough for any
joint. A delay beyond the limit of `bus_delay` counts only if it predicts the torque distinctly
better than every delay within the limit. A slow filter of the torque looks like a delay: both are
compared, and a finding names the one that predicts the torque distinctly better, or both.

Each joint is tried with link parameters of its own first. In a motion of few harmonics, these
parameters explain any delay. Therefore each joint is also tried with the link parameters that the
other joints show. Such a test finds a channel that differs from the others, also if a bus explains
its delay. The most distinct delay is corrected before the next joint is judged.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Final, Literal

import numpy as np

from acquisition.processing.torque_channel import ComplexArray, TorqueChannel
from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from identification.equations.bus_delay import SLOWEST_BUS_CYCLE_S
from identification.equations.candidate_equations import CandidateEquations
from identification.equations.compared_joints import (
    ComparedJoint,
    Links,
    block_means,
    compared_joints,
    links_of_others,
    residual,
)
from identification.regression.nested_choice import Gain

FURTHEST_S: Final = 0.2
STEP_S: Final = 0.01
FINE_STEP_S: Final = 0.001
LEAST_GAIN: Final = 0.2
"""Smallest decrease of the logarithm of the RMS error by a delay that is reported: 18 %."""
LEAST_DIFFERENCE: Final = 0.05
"""Smallest decrease of the logarithm of the RMS error by which a delay and a filter differ: 5 %."""
LAGS_S: Final = tuple(0.02 * 1.12**k for k in range(25))
"""Time constants of the filters that are compared with a delay: 8 to 0.5 Hz."""
SIGMAS: Final = 3.0
NEAR_S: Final = 0.06
"""Longest delay of the second search, which uses more rows: those nearer to a standstill."""
SHORTEST_S: Final = SLOWEST_BUS_CYCLE_S
"""A difference of up to one bus cycle between joints is usual."""
NEAR_SIGMAS: Final = 2.0


@dataclass(frozen=True)
class LateTorque:
    """Late or early torque of a joint that no bus explains.

    Attributes:
        joint: Name of the joint.
        delay_s: Delay of the recorded torque; negative if it is early [s].
        lag_s: Time constant of the first-order filter that explains the torque best [s].
        kind: Effect that predicts the torque distinctly better; "either" if neither does.
        is_filtered: True if the delay is in addition to a filter that the model contains.
        is_long: False if a bus explains the delay.
    """

    joint: str
    delay_s: float
    lag_s: float = 0.0
    kind: Literal["delay", "filter", "either"] = "delay"
    is_filtered: bool = False
    is_long: bool = True

    @property
    def sentence(self) -> str:
        """Finding, with the remedy."""
        late = f"about {1e3 * abs(self.delay_s):.0f} ms {'late' if self.delay_s > 0.0 else 'early'}"
        if self.is_filtered:
            late += ", in addition to the filter in the model"
        clock = "correct the time stamps of the torques or the logger's clock"
        if not self.is_long:
            late = f"{late} compared with the other joints"
        if self.kind == "delay":
            bus = "and no bus explains this delay" if self.is_long else "which a bus can explain"
            return (
                f"The recorded torque of {self.joint} is {late}, {bus}."
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
            f"The recorded torque of {self.joint} is {late}"
            f"{', which no bus explains' if self.is_long else ''}, or {filtered};"
            " the recording does not distinguish them. The parameters contain the effect: for a"
            f" delay, {clock}; for a filter, {remedy}."
        )


@dataclass(frozen=True, eq=False)
class _Found:
    """A joint with a late torque.

    Attributes:
        links: The link parameters with which it was found; None if it is the joint's own.
    """

    joint: ComparedJoint
    delay_s: float
    links: Links | None


def find_late_torques(
    robot: RobotDescription,
    equations: CandidateEquations,
    limit_s: float,
    channel: TorqueChannel | None = None,
    *,
    compare: bool = True,
) -> tuple[LateTorque, ...]:
    """Return the delays that no bus explains, and delays that the other joints do not have.

    Args:
        robot: The robot.
        equations: Result of `candidate_equations` for the recordings.
        limit_s: Longest delay that a bus explains [s].
        channel: Delays and filters that the model contains; the delays are then in addition.
        compare: False if the robot's files are wrong, so that the joints contradict one another.
    """
    channel = channel or TorqueChannel.none(equations.joints)
    known = [channel.response(piece.frequency_hz) for piece in equations.pieces]
    found: dict[int, _Found] = {}
    for furthest_s in (FURTHEST_S, NEAR_S):
        joints = compared_joints(equations, known, furthest_s)
        if furthest_s == FURTHEST_S:
            found |= _late_alone(joints, limit_s)
        if compare and len(joints) > 1:
            _compare(joints, found, SIGMAS if furthest_s == FURTHEST_S else NEAR_SIGMAS)
    late = []
    for j, each in sorted(found.items()):
        is_filtered = bool(channel.lag_s[j] or channel.width_s[j])
        is_long = abs(each.delay_s) > limit_s
        torque = LateTorque(
            robot.joint_names[j], each.delay_s, is_filtered=is_filtered, is_long=is_long
        )
        late.append(_delay_or_filter(each, torque))
    return tuple(late)


def _late_alone(joints: Sequence[ComparedJoint], limit_s: float) -> dict[int, _Found]:
    """Return the joints with a delay that no bus explains, with link parameters of their own."""
    found = {}
    for joint in joints:
        if len(joint.rows.torque_nm) <= joint.rows.columns.shape[1]:
            continue
        best_s, gain = _best_delay(joint, limit_s, None)
        if abs(best_s) > limit_s and gain.exceeds(SIGMAS, LEAST_GAIN):
            found[joint.number] = _Found(joint, best_s, None)
    return found


def _compare(joints: Sequence[ComparedJoint], found: dict[int, _Found], sigmas: float) -> None:
    """Add the joints with a delay that the other joints do not have, the most distinct first."""
    while True:
        delays_s = [found[each.number].delay_s if each.number in found else 0.0 for each in joints]
        shown: list[tuple[float, _Found]] = []
        for joint, other in zip(joints, links_of_others(joints, delays_s), strict=True):
            if joint.number in found:
                continue
            best_s, gain = _best_delay(joint, 0.0, other)
            if abs(best_s) > SHORTEST_S and gain.exceeds(sigmas, LEAST_GAIN):
                shown.append((gain.mean, _Found(joint, best_s, other)))
        if not shown:
            return
        most = max(shown, key=lambda each: each[0])[1]
        found[most.joint.number] = most


def _delay_or_filter(found: _Found, late: LateTorque) -> LateTorque:
    """Compare a joint's delay with first-order filters."""
    if late.delay_s < 0.0:
        return late

    def errors_with(response: Callable[[ComplexArray], ComplexArray]) -> FloatArray:
        return _filtered_errors(found, response)

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


def _filtered_errors(found: _Found, response: Callable[[ComplexArray], ComplexArray]) -> FloatArray:
    """Return the mean squared error of each block of time with filtered columns, (blocks,)."""
    responses: list[ComplexArray] = []
    joint = found.joint
    for own, piece in zip(joint.known, joint.equations.pieces, strict=True):
        s = np.asarray(2j * np.pi * piece.frequency_hz, dtype=np.complex128)
        responses.append(np.asarray(own * response(s), dtype=np.complex128))
    rows = joint.rows_with(responses)
    rest = residual(rows.columns, rows.torque_nm[:, np.newaxis], found.links)
    return np.asarray(block_means(rest, rows)[0])


def _best_delay(joint: ComparedJoint, limit_s: float, links: Links | None) -> tuple[float, Gain]:
    """Return a joint's best delay, and its gain over delays within a limit.

    A best delay at the end of its search range is returned as 0.
    """
    steps = round(joint.furthest_s / STEP_S)
    delays_s: FloatArray = STEP_S * np.arange(-steps, steps + 1, dtype=np.float64)
    errors = joint.block_errors(delays_s, links)
    best_s = float(delays_s[np.argmin(errors.mean(axis=1))])
    further_s = np.array([*best_s + FINE_STEP_S * np.arange(-9, 10), -limit_s, limit_s])
    errors = np.vstack([errors, joint.block_errors(further_s, links)])
    delays_s, mean = np.concatenate([delays_s, further_s]), errors.mean(axis=1)
    best = int(np.argmin(mean))
    within = int(np.argmin(np.where(np.abs(delays_s) <= limit_s, mean, np.inf)))
    best_s = float(delays_s[best])
    is_inside = abs(best_s) < joint.furthest_s
    return best_s if is_inside else 0.0, Gain.between(errors[within], errors[best])
