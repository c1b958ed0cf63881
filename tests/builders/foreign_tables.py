"""A small recording of two joints in another program's format, with import map and robot."""

from __future__ import annotations

import json
import math

import numpy as np

from acquisition.maps.import_map import ImportMap
from config.robot.robot import RobotDescription

ROWS = 400
W = 2.0 * math.pi * 0.5


def two_joint_map(**changes: object) -> ImportMap:
    values: dict[str, object] = {
        "name": "test",
        "robot": "test",
        "columns": 7,
        "time": {"column": 0},
        "joints": [
            {
                "joint": "a",
                "position": 1,
                "velocity": 3,
                "current": 5,
                "torque_constant_nm_per_a": 2.0,
            },
            {"joint": "b", "position": 2, "velocity": 4, "torque": 6},
        ],
        "plausible": {"position": 10.0, "speed": 5.0, "torque": 100.0},
    }
    values |= changes
    columns = [key for joint in values["joints"] for key in joint]  # type: ignore[attr-defined]
    values.setdefault("torques", "motor_torque" if "torque" in columns else "motor_current")
    return ImportMap.model_validate_json(json.dumps(values))


def sound_table(rows: int = ROWS) -> np.ndarray:
    t = np.cumsum(np.where(np.arange(rows) % 2, 0.010, 0.012)) + 5.0
    return np.stack(
        [
            t,
            np.sin(W * t),
            0.5 * np.cos(W * t),
            W * np.cos(W * t),
            -0.5 * W * np.sin(W * t),
            3.0 * np.sin(W * t),
            4.0 * np.cos(W * t),
        ],
        axis=1,
    )


def as_lines(table: np.ndarray, separator: str = ",") -> list[str]:
    return [separator.join(f"{value:.6f}" for value in row) for row in table]


def two_joint_robot(**changes: object) -> RobotDescription:
    """Return a robot of two joints with limits of 3 rad, 4 rad/s and 50 N m.

    `changes` replaces keys of its description.
    """
    limits = {"position_min": -3.0, "position_max": 3.0, "velocity": 4.0, "acceleration": 90.0}
    joints = [
        {"name": name, "limits": limits | {"torque": 50.0}, "gear_ratio": 100.0} for name in "ab"
    ]
    values: dict[str, object] = {
        "name": "test",
        "kinematics": {"convention": "modified_dh", "rows": [{}, {"alpha_rad": 1.5}]},
        "joints": joints,
    }
    return RobotDescription.model_validate_json(json.dumps(values | changes))
