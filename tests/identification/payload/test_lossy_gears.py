"""The procedures give the true payload if losses separate rotors from links."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from acquisition.processing.periods import average_periods
from acquisition.recording.recording import Recording
from dynamics.geometry.kinematics import flange_pose
from dynamics.model.robot_model import RobotModel
from identification.estimation.estimate import Estimate
from identification.model.options import ModelOptions
from identification.payload.body import PayloadBody, parameters_to_parent
from identification.payload.equations import Procedure
from identification.payload.periodic_runs import PeriodicRuns
from identification.payload.procedures import (
    PayloadOptions,
    equations_of_two_robots,
    identify_payload,
)
from identification.validation.robot_terms import with_friction

if TYPE_CHECKING:
    from tests.identification.conftest import KnownArm

LOSS = 0.09
BODY = PayloadBody.of_reported(
    np.array([9.6, 0.02, 0.09, -0.2, 0.12, 0.13, 0.11, 0.0, -0.002, -0.008])
)


@pytest.fixture(scope="module")
def runs(arm: KnownArm, measure: Callable[..., Recording]) -> PeriodicRuns:
    """Periods without and with the payload."""
    robot = with_friction(arm.robot, [(*joint.friction, "load") for joint in arm.robot.joints])
    model = RobotModel.from_description(robot).with_nonlinear([LOSS] * 3)
    heavier = arm.standard.copy()
    heavier[20:30] += parameters_to_parent(flange_pose(arm.robot)) @ BODY.parameters
    averages = tuple(
        average_periods(measure(seed, noise_nm=0.1, model=model, parameters=standard))
        for seed, standard in enumerate((arm.standard, heavier))
    )
    return PeriodicRuns(averages, (False, True), 10.0, 0.02)


@pytest.fixture(scope="module")
def alone(arm: KnownArm, runs: PeriodicRuns) -> Estimate:
    robot = with_friction(arm.robot, [(*joint.friction, "load") for joint in arm.robot.joints])
    return runs.part([0]).estimate(robot, ModelOptions(), [False])


@pytest.mark.parametrize("procedure", ["together", "model", "apart"])
def test_each_procedure_gives_the_payload(
    runs: PeriodicRuns, alone: Estimate, procedure: Procedure
) -> None:
    assert alone.options.separate_rotors == (0, 1, 2)
    how = PayloadOptions(procedure, alone.options, None if procedure == "together" else alone)
    found = identify_payload(alone.robot, runs, how)
    known = np.linalg.norm(found.unseen, axis=1) < 1e-6
    assert known[0]
    z = (found.values - BODY.parameters)[known] / found.sigma_parameters[known]
    assert np.abs(z).max() < 4.0
    assert found.sigma_parameters[0] < 0.02  # 0.1 to 0.7 kg with rotors that count as load


def test_two_robots_may_differ_in_their_separate_rotors(
    runs: PeriodicRuns, alone: Estimate
) -> None:
    loaded = runs.part([1])
    merged = replace(alone.options, nonlinear=None, separate_rotors=())
    estimates = [loaded.estimate(alone.robot, each, [False]) for each in (alone.options, merged)]
    names = [len(each.base) for each in estimates]
    assert names[0] > names[1]
    for estimate in estimates:
        equations = equations_of_two_robots(estimate, alone, runs.torque_nm)
        assert len(equations.factors) == 12
