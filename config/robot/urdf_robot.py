"""A `RobotDescription` out of a URDF: the chain, its rows, limits, drawings and bodies."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

import numpy as np
from pydantic import ValidationError

from config.arrays import FloatArray
from config.errors import ConfigError
from config.formats.urdf import MOVING, UrdfCollision, UrdfJoint, UrdfTree, rpy_of_rotation
from config.plausible import implausible, key_name
from config.robot.axis_lines import AxisFrames, rows_of_axes
from config.robot.bodies import Body, Capsule, Hull
from config.robot.robot import Joint, JointLimits, Kinematics, LinkCad, RobotDescription, Vector3

GRAVITY_M_S2: Final = 9.81
ACCELERATION_PER_VELOCITY: Final = 5.0
CYLINDER_CORNERS: Final = 16
LEAST_GYRATION_M: Final = 0.002


@dataclass(frozen=True)
class UrdfRobot:
    """A robot made from a URDF, and what a person should know of how it was made."""

    robot: RobotDescription
    notes: tuple[str, ...]


def robot_of_urdf(tree: UrdfTree, *, base: str | None = None, tip: str | None = None) -> UrdfRobot:
    """Return the serial robot between two links of a URDF.

    Link frames become those of the modified Denavit-Hartenberg convention, exactly, for any axes;
    links behind fixed joints count as part of the link that carries them, and so do branches, at
    position zero. The first frame has the base link's axes.

    Parameters
    ----------
    tree : UrdfTree
        The URDF.
    base : str or None
        The link that stands still; the URDF's root if not given.
    tip : str or None
        The link whose origin is the tool point; the last moving link if not given.

    Raises
    ------
    ConfigError
        There is no such link, no single chain, or a joint is invalid.
    """
    for link in (base, tip):
        if link is not None and link not in tree.links:
            raise ConfigError(
                f"{tree.file}: there is no link {link!r}; links are {', '.join(tree.links)}"
            )
    base = base or tree.root
    joints = _path(tree, base, tip) if tip is not None else _only_chain(tree, base)
    moving = [joint for joint in joints if joint.kind in MOVING]
    if not moving:
        raise ConfigError(f"{tree.file}: no joint moves between {base!r} and {tip!r}")
    notes: list[str] = []
    places = _placements(tree, base)
    end = places[tip if tip is not None else moving[-1].child]
    axes = rows_of_axes(
        np.array([places[joint.child][:3, 3] for joint in moving]),
        np.array([places[joint.child][:3, :3] @ joint.axis for joint in moving]),
        end[:3, :3],
    )
    names = _joint_names(tree, moving, notes)
    carried = _carried_links(tree, base, moving, notes)
    if tree.angles_made_right:
        notes.append(
            f"{tree.angles_made_right} angles within 1e-5 rad of a quarter turn were taken as"
            " exactly that"
        )
    in_root = _placements(tree, tree.root)[base][:3, :3]
    gravity = in_root.T @ np.array([0.0, 0.0, -GRAVITY_M_S2])
    tool = np.asarray(np.linalg.inv(axes.frames[-1]) @ end)
    try:
        robot = RobotDescription(
            name=_plain_name(tree.name or "robot"),
            gravity_m_s2=_vector(gravity),
            base_offset_m=_vector(axes.origin_m),
            kinematics=Kinematics(convention="modified_dh", rows=axes.rows),
            tool_offset_m=_vector(tool[:3, 3]),
            tool_rpy_rad=_vector(np.array(rpy_of_rotation(tool[:3, :3]))),
            joints=tuple(
                _joint(joint, name, tree.gear_ratios.get(joint.name), notes)
                for joint, name in zip(moving, names, strict=True)
            ),
            cad=_cad(tree, carried, places, axes, notes),
            bodies=_bodies(tree, carried, places, axes, notes),
        )
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise ConfigError(f"{tree.file}: makes no robot: {where}: {first['msg']}") from error
    notes += [
        f"robot.yaml is refused until {key_name(path)} is corrected: {why}"
        for path, why in implausible(robot)
    ]
    return UrdfRobot(robot, tuple(notes))


def _path(tree: UrdfTree, base: str, tip: str) -> list[UrdfJoint]:
    """Return the joints from base to tip."""
    joints: list[UrdfJoint] = []
    link = tip
    while link != base:
        joint = tree.joint_above.get(link)
        if joint is None:
            raise ConfigError(f"{tree.file}: link {tip!r} does not hang on {base!r}")
        joints.append(joint)
        link = joint.parent
    return joints[::-1]


def _only_chain(tree: UrdfTree, base: str) -> list[UrdfJoint]:
    """Return the joints from base to the last moving link, where no branch moves."""
    below = _placements(tree, base)
    moving = [j for j in tree.joints if j.kind != "fixed" and j.child in below and j.child != base]
    if not moving:
        raise ConfigError(f"{tree.file}: no joint moves below {base!r}")
    carrying: set[str] = set()
    for joint in moving:
        carrying.update(above.child for above in _path(tree, base, joint.parent))
    ends = [joint.child for joint in moving if joint.child not in carrying]
    if len(ends) > 1:
        raise ConfigError(
            f"{tree.file}: the moving joints branch and end at {', '.join(ends)}: say which with"
            " --tip; the other branches then count as fixed"
        )
    return _path(tree, base, ends[0])


def _placements(tree: UrdfTree, base: str) -> dict[str, FloatArray]:
    """Return where every link below the base is in its frame at position zero, (4, 4) each."""
    places: dict[str, FloatArray] = {base: np.eye(4)}
    waiting = [base]
    while waiting:
        link = waiting.pop()
        for joint in tree.joints_below.get(link, ()):
            places[joint.child] = places[link] @ joint.placement
            waiting.append(joint.child)
    return places


def _carried_links(
    tree: UrdfTree, base: str, moving: list[UrdfJoint], notes: list[str]
) -> list[list[str]]:
    """Return the URDF's links that move as one: with the base, then with each joint."""
    number = {joint.child: i + 1 for i, joint in enumerate(moving)}
    carried: list[list[str]] = [[] for _ in range(len(moving) + 1)]
    waiting = [(base, 0)]
    while waiting:
        link, body = waiting.pop()
        carried[body].append(link)
        for joint in tree.joints_below.get(link, ()):
            if joint.kind != "fixed" and joint.child not in number:
                notes.append(
                    f"joint {joint.name!r} is held at zero: what hangs on it counts as part of"
                    f" link {body}"
                )
            waiting.append((joint.child, number.get(joint.child, body)))
    return carried


def _joint_names(tree: UrdfTree, moving: list[UrdfJoint], notes: list[str]) -> list[str]:
    names = []
    for joint in moving:
        name = re.sub(r"[^A-Za-z0-9_-]", "_", joint.name)
        name = (name if name[:1].isalpha() else f"joint_{name}")[:32]
        if name != joint.name:
            notes.append(f"joint {joint.name!r} is called {name!r} here")
        names.append(name)
    if len(set(names)) < len(names):
        raise ConfigError(
            f"{tree.file}: joint names {', '.join(joint.name for joint in moving)} cannot be told"
            " apart in 32 plain characters: rename them"
        )
    return names


def _joint(joint: UrdfJoint, name: str, ratio: float | None, notes: list[str]) -> Joint:
    if joint.mimics is not None:
        raise ConfigError(
            f"{joint.where}: joint {joint.name!r} mimics {joint.mimics!r}; coupled axes are told by"
            " `coupling` in the robot file: remove <mimic> and state it there"
        )
    for key in ("velocity", "effort"):
        if joint.limits.get(key, 0.0) <= 0.0:
            raise ConfigError(
                f"{joint.where}: joint {joint.name!r} needs <limit {key}=...> above 0: motions are"
                " held to it. Some exporters write 0; state the real one"
            )
    low, high = joint.limits.get("lower", 0.0), joint.limits.get("upper", 0.0)
    if joint.kind == "continuous":
        low, high = -2.0 * np.pi, 2.0 * np.pi
        notes.append(f"joint {joint.name!r} has no end: -2 pi to 2 pi is taken; narrow it")
    elif low >= high:
        raise ConfigError(
            f"{joint.where}: joint {joint.name!r} has the range {low:g} to {high:g}: <limit> needs"
            " lower below upper"
        )
    velocity = joint.limits["velocity"]
    return Joint(
        name=name,
        type="prismatic" if joint.kind == "prismatic" else "revolute",
        limits=JointLimits(
            position_min=low,
            position_max=high,
            velocity=velocity,
            acceleration=round(ACCELERATION_PER_VELOCITY * velocity, 9),
            torque=joint.limits["effort"],
        ),
        gear_ratio=1.0 if ratio is None else ratio,
    )


def _cad(
    tree: UrdfTree,
    carried: list[list[str]],
    places: dict[str, FloatArray],
    axes: AxisFrames,
    notes: list[str],
) -> tuple[LinkCad, ...] | None:
    """Return mass, centre and inertia of every moving link in its frame."""
    cad: list[LinkCad] = []
    for number, names in enumerate(carried[1:], start=1):
        parts = []
        for name in names:
            inertial = tree.links[name].inertial
            if inertial is not None and inertial.mass_kg > 0.0:
                place = np.linalg.inv(axes.frames[number]) @ places[name] @ inertial.placement
                turn = place[:3, :3]
                parts.append(
                    (inertial.mass_kg, place[:3, 3], turn @ inertial.inertia_kg_m2 @ turn.T)
                )
        mass = sum(part[0] for part in parts)
        if not parts:
            notes.append(f"link {number} ({', '.join(names)}) has no mass: no `cad` was made")
            return None
        centre = np.sum([m * c for m, c, _ in parts], axis=0) / mass
        inertia = np.zeros((3, 3))
        for m, c, about_centre in parts:
            r = c - centre
            inertia += about_centre + m * (r @ r * np.eye(3) - np.outer(r, r))
        told = f"link {number} ({', '.join(names)})"
        gyration_m = float(np.sqrt(np.trace(inertia) / (2.0 * mass)))
        if gyration_m < LEAST_GYRATION_M:  # placeholders
            inertia = np.zeros((3, 3))
        try:
            cad.append(
                LinkCad(
                    mass_kg=mass,
                    centre_m=_vector(centre),
                    inertia_kg_m2=tuple(
                        round(x, 15) + 0.0 for x in inertia[np.triu_indices(3)].tolist()
                    ),
                )
            )
        except ValidationError as error:
            notes.append(
                f"{told} cannot exist, so no `cad` was made:"
                f" {error.errors()[0]['msg'].removeprefix('Value error, ')}"
            )
            return None
        unknown = cad[-1].unknown_inertia_kg_m2
        if unknown:
            notes.append(
                f"{told} has {mass:.3g} kg and next to no inertia (zero, or rounded away):"
                f" --cad-prior takes it as unknown, 0 ± {unknown:.2g} kg m²"
            )
    return tuple(cad)


def _bodies(
    tree: UrdfTree,
    carried: list[list[str]],
    places: dict[str, FloatArray],
    axes: AxisFrames,
    notes: list[str],
) -> tuple[Body, ...]:
    """Return the collision primitives in the frames of the links; meshes are noted."""
    bodies: list[Body] = []
    for number, names in enumerate(carried):
        for name in names:
            link = tree.links[name]
            place = np.linalg.inv(axes.frames[number]) @ places[name]
            bodies += [_body(number, part, place @ part.placement) for part in link.collisions]
            if link.meshes:
                notes.append(
                    f"collision mesh {', '.join(link.meshes)} of {name!r} was not read: add"
                    f" `bodies` for link {number} by hand where collisions matter"
                )
    return tuple(bodies)


def _body(link: int, part: UrdfCollision, place: FloatArray) -> Body:
    if part.shape == "sphere":
        centre = _vector(place[:3, 3])
        return Capsule(
            kind="capsule", link=link, start_m=centre, end_m=centre, radius_m=part.size[0]
        )
    if part.shape == "box":
        x, y, z = (0.5 * side for side in part.size)
        corners = [(sx * x, sy * y, sz * z) for sx in (-1, 1) for sy in (-1, 1) for sz in (-1, 1)]
    else:  # the prism around a cylinder
        radius, length = part.size
        angles = 2.0 * np.pi * np.arange(CYLINDER_CORNERS) / CYLINDER_CORNERS
        r = radius / np.cos(np.pi / CYLINDER_CORNERS)
        corners = [
            (r * np.cos(angle), r * np.sin(angle), side * 0.5 * length)
            for side in (-1, 1)
            for angle in angles
        ]
    points = np.array(corners) @ place[:3, :3].T + place[:3, 3]
    return Hull(kind="hull", link=link, points_m=tuple(_vector(point) for point in points))


def _plain_name(name: str) -> str:
    plain = re.sub(r"[^A-Za-z0-9_.-]", "_", name)
    return (plain if plain[:1].isalnum() else f"robot_{plain}")[:64]


def _vector(values: FloatArray) -> Vector3:
    x, y, z = (_clean(value) for value in values)
    return x, y, z


def _clean(value: float) -> float:
    """Return a value without rounding's dust, to a femtometre."""
    return 0.0 if abs(value) < 1e-12 else round(float(value), 15)
