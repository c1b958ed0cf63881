"""`estimated_friction`: the friction of an identified model, to compare measured friction with."""

from __future__ import annotations

from collections.abc import Callable

from config.arrays import FloatArray
from config.errors import ConfigError
from config.robot.robot import RobotDescription
from dynamics.terms.friction import Friction
from identification.estimation.estimate import Estimate
from identification.friction.curve import friction_columns


def estimated_friction(
    estimate: Estimate, robot: RobotDescription
) -> Callable[[int, FloatArray], FloatArray]:
    """Return what gives the friction that a model has by its estimate.

    Parameters
    ----------
    estimate : Estimate
        The model.
    robot : RobotDescription
        The robot whose friction was measured; the model must be of it.

    Returns
    -------
    callable
        Joint, from 0, and signed speeds, shape (s,), to torques, shape (s,) [N m or N].

    Raises
    ------
    ConfigError
        The model is of another robot, or has no friction.
    """
    if estimate.robot.joint_names != robot.joint_names:
        raise ConfigError(
            f"the model is of robot {estimate.robot.name!r}, the runs are of {robot.name!r}"
        )
    model = estimate.model
    if not any(isinstance(term, Friction) for term in model.terms):
        raise ConfigError("the model file has no friction to compare with")
    values = estimate.standard_values[model.parameter_groups["friction"]]
    return lambda joint, speed: friction_columns(model, joint, speed) @ values
