"""Constraints on the standard parameters of a real robot, term by term of its model."""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel
from dynamics.terms.armature import Armature
from dynamics.terms.conditions import Conditions
from dynamics.terms.friction import Friction
from dynamics.terms.friction_functions import traits
from dynamics.terms.payload import Payload
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK, RigidBodies
from dynamics.terms.rotors import Rotors
from dynamics.terms.spring import Spring

SLOWEST_SHARE: Final = 0.02
SPEEDS: Final = 40


def bodies(model: RobotModel) -> tuple[slice, ...]:
    """Return the indices of the ten parameters of each link, and of a payload."""
    return tuple(
        slice(start, start + PARAMETERS_PER_LINK)
        for term, columns in zip(model.terms, model.parameter_groups.values(), strict=True)
        if isinstance(term, RigidBodies | Payload)
        for start in range(columns.start, columns.stop, PARAMETERS_PER_LINK)
    )


def not_negative(model: RobotModel, robot: RobotDescription) -> FloatArray:
    """Return rows G, (k, p), of G theta >= 0: motor inertias, springs, and friction that brakes.

    Friction offsets, temperature coefficients and the Fourier form of a spring are unconstrained.

    Raises:
        EstimationError: The constraints of a term or a friction function are not known.
    """
    names, identity = model.parameter_names, np.eye(len(model.parameter_names))
    rows: list[FloatArray] = []
    for term, columns in zip(model.terms, model.parameter_groups.values(), strict=True):
        match term:
            case RigidBodies() | Payload() | Spring(distances_m=None):
                pass
            case Rotors() | Armature() | Spring():
                rows.extend(identity[columns])
            case Friction():
                for j in range(model.chain.n):
                    signs = {c: traits(c.function).sign for c in term.columns if c.joint == j}
                    if "curve" in signs.values():
                        fastest = robot.joints[j].limits.velocity
                        rows.extend(_braking(model, term, columns, j, fastest))
                        continue
                    rows.extend(
                        identity[names.index(c.parameter_name)]
                        for c, sign in signs.items()
                        if sign == "braking"
                    )
            case _:
                raise EstimationError(
                    f"the physical constraints of the model's term {term.name} are not known:"
                    " define them in identification/consistency/constraints.py, or leave the"
                    " term out",
                    code="RID-MODEL-TERM",
                )
    return np.array(rows).reshape(-1, len(names))


def _braking(
    model: RobotModel, friction: Friction, columns: slice, joint: int, fastest: float
) -> FloatArray:
    """Return rows whose product with theta is a joint's braking friction at several speeds."""
    speed = np.linspace(SLOWEST_SHARE * fastest, fastest, SPEEDS)
    actuator = np.zeros((2 * SPEEDS, model.chain.n))
    actuator[:, joint] = np.concatenate([speed, -speed])
    v = actuator if model.coupling is None else actuator @ model.coupling.joints_by_motors.T
    reference = Conditions(temperature_k=np.full(model.chain.n, 293.15))  # columns left free
    motion = model.motion(np.zeros_like(v), v, np.zeros_like(v), reference)
    torque = np.zeros((*v.shape, len(friction.columns)))
    friction.fill_torque(motion, torque)
    torque[:, :, [traits(c.function).sign == "free" for c in friction.columns]] = 0.0
    rows = np.zeros((len(v), len(model.parameter_names)))
    rows[:, columns] = torque[:, joint] * np.sign(actuator[:, [joint]])
    return rows
