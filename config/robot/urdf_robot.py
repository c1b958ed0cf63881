"""Conversion of a URDF to a `RobotDescription`: chain, kinematics, limits, links and bodies."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import ValidationError

from config.arrays import FloatArray
from config.errors import ConfigError
from config.formats.urdf import UrdfTree, rpy_of_rotation
from config.formats.yaml_tree import Path
from config.meshes.package_folders import PackageFolders
from config.plausible import implausible, key_name
from config.quantities import Vector3
from config.robot.axis_lines import rows_of_axes
from config.robot.joint_size import GRAVITY_M_S2, joint_sizes
from config.robot.kinematic_table import Kinematics
from config.robot.robot import Joint, RobotDescription
from config.robot.urdf_bodies import bodies_of_urdf, without_rounding_errors
from config.robot.urdf_chain import UrdfArm, arm_between, held_positions
from config.robot.urdf_drawings import LinkDrawing, drawings_of_urdf
from config.robot.urdf_limits import (
    LimitDefaults,
    ReplacedValue,
    limits_of_urdf,
    limits_within,
)
from config.robot.urdf_links import links_of_urdf
from config.robot.urdf_mimic import coupling_of, release_joints
from config.robot.urdf_motors import UrdfMotor, motors_of_urdf
from config.wrong_value import explain_error


@dataclass(frozen=True)
class UrdfRobot:
    """A robot made from a URDF, with notes on the conversion.

    Attributes:
        notes: Notes on values that were omitted, repaired or set to a default.
        comments: Notes on single joints and links, by their key of the robot file.
        motors: The URDF's friction and motor direction, one per joint.
        drawings: What is drawn of each link, base first; empty if no mesh was read.
    """

    robot: RobotDescription
    notes: tuple[str, ...]
    comments: Mapping[Path, str]
    motors: tuple[UrdfMotor, ...]
    drawings: tuple[LinkDrawing, ...] = ()


def robot_of_urdf(
    tree: UrdfTree,
    *,
    base: str | None = None,
    tip: str | None = None,
    defaults: LimitDefaults | None = None,
    packages: PackageFolders | None = None,
    parallelograms: Sequence[str] = (),
) -> UrdfRobot:
    """Return the serial robot between two links of a URDF.

    Link frames become those of the modified Denavit-Hartenberg convention, exactly, for any axes.
    Links behind fixed joints count as part of the link that carries them. So do side branches;
    their joints are held at zero, or as close to zero as their limits allow. The first frame has
    the base link's axes.

    Args:
        tree: The URDF.
        base: The fixed link; the URDF's root if not given.
        tip: The link whose origin is the tool point; the end of the only arm if not given.
        defaults: Limits to use if the URDF states none; if not given, they follow from the robot's
            size.
        packages: Places of the mesh files; if not given, meshes are not read.
        parallelograms: Mimic joints that their own motors turn through a parallelogram.

    Raises:
        SeveralArmsError: There are several arms and no `tip`.
        ConfigError: A link or the chain does not exist, the chain cannot be modelled (too many
            joints, some mimic joints), its names are not unique, or a value is one that no robot
            has.
    """
    tree, released = release_joints(tree, parallelograms)
    arm = arm_between(tree, base, tip)
    coupling = coupling_of([joint.name for joint in arm.joints], arm.merged, released)
    notes = list(arm.notes)
    notes += [
        f"joint {name!r} has its own motor, whose motion adds to {mimic.multiplier:g} times that of"
        f" {mimic.joint!r} (`coupling`); its <mimic> is ignored"
        for name, mimic in released.items()
    ]
    places = tree.placements(arm.base, held_positions(tree, arm))
    end = places[arm.tip]
    origins_m = np.array([places[joint.child][:3, 3] for joint in arm.joints])
    axes = rows_of_axes(
        origins_m,
        np.array([places[joint.child][:3, :3] @ joint.axis for joint in arm.joints]),
        end[:3, :3],
    )
    names = _joint_names(tree, arm, notes)
    carried = carried_links(tree, arm, notes)
    notes += tree.notes
    in_root = tree.placements(tree.root_of(arm.base))[arm.base][:3, :3]
    gravity = in_root.T @ np.array([0.0, 0.0, -GRAVITY_M_S2])
    tool = np.asarray(np.linalg.inv(axes.frames[-1]) @ end)
    links = links_of_urdf(tree, carried, places, axes, tool[:3, 3])
    centres = [np.array([*link.centre_m, 1.0]) for link in links.cad]
    sizes = joint_sizes(
        arm.joints,
        origins_m,
        end[:3, 3],
        np.array([frame @ c for frame, c in zip(axes.frames[1:], centres, strict=True)])[:, :3],
        np.array([link.mass_kg for link in links.cad]),
    )
    found = limits_of_urdf(arm.joints, sizes, defaults or LimitDefaults())
    if coupling is not None:
        found = limits_within(found, coupling[1])
    ratios, motors, replaced = motors_of_urdf(tree, arm, [one.limits for one in found])
    for values_here, one in zip(replaced, found, strict=True):
        values_here += one.replaced
    reach_m = max(size.reach_m for size in sizes)
    solids = bodies_of_urdf(tree, carried, places, axes, reach_m, packages)
    try:
        robot = RobotDescription(
            name=_plain_name(tree.name or "robot"),
            gravity_m_s2=_vector(gravity),
            base_offset_m=_vector(axes.origin_m),
            kinematics=Kinematics(convention="modified_dh", rows=axes.rows),
            tool_offset_m=_vector(tool[:3, 3]),
            tool_rpy_rad=_vector(np.array(rpy_of_rotation(tool[:3, :3]))),
            joints=tuple(
                Joint(
                    name=name,
                    type="prismatic" if joint.kind == "prismatic" else "revolute",
                    limits=one.limits,
                    gear_ratio=ratio,
                    armature=True,
                    friction=("coulomb", "viscous", "offset"),
                )
                for joint, name, one, ratio in zip(arm.joints, names, found, ratios, strict=True)
            ),
            coupling=None if coupling is None else tuple(map(tuple, coupling[0].tolist())),
            cad=links.cad,
            bodies=solids.bodies,
        )
    except ValidationError as error:
        lines = [
            f"{tree.file}: cannot be converted to a robot: {key_name(each['loc'])}:"
            f" {explain_error(each)}"
            for each in error.errors()
        ]
        raise ConfigError("\n".join(lines), code="RID-URDF-VALUE") from error
    _refuse_implausible(tree, robot)
    comments: dict[Path, str] = {("cad", i): text for i, text in links.comments.items()}
    comments |= {
        ("joints", i): ". ".join(map(str, values_here))
        for i, values_here in enumerate(replaced)
        if values_here
    }
    notes += [*links.notes, *_group_replaced(names, replaced), *solids.notes]
    drawings: tuple[LinkDrawing, ...] = ()
    if packages is not None:
        drawings, of_drawings = drawings_of_urdf(tree, carried, places, axes, reach_m, packages)
        notes += of_drawings
    return UrdfRobot(robot, tuple(notes), comments, motors, drawings)


def carried_links(tree: UrdfTree, arm: UrdfArm, notes: list[str]) -> list[list[str]]:
    """Return the URDF's links that move together: with the base, then with each joint.

    Args:
        tree: The URDF.
        arm: The arm; the other moving joints are held (`held_positions`). Links between a driven
            joint and a mimic joint that is part of it are left out.
        notes: One note for each group of held joints is appended.

    Raises:
        ConfigError: As for `held_positions`.
    """
    number = {joint.child: i + 1 for i, joint in enumerate(arm.joints)}
    carried: list[list[str]] = [[] for _ in range(len(arm.joints) + 1)]
    stand = held_positions(tree, arm)
    merged = {each.joint.name for each in arm.merged}
    between = {link for each in arm.merged for link in each.between}
    held: dict[tuple[int, float], list[str]] = {}
    waiting = [(arm.base, 0)]
    while waiting:
        link, body = waiting.pop()
        if link not in between:
            carried[body].append(link)
        for joint in tree.joints_below.get(link, ()):
            if joint.kind != "fixed" and joint.child not in number and joint.name not in merged:
                follows = f" (mimics {joint.mimic.joint!r})" if joint.mimic is not None else ""
                key = body, stand.get(joint.name, 0.0)
                held.setdefault(key, []).append(f"{joint.name!r}{follows}")
            waiting.append((joint.child, number.get(joint.child, body)))
    notes += [
        f"{', '.join(joints)} {'is' if len(joints) == 1 else 'are'} held at"
        f" {f'{position:g}' if position else 'zero'}; links behind"
        f" {'it' if len(joints) == 1 else 'them'} count as part of link {body}"
        for (body, position), joints in held.items()
    ]
    return carried


def _refuse_implausible(tree: UrdfTree, robot: RobotDescription) -> None:
    """Refuse geometry that no robot has; all other values were repaired before.

    Raises:
        ConfigError: A value is implausible; one line per value.
    """
    lines = [
        f"{tree.file}: implausible robot: {key_name(path)}: {why.split('. Correct')[0]}."
        " A URDF uses m, rad and kg, and so do --range, --velocity and --acceleration; correct it"
        " there"
        for path, why in implausible(robot.model_copy(update={"cad": None}))
    ]
    if lines:
        raise ConfigError("\n".join(lines), code="RID-URDF-VALUE")


def _group_replaced(names: list[str], replaced: list[list[ReplacedValue]]) -> list[str]:
    """Return one line per key and reason, with the joints and their values."""
    together: dict[tuple[str, str], tuple[list[str], list[str]]] = {}
    for name, values_here in zip(names, replaced, strict=True):
        for one in values_here:
            joints, values = together.setdefault((one.key, one.how), ([], []))
            joints.append(name)
            values.append(one.value)
    return [
        f"{key} of {', '.join(joints)}: {', '.join(values)} ({how})"
        for (key, how), (joints, values) in together.items()
    ]


def _joint_names(tree: UrdfTree, arm: UrdfArm, notes: list[str]) -> list[str]:
    names = []
    for joint in arm.joints:
        name = re.sub(r"[^A-Za-z0-9_-]", "_", joint.name)
        name = (name if name[:1].isalpha() else f"joint_{name}")[:32]
        if name != joint.name:
            notes.append(f"joint {joint.name!r} is renamed to {name!r}")
        names.append(name)
    if len(set(names)) < len(names):
        raise ConfigError(
            f"{tree.file}: joint names {', '.join(joint.name for joint in arm.joints)} are not"
            " unique in 32 plain characters; rename them",
            code="RID-URDF-NAME",
        )
    return names


def _plain_name(name: str) -> str:
    plain = re.sub(r"[^A-Za-z0-9_.-]", "_", name)
    return (plain if plain[:1].isalnum() else f"robot_{plain}")[:64]


def _vector(values: FloatArray) -> Vector3:
    x, y, z = (without_rounding_errors(value) for value in values.tolist())
    return x, y, z
