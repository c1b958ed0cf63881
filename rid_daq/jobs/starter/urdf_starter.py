"""A robot file, a simulated cell and a validation motion out of a URDF: `init --urdf`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

from acquisition.motion.kinds.multipoint import MultipointMotion
from config.errors import ConfigError
from config.formats.bounded_file import read_file
from config.formats.urdf import read_urdf
from config.formats.xml_tree import MAX_BYTES
from config.formats.yaml_tree import dump_yaml
from config.model import ConfigModel
from config.robot.urdf_robot import UrdfRobot, robot_of_urdf
from rid_daq.jobs.starter.simulated_plant import simulated_plant
from rid_daq.jobs.starter.starting_cell import starting_cell
from rid_daq.jobs.starter.workload import held_by_motors


def urdf_files(path: Path, base: str | None, tip: str | None) -> tuple[dict[str, str], UrdfRobot]:
    """Return the text of every file to start from, by name, and the robot that they are for.

    Without masses in the URDF nothing can be simulated, and the cell is one for real drives.

    Raises
    ------
    ConfigError
        The URDF cannot be read or makes no robot.
    """
    try:
        data = read_file(path, MAX_BYTES)
    except OSError as error:
        raise ConfigError(f"{path}: cannot read: {error.strerror}") from None
    made = robot_of_urdf(read_urdf(data, str(path)), base=base, tip=tip)
    robot = made.robot
    if robot.cad is not None:
        joints = tuple(
            joint if joint.rotor else joint.model_copy(update={"armature": True})
            for joint in robot.joints
        )
        robot, notes = held_by_motors(robot.model_copy(update={"joints": joints}))
        made = replace(made, robot=robot, notes=(*made.notes, *notes))
    files = {"robot.yaml": _text(robot, _robot_comment(path, made))}
    plant = None
    if robot.cad is not None:
        plant = simulated_plant(robot)
        files["plant.yaml"] = _text(
            plant,
            "What is simulated: the URDF's masses; motors, friction and loops are invented.\n"
            "Delete it, and `simulated` and `plant` in cell.yaml, once drives are there.",
        )
    files["cell.yaml"] = _text(starting_cell(robot, simulated=plant is not None), _CELL_COMMENT)
    motion = MultipointMotion(kind="multipoint", robot=robot.name, seed=1)
    files["validation.yaml"] = _text(
        motion, "Random points: run it after the excitation and give it to `rid-daq validate`."
    )
    return files, made


_CELL_COMMENT: Final = """\
A cell: one robot, its drives, their bus, the cycle. `rid-daq init` without a URDF writes one in
which every key is explained. Node ids, signs and zero positions are yours to correct before
anything moves; `rid-daq check cell.yaml` shows what the drives say."""

_ROBOT_COMMENT: Final = """\
Made from {file} by rid-daq init. Frames are those of the modified Denavit-Hartenberg convention:
frame i on axis i, z along it. What a URDF does not say stands at a default; correct it:
- limits.acceleration is five times the velocity, per second.
- rotor (link, axis) tells where a motor sits and which way it spins; armature: true stands for
  a motor whose place is not known. gear_ratio is motor turns per joint turn.
- cad is what the URDF says of the links: a prior with `uncertainty`, never a result.
{notes}"""


def _robot_comment(path: Path, made: UrdfRobot) -> str:
    notes = "".join(f"- {note}\n" for note in made.notes)
    return _ROBOT_COMMENT.format(file=path.name, notes=notes)


def _text(model: ConfigModel, comment: str) -> str:
    return dump_yaml(model.model_dump(mode="json", exclude_defaults=True), comment)
