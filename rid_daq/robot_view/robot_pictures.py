"""`robot_picture`, `flange_picture`: blocks with views of a robot and of its flange."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Final

import numpy as np

from config.cell.plate import PlateConfig
from config.formats.interval import with_minus_sign
from config.robot.robot import RobotDescription
from rid_daq.blocks.picture import Picture, PictureImage
from rid_daq.robot_view.link_shapes import ShapeKind
from rid_daq.robot_view.scene import RobotScene
from rid_daq.robot_view.still_picture import Still, flange_views, rest_pose, still_views

Centre = tuple[float, float, float]

_SHAPES: Final[Mapping[ShapeKind, str]] = {
    "meshes": "MESHES: the robot has the shape of the meshes of its URDF.",
    "bodies": "BODIES: the robot has the shape of `bodies` in its robot file.",
    "schematic": "SCHEMATIC: the robot file has no `bodies`, so rods connect the joints; the real"
    " robot is larger, and no clearance follows from this shape.",
}


@functools.lru_cache(maxsize=8)
def robot_picture(
    robot: RobotDescription,
    plate: PlateConfig | None = None,
    start: tuple[float, ...] | None = None,
    payload_centre_m: Centre | None = None,
    meshes: bytes | None = None,
) -> Picture:
    """Return four views of a robot.

    Args:
        robot: The robot.
        plate: Force plate of its cell.
        start: Joint positions at the start of the motion [rad or m]; None for the pose in which
            every joint is at zero, or at the limit that is closest to zero.
        payload_centre_m: Centre of gravity of a payload in the flange's frame.
        meshes: Bytes of the file `meshes` of the robot file; None to draw bodies.
    """
    scene = RobotScene.of(robot, plate, payload_centre_m, meshes)
    pose = rest_pose(scene) if start is None else np.array(start)
    which = "with all joints at zero, or at the limit that is closest to zero"
    text = (
        f"{robot.name} {which if start is None else 'at the start of the motion'}. Arrows J1 +,"
        " J2 + and so on are the joint axes: the joint turns about its arrow, or slides along it."
        " An arc or rail with ends is the range of a joint, and the bar across it is the joint's"
        " position; ranges of a whole turn are not drawn. Gravity points down."
        f"{'' if plate is None else ' The slab is the force plate; its size is not to scale.'}"
        f" {_SHAPES[scene.shape]}"
    )
    return _picture("robot", robot.name, still_views(scene, pose), text)


@functools.lru_cache(maxsize=8)
def flange_picture(
    robot: RobotDescription, payload_centre_m: Centre, meshes: bytes | None = None
) -> Picture:
    """Return views of the flange with the centre of gravity of a payload.

    Args:
        robot: The robot.
        payload_centre_m: Centre of gravity in the flange's frame.
        meshes: As in `robot_picture`.
    """
    scene = RobotScene.of(robot, None, payload_centre_m, meshes)
    x, y, z = (with_minus_sign(f"{1e3 * value:.1f}") for value in payload_centre_m)
    text = (
        f"Centre of gravity of the payload (quartered ball) at x {x}, y {y}, z {z} mm in the"
        " flange's frame, with the last two links of the robot. Compare the picture with the"
        f" mounted payload: a wrong flange frame turns or mirrors it. {_SHAPES[scene.shape]}"
    )
    return _picture("flange", robot.name, flange_views(scene), text)


def _picture(name: str, robot: str, stills: tuple[Still, ...], caption: str) -> Picture:
    images = (
        PictureImage.of(f"{robot}, {still.title}", still.width, still.height, still.png)
        for still in stills
    )
    return Picture(name=name, images=tuple(images), caption=caption)
