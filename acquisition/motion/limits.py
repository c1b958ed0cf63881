"""Check of a path against the joint limits, also between its rows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acquisition.motion.samples import JointTrajectory, MotionSamples
from config.arrays import FloatArray
from config.cell.cell import CellConfig
from config.errors import ConfigError, LimitError, PreflightError
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling

CHUNK_ROWS = 10_000
LIMIT_MARGIN_SHARE = 0.05


def violations(
    path: JointTrajectory, robot: RobotDescription, sample_period_s: float, oversampling: int = 10
) -> list[str]:
    """Return the exceeded limits as text, with the worst value of each joint, quantity and side."""
    limits = [joint.limits for joint in robot.joints]
    velocity = ("/s", [-x.velocity for x in limits], [x.velocity for x in limits])
    bounds = [
        ("position", "", [x.position_min for x in limits], [x.position_max for x in limits]),
        ("velocity", *velocity),
        (
            "acceleration",
            "/s^2",
            [-x.acceleration for x in limits],
            [x.acceleration for x in limits],
        ),
    ]
    coupling = WristCoupling.of_robot(robot)
    if coupling is not None:
        bounds.append(("velocity of the motor", *velocity))
    worst: dict[tuple[str, int, float], tuple[float, str]] = {}
    for first in range(0, len(path.position) - 1, CHUNK_ROWS):
        chunk = JointTrajectory(*(values[first : first + CHUNK_ROWS + 1] for values in path))
        fine: tuple[FloatArray, ...] = _between_rows(chunk, sample_period_s, oversampling)
        if coupling is not None:
            fine = (*fine, coupling.to_motors(fine[1]))
        for values, (quantity, per, low, high) in zip(fine, bounds, strict=True):
            for side, limit in ((1.0, high), (-1.0, low)):
                excess = side * (values - limit)
                rows = excess.argmax(axis=0)
                for column, (joint, row) in enumerate(zip(robot.joints, rows, strict=True)):
                    by = float(excess[row, column])
                    key = (quantity, column, side)
                    if by <= 1e-9 * abs(limit[column]) or by <= worst.get(key, (0.0, ""))[0]:
                        continue
                    unit = joint.unit + per
                    time_s = (first + row / oversampling) * sample_period_s
                    worst[key] = (
                        by,
                        f"{quantity} of joint {joint.name!r} reaches {values[row, column]:.6g}"
                        f" {unit} at {time_s:.4g} s, but its limit is {limit[column]:.6g} {unit}",
                    )
    return [words for _, words in worst.values()]


def _between_rows(
    path: JointTrajectory, sample_period_s: float, oversampling: int
) -> JointTrajectory:
    """Return a path with `oversampling` points per sample period, on quintics between its rows."""
    h = sample_period_s
    q0, v0, a0 = path.position[:-1], h * path.velocity[:-1], h**2 * path.acceleration[:-1]
    q1, v1, a1 = path.position[1:], h * path.velocity[1:], h**2 * path.acceleration[1:]
    rest = q1 - q0 - v0 - a0 / 2.0
    slope = v1 - v0 - a0
    bend = a1 - a0
    c3 = 10.0 * rest - 4.0 * slope + bend / 2.0
    c4 = -15.0 * rest + 7.0 * slope - bend
    c5 = 6.0 * rest - 3.0 * slope + bend / 2.0
    x = (np.arange(oversampling) / oversampling)[:, np.newaxis]

    def rows(inner: FloatArray, last: FloatArray) -> FloatArray:
        return np.concatenate([inner.reshape(-1, last.shape[-1]), last[-1:]])

    q0, v0, a0, c3, c4, c5 = (values[:, np.newaxis, :] for values in (q0, v0, a0, c3, c4, c5))
    position = q0 + x * (v0 + x * (a0 / 2.0 + x * (c3 + x * (c4 + x * c5))))
    velocity = v0 + x * (a0 + x * (3.0 * c3 + x * (4.0 * c4 + x * 5.0 * c5)))
    acceleration = a0 + x * (6.0 * c3 + x * (12.0 * c4 + x * 20.0 * c5))
    return JointTrajectory(
        rows(position, path.position),
        rows(velocity / h, path.velocity),
        rows(acceleration / h**2, path.acceleration),
    )


def sizes_between_rows(
    path: JointTrajectory, sample_period_s: float, acceleration_limit: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the largest speed and acceleration around each row, also between the rows.

    The derivatives of the quintic through two rows are within the hulls of their control points. If
    a hull exceeds the acceleration limit, the acceleration itself is evaluated.

    Args:
        path: The rows.
        sample_period_s: Time between rows [s].
        acceleration_limit: Shape (n,). Up to this limit, the bound of the hull is returned instead
            of the acceleration.

    Returns:
        `speed, acceleration`, shape (rows, n): absolute values. The larger value between two rows
        belongs to both rows.
    """
    h = sample_period_s
    q0, v0, a0 = (values[:-1] for values in path)
    q1, v1, a1 = (values[1:] for values in path)
    begin, end = v0 + 0.25 * h * a0, v1 - 0.25 * h * a1
    middle = 5.0 * (q1 - q0) / h - v0 - v1 - begin - end
    first, second = 4.0 * (middle - begin) / h, 4.0 * (end - middle) / h
    fastest = np.maximum(np.maximum(np.abs(begin), np.abs(end)), np.abs(middle))
    hardest = np.maximum(np.abs(first), np.abs(second))
    beyond = np.nonzero(hardest > acceleration_limit)
    x = np.linspace(0.0, 1.0, 21)[:, np.newaxis]
    y = 1.0 - x
    cubic = (
        y**3 * a0[beyond] + 3.0 * x * y**2 * first[beyond] + 3.0 * x**2 * y * second[beyond]
        + x**3 * a1[beyond]
    )  # fmt: skip
    hardest[beyond] = np.abs(cubic).max(axis=0)
    found = []
    for own, between in ((path.velocity, fastest), (path.acceleration, hardest)):
        size = np.abs(own)
        size[:-1] = np.maximum(size[:-1], between)
        size[1:] = np.maximum(size[1:], between)
        found.append(size)
    return found[0], found[1]


def beyond_limits(broken: list[str], what: str) -> LimitError:
    """Return the error for a path, called `what`, that exceeds limits."""
    return LimitError(
        f"{what} exceeds the robot's limits: {'; '.join(broken)}. Reduce the amplitudes or"
        " speeds, or correct the limits in the robot file",
        code="RID-MOTION-LIMIT",
    )


def refuse(broken: list[str], what: str) -> None:
    """Raise `LimitError` if a path, called `what`, exceeds a limit."""
    if broken:
        raise beyond_limits(broken, what)


def verify_limits(
    samples: MotionSamples, robot: RobotDescription, *, oversampling: int = 10
) -> None:
    """Check position, velocity and acceleration, also between the samples, and the feedforward.

    The motion is the quintic through each pair of neighbouring rows (positions, velocities and
    accelerations). Therefore a step in the rows appears as the speed that it requires.

    Args:
        samples: The motion.
        robot: Robot with the limits.
        oversampling: Number of checked points per sample period.

    Raises:
        ConfigError: A limit is exceeded (the text names every joint, value and limit), or the
            motion is for other joints.
    """
    if samples.joint_names != robot.joint_names:
        raise ConfigError(
            f"the motion is for joints {', '.join(samples.joint_names)}, but robot {robot.name!r}"
            f" has {', '.join(robot.joint_names)}: use the same joint names",
            code="RID-MOTION-JOINTS",
        )
    # two periods, so that the transition from one period to the next is included
    brief = samples.whole(most_periods=2)
    path = JointTrajectory(brief.position, brief.velocity, brief.acceleration)
    refuse(violations(path, robot, samples.sample_period_s, oversampling), "the motion")
    if samples.feedforward is not None:
        fastest = np.abs(samples.feedforward).max(axis=0)
        refuse(
            [
                f"feedforward of joint {joint.name!r} reaches {speed:.4g} per second, but its"
                f" speed limit is {joint.limits.velocity:g}"
                for joint, speed in zip(robot.joints, fastest, strict=True)
                if speed > joint.limits.velocity
            ],
            "the feedforward",
        )


def refuse_pose(robot: RobotDescription, position: Sequence[float]) -> None:
    """Raise an error if a joint is outside its limits.

    Raises:
        PreflightError: A joint is outside; the text names it.
    """
    for joint, value in zip(robot.joints, position, strict=True):
        low, high = joint.limits.position_min, joint.limits.position_max
        if not low <= value <= high:
            raise PreflightError(
                f"joint {joint.name} is at {value:.4f} {joint.unit}, outside its limits {low:g} to"
                f" {high:g} {joint.unit}: move the robot inside the limits by hand, or correct the"
                " robot file",
                code="RID-POSE-OUTSIDE",
            )


def position_bounds(cell: CellConfig, robot: RobotDescription) -> tuple[list[float], list[float]]:
    """Return the permitted positions of each joint: its limits, widened by a margin [rad or m].

    The margin is the permitted following error at standstill, but at most 5 % of the joint's range.
    """
    low, high = [], []
    for joint in robot.joints:
        limits = joint.limits
        share = LIMIT_MARGIN_SHARE * (limits.position_max - limits.position_min)
        margin = min(cell.supervision.following_error_min_rad, share)
        low.append(limits.position_min - margin)
        high.append(limits.position_max + margin)
    return low, high
