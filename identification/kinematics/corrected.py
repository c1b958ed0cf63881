"""`corrected_robot`: the robot description with calibrated geometry, point and stiffness."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from pydantic import BaseModel
from scipy.spatial.transform import Rotation

from config.errors import ConfigError
from config.formats.yaml_tree import parse_yaml
from config.load import to_yaml, validate
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain, flange_pose
from identification.kinematics.calibration import Calibration

_COLUMNS = ("alpha_rad", "beta_rad", "theta_rad", "a_m", "d_m")


def corrected_robot(calibration: Calibration, *, is_tool: bool) -> RobotDescription:
    """Return the robot with the results of a calibration.

    The offsets of the rows are added to `kinematics.calibration`. A table in the standard
    convention is first rewritten in the modified convention with the same geometry, because only
    this convention has Hayati's angle (`beta_rad`). `cad`, rotors and bodies need no change: their
    frames are those of the modified convention. Precisely identified compliances become
    `stiffness_nm_rad`; a joint with an imprecise one keeps what its file states.

    Args:
        calibration: The calibration.
        is_tool: True if the measured point is the tool point, which is then corrected too.

    Raises:
        ConfigError: A result is outside its plausible range.
    """
    robot, fit = _in_modified_convention(calibration.robot), calibration.fit
    offsets = fit.arm.chain.rows - Chain.from_description(robot).rows
    before = robot.kinematics.calibration or (KinematicRow(),) * len(robot.joints)
    rows = tuple(
        KinematicRow(
            **{
                name: getattr(row, name) + float(offset)
                for name, offset in zip(_COLUMNS, offsets[joint], strict=True)
            }
        )
        for joint, row in enumerate(before)
    )
    found = {each.joint for each in fit.parameters if each.kind == "compliance"}
    found -= set(calibration.imprecise)
    joints = tuple(
        joint.model_copy(update={"stiffness_nm_rad": float(1.0 / fit.arm.compliance[number])})
        if number in found
        else joint
        for number, joint in enumerate(robot.joints)
    )
    tool = tuple(fit.arm.chain.tool_m.tolist()) if is_tool else robot.tool_offset_m
    corrected = robot.model_copy(
        update={
            "kinematics": robot.kinematics.model_copy(update={"calibration": rows}),
            "joints": joints,
            "tool_offset_m": tool,
        }
    )
    name = f"the corrected robot {robot.name!r}"
    try:
        return validate(parse_yaml(to_yaml(corrected).encode(), name), RobotDescription)
    except ConfigError as error:
        raise ConfigError(
            f"no robot file is written, because a result is not plausible: {error}",
            code=error.refusal,
        ) from None


def changed_keys(
    before: RobotDescription, after: RobotDescription
) -> tuple[tuple[str, str, str], ...]:
    """Return each key that differs between two descriptions, with its old and its new value."""
    old, new = dict(_leaves(before)), dict(_leaves(after))
    keys = dict.fromkeys((*old, *new))
    return tuple(
        (key, old.get(key, ""), new.get(key, ""))
        for key in keys
        if old.get(key, "") != new.get(key, "")
    )


def _in_modified_convention(robot: RobotDescription) -> RobotDescription:
    """Return the robot with its table in the modified convention; the geometry is the same."""
    table = robot.kinematics
    if table.convention == "modified_dh":
        return robot
    tool = Rotation.from_matrix(flange_pose(robot)[:3, :3])
    nominal = table.model_copy(update={"calibration": ()}).modified_rows()
    offsets = tuple(
        KinematicRow(**{n: getattr(sum_, n) - getattr(row, n) for n in _COLUMNS})
        for sum_, row in zip(table.modified_rows(), nominal, strict=True)
    )
    return robot.model_copy(
        update={
            "kinematics": Kinematics(convention="modified_dh", rows=nominal, calibration=offsets),
            "tool_offset_m": tuple(Chain.from_description(robot).tool_m.tolist()),
            "tool_rpy_rad": tuple(np.round(tool.as_euler("xyz"), 12).tolist()),
        }
    )


def _leaves(model: BaseModel) -> Iterator[tuple[str, str]]:
    """Yield the keys of a model with their values as texts."""

    def walk(value: object, key: str) -> Iterator[tuple[str, str]]:
        if isinstance(value, dict):
            for name, each in value.items():
                yield from walk(each, f"{key}.{name}" if key else name)
        elif isinstance(value, list):
            for number, each in enumerate(value):
                yield from walk(each, f"{key}.{number}")
        elif value is not None and value != 0.0:
            yield key, f"{value:.9g}" if isinstance(value, float) else str(value)

    yield from walk(model.model_dump(mode="json"), "")
