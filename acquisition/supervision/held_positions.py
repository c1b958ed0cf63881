"""`HeldPositions`: positions for the position loop, held if an answer is lost or implausible."""

from __future__ import annotations

from collections.abc import Sequence

from acquisition.supervision.cycle import Cycle
from config.cell.cell import CellConfig
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling

PLAUSIBLE_FACTOR = 1.5
"""Largest plausible rate of change of a value, divided by the joint's limit of this rate."""


class HeldPositions:
    """Plausibility check of positions; replaces missing and implausible positions.

    With a coupled wrist a joint has a position only if all motors that move it have answered.

    Args:
        cell, robot: Cycle time, largest velocities, coupling of the wrist.

    Attributes:
        position: Position of each joint for the position loop [rad or m]. A missing or implausible
            position is replaced by the last plausible one plus the motion of the set-point since
            then, so that a lost answer does not change the correction of the position loop.
        velocity: For each joint, mean velocity between its last two plausible positions [rad/s or
            m/s].
        missed, implausible: For each joint, number of consecutive cycles without an answer, and
            number of implausible answers since the last plausible one.
        unknown: For each joint, number of cycles since its last plausible position in which any
            motor that moves it did not answer. It need not be the same motor in all these cycles.
        jump, jump_limit: For each joint, change from the last plausible position to the latest
            implausible one, and the limit of this change [rad or m].
    """

    def __init__(self, cell: CellConfig, robot: RobotDescription) -> None:
        self._period_s = cell.cycle_time_s
        velocities = [joint.limits.velocity for joint in robot.joints]
        self._step = [PLAUSIBLE_FACTOR * velocity * self._period_s for velocity in velocities]
        coupling = WristCoupling.of_robot(robot)
        self._motors = None if coupling is None else coupling.motors_of
        self.begin([0.0] * len(velocities))

    def begin(self, position: Sequence[float]) -> None:
        """Restart with all joints at rest at `position` [rad or m]."""
        n = len(position)
        self.position = list(position)
        self.velocity = [0.0] * n
        self.missed = [0] * n
        self.implausible = [0] * n
        self.unknown = [0] * n
        self.jump = [0.0] * n
        self.jump_limit = [0.0] * n
        self._plausible = list(position)  # last plausible positions
        self._since = [0] * n  # number of cycle times since these positions were received
        self._target = list(position)

    def take(self, cycle: Cycle) -> None:
        """Process the answers of a cycle; set its `valid` for each plausible position."""
        received, measured, target = cycle.received, cycle.position, cycle.target.position
        motors, periods = self._motors, cycle.periods
        valid = [0] * len(measured)
        for i, actual in enumerate(measured):
            since = self._since[i] = self._since[i] + periods
            self.position[i] += target[i] - self._target[i]
            self.missed[i] = 0 if received[i] else self.missed[i] + 1
            if not (received[i] if motors is None else all(received[j] for j in motors[i])):
                self.unknown[i] += 1
                continue
            jump, limit = actual - self._plausible[i], self._step[i] * since
            if not -limit <= jump <= limit:
                self.implausible[i] += 1
                self.jump[i], self.jump_limit[i] = jump, limit
                continue
            self.implausible[i] = self.unknown[i] = 0
            valid[i] = 1
            self._since[i] = 0
            self.position[i] = self._plausible[i] = actual
            self.velocity[i] = jump / (since * self._period_s)
        self._target = list(target)
        cycle.valid = valid
