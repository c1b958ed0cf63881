"""Standard parameters from a robot's CAD data (`cad` in the robot file), with their uncertainty."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from config.arrays import FloatArray
from config.errors import ConfigError
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK

SMALLEST_MASS_KG: Final = 0.01
SMALLEST_ARM_M: Final = 0.01


def cad_parameters(model: RobotModel, robot: RobotDescription) -> tuple[FloatArray, FloatArray]:
    """Return a model's standard parameters from CAD data, with standard deviations.

    Args:
        robot: The model's robot; its file must contain `cad`.

    Returns:
        `values`, shape (parameters,). The links' inertial parameters about the origins of their
        frames; zero for all other parameters. `sigmas`, shape (parameters,). Standard deviations of
        the values: the stated `uncertainty` times the link's mass, the magnitude of its first
        moment, or the magnitude of its inertia. If the inertia of a link is unknown, a typical
        inertia for its mass is added. Infinite for parameters without CAD data, such as those of
        friction and rotors, and for links whose data are only a guess (`uncertainty: null`).

    Raises:
        ConfigError: The robot has no `cad`.
    """
    if robot.cad is None:
        raise ConfigError(
            f"robot {robot.name!r} has no cad values: state mass, centre and inertia of its links"
            " under `cad` in the robot file",
            code="RID-ROBOT-CAD",
        )
    values = np.zeros(len(model.parameter_names))
    sigmas = np.full(len(values), np.inf)
    for link, cad in enumerate(robot.cad):
        columns = slice(PARAMETERS_PER_LINK * link, PARAMETERS_PER_LINK * (link + 1))
        xx, xy, xz, yy, yz, zz = cad.inertia_kg_m2
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        values[columns] = about_origin(cad.mass_kg, cad.centre_m, inertia)
        if cad.uncertainty is not None:
            sigmas[columns] = cad.uncertainty * _sizes(values[columns])
            sigmas[columns][4:] += cad.unknown_inertia_kg_m2 or 0.0
    return values, sigmas


def cad_prior(model: RobotModel, robot: RobotDescription) -> tuple[FloatArray, FloatArray]:
    """Return `cad_parameters`; refuse CAD data in which every value is a guess.

    Raises:
        ConfigError: The robot has no `cad`, or all values in it are guesses.
    """
    values, sigmas = cad_parameters(model, robot)
    if not np.isfinite(sigmas).any():
        raise ConfigError(
            f"robot {robot.name!r} has only guesses under `cad` (uncertainty: null), which"
            " cannot be a prior: state values from drawings with their uncertainty",
            code="RID-ROBOT-CAD",
        )
    return values, sigmas


def about_origin(mass_kg: float, centre_m: ArrayLike, inertia_kg_m2: FloatArray) -> FloatArray:
    """Return a link's ten parameters about its frame's origin, by the parallel axis theorem.

    Args:
        centre_m: Shape (3,). Centre of gravity in the link's frame.
        inertia_kg_m2: Shape (3, 3). Inertia about the centre of gravity.
    """
    c = np.array(centre_m)
    inertia = inertia_kg_m2 + mass_kg * (c @ c * np.eye(3) - np.outer(c, c))
    return np.array([mass_kg, *(mass_kg * c), *inertia[np.triu_indices(3)]])


def _sizes(link: FloatArray) -> FloatArray:
    """Return the values to which a link's relative uncertainty refers: mass, first moment, inertia.

    Each value is at least that of a small, compact body, so that no uncertainty is zero.
    """
    mass = max(float(link[0]), SMALLEST_MASS_KG)
    moment = max(float(np.linalg.norm(link[1:4])), mass * SMALLEST_ARM_M)
    inertia = max(float(link[4] + link[7] + link[9]) / 3.0, mass * SMALLEST_ARM_M**2)
    return np.array([mass, *(moment,) * 3, *(inertia,) * 6])
