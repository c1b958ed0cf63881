"""Friction alone: `FrictionCurve`s from the two motions that are designed to measure friction.

These are runs at constant speed in both directions over the same positions, and a path that is
driven forwards and then backwards in time. In both, gravity and inertia torques do not change when
the speed changes sign, and half of the torque's change is friction (theory: section 4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import qr

from acquisition.motion.kinds.constant_velocity import ConstantRun, ConstantVelocityMotion
from acquisition.motion.kinds.reversed import ReversedMotion
from acquisition.motion.samples import Phase
from acquisition.processing.periods import PeriodAverage, average_periods
from acquisition.recording.recording import Recording
from acquisition.signals.bins import Derivatives, differentiate_on_bins, divide_filter
from config.arrays import BoolArray, FloatArray
from config.errors import DataQualityError, EstimationError
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling
from dynamics.model.robot_model import regressor
from identification.friction.curve import FrictionCurve
from identification.model.options import ModelOptions

SETTLING_S = 0.1
BLOCKS = 8
SPEED_BINS = 12
SLOWEST_SHARE = 0.02
BAND_OF_FILTER = 1.0
LEAST_TURN = 0.3


def constant_velocity_curves(
    recording: Recording, motion: ConstantVelocityMotion, robot: RobotDescription
) -> tuple[FrictionCurve, ...]:
    """Return the friction of every motor whose joint was run at constant speeds.

    The positions of each run are divided into blocks. In each block the torques of both directions
    are compared:
    - Half of their difference is friction.
    - Half of their sum is gravity, plus the part of friction that does not change its sign
      (`FrictionCurve.even`).

    Gravity is fitted as a function of the joint's position, with the functions of the robot's
    model. If these functions cannot be distinguished from a constant, the standard deviations are
    large. The scatter between blocks (cogging, load) counts as uncertainty.

    Args:
        recording: The run.
        motion: The motion that was executed.

    Raises:
        DataQualityError: A run is missing or incomplete, its two directions do not cover the same
            positions, or the time stamps are not uniform.
        EstimationError: A joint's motor hardly turns when only this joint moves.
    """
    _, runs = motion.runs(robot, _sample_period(recording))
    curves = []
    for joint in dict.fromkeys(run.joint for run in runs):
        of_joint = [run for run in runs if run.joint == joint]
        speeds = sorted({abs(run.speed) for run in of_joint})
        blocks = [
            _blocks(recording, [run for run in of_joint if abs(run.speed) == speed])
            for speed in speeds
        ]
        curves.append(_curve(robot, motion, joint, np.array(speeds), blocks))
    return tuple(curves)


def reversed_curves(
    recording: Recording, motion: ReversedMotion, robot: RobotDescription
) -> tuple[FrictionCurve, ...]:
    """Return the friction of every motor that moves in a path driven in both directions of time.

    tau(q, v, a) - tau(q, -v, a) = 2 tau_f(v). In this difference rigid bodies, spring and gravity
    cancel, and so does friction that does not change its sign with the speed. The mean periods are
    evaluated on their bins, up to the anti-alias filter's cut-off, and the filter is divided out.
    At a reversal, friction makes the accelerations of the two directions differ a little. The
    inertia torque of this difference is fitted together with friction, and subtracted.

    Args:
        recording: The run.
        motion: The motion that was executed.

    Raises:
        DataQualityError: One of the two parts is incomplete, the time stamps are not uniform, or a
            joint passes through each speed only once.
    """
    there, back = (average_periods(part) for part in _two_parts(recording, motion, robot))
    forward, torque = _on_the_bins(there)
    backward, torque_back = _on_the_bins(back)
    at = -np.arange(there.samples_per_period) % there.samples_per_period
    difference = 0.5 * (torque - torque_back[at])
    velocity = 0.5 * (forward.velocity - backward.velocity[at])
    swing = there.position
    coupling = WristCoupling.of_robot(robot)
    if coupling is not None:  # friction depends on the motors' speeds
        velocity, swing = coupling.to_motors(velocity), coupling.to_motors(swing)
    unequal = 0.5 * (forward.acceleration - backward.acceleration[at])
    return tuple(
        _average_in_bins(name, velocity[:, j], difference[:, j], unequal)
        for j, name in enumerate(recording.joint_names)
        if np.ptp(swing[:, j]) > 1e-3
    )


def _motor_turns(robot: RobotDescription, joint: int) -> float:
    """Return the motor's rotation, divided by its gear ratio, per unit rotation of its joint alone.

    Torque is measured at the motor, and friction depends on the motor's speed (theory: section 6).
    With a coupled wrist other motors turn too, but their friction does not affect this motor's
    torque.

    Raises:
        EstimationError: The motor hardly turns, so that moving only this joint does not show its
            friction.
    """
    coupling = WristCoupling.of_robot(robot)
    if coupling is None:
        return 1.0
    turns = float(coupling.motors_by_joints[joint, joint])
    if abs(turns) < LEAST_TURN:
        raise EstimationError(
            f"robot {robot.name!r}: because of its coupled wrist, the motor of"
            f" {robot.joint_names[joint]} turns by only {abs(turns):.2g} when only that joint"
            " turns by 1. Runs of single joints do not show its friction: use a path driven in"
            " both directions (`rid-daq design CELL --kind reversed`)",
            code="RID-FRICTION-RUNS",
        )
    return turns


def _sample_period(recording: Recording) -> float:
    if recording.sample_period_s is None:
        raise DataQualityError(
            "the time stamps are not uniform, so the parts of the motion cannot be located: record"
            " with a constant sample period",
            code="RID-RECORDING-CLOCK",
        )
    return recording.sample_period_s


@dataclass(frozen=True, eq=False)
class _Blocks:
    """Torques at one speed in blocks of position, for both directions."""

    position: FloatArray
    odd: FloatArray
    even: FloatArray

    @property
    def odd_sigma(self) -> float:
        return float(np.std(self.odd, ddof=1) / np.sqrt(len(self.odd)))


def _blocks(recording: Recording, runs: Sequence[ConstantRun]) -> _Blocks:
    """Return the blocks of all runs at one speed, in both directions."""
    settling = round(SETTLING_S / _sample_period(recording))
    joint = runs[0].joint
    rows = [
        recording.valid
        & (recording.sample_index >= run.first + settling)
        & (recording.sample_index < run.end)
        for run in runs
    ]
    for run, own in zip(runs, rows, strict=True):
        if np.count_nonzero(own) < 2 * BLOCKS:
            raise DataQualityError(
                f"the recording contains only {np.count_nonzero(own)} rows of the run of"
                f" {recording.joint_names[joint]} at {run.speed:g} per second: the recording"
                " ended early, or rows were lost; record again",
                code="RID-RECORDING-ROWS-LOST",
            )
    position, torque = recording.position[:, joint], recording.torque_nm[:, joint]
    low = max(position[own].min() for own in rows)
    high = min(position[own].max() for own in rows)
    width = (high - low) / BLOCKS
    forwards, backwards = (
        np.logical_or.reduce(
            [own for run, own in zip(runs, rows, strict=True) if sign * run.speed > 0]
        )
        for sign in (1.0, -1.0)
    )
    found = []
    for middle in low + width * (np.arange(BLOCKS) + 0.5):
        inside = np.abs(position - middle) <= 0.5 * width
        there, back = forwards & inside, backwards & inside
        if min(np.count_nonzero(there), np.count_nonzero(back)) < 1:
            raise DataQualityError(
                f"the runs of {recording.joint_names[joint]} at {abs(runs[0].speed):g} per second"
                " do not cover the same positions in both directions: check the following error",
                code="RID-FRICTION-RUNS",
            )
        both = there | back
        # Positions differ between the directions: gravity is assumed linear within a block.
        matrix = np.column_stack(
            [np.ones(both.sum()), np.where(there[both], 1.0, -1.0), position[both] - middle]
        )
        level, half, _ = np.linalg.lstsq(matrix, torque[both], rcond=None)[0]
        found.append((middle, half, level))
    return _Blocks(*np.array(found).T)


def _curve(
    robot: RobotDescription,
    motion: ConstantVelocityMotion,
    joint: int,
    speeds: FloatArray,
    blocks: Sequence[_Blocks],
) -> FrictionCurve:
    """Subtract gravity from the even part of the torques, for all speeds together."""
    turns = _motor_turns(robot, joint)
    gravity = _gravity_functions(robot, motion, joint, [b.position for b in blocks])
    k, g = len(speeds), gravity[0].shape[1]
    matrix = np.zeros((k * BLOCKS, k + g))
    for row, functions in enumerate(gravity):
        rows = slice(row * BLOCKS, (row + 1) * BLOCKS)
        matrix[rows, row] = 1.0
        matrix[rows, k:] = functions
    even = np.concatenate([b.even for b in blocks])
    # A gravity function that is nearly constant cannot be distinguished from the even part of
    # friction. Therefore its coefficient has a prior: zero, with the torque limit as deviation.
    largest = robot.joints[joint].limits.torque
    prior = np.hstack([np.zeros((g, k)), np.eye(g)]) / largest
    sigma, freedom = 1.0, max(1, k * (BLOCKS - 1) - g)
    solution = _solve(matrix, even, prior, sigma)
    for _ in range(2):  # the scatter is known only after the first pass
        residual = even - matrix @ solution
        sigma = max(float(np.sqrt(residual @ residual / freedom)), 1e-9 * largest)
        solution = _solve(matrix, even, prior, sigma)
    inverse = np.linalg.inv(np.linalg.qr(np.vstack([matrix / sigma, prior]), mode="r"))
    covariance = np.asarray((inverse @ inverse.T)[:k, :k], np.float64)
    return FrictionCurve(
        joint=robot.joint_names[joint],
        speed=abs(turns) * speeds,
        odd=np.sign(turns) * np.array([b.odd.mean() for b in blocks]),
        odd_sigma=np.array([b.odd_sigma for b in blocks]),
        even=solution[:k],
        even_covariance=0.5 * (covariance + covariance.T),
    )


def _solve(matrix: FloatArray, even: FloatArray, prior: FloatArray, sigma: float) -> FloatArray:
    rhs = np.concatenate([even / sigma, np.zeros(len(prior))])
    stacked = np.vstack([matrix / sigma, prior])
    return np.asarray(np.linalg.lstsq(stacked, rhs, rcond=None)[0], np.float64)


def _gravity_functions(
    robot: RobotDescription,
    motion: ConstantVelocityMotion,
    joint: int,
    positions: Sequence[FloatArray],
) -> list[FloatArray]:
    """Return the values, at some positions, of the functions that its torque at rest can contain.

    The functions are independent of each other. There is one array for each of `positions`.
    """
    model = ModelOptions(rotors=False, friction=False).build(robot)

    def at_rest(position: FloatArray) -> FloatArray:
        pose = np.tile(motion.pose, (len(position), 1))
        pose[:, joint] = position
        still = np.zeros_like(pose)
        return regressor(model, pose, still, still)[:, joint]

    limits = robot.joints[joint].limits
    whole = at_rest(np.linspace(limits.position_min, limits.position_max, 200))
    _, triangle, order = qr(whole, mode="economic", pivoting=True)
    size = np.abs(np.diagonal(triangle))
    kept = order[: int(np.count_nonzero(size > 1e-9 * max(size[0], 1e-9)))]
    scale = np.maximum(np.sqrt(np.mean(whole[:, kept] ** 2, axis=0)), 1e-12)
    return [at_rest(position)[:, kept] / scale for position in positions]


def _two_parts(
    recording: Recording, motion: ReversedMotion, robot: RobotDescription
) -> tuple[Recording, Recording]:
    """Return the forward and the backward part of a recording; both are periodic."""
    sample_period_s = _sample_period(recording)
    samples = motion.plan(robot, sample_period_s)
    rest = np.flatnonzero(samples.phase == Phase.HOLD)
    period = round(motion.period_s / sample_period_s)
    index = recording.sample_index
    return (
        _part(recording, (index >= 0) & (index < rest[0]), 0, period),
        _part(recording, index > rest[-1], int(rest[-1]) + 1, period),
    )


def _part(recording: Recording, rows: BoolArray, first: int, period: int) -> Recording:
    if not rows.any():
        raise DataQualityError(
            "the recording ends before the motion's backward part: record again",
            code="RID-RECORDING-ROWS-LOST",
        )
    fields = ("time_s", "position", "torque_nm", "valid", "phase")
    tables = {name: getattr(recording, name)[rows] for name in fields}
    for name in ("target_position", "velocity_command", "temperature_k", "answered"):
        values = getattr(recording, name)
        tables[name] = None if values is None else values[rows]
    return replace(
        recording,
        **tables,
        sample_index=recording.sample_index[rows] - first,
        samples_per_period=period,
        reaction=None,  # a force plate does not measure friction
    )


def _on_the_bins(average: PeriodAverage) -> tuple[Derivatives, FloatArray]:
    """Return a mean period's motion and torque, with the anti-alias filter removed."""
    samples, step_s = average.samples_per_period, average.sample_period_s
    harmonics = (samples - 1) // 2
    if average.torque_filter is not None:
        highest_hz = BAND_OF_FILTER * average.torque_filter.cutoff_hz
        harmonics = min(harmonics, int(highest_hz * samples * step_s))
    motion = differentiate_on_bins(average.position, step_s, harmonics)
    torque = divide_filter(average.torque_nm, step_s, average.torque_filter, harmonics)
    return motion, torque


def _average_in_bins(
    joint: str, velocity: FloatArray, difference: FloatArray, unequal: FloatArray
) -> FrictionCurve:
    """Average a period in bins of speed; every passage through a bin counts as one value."""
    speed = np.abs(velocity)
    fast = speed > SLOWEST_SHARE * speed.max()
    edges = np.quantile(speed[fast], np.linspace(0.0, 1.0, SPEED_BINS + 1))
    number = np.where(fast, np.digitize(speed, edges[1:-1]), -1)
    in_bin = (number[:, np.newaxis] == np.arange(SPEED_BINS)).astype(np.float64)
    # In every bin, friction is linear in the speed; `unequal` is the inertia torque per parameter
    # that is due to different accelerations of the two directions.
    columns = [in_bin * np.sign(velocity)[:, np.newaxis], in_bin * velocity[:, np.newaxis], unequal]
    fitted = np.linalg.lstsq(np.hstack(columns)[fast], difference[fast], rcond=None)[0]
    odd = (difference - unequal @ fitted[2 * SPEED_BINS :]) * np.sign(velocity)
    changes = np.flatnonzero(np.diff(number)) + 1
    passages = [rows for rows in np.split(np.arange(len(number)), changes) if number[rows[0]] >= 0]
    found = []
    for wanted in range(SPEED_BINS):
        own = [rows for rows in passages if number[rows[0]] == wanted]
        if len(own) < 2:
            continue
        weight = np.array([len(rows) for rows in own], dtype=float)
        weight /= weight.sum()
        values = np.array([odd[rows].mean() for rows in own])
        mean = float(weight @ values)
        spread = float(weight @ (values - mean) ** 2) / max(1.0 - float(weight @ weight), 1e-12)
        middle = float(weight @ np.array([speed[rows].mean() for rows in own]))
        found.append((middle, mean, np.sqrt(spread * float(weight @ weight))))
    if not found:
        raise DataQualityError(
            f"joint {joint!r} passes through each speed only once: record a motion with"
            " more harmonics",
            code="RID-FRICTION-RUNS",
        )
    table = np.array(found)
    return FrictionCurve(joint, table[:, 0], table[:, 1], table[:, 2])
