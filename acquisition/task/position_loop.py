"""`PositionLoop`: position controller of this computer, around the drives' velocity loops."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from config.cell.cell import CellConfig
from config.errors import ConfigError
from config.robot.robot import RobotDescription


@dataclass(frozen=True)
class PositionLoop:
    """Proportional position control with velocity feedforward.

    Attributes:
        gain_per_s: K_v [1/s].
        velocity_limit: Largest command of each joint [rad/s or m/s]. Commands are clipped to it;
            measured velocities are checked by the supervisor.
    """

    gain_per_s: float
    velocity_limit: tuple[float, ...]

    def __post_init__(self) -> None:
        if not (math.isfinite(self.gain_per_s) and self.gain_per_s > 0.0):
            raise ConfigError(
                f"position loop: invalid gain_per_s {self.gain_per_s}: give a positive value",
                code="RID-CELL-VALUE",
            )
        if not all(limit > 0.0 for limit in self.velocity_limit):
            raise ConfigError(
                f"position loop: invalid velocity limits {self.velocity_limit}: give positive"
                " values",
                code="RID-CELL-VALUE",
            )

    @classmethod
    def of_cell(cls, cell: CellConfig, robot: RobotDescription) -> PositionLoop:
        """Return the loop with the cell's gain and the robot's limits plus the permitted margin."""
        margin = 1.0 + cell.supervision.limit_margin_fraction
        return cls(
            cell.position_gain_per_s,
            tuple(joint.limits.velocity * margin for joint in robot.joints),
        )

    def velocity_command(
        self,
        target_position: Sequence[float],
        target_velocity: Sequence[float],
        position: Sequence[float],
    ) -> list[float]:
        """Return q̇_cmd = K_v (q_d − q) + q̇_ff, within the limits (theory: section 12).

        A command that is NaN stays NaN; the supervisor refuses it.

        Args:
            target_position, target_velocity, position: q_d, q̇_ff and q, one value per joint [rad
                or m, and per second].
        """
        gain = self.gain_per_s
        command = []
        for target, feedforward, actual, limit in zip(
            target_position, target_velocity, position, self.velocity_limit, strict=True
        ):
            velocity = gain * (target - actual) + feedforward
            if velocity > limit:
                velocity = limit
            elif velocity < -limit:
                velocity = -limit
            command.append(velocity)
        return command
