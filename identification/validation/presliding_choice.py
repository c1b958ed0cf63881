"""Which joints' friction remembers where it came from: chosen by the data, as other terms are.

With presliding the samples at rest and at reversal can be predicted. A joint gets it where that
lowers its squared error on parts of the recordings that a fit has not seen, rest and reversal
included, by more than one standard error of the difference, second by second (Breiman and others
1984). Stribeck friction is left out meanwhile: at reversals it stands for what gives way. The
parameters that are not linear are those of all data in every fold. A distance that the data do not
tell from zero, or that ends at a bound, is not taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from identification.equations.segments import thinned
from identification.estimation.fitted_signals import FittedSignals, fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.validation.held_out import FOLDS, held_out_errors, shown_values
from identification.validation.stribeck_choice import with_stribeck

STARTS: Final = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2)
"""Presliding distances from which the fit begins [rad or m]: each joint from its best."""


@dataclass(frozen=True, eq=False)
class PreslidingChoice:
    """Which joints have presliding, and what that is worth.

    Attributes
    ----------
    joint_names : tuple of str
        Base to flange.
    distances : tuple of float or None
        Presliding distance of each joint that has it [rad or m].
    error_nm : ndarray, shape (2, n)
        RMS error of each joint without and with it on parts left out, standstill and reversal
        included [N m or N].
    """

    joint_names: tuple[str, ...]
    distances: tuple[float | None, ...]
    error_nm: FloatArray

    def robot(self, robot: RobotDescription) -> RobotDescription:
        """Return a robot with the chosen presliding."""
        return with_presliding(robot, self.distances)


def choose_presliding(
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    options: EstimationOptions | None = None,
    *,
    folds: int = FOLDS,
) -> PreslidingChoice:
    """Choose the joints whose friction has memory.

    Parameters
    ----------
    robot : RobotDescription
        The robot with its other friction terms; Stribeck friction is left out.
    signals : sequence of SmoothedSignals
        The recordings of the training runs. They are `thinned`.
    options : EstimationOptions, optional
        The other terms of the model, and from which speed on a joint moves.
    folds : int
        Parts that the recordings are cut into.

    Raises
    ------
    EstimationError
        The recordings are too short, or do not show the model.
    """
    options = options or EstimationOptions()
    robot = with_stribeck(
        with_presliding(robot, [None] * len(robot.joints)), [None] * len(robot.joints)
    )
    parts = [thinned(run) for run in signals]
    plain = fit_smoothed(robot, parts, options)
    start = _start(robot, plain, options)
    full = fit_smoothed(with_presliding(robot, start), parts, options)
    errors = held_out_errors(plain, full, folds)
    distances = shown_values(full.estimate(), errors, "dp")
    return PreslidingChoice(robot.joint_names, distances, np.sqrt(np.nanmean(errors, axis=1)))


def with_presliding(robot: RobotDescription, distances: Sequence[float | None]) -> RobotDescription:
    """Return a robot with presliding on the joints that have a distance [rad or m], no others."""
    joints = []
    for joint, distance in zip(robot.joints, distances, strict=True):
        friction = tuple(term for term in joint.friction if term != "presliding")
        update: dict[str, object] = {"friction": friction}
        if distance is not None:
            update = {"friction": (*friction, "presliding"), "presliding_distance": distance}
        joints.append(joint.model_copy(update=update))
    return robot.model_copy(update={"joints": tuple(joints)})


def _start(
    robot: RobotDescription, plain: FittedSignals, options: EstimationOptions
) -> list[float]:
    """Return the distance of `STARTS` that fits each joint best, gears losing nothing yet."""
    residuals = []
    for distance in STARTS:
        tried = with_presliding(robot, [distance] * len(robot.joints))
        residuals.append(plain.problem.fit(options.model.build(tried), None).residual_nm)
    return [STARTS[k] for k in np.argmin(residuals, axis=0)]
