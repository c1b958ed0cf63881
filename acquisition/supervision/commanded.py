"""Commanded motion of the drives: a planned motion together with its feedforward.

The position loop sends K_v (q_d - q) + v_ff. If the feedforward differs from the planned velocity,
a drive that follows its commands leaves the planned path. This commanded motion is computed here in
advance and checked against the robot's limits before anything moves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acquisition.motion.samples import MotionSamples
from acquisition.supervision.held_positions import PLAUSIBLE_FACTOR
from config.arrays import FloatArray, IntArray
from config.cell.cell import CellConfig
from config.errors import LimitError
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling

CODE = "RID-MOTION-COMMAND"


def commanded_motion(samples: MotionSamples, gain_per_s: float) -> MotionSamples:
    """Return the motion of drives that follow every command exactly.

    Without feedforward, this is the planned motion.

    The deviation d from the plan obeys d[k+1] = (1 - K_v T) d[k] + T (v_ff[k] - v[k]).

    Args:
        samples: The planned motion with its feedforward.
        gain_per_s: K_v of the position loop [1/s].

    Returns:
        Every row, without a feedforward. Velocities are the commands; accelerations are their
        changes from row to row, the last one back to rest.
    """
    if samples.feedforward is None:
        return samples
    from scipy.signal import lfilter  # a slow import, for feedforward only

    samples = samples.whole()
    ahead = np.asarray(samples.feedforward)
    step_s = samples.sample_period_s
    deviation = lfilter(
        [0.0, step_s], [1.0, gain_per_s * step_s - 1.0], ahead - samples.velocity, axis=0
    )
    command = ahead - gain_per_s * deviation
    return replace(
        samples,
        position=samples.position + deviation,
        velocity=command,
        acceleration=np.diff(command, axis=0, append=np.zeros((1, command.shape[1]))) / step_s,
        feedforward=None,
    )


def verify_command(samples: MotionSamples, cell: CellConfig, robot: RobotDescription) -> None:
    """Check a motion together with its feedforward, row by row, before anything moves.

    - Positions must be within the robot's limits.
    - Velocities must be within the robot's limits plus the margin of the cell's supervision.
    - Accelerations of the command may be 1.5 times the joint's limit, as in the supervisor: a
      velocity loop lags, so a motion at the limit needs larger commands.
    - The feedforward itself must not change faster than with 1.5 times the acceleration limit. This
      applies to every possible transition between rows: at the start, at the end, and if periods
      are left out.

    Args:
        samples: The planned motion; without a feedforward nothing is checked.
        cell: Cell with the gain of the position loop and the margins.
        robot: Robot with the limits.

    Raises:
        LimitError: A limit is exceeded; the message names joint, time, value and limit.
    """
    if samples.feedforward is None:
        return
    samples = samples.whole()
    assert samples.feedforward is not None
    step_s = samples.sample_period_s
    driven = commanded_motion(samples, cell.position_gain_per_s)
    limits = [joint.limits for joint in robot.joints]
    margin = 1.0 + cell.supervision.limit_margin_fraction
    fastest = np.array([each.velocity for each in limits])
    hardest = np.array([each.acceleration for each in limits])
    low = np.array([each.position_min for each in limits])
    high = np.array([each.position_max for each in limits])
    found = _Excesses(robot, step_s)
    found.look("position", "", driven.position, low, high)
    speed, change = margin * fastest, PLAUSIBLE_FACTOR * hardest
    found.look("velocity", "/s", driven.velocity, -speed, speed)
    coupling = WristCoupling.of_robot(robot)
    if coupling is not None:
        turned = coupling.to_motors(driven.velocity)
        found.look("velocity of the motor", "/s", turned, -speed, speed)
    found.look("acceleration", "/s^2", driven.acceleration, -change, change)
    for rows, steps in _transitions(samples):
        found.look("change of the feedforward", "/s^2", steps / step_s, -change, change, at=rows)
    if found.words:
        raise LimitError(
            "the motion with its feedforward exceeds the robot's limits:"
            f" {'; '.join(found.words)}. Compute the feedforward again for this motion (`rid-daq"
            " compensate`), or drive the motion more slowly",
            code=CODE,
        )


def _transitions(samples: MotionSamples) -> Sequence[tuple[IntArray, FloatArray]]:
    """Return the rows after each possible transition, and the change of the feedforward there."""
    ahead = np.asarray(samples.feedforward)
    rest = np.zeros((1, ahead.shape[1]))
    steps = np.diff(ahead, axis=0, prepend=rest, append=rest)
    found = [(np.arange(len(steps)), steps)]
    ends = samples.period_ends
    if ends:
        last = max(ends)
        leaving = np.array([row for row in ends if row < len(ahead)], dtype=int)
        onto = ahead[last : last + 1] if last < len(ahead) else rest
        found.append((leaving, onto - ahead[leaving - 1]))
    return found


class _Excesses:
    """Worst violation of the limits by each quantity and joint, in words."""

    def __init__(self, robot: RobotDescription, step_s: float) -> None:
        self._robot = robot
        self._step_s = step_s
        self.words: list[str] = []

    def look(
        self,
        quantity: str,
        per: str,
        values: FloatArray,
        low: FloatArray,
        high: FloatArray,
        at: IntArray | None = None,
    ) -> None:
        """Record each joint's worst value outside its lower and upper limit.

        Args:
            quantity, per: Name of the quantity, and the end of its unit, such as `/s`.
            values: Shape (rows, n). The values.
            low, high: Shape (n,). The limits.
            at: Shape (rows,). Row of the motion for each value (default: counted from 0).
        """
        beyond = np.maximum(values - high, low - values)
        for column, joint in enumerate(self._robot.joints):
            row = int(beyond[:, column].argmax())
            value = values[row, column]
            limit = (high if value > high[column] else low)[column]
            if beyond[row, column] <= 1e-9 * abs(limit):
                continue
            unit = joint.unit + per
            number = row if at is None else int(at[row])
            self.words.append(
                f"{quantity} of joint {joint.name!r} reaches {value:.6g} {unit} at"
                f" {number * self._step_s:.4g} s (row {number}), its limit is {limit:.6g} {unit}"
            )
