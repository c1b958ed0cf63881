"""What a robot is like before anything is measured: from its drawings, or from its geometry."""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import LinkCad, RobotDescription
from dynamics.geometry.kinematics import Chain
from dynamics.model.cad import cad_parameters
from dynamics.model.robot_model import RobotModel, regressor
from dynamics.terms.conditions import Conditions

DENSITY_KG_M3: Final = 2000.0
SLENDERNESS: Final = 25.0
MOTIONS: Final = 200


def nominal_parameters(model: RobotModel, robot: RobotDescription) -> tuple[FloatArray, FloatArray]:
    """Return a plausible value for every standard parameter, and how far it may be off.

    Links are as the drawings say. Without drawings each is a cylinder of 2000 kg/m^3 (castings,
    motors and air) along the link, with a radius of 1/25 of the arm's length, give or take all of
    it. All other parameters are zero, give or take what makes torques as large as the links do.

    Parameters
    ----------
    model : RobotModel
        The model.
    robot : RobotDescription
        Its robot.

    Returns
    -------
    values, sigmas : ndarray, shape (p,)
        Values and standard deviations, all sigmas finite and positive.
    """
    if robot.cad is None:
        robot = robot.model_copy(update={"cad": cylinders(model.chain)})
    values, sigmas = cad_parameters(model, robot)
    unknown = ~np.isfinite(sigmas)
    size = _column_sizes(model, robot)
    torque = float(np.sqrt(np.mean((size * values)[~unknown] ** 2)))
    sigmas[unknown] = torque / np.maximum(size[unknown], 1e-12 * size.max())
    return values, sigmas


def cylinders(chain: Chain) -> tuple[LinkCad, ...]:
    """Return a solid cylinder for each link, from half its own offset to the next axis."""
    lengths = np.abs(chain.rows[:, 3:5]).sum() + float(np.linalg.norm(chain.tool_m))
    radius = max(lengths, 0.1) / SLENDERNESS
    ends = [np.array([a, 0.0, 0.0]) for a in chain.rows[1:, 3]] + [chain.tool_m]
    links: list[LinkCad] = []
    for d, end in zip(chain.rows[:, 4], ends, strict=True):
        start = np.array([0.0, 0.0, -0.5 * d])
        along = end - start
        length = float(np.linalg.norm(along))
        axis = along / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
        length += 2.0 * radius
        mass = DENSITY_KG_M3 * np.pi * radius**2 * length
        spin, turn = mass * radius**2 / 2.0, mass * (radius**2 / 4.0 + length**2 / 12.0)
        inertia = turn * np.eye(3) + (spin - turn) * np.outer(axis, axis)
        x, y, z = (0.5 * (start + end)).tolist()
        xx, xy, xz, yy, yz, zz = inertia[np.triu_indices(3)].tolist()
        links.append(
            LinkCad(
                mass_kg=mass,
                centre_m=(x, y, z),
                inertia_kg_m2=(xx, xy, xz, yy, yz, zz),
                uncertainty=1.0,
            )
        )
    return tuple(links)


def _column_sizes(model: RobotModel, robot: RobotDescription) -> FloatArray:
    """Return the RMS torque per unit of each parameter on lively motions, shape (p,)."""
    random = np.random.default_rng(0)
    shape = (MOTIONS, len(robot.joints))
    speed = np.array([joint.limits.velocity for joint in robot.joints])
    q, v = random.uniform(-np.pi, np.pi, shape), speed * random.uniform(-1.0, 1.0, shape)
    a = 3.0 * speed * random.uniform(-1.0, 1.0, shape)
    temperature = np.array([joint.reference_temperature_k + 10.0 for joint in robot.joints])
    load = np.ones(shape)
    phi = regressor(model, q, v, a, Conditions(temperature, load, payload=True))
    return np.asarray(np.sqrt(np.mean(phi**2, axis=(0, 1))))
