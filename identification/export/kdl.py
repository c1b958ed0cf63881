"""Parameters of ROS 2's `inverse_dynamics_solver` with its KDL plug-in, for a URDF of the robot.

Source: documentation of the packages `inverse_dynamics_solver` and `kdl_inverse_dynamics_solver`
(ROS 2 Jazzy). The parameters are `robot_description`, `root`, `tip`, and `gravity` in the frame of
`root`. The file has not been tried with these packages.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from config.arrays import FloatArray
from identification.consistency.metric import whiten_parameters
from identification.estimation.estimate import Estimate
from identification.export.model import ExportModel
from identification.export.text import comment_text, header_lines, numbers
from identification.export.urdf_arm import MatchedArm

PLUGIN: Final = "kdl_inverse_dynamics_solver/InverseDynamicsSolverKDL"
NAMESPACE: Final = "kdl"


def kdl_parameters(model: ExportModel, matched: MatchedArm, notes: tuple[str, ...]) -> str:
    """Return a YAML file of ROS 2 parameters.

    Args:
        model: The identified robot.
        matched: Its arm in the URDF that the solver gets as `robot_description`.
        notes: Further lines for the comment at the top, as `kdl_notes` returns them.
    """
    gravity = matched.frames[0][:3, :3] @ model.model.chain.gravity_m_s2
    lines = [
        *header_lines(model),
        comment_text(f"For the robot_description {matched.tree.file}."),
        *map(comment_text, notes),
    ]
    return (
        "".join(f"# {line}\n" for line in lines)
        + "/**:\n"
        + "  ros__parameters:\n"
        + f"    inverse_dynamics_solver_plugin_name: {PLUGIN}\n"
        + f"    {NAMESPACE}:\n"
        + f"      root: {_quoted(matched.arm.base)}\n"
        + f"      tip: {_quoted(_tip(model, matched))}\n"
        + f"      gravity: [{numbers(_round(gravity))}]\n"
    )


def rest_of_model(
    estimate: Estimate, model: ExportModel, bodies: FloatArray
) -> tuple[ExportModel, float]:
    """Return a model with a file's bodies, and the rotors and friction that fit them best.

    Torques determine sums of links' inertias and rotors' inertias. If the links are given, the
    rotors are the rest.

    Args:
        estimate: The identified model.
        model: Physically consistent parameters.
        bodies: Shape (n, 10). The bodies in the file, in the model's frames.

    Returns:
        The model, and the largest difference of its base parameters from the estimate [sigma].
    """
    theta = np.array(model.parameters)
    theta[: bodies.size] = bodies.ravel()
    columns = whiten_parameters(estimate, estimate.base.combination[:, bodies.size :])
    missing = estimate.values - estimate.base.from_standard(theta)
    change = np.linalg.lstsq(columns, whiten_parameters(estimate, missing), rcond=1e-12)[0]
    theta[bodies.size :] += change
    left = estimate.values - estimate.base.from_standard(theta)
    return replace(model, parameters=theta), float(np.max(np.abs(left) / estimate.sigma))


def kdl_notes(model: ExportModel, matched: MatchedArm) -> Iterator[str]:
    """Yield descriptions of what the solver does not compute."""
    tip = _tip(model, matched)
    tree = matched.tree
    on_chain = {matched.arm.base, *(each.child for each in tree.path(matched.arm.base, tip))}
    moving = [name for name in tree.links if name not in on_chain]
    lost = []
    for name in moving:
        inertial, above = tree.links[name].inertial, name
        while above not in on_chain and above in tree.joint_above:
            above = tree.joint_above[above].parent
        is_carried = above in on_chain and above != matched.arm.base
        if is_carried and inertial is not None and inertial.mass_kg > 0.0:
            lost.append(f"{name} ({inertial.mass_kg:g} kg)")
    if lost:
        yield (
            f"KDL uses only the links between root and tip. These links move with the arm and are"
            f" left out: {', '.join(lost)}."
        )
    yield "getTorques contains no friction and no rotors; add them in the controller:"
    for j, joint in enumerate(matched.arm.joints):
        line = model.straight_friction(j)
        yield (
            f"  {joint.name}: armature {model.armature(j):.6g}, friction {line.friction:.6g},"
            f" damping {line.damping:.6g}"
        )


def _tip(model: ExportModel, matched: MatchedArm) -> str:
    return matched.link_at_tool(model) or matched.arm.joints[-1].child


def _quoted(name: str) -> str:
    return "'" + name.replace("'", "''") + "'"


def _round(values: FloatArray) -> FloatArray:
    """Return a vector without rounding errors near zero."""
    return np.where(np.abs(values) < 1e-9, 0.0, values)
