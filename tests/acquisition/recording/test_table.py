"""Units of the columns of an exported recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acquisition.motion.samples import Phase
from acquisition.recording.plate_geometry import WRENCH_NAMES, WRENCH_UNITS
from acquisition.recording.reaction import Reaction
from acquisition.recording.recording import Recording
from acquisition.recording.table import recording_table
from config.robot.robot import RobotDescription


def test_the_moments_of_a_plate_that_computes_its_wrench_are_in_newton_metres(
    robot: RobotDescription,
) -> None:
    rows, joints = 3, len(robot.joints)
    reaction = Reaction(
        WRENCH_NAMES, np.ones((rows, 6)), np.ones((rows, 6), dtype=np.bool_), -np.eye(6)
    )
    recording = Recording(
        joint_names=robot.joint_names,
        time_s=np.arange(rows, dtype=np.float64),
        position=np.zeros((rows, joints)),
        torque_nm=np.zeros((rows, joints)),
        valid=np.ones(rows, dtype=np.bool_),
        phase=np.full(rows, Phase.MAIN, dtype=np.uint8),
        sample_index=np.arange(rows),
        source="import",
    )
    table = recording_table(replace(recording, reaction=reaction), robot)
    found = {column.name: column.unit for column in table.columns}
    expected = {
        f"plate_{name}_{unit.lower().replace(' ', '')}": unit
        for name, unit in zip(WRENCH_NAMES, WRENCH_UNITS, strict=True)
    }
    assert {name: found.get(name) for name in expected} == expected
