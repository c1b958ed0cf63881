"""`OnlineFeedforward`: data for on-line compensation, checked before the drives are switched on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from compensation.feedforward.inverse import CYCLES_TO_ACT, FeedforwardTuning
from compensation.loops.velocity_loop import VelocityLoop, in_order
from compensation.online import online_kernel as stage
from compensation.online import path_kernels as path
from compensation.online.load_kernels import (
    LoadArrays,
    load_arrays,
    most_possible_loads,
    stated_times,
)
from compensation.online.load_signals import LoadSignals
from compensation.ramped_load import RampedLoad
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
LOAD_TIME_S: Final = 0.3e-6
"""Upper limit of the time to compute the torque of a possible load at one point of the path, per
joint [s]; `benchmarks.stream` checks it."""
LARGEST_LOAD_FRACTION: Final = 0.1
"""Largest fraction of a cycle that is used to check the torques of all possible loads."""


@dataclass(frozen=True, eq=False)
class OnlineFeedforward:
    """Model, velocity loops and limits, in the form that the compiled kernels need.

    Attributes:
        cycle_time_s: Cycle time of the cell [s].
        torque: The identified model.
        axes: Shape (rows, n). Limits and inverse of each velocity loop; `online_kernel` names the
            rows.
        loads: Parameters of the model with each of its loads, and the times of the changes.
        signals: Signals at which the load changes; None without signals.
    """

    robot: RobotDescription
    cycle_time_s: float
    torque: SampleTorque
    axes: FloatArray
    loads: LoadArrays
    signals: LoadSignals | None = None

    @classmethod
    def from_model(
        cls,
        cell: CellConfig,
        robot: RobotDescription,
        estimate: Estimate | RampedLoad,
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
        estimates = (estimate,) if isinstance(estimate, Estimate) else estimate.estimates
        torques = tuple(
            SampleTorque.of(each.model, each.standard_values, least_smoothing_rad_s=REST_RAD_S)
            for each in estimates
        )
        found = cls.of(cell, robot, torques[0], ordered, tuning)
        if isinstance(estimate, Estimate):
            return found
        times_s = stated_times(estimate.begin_s, estimate.ramp_s)
        return replace(found, loads=load_arrays(torques, times_s))

    @classmethod
    def of(
        cls,
        cell: CellConfig,
        robot: RobotDescription,
        torque: SampleTorque,
        loops: Sequence[VelocityLoop],
        tuning: FeedforwardTuning | None = None,
    ) -> OnlineFeedforward:
        """Build the data from a model's torque and the velocity loops, motor by motor.

        Speed and acceleration limits are those of the robot plus 1 %, because differences of a
        path's points are not exact. Position and torque limits are those of the robot. The rate at
        which the feedforward changes is limited to the acceleration limit plus 1 %, or plus the
        limit margin of the cell's supervision if that is larger.

        Args:
            cell, robot: Cycle time and limits.
            torque: Model of the robot.
            loops: Velocity loops, one per motor, in the order of the joints.
            tuning: Correction found in a reference run.

        Raises:
            ConfigError: The tuning belongs to other joints or has a scale that is not positive, or
                the delay of a loop cannot be compensated.
        """
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
                    f"joint {joint.name}: its velocity loop acts {ahead:.3g} cycles late, but only"
                    f" 0 to {LONGEST_LOOK_AHEAD} cycles can be compensated: measure the loop again",
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
        return cls(robot, step_s, torque, axes, load_arrays((torque,), np.zeros(0)))

    def with_signals(self, signals: LoadSignals) -> OnlineFeedforward:
        """Return the data for a path during which the load changes at signals.

        Raises:
            ConfigError: So many loads are possible at the same time that a cycle is too short to
                check their torques.
        """
        begun = signals.begin(self.loads, self.delay_cycles * self.cycle_time_s)
        possible = most_possible_loads(begun)
        load_s = stage.POINTS_A_CYCLE * len(self.robot.joints) * LOAD_TIME_S
        most = int(LARGEST_LOAD_FRACTION * self.cycle_time_s / load_s)
        if possible > max(most, 2):
            raise ConfigError(
                f"{possible} loads are possible at the same time, but a cycle of"
                f" {1e3 * self.cycle_time_s:g} ms is long enough to check the torques of"
                f" {max(most, 2)} only: give fewer signals, or `missed: stop`",
                code="RID-LOAD-SIGNAL-MANY",
            )
        return replace(self, signals=signals)

    @property
    def delay_cycles(self) -> int:
        """Number of cycles by which the feedforward is computed ahead of the set-points."""
        return int(self.axes[stage.CYCLES].max()) + 1
