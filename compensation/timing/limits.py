"""`TimingLimits`: the limits of a timed path, per joint."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from config.arrays import FloatArray, freeze
from config.errors import ConfigError
from config.robot.robot import RobotDescription


@dataclass(frozen=True, eq=False)
class TimingLimits:
    """Limits that hold in both directions, in rad, m, s, N and N m; None is no limit.

    Torques are on the link side.

    Attributes:
        speed, acceleration: Shape (n,). Limits of the joints; with a coupled wrist `speed` limits
            each motor too.
        torque: Shape (n,). Limits of the motors.
        base: Shape (6,). Limits of force and moment of the base wrench [N, N m]; inf for no limit.
        torque_rms: Shape (n,). Limits of each motor's RMS torque over the motion.
        torque_rate: Shape (n,). Limits of the rate of a motor's torque [N m/s or N/s], without the
            jump of friction at a reversal.
        jerk: Shape (n,). Limits of the rate of a joint's acceleration [rad/s³ or m/s³].

    Raises:
        ConfigError: An array has the wrong shape, or a limit is not positive.
    """

    speed: FloatArray
    acceleration: FloatArray
    torque: FloatArray
    base: FloatArray | None = None
    torque_rms: FloatArray | None = None
    torque_rate: FloatArray | None = None
    jerk: FloatArray | None = None

    def __post_init__(self) -> None:
        freeze(self, ConfigError, (None,), "torque", what="limits ")
        n = len(self.torque)
        own = ("speed", "acceleration", "torque_rms", "torque_rate", "jerk")
        freeze(self, ConfigError, (n,), *own, what="limits ")
        if self.base is not None and np.shape(self.base) != (6,):
            raise ConfigError(
                "limits.base needs six values: three forces, three moments",
                code="RID-OPTION-COUNT",
            )
        for name in (*own, "torque", "base"):
            values = getattr(self, name)
            if values is not None and not (values > 0.0).all():
                raise ConfigError(
                    f"limits: {name} must be positive: {values.tolist()}", code="RID-OPTION-RANGE"
                )

    @classmethod
    def of_robot(cls, robot: RobotDescription) -> TimingLimits:
        """Return the limits of a robot file."""
        limits = [joint.limits for joint in robot.joints]
        return cls(
            speed=np.array([each.velocity for each in limits]),
            acceleration=np.array([each.acceleration for each in limits]),
            torque=np.array([each.torque for each in limits]),
        )

    def keeping_free(self, share: float) -> TimingLimits:
        """Return limits with a fraction of the torque and base-wrench limits held in reserve.

        Raises:
            ConfigError: The fraction is negative, or at least 1.
        """
        if not 0.0 <= share < 1.0:
            raise ConfigError(
                f"invalid torque margin {share:g}: give a fraction of at least 0 and less than 1",
                code="RID-OPTION-RANGE",
            )
        left = 1.0 - share
        return replace(
            self, torque=left * self.torque, base=None if self.base is None else left * self.base
        )
