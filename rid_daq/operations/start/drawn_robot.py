"""`files_with_drawing`: the starting files of a URDF's robot, with its meshes and its picture."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

from config.meshes.link_meshes_file import pack_link_meshes
from config.robot.meshes_file import MeshesFile
from config.robot.urdf_robot import UrdfRobot
from rid_daq.operations.start.init import ROBOT_MESHES, ROBOT_PICTURE
from rid_daq.operations.start.urdf_starter import starting_files
from rid_daq.robot_view.link_shapes import body_mesh
from rid_daq.robot_view.scene import RobotScene
from rid_daq.robot_view.simplified_meshes import simplify_links
from rid_daq.robot_view.solids import join_meshes
from rid_daq.robot_view.still_picture import join_stills, rest_pose, still_views

MOST_TRIANGLES: Final = 30_000
"""Largest number of triangles in the meshes file; it then has about 600 kB."""


def files_with_drawing(urdf: Path, made: UrdfRobot) -> dict[str, bytes]:
    """Return every starting file by name.

    If a mesh of the URDF was read, the simplified meshes are one of the files, and the robot file
    names it.

    Args:
        urdf: The URDF.
        made: The robot of the URDF.
    """
    files: dict[str, bytes] = {}
    if made.drawings:
        links = [
            join_meshes([*drawing.meshes, *map(body_mesh, drawing.bodies)])
            for drawing in made.drawings
        ]
        files[ROBOT_MESHES] = pack_link_meshes(simplify_links(links, MOST_TRIANGLES))
        named = MeshesFile.of(ROBOT_MESHES, files[ROBOT_MESHES])
        made = replace(made, robot=made.robot.model_copy(update={"meshes": named}))
    scene = RobotScene.of(made.robot, meshes=files.get(ROBOT_MESHES))
    files[ROBOT_PICTURE] = join_stills(still_views(scene, rest_pose(scene)))
    texts = starting_files(urdf, made)
    return {name: text.encode() for name, text in texts.items()} | files
