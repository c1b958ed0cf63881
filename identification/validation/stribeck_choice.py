"""Which joints have Stribeck friction beside memory, or in its place: chosen after the memory.

At a reversal friction that remembers and friction by speed look alike. Memory is therefore tried
without Stribeck friction. Then Stribeck friction is tried on the joints that have memory and on
those for which it was chosen among the candidates. A joint gets it where it lowers the squared
error on parts of the recordings that a fit has not seen by more than one standard error of the
difference, and where the data tell it and its speed from zero: above zero, since friction does not
fall towards rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import FloatArray
from config.robot.robot import Joint, RobotDescription
from identification.equations.segments import thinned
from identification.estimation.fitted_signals import fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.validation.held_out import (
    DISTINCT_SIGMAS,
    FOLDS,
    held_out_errors,
    shown_values,
)


@dataclass(frozen=True, eq=False)
class StribeckChoice:
    """Which joints have Stribeck friction, and what that is worth.

    Attributes
    ----------
    joint_names : tuple of str
        Base to flange.
    speeds : tuple of float or None
        Stribeck speed of each joint that has it [rad/s or m/s].
    error_nm : ndarray, shape (2, n)
        RMS error of each joint without and with it on parts left out [N m or N].
    """

    joint_names: tuple[str, ...]
    speeds: tuple[float | None, ...]
    error_nm: FloatArray

    def robot(self, robot: RobotDescription) -> RobotDescription:
        """Return a robot with the chosen Stribeck friction, on no other joints."""
        return with_stribeck(robot, self.speeds)


def choose_stribeck(
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    options: EstimationOptions | None = None,
    *,
    folds: int = FOLDS,
) -> StribeckChoice | None:
    """Choose the joints whose friction is larger at low speed.

    Parameters
    ----------
    robot : RobotDescription
        The robot with its friction terms. Joints with presliding or Stribeck friction are tried.
    signals : sequence of SmoothedSignals
        The recordings of the training runs. They are `thinned`.
    options : EstimationOptions, optional
        The other terms of the model, and from which speed on a joint moves.
    folds : int
        Parts that the recordings are cut into.

    Returns
    -------
    StribeckChoice or None
        None where no joint is to be tried.

    Raises
    ------
    EstimationError
        The recordings are too short, or do not show the model.
    """
    options = options or EstimationOptions()
    start = [joint.stribeck_velocity if _is_tried(joint) else None for joint in robot.joints]
    if not any(start):
        return None
    parts = [thinned(run) for run in signals]
    plain = fit_smoothed(with_stribeck(robot, [None] * len(start)), parts, options)
    full = fit_smoothed(with_stribeck(robot, start), parts, options)
    remembers = any("presliding" in joint.friction for joint in robot.joints)
    errors = held_out_errors(plain, full, folds, low_passed=remembers)
    estimate = full.estimate()
    above = dict(
        zip(full.base.names, estimate.values > DISTINCT_SIGMAS * estimate.sigma, strict=True)
    )
    shown = shown_values(estimate, errors, "vs")
    return StribeckChoice(
        joint_names=robot.joint_names,
        speeds=tuple(
            speed if above.get(f"fs_{name}", False) else None
            for name, speed in zip(robot.joint_names, shown, strict=True)
        ),
        error_nm=np.sqrt(np.nanmean(errors, axis=1)),
    )


def with_stribeck(robot: RobotDescription, speeds: Sequence[float | None]) -> RobotDescription:
    """Return a robot with Stribeck friction on the joints that have a speed, on no others."""
    joints = []
    for joint, speed in zip(robot.joints, speeds, strict=True):
        friction = tuple(term for term in joint.friction if term != "stribeck")
        update: dict[str, object] = {"friction": friction}
        if speed is not None:
            update = {"friction": (*friction, "stribeck"), "stribeck_velocity": speed}
        joints.append(joint.model_copy(update=update))
    return robot.model_copy(update={"joints": tuple(joints)})


def _is_tried(joint: Joint) -> bool:
    return not {"presliding", "stribeck"}.isdisjoint(joint.friction)
