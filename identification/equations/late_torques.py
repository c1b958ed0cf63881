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
from functools import cached_property, partial
from typing import Final, Literal, NamedTuple

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from acquisition.processing.torque_channel import ComplexArray, TorqueChannel
from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from identification.equations.bus_delay import SLOWEST_BUS_CYCLE_S, longest_delay_s
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
NEAR_S: Final = 0.06
"""Longest delay of the second search, which uses more rows: those nearer to a standstill."""
SHORTEST_S: Final = SLOWEST_BUS_CYCLE_S
"""A difference of up to one bus cycle between joints is usual."""
NEAR_SIGMAS: Final = 2.0
ROUNDS: Final = 3
"""Rounds in which the weights of the joints are estimated from their errors."""
FEWEST_ROWS: Final = 30
RIDGE: Final = 1e-9


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


class _Links(NamedTuple):
    """Normal equations of the link parameters, from the torques of some joints.

    Attributes:
        gram: Shape (p, p).
        right: Shape (p,).
    """

    gram: FloatArray
    right: FloatArray


@dataclass(frozen=True, eq=False)
class _Joint:
    """One joint's equations.

    Attributes:
        known: Response of the joint's known channel, one per piece.
        furthest_s: Longest delay that is tried; rows so near to a standstill are left out.
    """

    equations: CandidateEquations
    number: int
    known: Sequence[ComplexArray]
    furthest_s: float

    @property
    def reach(self) -> Reach:
        """Time around standstill that is left out."""
        return Reach(self.furthest_s, self.furthest_s)

    @cached_property
    def rows(self) -> JointRows:
        """Rows with the columns of its links and of its friction."""
        return self.rows_with(self.known)

    def rows_with(self, responses: Sequence[ComplexArray]) -> JointRows:
        """Return the rows with the columns filtered by a channel."""
        return self.equations.rows(self.number, FLEXIBLE, responses, self.reach, BLOCK_S)


@dataclass(frozen=True, eq=False)
class _Found:
    """A joint with a late torque.

    Attributes:
        links: The link parameters with which it was found; None if it is the joint's own.
    """

    joint: _Joint
    delay_s: float
    links: _Links | None


def find_late_torques(
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    options: ModelOptions,
    standstill_rad_s: float,
    channel: TorqueChannel | None = None,
    *,
    compare: bool = True,
) -> tuple[LateTorque, ...]:
    """Return the delays that no bus explains, and delays that the other joints do not have.

    Args:
        robot: The robot.
        signals: The recordings.
        options: The terms of the model besides friction.
        standstill_rad_s: Speed below which a joint does not count as moving [rad/s or m/s].
        channel: Delays and filters that the model contains; the delays are then in addition.
        compare: False if the robot's files are wrong, so that the joints contradict one another.
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
    found: dict[int, _Found] = {}
    for furthest_s in (FURTHEST_S, NEAR_S):
        every = (
            _Joint(equations, j, [each[:, j] for each in known], furthest_s)
            for j in range(equations.joints)
        )
        joints = [joint for joint in every if joint.rows.columns.shape[0] > FEWEST_ROWS]
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


def _late_alone(joints: Sequence[_Joint], limit_s: float) -> dict[int, _Found]:
    """Return the joints with a delay that no bus explains, with link parameters of their own."""
    found = {}
    for joint in joints:
        if len(joint.rows.torque_nm) <= joint.rows.columns.shape[1]:
            continue
        best_s, gain = _best_delay(joint, limit_s, None)
        if abs(best_s) > limit_s and gain.exceeds(SIGMAS, LEAST_GAIN):
            found[joint.number] = _Found(joint, best_s, None)
    return found


def _compare(joints: Sequence[_Joint], found: dict[int, _Found], sigmas: float) -> None:
    """Add the joints with a delay that the other joints do not have, the most distinct first."""
    while True:
        delays_s = [found[each.number].delay_s if each.number in found else 0.0 for each in joints]
        links = [_links(joint, delay_s) for joint, delay_s in zip(joints, delays_s, strict=True)]
        sigma_nm = np.array([float(np.std(joint.rows.torque_nm)) for joint in joints])
        for _ in range(ROUNDS):
            others = _other_links(links, sigma_nm)
            errors = [
                _block_errors(joint, np.array([delay_s]), other).mean()
                for joint, delay_s, other in zip(joints, delays_s, others, strict=True)
            ]
            sigma_nm = np.sqrt(errors)
        shown: list[tuple[float, _Found]] = []
        for joint, other in zip(joints, _other_links(links, sigma_nm), strict=True):
            if joint.number in found:
                continue
            best_s, gain = _best_delay(joint, 0.0, other)
            if abs(best_s) > SHORTEST_S and gain.exceeds(sigmas, LEAST_GAIN):
                shown.append((gain.mean, _Found(joint, best_s, other)))
        if not shown:
            return
        most = max(shown, key=lambda each: each[0])[1]
        found[most.joint.number] = most


def _other_links(links: Sequence[_Links], sigma_nm: FloatArray) -> list[_Links]:
    """Return, for each joint, the equations of all others, in units of the joint's error."""
    weight = 1.0 / sigma_nm**2
    gram = sum(w * own.gram for w, own in zip(weight, links, strict=True))
    right = sum(w * own.right for w, own in zip(weight, links, strict=True))
    return [
        _Links((gram - w * own.gram) / w, (right - w * own.right) / w)
        for w, own in zip(weight, links, strict=True)
    ]


def _links(joint: _Joint, delay_s: float) -> _Links:
    """Return a joint's equations of the link parameters, its friction eliminated."""
    count = joint.rows.columns.shape[1] - len(FLEXIBLE)
    both = np.hstack([joint.rows.columns[:, :count], _advanced(joint, np.array([delay_s]))])
    rest = _residual(joint.rows.columns[:, count:], both)
    return _Links(rest[:, :count].T @ rest[:, :count], rest[:, :count].T @ rest[:, count])


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
    rest = _residual(rows.columns, rows.torque_nm[:, np.newaxis], found.links)
    return np.asarray(_block_means(rest, rows)[0])


def _best_delay(joint: _Joint, limit_s: float, links: _Links | None) -> tuple[float, Gain]:
    """Return a joint's best delay, and its gain over delays within a limit.

    A best delay at the end of its search range is returned as 0.
    """
    steps = round(joint.furthest_s / STEP_S)
    delays_s: FloatArray = STEP_S * np.arange(-steps, steps + 1, dtype=np.float64)
    errors = _block_errors(joint, delays_s, links)
    best_s = float(delays_s[np.argmin(errors.mean(axis=1))])
    further_s = np.array([*best_s + FINE_STEP_S * np.arange(-9, 10), -limit_s, limit_s])
    errors = np.vstack([errors, _block_errors(joint, further_s, links)])
    delays_s, mean = np.concatenate([delays_s, further_s]), errors.mean(axis=1)
    best = int(np.argmin(mean))
    within = int(np.argmin(np.where(np.abs(delays_s) <= limit_s, mean, np.inf)))
    best_s = float(delays_s[best])
    is_inside = abs(best_s) < joint.furthest_s
    return best_s if is_inside else 0.0, Gain.between(errors[within], errors[best])


def _advanced(joint: _Joint, delays_s: FloatArray) -> FloatArray:
    """Return a joint's torque advanced by some delays, (rows, delays)."""
    pieces, number = joint.equations.pieces, joint.number
    return np.vstack(
        [
            piece.to_rows(
                piece.torque[:, number, np.newaxis]
                * np.exp(2j * np.pi * np.outer(piece.frequency_hz, delays_s))
            )[joint.equations.usable_rows(piece, number, joint.reach)]
            for piece in pieces
        ]
    )


def _block_errors(joint: _Joint, delays_s: FloatArray, links: _Links | None) -> FloatArray:
    """Return the mean squared error of each block of time with each delay, (delays, blocks).

    The torque is advanced, so that the columns are the same for all delays.
    """
    rest = _residual(joint.rows.columns, _advanced(joint, delays_s), links)
    return _block_means(rest, joint.rows)


def _residual(
    columns: FloatArray, torque_nm: FloatArray, links: _Links | None = None
) -> FloatArray:
    """Return the part of some torques, (rows, any), that the columns do not explain.

    The first columns belong to the link parameters, of which `links` are further equations.
    """
    gram, right = columns.T @ columns, columns.T @ torque_nm
    if links is not None:
        own = slice(len(links.right))
        gram[own, own] += links.gram
        right[own] += links.right[:, np.newaxis]
    size = np.sqrt(np.diagonal(gram))
    size = np.where(size > 0.0, size, 1.0)
    gram = gram / np.outer(size, size) + RIDGE * np.eye(len(gram))
    solution = np.linalg.solve(gram, right / size[:, np.newaxis]) / size[:, np.newaxis]
    return np.asarray(torque_nm - columns @ solution)


def _block_means(rest: FloatArray, rows: JointRows) -> FloatArray:
    """Return the mean squares of a residual, (rows, any), in each block of time, (any, blocks)."""
    numbers = np.unique(rows.block, return_inverse=True)[1]
    return np.array([np.bincount(numbers, each**2) for each in rest.T]) / np.bincount(numbers)
