"""Make a robot file, a simulated cell and a validation motion from a URDF (`init --urdf`)."""

from __future__ import annotations

import os
import textwrap
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

from config.errors import ConfigError
from config.formats.bounded_file import read_file
from config.formats.number import parse_numbers
from config.formats.urdf_file import read_urdf
from config.formats.xml_tree import MAX_BYTES
from config.formats.yaml_tree import Path as YamlPath
from config.formats.yaml_tree import dump_yaml
from config.meshes.package_folders import PackageFolders
from config.model import ConfigModel
from config.robot.robot import RobotDescription
from config.robot.urdf_chain import SeveralArmsError, UrdfArm
from config.robot.urdf_limits import LimitDefaults
from config.robot.urdf_robot import UrdfRobot, robot_of_urdf
from rid_daq.operations.start.init import InitRequest
from rid_daq.operations.start.simulated_plant import simulated_plant
from rid_daq.operations.start.starting_cell import starting_cell
from rid_daq.operations.start.touching_bodies import allow_touching_pairs
from rid_daq.operations.start.workload import (
    limit_to_motors,
    slow_down,
    validation_motion,
    zero_pose,
)
from rid_daq.terminal.console import as_command


def starting_robot(request: InitRequest, path: Path) -> UrdfRobot:
    """Return the robot of a URDF, with limits that its motors can keep.

    Args:
        request: Choice of the arm, and limits for joints without limits in the URDF.
        path: The URDF.

    Raises:
        ConfigError: The URDF cannot be read or describes no robot, an option is no list of numbers,
            or a folder of packages does not exist.
    """
    defaults = LimitDefaults(
        _positive_numbers("--range", request.position),
        _positive_numbers("--velocity", request.velocity),
        _positive_numbers("--acceleration", request.acceleration),
        _positive_numbers("--effort", request.effort),
    )
    for folder in request.packages:
        if not folder.is_dir():
            raise ConfigError(f"--packages {folder}: there is no such folder", code="RID-FILE-READ")
    try:
        data = read_file(path, MAX_BYTES)
    except OSError as error:
        raise ConfigError(
            f"{path}: the file cannot be read: {error.strerror}", code="RID-FILE-READ"
        ) from None
    tree = read_urdf(data, str(path))
    try:
        made = robot_of_urdf(
            tree,
            base=request.base,
            tip=request.tip,
            defaults=defaults,
            packages=PackageFolders(path, request.packages, installed_packages()),
            parallelograms=request.parallelograms,
        )
    except SeveralArmsError as error:
        raise ConfigError(
            _several_arms_text(request, path, error.arms), code=error.refusal
        ) from None
    robot, touching = allow_touching_pairs(made.robot, zero_pose(made.robot))
    made = replace(made, robot=robot, notes=(*made.notes, *touching))
    held, notes = limit_to_motors(robot)
    return _with_limits_of(made, held, "so that the motors can move the links", notes)


def installed_packages() -> tuple[Path, ...]:
    """Return the folders of ROS packages that the environment names (ROS 2, then ROS 1)."""
    prefixes, folders = (
        [Path(part) for part in os.environ.get(name, "").split(os.pathsep) if part]
        for name in ("AMENT_PREFIX_PATH", "ROS_PACKAGE_PATH")
    )
    return (*(prefix / "share" for prefix in prefixes), *folders)


def slower_robot(made: UrdfRobot, speed: float, why: str) -> UrdfRobot:
    """Return the robot with its speeds multiplied by a factor, and with the reason as a note."""
    note = f"all speeds are multiplied by {speed:g} and accelerations by its square: {why}"
    return _with_limits_of(
        made, slow_down(made.robot, speed), "so that the rehearsal passes", (note,)
    )


def starting_files(urdf: Path, made: UrdfRobot) -> dict[str, str]:
    """Return the text of every starting file by name."""
    robot = made.robot
    return {
        "robot.yaml": _yaml_text(robot, _robot_comment(urdf, made.notes), made.comments),
        "plant.yaml": _yaml_text(simulated_plant(robot, made.motors), _PLANT_COMMENT),
        "cell.yaml": _yaml_text(starting_cell(robot, made.motors), _CELL_COMMENT),
        "validation.yaml": _yaml_text(
            validation_motion(robot),
            "Random points: record this motion after the excitation, then run `rid-daq validate`"
            " with it.",
        ),
    }


_CELL_COMMENT: Final = """\
A cell: one robot, its drives, their bus, the cycle. `rid-daq init` without a URDF writes a cell
file that explains every key. Correct node ids, signs and zero positions before anything moves;
`rid-daq check cell.yaml` shows the values of the drives."""

_ROBOT_COMMENT: Final = """\
Made from {file} by rid-daq init. Frames follow the modified Denavit-Hartenberg convention: the z
axis of frame i is the axis of joint i. Values that the URDF does not state are defaults; correct
them. A comment above a joint marks default limits.
- armature: true means that the position of the motor is unknown. If you know it, give rotor (link,
  axis): the link that carries the motor, and the motor's axis of rotation.
- gear_ratio is motor turns per joint turn; 1 if unknown.
- cad contains the mass data of the links in the URDF. They can be used as prior knowledge, with
  the relative standard deviation `uncertainty`.
{notes}"""


_PLANT_COMMENT: Final = """\
True values of the simulated robot: the masses of the links and, if the URDF states it, friction
come from the URDF; all other values are assumed. When the real drives are connected, delete this
file, and `simulated` and `plant` in cell.yaml."""


def _with_limits_of(
    made: UrdfRobot, robot: RobotDescription, why: str, notes: tuple[str, ...]
) -> UrdfRobot:
    """Return the URDF's robot with the limits of `robot`; each changed joint gets a comment."""
    comments = dict(made.comments)
    for number, (before, after) in enumerate(zip(made.robot.joints, robot.joints, strict=True)):
        changed = [
            f"{key}: {getattr(after.limits, key):g} instead of {getattr(before.limits, key):g}"
            for key in ("velocity", "acceleration", "torque")
            if getattr(after.limits, key) != getattr(before.limits, key)
        ]
        if changed:
            known = comments.get(("joints", number))
            comment = f"{', '.join(changed)}, {why}"
            comments["joints", number] = f"{known}. {comment}" if known else comment
    return replace(made, robot=robot, notes=(*made.notes, *notes), comments=comments)


def _several_arms_text(request: InitRequest, path: Path, arms: tuple[UrdfArm, ...]) -> str:
    """Return an error text for a URDF with several arms: a command for each, and the argument."""
    again = ["init", request.folder, "--urdf", path]
    lines = [
        f"  {as_command(*again, '--tip', arm.tip)}  ({len(arm.joints)} joints)" for arm in arms
    ]
    return "\n".join(
        (
            f"{path}: there are {len(arms)} arms; choose one with --tip; the joints of the other"
            " arms are then fixed:",
            *lines,
            f"In Python: Robot.from_urdf(..., tip={arms[0].tip!r})",
        )
    )


def _robot_comment(path: Path, notes: tuple[str, ...]) -> str:
    items = [textwrap.fill(note, 98, initial_indent="- ", subsequent_indent="  ") for note in notes]
    return _ROBOT_COMMENT.format(file=path.name, notes="\n".join(items))


def _yaml_text(
    model: ConfigModel, comment: str, comments: Mapping[YamlPath, str] | None = None
) -> str:
    return dump_yaml(model.model_dump(mode="json", exclude_defaults=True), comment, comments)


def _positive_numbers(option: str, text: str | None) -> tuple[float, ...]:
    """Return the positive numbers of an option; an empty tuple if it is not set.

    Raises:
        ConfigError: The text contains anything else.
    """
    code = ""
    values: tuple[float, ...] = ()
    try:
        values = parse_numbers(text) if text is not None else ()
    except ConfigError:
        code = "RID-OPTION-SYNTAX"
    if not all(value > 0.0 for value in values):
        code = "RID-OPTION-RANGE"
    if code:
        raise ConfigError(
            f"{option} {text}: give one number above 0, or one per joint: 3.1,3.1,2.5",
            code=code,
        )
    return values
