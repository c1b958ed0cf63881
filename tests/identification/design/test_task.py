"""Design task: torque margins for a motion, from a model of the robot."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.motion.kinds.fourier import FourierMotion
from config.errors import ConfigError
from config.load import LoadedCell, load_cell
from config.robot.friction_terms import FrictionTerm
from dynamics.model.robot_model import torque
from identification.design.criteria import Condition
from identification.design.problem import ExcitationProblem
from identification.design.task import excitation_problem
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from identification.estimation.estimate import Estimate, predict
from tests.builders.known_model import estimate_with_terms, known_estimate
from tests.builders.raised_codes import raises_code


@pytest.fixture(scope="module")
def cell() -> LoadedCell:
    return load_cell("ir361")


@pytest.fixture(scope="module")
def motion(cell: LoadedCell) -> FourierMotion:
    return design_two_harmonic(cell.robot, TwoHarmonicOptions(5.0, tries=50), 0.008)


def problem_of(cell: LoadedCell, model: Estimate) -> ExcitationProblem:
    return excitation_problem(
        cell.config, cell.robot, period_s=5.0, harmonics=5, criterion=Condition(), model=model
    )


def test_a_model_with_the_robot_files_terms_uses_the_full_limits(cell: LoadedCell) -> None:
    assert problem_of(cell, known_estimate(cell, {})).torque_share == 1.0


def test_friction_missing_in_the_robot_file_is_subtracted_from_the_limits(
    cell: LoadedCell, motion: FourierMotion
) -> None:
    terms: tuple[FrictionTerm, ...] = ("coulomb", "viscous", "cube_root", "offset")
    model = estimate_with_terms(cell, terms, 10.0)
    problem = problem_of(cell, model)
    assert problem.parameters is not None
    assert 0.5 < problem.torque_share < 1.0
    samples = motion.plan(cell.robot, cell.config.cycle_time_s).whole()
    driven = (samples.position, samples.velocity, samples.acceleration)
    planned = np.abs(torque(problem.model, *driven, problem.parameters)).max(axis=0)
    limits = np.array([joint.limits.torque for joint in cell.robot.joints])
    needed = np.abs(predict(model, *driven)).max(axis=0)
    assert np.any(needed > planned)
    assert np.all(needed <= planned + (1.0 - problem.torque_share) * limits)


def test_friction_that_exceeds_a_limit_is_refused(cell: LoadedCell) -> None:
    model = estimate_with_terms(cell, ("coulomb", "viscous", "offset"), 1e4)
    with raises_code(ConfigError, "RID-MODEL-TERMS-DIFFER", "of axis3", "%"):
        problem_of(cell, model)
