"""Choosing friction terms by cross-validation, on arms whose friction is known.

`exhaustive` fits every candidate from the rows, as the first version did: the slow reference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import FloatArray
from config.errors import EstimationError
from config.load import load_robot
from config.robot.robot import FrictionTerm, RobotDescription
from dynamics.model.robot_model import RobotModel, torque
from identification.equations.segments import cut
from identification.estimation.estimate import predict
from identification.estimation.fitted_signals import FittedSignals, fit_smoothed
from identification.estimation.options import STANDSTILL_RAD_S, EstimationOptions
from identification.validation.friction_selection import (
    CLASSICAL,
    Comparison,
    choose_friction,
    with_friction,
)

Term = tuple[FrictionTerm, ...]
Terms = tuple[Term, ...]

TRUTH: Terms = (CLASSICAL, (*CLASSICAL, "offset", "cubic"), (*CLASSICAL, "offset", "cube_root"))
CANDIDATES = (
    CLASSICAL,
    (*CLASSICAL, "offset"),
    (*CLASSICAL, "offset", "cubic"),
    (*CLASSICAL, "offset", "cube_root"),
    (*CLASSICAL, "offset", "cube_root", "cubic"),
)


def recording(
    terms: Terms, samples: int, noise_nm: float = 1.0, nonlinear: tuple[float, ...] = ()
) -> SmoothedSignals:
    """Return a motion of the bundled arm with these terms of friction."""
    robot = with_friction(load_robot("ir361"), terms)
    model = RobotModel.from_description(robot).with_nonlinear(nonlinear)
    random = np.random.default_rng(1)
    values = random.uniform(0.5, 1.0, len(model.parameter_names))
    friction = model.parameter_groups["friction"]
    values[friction] *= 20.0
    time_s = 0.01 * np.arange(samples, dtype=np.float64)
    omega = 2.0 * np.pi / 20.0 * np.arange(1, 8)
    sine, cosine = 0.3 * random.normal(size=(2, 7, 3))
    s, c = np.sin(np.outer(time_s, omega)), np.cos(np.outer(time_s, omega))
    q, v = s @ sine + c @ cosine, (c * omega) @ sine - (s * omega) @ cosine
    a = -(s * omega**2) @ sine - (c * omega**2) @ cosine
    return SmoothedSignals(
        joint_names=robot.joint_names,
        time_s=time_s,
        position=q,
        velocity=v,
        acceleration=a,
        torque_nm=torque(model, q, v, a, values) + noise_nm * random.normal(size=q.shape),
        segment=np.zeros(len(q), dtype=np.int64),
        sample_period_s=0.01,
        cutoff_hz=10.0,
    )


def exhaustive(
    robot: RobotDescription, parts: Sequence[SmoothedSignals]
) -> tuple[FittedSignals, FloatArray]:
    """Return the fit to all parts, and the mean squared error of each second left out."""
    whole = fit_smoothed(robot, parts)
    started = EstimationOptions(model=whole.options)
    found = []
    for part in parts:
        fit = fit_smoothed(robot, [other for other in parts if other is not part], started)
        predicted = predict(fit, part.position, part.velocity, part.acceleration)
        moving = np.abs(part.velocity) >= STANDSTILL_RAD_S
        error = np.where(moving, (part.torque_nm - predicted) ** 2, np.nan)
        second = np.floor(part.time_s - part.time_s[0])
        found += [np.nanmean(error[second == k], axis=0) for k in np.unique(second)]
    return whole, np.array(found)


@pytest.fixture(scope="module")
def signals() -> SmoothedSignals:
    return recording(TRUTH, 6000)


@pytest.fixture(scope="module")
def comparison(signals: SmoothedSignals) -> Comparison:
    return choose_friction(load_robot("ir361"), [signals], candidates=CANDIDATES)


def test_each_joint_gets_the_terms_that_it_has(comparison: Comparison) -> None:
    assert comparison.chosen == TRUTH


def test_the_error_on_parts_left_out_is_the_noise(comparison: Comparison) -> None:
    np.testing.assert_allclose(comparison.combined.error_nm, 1.0, atol=0.05)
    assert comparison.trials[0].error_nm[1] > 1.2


def test_the_criteria_prefer_each_joint_s_own(comparison: Comparison) -> None:
    assert comparison.combined.bic == min(t.bic for t in (*comparison.trials, comparison.combined))


def test_the_robot_carries_the_choice(comparison: Comparison) -> None:
    robot = comparison.robot(load_robot("ir361"))
    assert tuple(joint.friction for joint in robot.joints) == TRUTH


def test_the_watcher_hears_of_every_model(signals: SmoothedSignals) -> None:
    heard: list[tuple[int, int]] = []
    choose_friction(
        load_robot("ir361"),
        cut(signals, 2),
        candidates=CANDIDATES[:2],
        folds=2,
        watch=lambda done, total, _: heard.append((done, total)),
    )
    assert heard[:2] == [(0, 3), (1, 3)]
    assert set(heard[2:]) <= {(2, 3)}


HARD: Terms = (
    (*CLASSICAL, "offset"),
    (*CLASSICAL, "offset", "load"),
    (*CLASSICAL, "offset", "stribeck"),
)


@pytest.mark.parametrize("terms", [(*CLASSICAL, "offset", "cubic"), *HARD])
def test_a_trial_is_what_fitting_every_part_from_the_rows_gives(terms: Term) -> None:
    hard = recording(HARD, 2400, 0.2, (0.1, 0.08))
    robot = load_robot("ir361")
    trial = choose_friction(robot, [hard], candidates=[CLASSICAL, terms], folds=3).trials[1]
    whole, errors = exhaustive(with_friction(robot, [terms] * 3), cut(hard, 3))
    assert trial.parameters == len(whole.base) + len(whole.options.nonlinear or ())
    # Which way a gear is loaded is known by the estimate itself there, by another here.
    known = 2e-2 if "load" in terms else 1e-4 if "stribeck" in terms else 1e-9
    np.testing.assert_allclose(trial.event_errors, errors, rtol=known)


def test_joints_choose_nonlinear_terms_too() -> None:
    hard = recording(HARD, 6000, 0.2, (0.1, 0.08))
    found = choose_friction(load_robot("ir361"), [hard], candidates=[CLASSICAL, *HARD], folds=3)
    assert found.chosen == HARD


def test_nothing_to_leave_out_is_told(signals: SmoothedSignals) -> None:
    with pytest.raises(EstimationError, match="two parts"):
        choose_friction(load_robot("ir361"), [signals], folds=1)
    with pytest.raises(EstimationError, match="and candidates"):
        choose_friction(load_robot("ir361"), [signals], candidates=())


def test_parts_are_the_recording(signals: SmoothedSignals) -> None:
    parts = cut(signals, 7)
    np.testing.assert_array_equal(np.concatenate([p.time_s for p in parts]), signals.time_s)
    assert replace(parts[0]).cutoff_hz == signals.cutoff_hz
