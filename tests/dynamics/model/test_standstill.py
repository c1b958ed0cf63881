"""A reversal of a joint between two rows counts as standstill."""

from __future__ import annotations

import numpy as np

from dynamics.model.robot_model import RobotModel
from dynamics.model.standstill import moving_actuators, moving_without_reversal
from tests.builders.presliding_arm import arm

SLOW_RAD_S = 0.02


def test_a_reversal_between_two_rows_counts_as_standstill() -> None:
    model = RobotModel.from_description(arm())
    v = np.full((6, model.chain.n), 0.5)
    v[3:, 0] = -0.5
    v[2, 1] = 0.0
    assert moving_actuators(model, v, SLOW_RAD_S)[:, 0].all()
    assert moving_without_reversal(model, v, SLOW_RAD_S)[:, 0].tolist() == [
        True,
        True,
        False,
        False,
        True,
        True,
    ]
    assert moving_without_reversal(model, v, SLOW_RAD_S)[:, 1].tolist() == [
        True,
        True,
        False,
        True,
        True,
        True,
    ]
