"""Payload identification with a robot model whose friction terms `identify --choose` selected."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from acquisition.processing.periods import PeriodAverage
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from identification.estimation.fitted_periods import fit_periodic
from identification.estimation.options import EstimationOptions
from identification.model.options import ModelOptions
from identification.payload.equations import Procedure
from identification.payload.periodic_runs import PeriodicRuns
from identification.payload.procedures import PayloadOptions, identify_payload
from tests.builders.raised_codes import raises_code

OPTIONS = ModelOptions(rotors=False)


def test_a_model_with_presliding_hysteresis_identifies_a_payload(
    lab: SimpleNamespace,
    robot: RobotDescription,
    unloaded: PeriodAverage,
    loaded: PeriodAverage,
    both: PeriodicRuns,
) -> None:
    """As after `identify --choose`: the model has presliding terms, the robot file has none."""
    remembering = robot.joints[2].model_copy(
        update={
            "friction": (*robot.joints[2].friction, "presliding"),
            "presliding_distance": 1e-3,
            "presliding_share": 0.5,
        }
    )
    chosen = robot.model_copy(
        update={"joints": (*robot.joints[:2], remembering, *robot.joints[3:])}
    )
    model = fit_periodic(chosen, [unloaded], EstimationOptions(model=OPTIONS)).estimate()
    assert model.model.nonlinear_names == ("dp_joint3", "sp_joint3")
    given: dict[Procedure, PeriodicRuns] = {
        "model": PeriodicRuns((loaded,), (True,), 10.0, 0.02),
        "together": both,
        "difference": both,
    }
    for procedure, measured in given.items():
        how = PayloadOptions(procedure, OPTIONS, model)
        found = identify_payload(robot, measured, how)
        assert abs(found.reported[0] - lab.medium.mass_kg) < 0.02, procedure
        off = (found.reported - lab.medium.reported) / found.sigma
        assert np.max(np.abs(off)) < 3.0, procedure


def test_difference_is_refused_if_gear_losses_depend_on_the_payload(
    robot: RobotDescription, both: PeriodicRuns
) -> None:
    joints = tuple(
        joint.model_copy(update={"friction": (*joint.friction, "load")}) for joint in robot.joints
    )
    lossy = robot.model_copy(update={"joints": joints})
    with raises_code(EstimationError, "RID-MODEL-LOAD-FRICTION", "`together`"):
        identify_payload(lossy, both, PayloadOptions("difference", OPTIONS))
