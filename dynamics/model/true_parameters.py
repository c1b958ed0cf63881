"""True parameters of a simulated robot, as parameters of the identification model.

Only a simulated robot has known true parameters; the demo compares estimates and their confidence
intervals with them.
"""

from __future__ import annotations

import numpy as np

from config.arrays import FloatArray
from config.errors import ConfigError
from config.robot.robot import RobotDescription
from config.simulation.plant import PlantConfig
from dynamics.model.cad import about_origin
from dynamics.model.robot_model import RobotModel
from dynamics.terms.rigid_body import SYMBOLS


def true_parameters(model: RobotModel, robot: RobotDescription, plant: PlantConfig) -> FloatArray:
    """Return the plant's values of the model's standard parameters.

    Link inertias are converted from the centre of gravity to the origin of the link's frame. A
    rotor's polar inertia about its spin axis is added to the link that carries it, because the
    rotor term of the model assumes this (theory: section 3).

    Args:
        model: The model whose parameters are returned. The coefficients of offset, cubic,
            cube-root, Stribeck and temperature-dependent friction are zero.
        robot: Description of the robot, with the mounting of its rotors.
        plant: The simulated robot; its effects under `unmodelled` are ignored, even if the model
            has a parameter for them.

    Returns:
        Shape (parameters,). Values in the order and units of `model.parameter_names`.

    Raises:
        ConfigError: The model has a parameter that the plant file does not state.
    """
    known: dict[str, float] = {}
    for number, link in enumerate(plant.links, start=1):
        xx, yy, zz, xy, xz, yz = link.inertia_kg_m2
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        inertia += _rotors_on(number, robot, plant)
        values = about_origin(link.mass_kg, link.centre_m, inertia).tolist()
        known |= {f"{s}{number}": each for s, each in zip(SYMBOLS, values, strict=True)}
    for number, (joint, axis) in enumerate(zip(robot.joints, plant.axes, strict=True), start=1):
        known[f"Im{number}"] = axis.rotor_inertia_kg_m2
        known[f"fc_{joint.name}"] = axis.coulomb_nm
        known[f"fv_{joint.name}"] = axis.viscous_nm_s
        known[f"Ia{number}"] = joint.gear_ratio**2 * axis.rotor_inertia_kg_m2
        known |= {f"{side}_{joint.name}": axis.coulomb_nm for side in ("fcp", "fcn")}
        known |= {f"{term}_{joint.name}": 0.0 for term in ("fo", "f3", "fcr", "fs", "fcT", "fvT")}
    if plant.spring is not None:
        known["k_spring"] = plant.spring.stiffness_n_per_m
        known["P0_spring"] = plant.spring.stiffness_n_per_m * plant.spring.free_length_m
    unknown = [name for name in model.parameter_names if name not in known]
    if unknown:
        raise ConfigError(
            f"plant {plant.name}: the plant file has no value of {', '.join(unknown)}",
            code="RID-PLANT-UNFIT",
        )
    return np.array([known[name] for name in model.parameter_names])


def _rotors_on(link: int, robot: RobotDescription, plant: PlantConfig) -> FloatArray:
    """Return the inertia matrix of all rotors that are mounted on a link, (3, 3) [kg m^2]."""
    lumped = np.zeros((3, 3))
    for joint, axis in zip(robot.joints, plant.axes, strict=True):
        if joint.rotor is not None and joint.rotor.link == link:
            lumped += axis.rotor_inertia_kg_m2 * np.outer(joint.rotor.axis, joint.rotor.axis)
    return lumped
