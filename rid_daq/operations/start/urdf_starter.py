"""A robot file, a simulated cell and a validation motion out of a URDF: `init --urdf`."""

from __future__ import annotations

import math
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
from config.model import ConfigModel
from config.robot.robot import RobotDescription
from config.robot.urdf_chain import SeveralArmsError, UrdfArm
from config.robot.urdf_limits import LimitDefaults
from config.robot.urdf_robot import UrdfRobot, robot_of_urdf
from rid_daq.operations.start.init import InitRequest
from rid_daq.operations.start.simulated_plant import simulated_plant, zero_pose
from rid_daq.operations.start.starting_cell import starting_cell
from rid_daq.operations.start.touching_bodies import without_touching
from rid_daq.operations.start.workload import held_by_motors, slower, validation_motion
from rid_daq.terminal.console import as_command


def starting_robot(request: InitRequest, path: Path) -> UrdfRobot:
    """Return the robot of a URDF, with limits that its motors hold.

    Args:
        request: Which arm it is, and what to take where it states no limits.
        path: The URDF.

    Raises:
        ConfigError: The URDF cannot be read or makes no robot, or an option has no numbers.
    """
    defaults = LimitDefaults(
        _numbers("--range", request.position),
        _numbers("--velocity", request.velocity),
        _numbers("--acceleration", request.acceleration),
        _numbers("--effort", request.effort),
    )
    try:
        data = read_file(path, MAX_BYTES)
    except OSError as error:
        raise ConfigError(f"{path}: cannot read: {error.strerror}", code="RID-FILE-READ") from None
    tree = read_urdf(data, str(path))
    try:
        made = robot_of_urdf(tree, base=request.base, tip=request.tip, defaults=defaults)
    except SeveralArmsError as error:
        raise ConfigError(_which_arm(request, path, error.arms), code=error.refusal) from None
    robot, touching = without_touching(made.robot, zero_pose(made.robot))
    made = replace(made, robot=robot, notes=(*made.notes, *touching))
    held, notes = held_by_motors(robot)
    return _with_limits_of(made, held, "as the motors hold the links", notes)


def slower_robot(made: UrdfRobot, speed: float, why: str) -> UrdfRobot:
    """Return the robot with its speeds times a factor, and the reason said where it stands."""
    note = f"speeds are {speed:g} of what they were, accelerations in proportion: {why}"
    return _with_limits_of(made, slower(made.robot, speed), "as the rehearsal ran", (note,))


def starting_files(urdf: Path, made: UrdfRobot) -> dict[str, str]:
    """Return the text of every file to start from, by name."""
    robot = made.robot
    return {
        "robot.yaml": _text(robot, _robot_comment(urdf, made.notes), made.comments),
        "plant.yaml": _text(simulated_plant(robot, made.motors), _PLANT_COMMENT),
        "cell.yaml": _text(starting_cell(robot, made.motors), _CELL_COMMENT),
        "validation.yaml": _text(
            validation_motion(robot),
            "Random points: run it after the excitation and give it to `rid-daq validate`.",
        ),
    }


_CELL_COMMENT: Final = """\
A cell: one robot, its drives, their bus, the cycle. `rid-daq init` without a URDF writes one in
which every key is explained. Node ids, signs and zero positions are yours to correct before
anything moves; `rid-daq check cell.yaml` shows what the drives say."""

_ROBOT_COMMENT: Final = """\
Made from {file} by rid-daq init. Frames are those of the modified Denavit-Hartenberg convention:
frame i on axis i, z along it. What a URDF does not say stands at a default; correct it. Limits that
are defaults say so above their joint.
- armature: true stands for a motor whose place is not known; rotor (link, axis) tells where one
  sits and which way it spins. gear_ratio is motor turns per joint turn, 1 where nobody says.
- cad is what the URDF says of the links: a prior with `uncertainty`, never a result.
{notes}"""


_PLANT_COMMENT: Final = """\
What is simulated: the links' masses, and friction if the URDF states it; all else is invented.
Delete it, and `simulated` and `plant` in cell.yaml, once drives are there."""


def _with_limits_of(
    made: UrdfRobot, robot: RobotDescription, why: str, notes: tuple[str, ...]
) -> UrdfRobot:
    """Return what was made with another robot's limits; what changed is said at its joint."""
    comments = dict(made.comments)
    for number, (before, after) in enumerate(zip(made.robot.joints, robot.joints, strict=True)):
        changed = [
            f"{key}: {getattr(after.limits, key):g} in place of {getattr(before.limits, key):g}"
            for key in ("velocity", "acceleration", "torque")
            if getattr(after.limits, key) != getattr(before.limits, key)
        ]
        if changed:
            known = comments.get(("joints", number))
            told = f"{', '.join(changed)}, {why}"
            comments["joints", number] = f"{known}. {told}" if known else told
    return replace(made, robot=robot, notes=(*made.notes, *notes), comments=comments)


def _which_arm(request: InitRequest, path: Path, arms: tuple[UrdfArm, ...]) -> str:
    """Return what to say where there are several arms: a command for each."""
    again = ["init", request.folder, "--urdf", path]
    lines = [
        f"  {as_command(*again, '--tip', arm.tip)}  ({len(arm.joints)} joints)" for arm in arms
    ]
    return "\n".join(
        (
            f"{path}: there are {len(arms)} arms; say which, the others then are fixed:",
            *lines,
        )
    )


def _robot_comment(path: Path, notes: tuple[str, ...]) -> str:
    told = [textwrap.fill(note, 98, initial_indent="- ", subsequent_indent="  ") for note in notes]
    return _ROBOT_COMMENT.format(file=path.name, notes="\n".join(told))


def _text(model: ConfigModel, comment: str, comments: Mapping[YamlPath, str] | None = None) -> str:
    return dump_yaml(model.model_dump(mode="json", exclude_defaults=True), comment, comments)


def _numbers(option: str, text: str | None) -> tuple[float, ...]:
    """Return the positive numbers of an option; none if it is not given.

    Raises:
        ConfigError: It has something else.
    """
    try:
        values = parse_numbers(text) if text is not None else ()
    except ConfigError:
        values = (math.nan,)
    if not all(math.isfinite(value) and value > 0.0 for value in values):
        raise ConfigError(
            f"{option} {text}: give one number above 0, or one per joint: 3.1,3.1,2.5",
            code="RID-OPTION-SYNTAX",
        )
    return values
