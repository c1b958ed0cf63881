"""`TimingLimits`: what a timed path keeps to, joint by joint."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from config.arrays import FloatArray, freeze
from config.errors import ConfigError
from config.robot.robot import RobotDescription


@dataclass(frozen=True, eq=False)
class TimingLimits:
    """Limits of size, alike both ways; rad or m, per second, N m or N at the link side.

    Attributes:
        speed, acceleration: Shape (n,). The joints'; with a coupled wrist `speed` bounds the
            motors' as well, each on its own side.
        torque: Shape (n,). The motors'.
        base: Shape (6,). Force and moment of the base wrench [N, N m]; inf where one is free.
        torque_rms: Shape (n,). Root mean square of each motor's torque over the motion.
        torque_rate: Shape (n,). How fast a motor's torque may change [N m/s or N/s], the jump of
            its friction where it turns back left out.
        jerk: Shape (n,). How fast a joint's acceleration may change [rad/s³ or m/s³].
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
                "limits base must have six values: three forces, three moments",
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
        """Return those of a robot file."""
        limits = [joint.limits for joint in robot.joints]
        return cls(
            speed=np.array([each.velocity for each in limits]),
            acceleration=np.array([each.acceleration for each in limits]),
            torque=np.array([each.torque for each in limits]),
        )

    def keeping_free(self, share: float) -> TimingLimits:
        """Return them with a share of the torque, and of what the base takes, kept free.

        Raises:
            ConfigError: The share is not one of 0 to 1.
        """
        if not 0.0 <= share < 1.0:
            raise ConfigError(
                f"a margin of {share:g} of the torque: give 0 to less than 1",
                code="RID-OPTION-RANGE",
            )
        left = 1.0 - share
        return replace(
            self, torque=left * self.torque, base=None if self.base is None else left * self.base
        )
