"""Parameters of ROS 2's `inverse_dynamics_solver` with its KDL plug-in, for a URDF of the robot.

Source: documentation of the packages `inverse_dynamics_solver` and `kdl_inverse_dynamics_solver`
(ROS 2 Jazzy). The parameters are `robot_description`, `root`, `tip`, and `gravity` in the frame of
`root`. The file has not been tried with these packages.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from config.arrays import FloatArray
from identification.export.model import ExportModel
from identification.export.text import header_lines, numbers
from identification.export.urdf_arm import MatchedArm

PLUGIN: Final = "kdl_inverse_dynamics_solver/InverseDynamicsSolverKDL"
NAMESPACE: Final = "kdl"


def kdl_parameters(model: ExportModel, matched: MatchedArm) -> str:
    """Return a YAML file of ROS 2 parameters.

    Args:
        model: The identified robot.
        matched: Its arm in the URDF that the solver gets as `robot_description`.
    """
    gravity = matched.frames[0][:3, :3] @ model.model.chain.gravity_m_s2
    lines = [
        *header_lines(model),
        f"For the robot_description {matched.tree.file}.",
        *kdl_notes(model, matched),
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


def kdl_notes(model: ExportModel, matched: MatchedArm) -> Iterator[str]:
    """Yield what the solver leaves out."""
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
