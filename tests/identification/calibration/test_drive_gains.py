"""Drive gains from a weighed load, for data on which least squares and total least squares fail."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.processing.smoothing import SmoothedSignals
from config.errors import EstimationError
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import Joint, JointLimits, RobotDescription
from dynamics.model.robot_model import torque
from dynamics.terms.conditions import Conditions
from identification.calibration.drive_gains import drive_gains
from identification.equations.time_domain import TimeRun, joint_equations, time_runs
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_signals import fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.model.options import ModelOptions
from tests.builders.raised_codes import raises_code

if TYPE_CHECKING:
    from tests.identification.conftest import KnownArm

OPTIONS = ModelOptions(payload=True)
TRUE_GAINS = np.array([1.15, 0.9, 1.05])
LOAD = {"mL": 15.0, "sxL": 3.0, "IzzL": 1.5, "IxxL": 1.0, "IyyL": 1.2}
STEP_S = 0.01


def simulate_run(arm: KnownArm, payload: bool, seed: int) -> SmoothedSignals:
    """Return 30 s of a run: torques divided by gains, with noise and an unmodelled ripple."""
    trajectory = arm.motion.trajectory(arm.robot, STEP_S)
    times = np.arange(3000, dtype=np.float64) * STEP_S
    q, v, a = (
        f(times) for f in (trajectory.position, trajectory.velocity, trajectory.acceleration)
    )
    model = OPTIONS.build(arm.robot)
    known = dict(zip(arm.model.parameter_names, arm.standard, strict=True)) | LOAD
    theta = np.array([known.get(name, 0.0) for name in model.parameter_names])
    tau = torque(model, q, v, a, theta, Conditions(payload=payload))
    random = np.random.default_rng(seed)
    size = np.sqrt(np.mean(tau**2, axis=0))
    noise = 0.15 * size * random.standard_normal(q.shape)
    ripple = 0.02 * size * np.sin(11.0 * q + random.uniform(0.0, 6.0, 3))
    return SmoothedSignals(
        joint_names=arm.robot.joint_names,
        time_s=times,
        position=q,
        velocity=v,
        acceleration=a,
        torque_nm=(tau + noise + ripple) / TRUE_GAINS,
        segment=np.zeros(len(times), dtype=np.int64),
        sample_period_s=STEP_S,
        cutoff_hz=50.0,
        temperature_k=None,
    )


@pytest.fixture(scope="module")
def loaded(arm: KnownArm) -> tuple[Estimate, tuple[TimeRun, ...]]:
    signals = [simulate_run(arm, False, 1), simulate_run(arm, True, 2)]
    carried = [False, True]
    estimate = fit_smoothed(
        arm.robot, signals, EstimationOptions(model=OPTIONS), payload=carried
    ).estimate()
    return estimate, time_runs(estimate.model, signals, carried)


def noise_weighted_equations(
    estimate: Estimate, runs: tuple[TimeRun, ...]
) -> tuple[NDArray[np.float64], int]:
    """Return the equations of all joints, divided by each joint's noise.

    Returns:
        `rows`. The columns of the drive gains (minus the torque), then those of the parameters.
        `column`. Index of the column of the load's mass.
    """
    n, parts = estimate.model.chain.n, []
    for rows in joint_equations(estimate.model, estimate.base, runs, estimate.standstill_rad_s):
        for j, (matrix, rhs) in enumerate(rows):
            gains = np.zeros((len(rhs), n))
            gains[:, j] = -rhs
            parts.append(np.hstack([gains, matrix]) / estimate.residual_nm[j])
    return np.vstack(parts), n + estimate.base.names.index("mL")


def test_a_weighed_load_determines_the_drive_gains(
    loaded: tuple[Estimate, tuple[TimeRun, ...]],
) -> None:
    estimate, runs = loaded
    gains = drive_gains(estimate, runs, LOAD["mL"], 0.01)
    assert np.abs((gains.values - TRUE_GAINS) / gains.sigma).max() < 2.5
    assert gains.sigma.max() < 0.05
    assert gains.wrong[:2] == (True, True)
    assert "multiply the joint's torque constant by this factor" in gains.sentences()[0]


def test_least_squares_and_total_least_squares_have_larger_errors(
    loaded: tuple[Estimate, tuple[TimeRun, ...]],
) -> None:
    """Both methods of Gautier and Briot (2014) use the same data."""
    estimate, runs = loaded
    ours = np.abs(drive_gains(estimate, runs, LOAD["mL"], 0.01).values - TRUE_GAINS).max()
    equations, mass = noise_weighted_equations(estimate, runs)
    others = [k for k in range(equations.shape[1]) if k != mass]
    rhs = -equations[:, mass] * LOAD["mL"]
    least_squares = np.linalg.lstsq(equations[:, others], rhs, rcond=None)[0][:3]
    assert np.all(least_squares < TRUE_GAINS), "noise in the regressors biases the gains downwards"
    last = np.linalg.svd(equations, full_matrices=False)[2][-1]
    total = last[:3] / last[mass] * LOAD["mL"]
    for peer in (least_squares, total):
        assert np.abs(peer - TRUE_GAINS).max() > 5.0 * ours


def test_a_factor_of_all_torques_is_a_factor_of_the_gains(
    loaded: tuple[Estimate, tuple[TimeRun, ...]],
) -> None:
    estimate, runs = loaded
    factor = np.array([2.0, 0.5, 1.3])
    scaled = tuple(
        replace(run, signals=replace(run.signals, torque_nm=run.signals.torque_nm * factor))
        for run in runs
    )
    before = drive_gains(estimate, runs, LOAD["mL"], 0.01)
    after = drive_gains(estimate, scaled, LOAD["mL"], 0.01)
    np.testing.assert_allclose(after.values * factor, before.values, rtol=1e-5)


@pytest.mark.parametrize(
    ("mass_kg", "factors", "details"),
    [
        (15000.0, (1.0, 1.0, 1.0), ("15000 kg (grams", "14.4 kg")),
        (7.5, (1.0, 1.0, 1.0), ("7.5 kg (", "twice", "14.4 kg")),
        (15.0, (1.0, 2.0, 1.0), ("1.4: axis2 0.452; ", "not all")),
        (15.0, (3.0, 3.0, 3.0), ("axis1 0.402, ", " 43.1 kg", " 15 kg: ")),
    ],
)
def test_implausible_gains_are_refused_with_the_likely_mistake(
    loaded: tuple[Estimate, tuple[TimeRun, ...]],
    mass_kg: float,
    factors: tuple[float, ...],
    details: tuple[str, ...],
) -> None:
    estimate, runs = loaded
    scaled = tuple(
        replace(run, signals=replace(run.signals, torque_nm=run.signals.torque_nm * factors))
        for run in runs
    )
    gains = drive_gains(estimate, scaled, mass_kg, 0.01)
    with raises_code(EstimationError, "RID-GAINS-IMPLAUSIBLE", *details):
        gains.require_plausible(mass_kg)
    drive_gains(estimate, runs, LOAD["mL"], 0.01).require_plausible(LOAD["mL"])


def test_the_uncertainty_of_the_weighed_mass_is_part_of_every_gain(
    loaded: tuple[Estimate, tuple[TimeRun, ...]],
) -> None:
    estimate, runs = loaded
    fine, coarse = (drive_gains(estimate, runs, LOAD["mL"], sigma) for sigma in (0.001, 1.5))
    more = np.sqrt(coarse.sigma**2 - fine.sigma**2) / coarse.values
    np.testing.assert_allclose(more, 0.1, rtol=0.1)  # 1.5 kg of 15 kg


def test_runs_that_cannot_determine_gains_are_refused(
    arm: KnownArm, loaded: tuple[Estimate, tuple[TimeRun, ...]]
) -> None:
    estimate, runs = loaded
    empty = fit_smoothed(arm.robot, [runs[0].signals]).estimate()
    with raises_code(EstimationError, "RID-PAYLOAD-RUNS"):
        drive_gains(empty, runs[:1], 15.0, 0.01)
    with raises_code(EstimationError, "RID-OPTION-RANGE"):
        drive_gains(estimate, runs, 0.0, 0.01)


def lever_signals(load_nm: float, inertia: float) -> SmoothedSignals:
    """Return 20 s of a lever on a horizontal axis, with noise."""
    times = np.arange(2000, dtype=np.float64)[:, np.newaxis] * STEP_S
    rate = 2.0 * np.pi * 0.3
    q = 1.2 * np.sin(rate * times) + 0.4 * np.sin(2.0 * rate * times)
    v = rate * (1.2 * np.cos(rate * times) + 0.8 * np.cos(2.0 * rate * times))
    a = -(rate**2) * (1.2 * np.sin(rate * times) + 1.6 * np.sin(2.0 * rate * times))
    noise = 0.01 * np.random.default_rng(3).standard_normal(q.shape)
    return SmoothedSignals(
        joint_names=("motor",),
        time_s=times[:, 0],
        position=q,
        velocity=v,
        acceleration=a,
        torque_nm=inertia * a + load_nm * np.cos(q) + noise,
        segment=np.zeros(len(times), dtype=np.int64),
        sample_period_s=STEP_S,
        cutoff_hz=50.0,
        temperature_k=None,
    )


def test_a_weighed_mass_without_its_distance_from_the_axis_is_refused() -> None:
    limits = JointLimits(
        position_min=-3.0, position_max=3.0, velocity=9.0, acceleration=99.0, torque=9.0
    )
    lever = RobotDescription(
        name="lever",
        gravity_m_s2=(0.0, -9.81, 0.0),
        kinematics=Kinematics(convention="modified_dh", rows=(KinematicRow(),)),
        joints=(Joint(name="motor", limits=limits),),
    )
    signals, carried = [lever_signals(0.6, 0.01), lever_signals(3.0, 0.07)], [False, True]
    how = EstimationOptions(model=OPTIONS)
    estimate = fit_smoothed(lever, signals, how, payload=carried).estimate()
    with raises_code(EstimationError, "RID-LOAD-MASS-HIDDEN", "motor"):
        drive_gains(estimate, time_runs(estimate.model, signals, carried), 1.0, 0.01)
