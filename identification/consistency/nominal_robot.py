"""Nominal parameters of a robot before any measurement: from its drawings or its geometry."""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.robot.nominal_links import nominal_links
from config.robot.robot import RobotDescription
from dynamics.model.cad import cad_parameters
from dynamics.model.robot_model import RobotModel, regressor
from dynamics.terms.conditions import Conditions

MOTIONS: Final = 200


def nominal_parameters(model: RobotModel, robot: RobotDescription) -> tuple[FloatArray, FloatArray]:
    """Return a plausible value for every standard parameter, and its uncertainty.

    Links have the values of `cad` in the robot file; without `cad`, each link is a nominal
    cylinder. If a link has no stated uncertainty, its relative uncertainty is 1. All other
    parameters are zero, with an uncertainty that causes torques as large as those of the links.

    Returns:
        `values, sigmas`, shape (p,). Values and standard deviations, all sigmas finite and
        positive.
    """
    chain = model.chain
    drawn = robot.cad or nominal_links(chain.rows, chain.tool_m)
    guessed = {"uncertainty": 1.0}
    cad = tuple(
        link if link.uncertainty is not None else link.model_copy(update=guessed) for link in drawn
    )
    robot = robot.model_copy(update={"cad": cad})
    values, sigmas = cad_parameters(model, robot)
    unknown = ~np.isfinite(sigmas)
    size = _column_sizes(model, robot)
    torque = float(np.sqrt(np.mean((size * values)[~unknown] ** 2)))
    sigmas[unknown] = torque / np.maximum(size[unknown], 1e-12 * size.max())
    return values, sigmas


def _column_sizes(model: RobotModel, robot: RobotDescription) -> FloatArray:
    """Return the RMS torque per unit of each parameter on fast random motions, shape (p,)."""
    random = np.random.default_rng(0)
    shape = (MOTIONS, len(robot.joints))
    speed = np.array([joint.limits.velocity for joint in robot.joints])
    q, v = random.uniform(-np.pi, np.pi, shape), speed * random.uniform(-1.0, 1.0, shape)
    a = 3.0 * speed * random.uniform(-1.0, 1.0, shape)
    temperature = np.array([joint.reference_temperature_k + 10.0 for joint in robot.joints])
    load = np.ones(shape)
    phi = regressor(model, q, v, a, Conditions(temperature, load, payload=True))
    return np.asarray(np.sqrt(np.mean(phi**2, axis=(0, 1))))
