"""`RecordingTable`: a recording as named columns with units, for other programs."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.recording.plate_geometry import WRENCH_NAMES, WRENCH_UNITS
from acquisition.recording.recording import Recording
from config.arrays import FloatArray
from config.errors import RecordingError
from config.robot.robot import RobotDescription

WRENCH: Final = ("force_x_n", "force_y_n", "force_z_n", "moment_x_nm", "moment_y_nm", "moment_z_nm")


@dataclass(frozen=True, eq=False)
class RecordingColumn:
    """One quantity over time.

    Attributes:
        name: Name made of quantity, joint and unit, with letters, digits and `_`
            (`torque_axis1_nm`).
        unit: Unit as printed for users; empty for counts and flags.
        values: Shape (samples,). Float or integer.
    """

    name: str
    unit: str
    values: np.ndarray


@dataclass(frozen=True, eq=False)
class RecordingTable:
    """Columns of equal length and their origin.

    Attributes:
        columns: The first one is `time_s`.
        origin: Provenance: names of run, robot, cell and source.
    """

    columns: tuple[RecordingColumn, ...]
    origin: dict[str, str]


def recording_table(recording: Recording, robot: RobotDescription) -> RecordingTable:
    """Return a recording as columns, one per quantity and joint.

    Args:
        recording: Recording of one run.
        robot: Determines which joints are revolute and which are prismatic.

    Raises:
        RecordingError: Robot and recording have different joints.
    """
    if robot.joint_names != recording.joint_names:
        raise RecordingError(
            f"the joints differ: recording {', '.join(recording.joint_names)}, robot"
            f" {', '.join(robot.joint_names)}: use the robot file of this run",
            code="RID-ROBOT-OTHER",
        )
    slides = [joint.type == "prismatic" for joint in robot.joints]
    columns = [RecordingColumn("time_s", "s", recording.time_s)]
    kinds: tuple[tuple[str, FloatArray | None, str, str], ...] = (
        ("position", recording.position, "rad", "m"),
        ("torque", recording.torque_nm, "N m", "N"),
        ("target_position", recording.target_position, "rad", "m"),
        ("velocity_command", recording.velocity_command, "rad/s", "m/s"),
        ("temperature", recording.temperature_k, "K", "K"),
    )
    for quantity, values, turning, sliding in kinds:
        if values is None:
            continue
        for joint, name in enumerate(recording.joint_names):
            unit = sliding if slides[joint] else turning
            columns.append(
                RecordingColumn(_column_name(quantity, name, unit), unit, values[:, joint])
            )
    if recording.reaction is not None:
        reaction = recording.reaction
        units = dict(zip(WRENCH_NAMES, WRENCH_UNITS, strict=True))
        for channel, name in enumerate(reaction.channel_names):
            unit = units.get(name, "N")
            values = reaction.channels_n[:, channel]
            columns.append(RecordingColumn(_column_name("plate", name, unit), unit, values))
        wrench = reaction.channels_n @ reaction.base_wrench_matrix.T
        for axis, name in enumerate(WRENCH):
            unit = "N" if name.endswith("_n") else "N m"
            columns.append(RecordingColumn(f"base_{name}", unit, wrench[:, axis]))
        good = np.asarray(reaction.valid.all(axis=1))
        columns.append(RecordingColumn("plate_valid", "", good.astype(np.int32)))
    columns += [
        RecordingColumn("valid", "", recording.valid.astype(np.int32)),
        RecordingColumn("phase", "", recording.phase.astype(np.int32)),
        RecordingColumn("sample_index", "", recording.sample_index),
    ]
    origin = {
        "run": recording.run_id,
        "robot": robot.name,
        "cell": recording.cell_name,
        "source": recording.source,
    }
    return RecordingTable(tuple(columns), origin)


def _column_name(quantity: str, joint: str, unit: str) -> str:
    suffix = unit.lower().replace(" ", "").replace("/", "_")
    return re.sub(r"[^A-Za-z0-9_]", "_", f"{quantity}_{joint}_{suffix}")
