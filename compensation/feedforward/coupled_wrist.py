"""What is worked out joint by joint, and so not for a robot whose motors move several joints."""

from __future__ import annotations

from config.errors import ConfigError
from config.robot.robot import RobotDescription


def refuse_coupled_wrist(robot: RobotDescription, what: str) -> None:
    """Refuse what works joint by joint for a robot whose motors do not.

    Raises
    ------
    ConfigError
        The robot's wrist is coupled; `what` is named.
    """
    if robot.coupling is not None:
        raise ConfigError(
            f"robot {robot.name}: {what} works joint by joint, and this robot's wrist is coupled;"
            " use `rid-daq compensate` without it"
        )
