"""`OnlineFeedforward`: data for on-line compensation, checked before the drives are switched on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from compensation.feedforward.inverse import CYCLES_TO_ACT, FeedforwardTuning, refuse_coupled_wrist
from compensation.loops.velocity_loop import VelocityLoop, in_order
from compensation.online import online_kernel as stage
from compensation.online import path_kernels as path
from config.arrays import FloatArray
from config.cell.cell import CellConfig
from config.errors import ConfigError
from config.robot.robot import RobotDescription
from dynamics.model.one_sample import SampleTorque
from identification.estimation.estimate import Estimate

ROUNDING: Final = 0.01
REST_RAD_S: Final = 1e-3
LARGEST_CORRECTION: Final = 0.25
LONGEST_LOOK_AHEAD: Final = 32


@dataclass(frozen=True, eq=False)
class OnlineFeedforward:
    """Model, velocity loops and limits, in the form that the compiled kernels need.

    Attributes:
        cycle_time_s: Cycle time of the cell [s].
        torque: The identified model.
        axes: Shape (rows, n). Limits and inverse of each velocity loop; `online_kernel` names the
            rows.
    """

    robot: RobotDescription
    cycle_time_s: float
    torque: SampleTorque
    axes: FloatArray

    @classmethod
    def from_model(
        cls,
        cell: CellConfig,
        robot: RobotDescription,
        estimate: Estimate,
        loops: Sequence[VelocityLoop],
        tuning: FeedforwardTuning | None = None,
    ) -> OnlineFeedforward:
        """Build the data from an identified model and the measured velocity loops.

        Raises:
            ConfigError: Model, loops or tuning belong to other joints, or the delay of a loop
                cannot be compensated.
            EstimationError: The model depends on the drives' temperature.
        """
        ordered = in_order(robot.joint_names, estimate.robot.joint_names, loops)
        torque = SampleTorque.of(
            estimate.model, estimate.standard_values, least_smoothing_rad_s=REST_RAD_S
        )
        return cls.of(cell, robot, torque, ordered, tuning)

    @classmethod
    def of(
        cls,
        cell: CellConfig,
        robot: RobotDescription,
        torque: SampleTorque,
        loops: Sequence[VelocityLoop],
        tuning: FeedforwardTuning | None = None,
    ) -> OnlineFeedforward:
        """Build the data from a model's torque and the velocity loops, joint by joint.

        Speed and acceleration limits are those of the robot plus 1 %, because differences of a
        path's points are not exact. Position and torque limits are those of the robot. The
        feedforward changes by at most the acceleration limit plus the limit margin of the cell's
        supervision.

        Args:
            cell, robot: Cycle time and limits.
            torque: Model of the robot.
            loops: Velocity loops, one per joint, in the order of the joints.
            tuning: Correction found in a reference run.

        Raises:
            ConfigError: The robot has a coupled wrist, the tuning belongs to other joints, or the
                delay of a loop cannot be compensated.
        """
        refuse_coupled_wrist(robot, "on-line feedforward")
        n = len(robot.joints)
        tuning = tuning or FeedforwardTuning.none(n)
        if len(tuning.scale) != n:
            raise ConfigError(
                f"the tuning has {len(tuning.scale)} joints, the robot {n}: use a tuning of this"
                " robot",
                code="RID-ROBOT-OTHER",
            )
        if not (tuning.scale > 0.0).all():
            worst = int(np.argmin(tuning.scale))
            raise ConfigError(
                f"the tuning multiplies the model torque of {robot.joints[worst].name} by"
                f" {tuning.scale[worst]:.3g}, which is not positive: measure the loops again",
                code="RID-LOOP-OTHER",
            )
        step_s = cell.cycle_time_s
        axes = np.zeros((stage.AXES_ROWS, n))
        for j, (joint, loop) in enumerate(zip(robot.joints, loops, strict=True)):
            limits = joint.limits
            x = step_s / loop.integral_time_s
            decay = math.exp(-x)
            share = -math.expm1(-x) / x
            ahead = CYCLES_TO_ACT + (loop.delay_s + loop.lag_s + tuning.delay_s[j]) / step_s
            if not 0.0 <= ahead <= LONGEST_LOOK_AHEAD:
                raise ConfigError(
                    f"joint {joint.name}: its velocity loop acts {ahead:.3g} cycles late; at most"
                    f" {LONGEST_LOOK_AHEAD} cycles can be compensated: measure the loop again",
                    code="RID-LOOP-WEAK",
                )
            column = axes[:, j]
            column[path.LOW], column[path.HIGH] = limits.position_min, limits.position_max
            column[path.SPEED] = (1.0 + ROUNDING) * limits.velocity
            column[path.ACCELERATION] = (1.0 + ROUNDING) * limits.acceleration
            column[path.TORQUE] = limits.torque
            column[stage.GAIN] = loop.gain / tuning.scale[j]
            column[stage.OLD], column[stage.NEW] = share - decay, 1.0 - share
            column[stage.DECAY] = decay
            column[stage.SHARE] = 0.5 * x
            column[stage.MOST] = LARGEST_CORRECTION * limits.velocity
            column[stage.CYCLES] = math.floor(ahead)
            column[stage.FRACTION] = ahead - math.floor(ahead)
            most = (1.0 + cell.supervision.limit_margin_fraction) * limits.acceleration
            column[stage.STEP] = max(most, column[path.ACCELERATION]) * step_s
        axes[stage.PRESLIDING : stage.PRESLIDING + 2] = torque.presliding
        axes.setflags(write=False)
        return cls(robot, step_s, torque, axes)

    @property
    def delay_cycles(self) -> int:
        """Number of cycles that the path's head is ahead of the set-points."""
        return int(self.axes[stage.CYCLES].max()) + 1
