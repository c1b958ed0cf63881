from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from acquisition.processing.periods import average_periods
from acquisition.recording.recording import Recording
from config.arrays import FloatArray
from config.cell.plate import PlateLimits
from config.errors import ConfigError, EstimationError
from dynamics.model.base_wrench import base_wrench
from identification.calibration.base_reaction import base_load
from identification.design.criteria import Condition
from identification.design.problem import ExcitationProblem
from identification.design.search import refine_start
from identification.design.verification import check_motion
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_periods import fit_periodic
from identification.estimation.options import EstimationOptions
from identification.model.options import ModelOptions
from tests.builders.raised_codes import raises_code

if TYPE_CHECKING:
    from tests.identification.conftest import KnownArm

Motion = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
Weigh = Callable[..., Recording]
WIDE = PlateLimits(force_n=(1e4, 1e4, 1e4), moment_nm=(1e4, 1e4, 1e4))


@pytest.fixture(scope="module")
def estimate(arm: KnownArm, weigh: Weigh) -> Estimate:
    average = average_periods(weigh(0))
    return fit_periodic(
        arm.robot, [average], EstimationOptions(model=ModelOptions(kind="combined"))
    ).estimate()


@pytest.fixture(scope="module")
def motion(arm: KnownArm) -> Motion:
    trajectory = arm.motion.trajectory(arm.robot, 0.008)
    at = trajectory.sample_times_s
    return at, trajectory.position(at), trajectory.velocity(at), trajectory.acceleration(at)


def test_the_peak_reaction_of_a_motion_is_that_of_the_robot(
    arm: KnownArm, estimate: Estimate, motion: Motion
) -> None:
    at, q, v, a = motion
    true = np.abs(base_wrench(arm.model, q, v, a, arm.standard))
    found = base_load(estimate, at, q, v, a, WIDE, mass_kg=99.0)
    np.testing.assert_allclose(found.peak, true.max(axis=0), rtol=5e-3)
    np.testing.assert_allclose(found.at_s, at[true.argmax(axis=0)], atol=0.02)
    assert all(found.held)
    assert "all base limits are satisfied" in found.sentence


def test_an_exceeded_limit_is_named(estimate: Estimate, motion: Motion) -> None:
    wide = base_load(estimate, *motion, WIDE, mass_kg=99.0)
    tight = WIDE.model_copy(update={"moment_nm": (1e4, float(0.9 * wide.peak[4]), 1e4)})
    found = base_load(estimate, *motion, tight, mass_kg=99.0)
    assert found.held == (True, True, True, True, False, True)
    assert found.sentence.startswith("My reaches")


def test_the_uncertainty_is_included(estimate: Estimate, motion: Motion) -> None:
    wide = base_load(estimate, *motion, WIDE, mass_kg=99.0)
    just = float(wide.peak[0] + wide.sigma[0])
    limits = WIDE.model_copy(update={"force_n": (just, 1e4, 1e4)})
    assert not base_load(estimate, *motion, limits, mass_kg=99.0).held[0]


def test_without_a_known_mass_the_weight_is_excluded_and_that_is_reported(
    estimate: Estimate, motion: Motion
) -> None:
    """A large plate offset must not count as weight."""
    shifted = estimate.values.copy()
    shifted[estimate.base.names.index("m1")] += 1000.0
    found = base_load(replace(estimate, values=shifted), *motion, WIDE)
    heavy = base_load(estimate, *motion, WIDE, mass_kg=99.0)
    assert not found.weight_known
    assert "static weight is unknown" in found.sentence
    assert found.peak[2] < 400.0 < 900.0 < heavy.peak[2]


def test_an_internal_model_gives_no_base_reaction(
    arm: KnownArm, weigh: Weigh, motion: Motion
) -> None:
    internal = fit_periodic(arm.robot, [average_periods(weigh(0))]).estimate()
    with raises_code(EstimationError, "RID-MODEL-NOT-COMBINED"):
        base_load(internal, *motion, WIDE)


LIMITS = np.array([150.0, 150.0, 1500.0, 900.0, 900.0, 60.0])


@pytest.fixture(scope="module")
def problem(arm: KnownArm) -> ExcitationProblem:
    return ExcitationProblem(
        robot=arm.robot,
        period_s=5.0,
        harmonics=3,
        criterion=Condition(),
        limit_fraction=0.95,
        expected_noise_nm=np.ones(3),
        parameters=arm.standard,
    )


class TestDesign:
    def test_a_design_keeps_the_limits_of_the_base(self, problem: ExcitationProblem) -> None:
        free = refine_start(problem, 1, 0.008, iterations=60)
        limited = replace(problem, base_limits=LIMITS)
        assert "Mz on the base" in " ".join(check_motion(limited, free.motion, 0.008).broken)
        held = refine_start(limited, 1, 0.008, iterations=60)
        assert held.check.broken == ()
        uses = {use.what: use for use in held.check.uses}
        assert uses["Mz on the base"].used <= 60.0
        assert held.check.objective < 3.0 * free.check.objective

    def test_the_design_problem_with_a_base_limit_has_an_exact_gradient(
        self, problem: ExcitationProblem
    ) -> None:
        limited = replace(problem, base_limits=LIMITS / 10.0)
        x, shifts = limited.start(3), limited.no_shifts()
        _, gradient = limited.value(x, 10.0, shifts)
        step = 1e-6 * np.random.default_rng(0).normal(size=len(x))
        change = limited.value(x + step, 10.0, shifts)[0] - limited.value(x - step, 10.0, shifts)[0]
        assert 2.0 * gradient @ step == pytest.approx(change, rel=1e-5)

    def test_a_base_limit_needs_parameters(self, problem: ExcitationProblem) -> None:
        with raises_code(ConfigError, "RID-ROBOT-CAD"):
            replace(problem, parameters=None, base_limits=LIMITS)
