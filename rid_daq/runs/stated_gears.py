"""`with_stated_gears`: runs with the gears of a newer robot file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from config.errors import ConfigError
from config.load import load_robot
from rid_daq.runs.run_data import RunData

KEYS: Final = ("stiffness_nm_rad", "damping_nm_s", "motor_inertia_kg_m2")
"""Keys of a joint that `stiffness` identifies after the runs were recorded."""


def with_stated_gears(data: Sequence[RunData], path: Path | None) -> tuple[RunData, ...]:
    """Return runs whose robot has the stiffness, damping and motor inertia of a robot file.

    Args:
        data: The runs.
        path: The robot file; None leaves the runs as they are.

    Raises:
        ConfigError: The file cannot be read, is of another robot, or states no stiffness.
    """
    if path is None:
        return tuple(data)
    newer = load_robot(str(path))
    changes = {joint.name: joint.model_dump(include=set(KEYS)) for joint in newer.joints}
    if all(keys["stiffness_nm_rad"] is None for keys in changes.values()):
        raise ConfigError(
            f"--gears {path} has no effect, because no joint has stiffness_nm_rad: copy the keys"
            " that `rid-daq stiffness` prints into the robot file",
            code="RID-OPTION-NO-EFFECT",
        )
    for item in data:
        if different := newer.differences(item.robot):
            raise ConfigError(
                f"{path}: {', '.join(different)} differ from the robot of run"
                f" {item.folder.run_id}: give the file of this robot",
                code="RID-ROBOT-OTHER",
            )
    return tuple(
        replace(
            item,
            robot=item.robot.model_copy(
                update={
                    "joints": tuple(
                        joint.model_copy(update=changes[joint.name]) for joint in item.robot.joints
                    )
                }
            ),
        )
        for item in data
    )
