"""Standard parameters out of a robot's drawings, with their stated uncertainty."""

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
    """Return what the drawings say of a model's standard parameters.

    Args:
        robot: Its robot, with `cad`.

    Returns:
        `values`, shape (parameters,). The links' inertial parameters about their frames' origins;
            zero for all others.
        `sigmas`, shape (parameters,). Their standard deviations: the stated share of the link's
            mass, of its first moment and of the size of its inertia, or all of the inertia that a
            body of the mass may have where the drawings tell none; infinite where the drawings say
            nothing (friction, rotors, spring, links that are a guess).

    Raises:
        ConfigError: If the robot has no `cad`.
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
    """Return `cad_parameters` of a robot whose drawings tell something.

    Raises:
        ConfigError: The robot has no `cad`, or guesses only.
    """
    values, sigmas = cad_parameters(model, robot)
    if not np.isfinite(sigmas).any():
        raise ConfigError(
            f"robot {robot.name!r} has guesses for `cad` (uncertainty: null), which are no prior:"
            " state what its drawings say and how far it may be off",
            code="RID-ROBOT-CAD",
        )
    return values, sigmas


def about_origin(mass_kg: float, centre_m: ArrayLike, inertia_kg_m2: FloatArray) -> FloatArray:
    """Return the ten parameters of a link about its frame's origin (parallel axes).

    Args:
        centre_m: Shape (3,). Its centre of gravity in its frame.
        inertia_kg_m2: Shape (3, 3). About the centre of gravity.
    """
    c = np.array(centre_m)
    inertia = inertia_kg_m2 + mass_kg * (c @ c * np.eye(3) - np.outer(c, c))
    return np.array([mass_kg, *(mass_kg * c), *inertia[np.triu_indices(3)]])


def _sizes(link: FloatArray) -> FloatArray:
    """Return what a share of uncertainty is taken of: mass, first moment, inertia as a whole.

    None is zero, since no drawing is exact: a link counts as at least a small, compact body.
    """
    mass = max(float(link[0]), SMALLEST_MASS_KG)
    moment = max(float(np.linalg.norm(link[1:4])), mass * SMALLEST_ARM_M)
    inertia = max(float(link[4] + link[7] + link[9]) / 3.0, mass * SMALLEST_ARM_M**2)
    return np.array([mass, *(moment,) * 3, *(inertia,) * 6])
