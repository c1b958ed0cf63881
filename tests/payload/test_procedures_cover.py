"""Two-sigma intervals of every payload procedure cover the truth in simulated experiments."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from config.robot.robot import RobotDescription
from identification.model.options import ModelOptions
from identification.payload.equations import Procedure
from identification.payload.periodic_runs import PeriodicRuns
from identification.payload.procedures import PayloadOptions, identify_payload

OPTIONS = ModelOptions(rotors=False)


@pytest.fixture(scope="module")
def robot(lab: SimpleNamespace) -> RobotDescription:
    return lab.six_axes()


@pytest.fixture(scope="module")
def experiments(lab: SimpleNamespace, robot: RobotDescription) -> list[PeriodicRuns]:
    motion = lab.motion_of(robot)
    return [
        PeriodicRuns(
            (
                lab.averaged(robot, motion, None, seed=100 + seed, friction=1.2),
                lab.averaged(robot, motion, lab.medium, seed=200 + seed),
            ),
            (False, True),
            10.0,
            0.02,
        )
        for seed in range(12)
    ]


@pytest.mark.slow
@pytest.mark.parametrize("procedure", ["together", "difference", "model", "apart"])
def test_two_sigma_intervals_cover_the_truth_in_at_least_nine_of_ten_cases(
    lab: SimpleNamespace,
    robot: RobotDescription,
    experiments: list[PeriodicRuns],
    procedure: Procedure,
) -> None:
    off = []
    for both in experiments:
        given, alone = both, None
        if procedure == "model":
            alone = both.part([0]).estimate(robot, OPTIONS, [False])
            given = both.part([1])
        how = PayloadOptions(procedure, OPTIONS, alone)
        found = identify_payload(robot, given, how)
        off.append((found.reported - lab.medium.reported) / found.sigma)
    inside = np.abs(np.array(off)) < 2.0
    assert inside.mean() >= 0.9
    # The intervals are not too wide: ratio of RMS error and stated sigma, over all parameters.
    assert 0.7 < float(np.sqrt(np.mean(np.square(off)))) < 1.4
