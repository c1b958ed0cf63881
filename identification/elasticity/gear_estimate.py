"""`estimate_gears`: maximum-likelihood estimate of the stiffness and damping of elastic gears.

Base parameters, motor inertia, stiffness and damping of every joint are fitted together to
excitation and multisine runs. The standard deviation of a stiffness is the larger of two: the one
from the residuals, and the one from leaving out one run at a time (jackknife).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np

from acquisition.processing.periods import PeriodAverage
from acquisition.signals.bins import Bins
from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from identification.elasticity.elastic_arm import ElasticArm
from identification.elasticity.elastic_problem import ElasticProblem
from identification.elasticity.elastic_runs import ExcitationBins, MultisineBins, multisine_torque
from identification.elasticity.first_stiffness import first_gears
from identification.elasticity.levenberg_marquardt import Minimum, minimise
from identification.elasticity.link_motion import Gears, solve_links

SHARE_OF_RESONANCE: Final = 0.5
"""Ratio of the band of the excitation runs to the lowest resonance frequency of a link on a
locked motor."""
ROUNDS: Final = 3
ITERATIONS: Final = 15
MODEL_ERROR: Final = 0.01
"""Lowest relative standard deviation: the error of the model's structure in simulations."""
LARGEST_SIGMA: Final = 0.2
LARGEST_DAMPING_SIGMA: Final = 0.5
LEAST_BEND: Final = {"rad": 2e-5, "m": 6e-6}
"""Smallest deflection that shows a stiffness; 1 rad displaces the tool by about 0.3 m."""
LARGEST_RESIDUAL: Final = 0.15
"""Largest accepted share of the torque that is not explained; simulated cells have 0.09 to 0.12."""
LARGEST_MISMATCH: Final = 0.3
"""Largest accepted share of the deflection that is not explained; the cell `ir361_elastic` has
0.02.
"""
FEWEST_RUNS: Final = 3
ONLY_THIS_RUN: Final = 1e-9
STEPS: Final = {"stiffness": 1e-4, "loss": 1e-2, "rotor": 1e-4, "body": 1e-3, "delay": 1e-2}


@dataclass(frozen=True, eq=False)
class GearEstimate:
    """Stiffness and damping of the gears, with intervals.

    Attributes:
        joint_names: Base to flange.
        units: Unit of each joint's position, rad or m.
        gears: The fitted parameters.
        motor_inertia: Shape (n,). Inertia of each motor at the gear's output [kg m^2 or kg].
        relative_sigma: Shape (n,). Standard deviation of each stiffness over its value.
        damping_sigma: Shape (n,). Standard deviation of each damping [N m s/rad or N s/m].
        bend: Shape (n,). Largest amplitude of the deflection in an excitation run, without its
            constant part [rad or m].
        minimum_hz: Shape (n,). Fitted frequency at which motor and link move against each other.
        residual_share: Shape (n,). RMS of the torque's residual over RMS of the torque, on the
            lines of the multisines.
        responses: Measured and predicted frequency response of each axis.
        has_plate: True if a force plate was used.
        tool_residual_m: RMS distance of the tracker's points from the fitted path, without its
            constant part; None without a tracker.
        has_link_encoders: True if encoders on the link side were used.
        link_side_mismatch: Largest share of a deflection, measured by an instrument, that the fit
            does not explain.
    """

    joint_names: tuple[str, ...]
    units: tuple[str, ...]
    gears: Gears
    motor_inertia: FloatArray
    relative_sigma: FloatArray
    damping_sigma: FloatArray
    bend: FloatArray
    minimum_hz: FloatArray
    residual_share: FloatArray
    responses: tuple[GearResponse, ...]
    has_plate: bool
    tool_residual_m: float | None = None
    has_link_encoders: bool = False
    link_side_mismatch: float = 0.0

    @property
    def shows_damping(self) -> tuple[bool, ...]:
        """For each joint: True if the data determine stiffness and damping."""
        shown = self.damping_sigma <= LARGEST_DAMPING_SIGMA * self.gears.damping
        return tuple(
            bool(each) and reason is None for each, reason in zip(shown, self.reasons, strict=True)
        )

    @property
    def reasons(self) -> tuple[str | None, ...]:
        """For each joint: the reason why the data do not determine its stiffness.

        None if they determine it.

        The axes are fitted together. Therefore no stiffness is shown if one residual is too large.
        """
        worst = int(np.argmax(self.residual_share))
        left = float(self.residual_share[worst])
        if left > LARGEST_RESIDUAL:
            unexplained = (
                f"the model, which is fitted to all axes together, does not explain"
                f" {100.0 * left:.0f} % of the multisine's torque of {self.joint_names[worst]} (at"
                f" most {100.0 * LARGEST_RESIDUAL:.0f} %); all runs need the same load"
            )
            return (unexplained,) * len(self.joint_names)
        if self.link_side_mismatch > LARGEST_MISMATCH:
            contradicted = (
                "the instrument on the link side contradicts the motors:"
                f" {100.0 * self.link_side_mismatch:.0f} % of the deflection is not explained (at"
                f" most {100.0 * LARGEST_MISMATCH:.0f} %); check that its channels have the signs,"
                " units and places that you stated, and that all runs have the same load"
            )
            return (contradicted,) * len(self.joint_names)
        found: list[str | None] = []
        each_joint = (self.relative_sigma, self.bend, self.units, self.minimum_hz, self.responses)
        for sigma, bend, unit, minimum_hz, response in zip(*each_joint, strict=True):
            reason = None
            last_hz = float(response.frequency_hz[-1])
            if minimum_hz > last_hz:
                reason = (
                    f"motor and link move against each other at {minimum_hz:.3g} Hz, above the"
                    f" multisine's last line at {last_hz:.3g} Hz: record a multisine of a wider"
                    " band"
                )
            elif sigma > LARGEST_SIGMA:
                reason = (
                    f"its standard deviation is {100.0 * sigma:.0f} % (at most"
                    f" {100.0 * LARGEST_SIGMA:.0f} %)"
                )
            elif bend < LEAST_BEND[unit]:
                reason = f"the gear bends by {1e3 * bend:.2g} m{unit} only"
            found.append(reason)
        return tuple(found)


@dataclass(frozen=True, eq=False)
class GearResponse:
    """Torque over motor velocity of one axis on its own lines of the multisines.

    Attributes:
        frequency_hz: Shape (F,). The lines [Hz].
        measured, predicted: Shape (F,). Torque over velocity without friction, over all
            realisations [N m s/rad or N s/m].
    """

    frequency_hz: FloatArray
    measured: Bins
    predicted: Bins


def estimate_gears(
    robot: RobotDescription,
    averages: Sequence[PeriodAverage],
    excitations: Sequence[ExcitationBins],
    multisines: Sequence[MultisineBins],
    arm: ElasticArm,
) -> GearEstimate:
    """Estimate stiffness and damping of all gears.

    Args:
        robot: The robot, whose friction terms serve for the start of the fit only.
        averages: Mean periods of the excitation runs, for the start of the fit.
        excitations, multisines: The same runs and the realisations of the multisines, prepared.
        arm: Structure with which the runs were prepared.

    Raises:
        EstimationError: A joint is excited by no multisine, or the runs do not determine the arm,
            or the fit does not converge.
    """
    for j, name in enumerate(robot.joint_names):
        if not any((run.excited == j).any() for run in multisines):
            raise EstimationError(
                f"joint {name} is not excited by any multisine: record a multisine of"
                " `rid-daq design --kind multisine` that moves it",
                code="RID-MOTION-UNINFORMATIVE",
            )
    start = first_gears(robot, arm, averages, excitations, multisines)
    inertia = ElasticProblem.of(arm, excitations, multisines, start).inertia
    resonance_hz = np.sqrt(start.stiffness / inertia) / (2.0 * math.pi)
    band_hz = SHARE_OF_RESONANCE * float(resonance_hz.min())
    below = [run.below(band_hz) for run in excitations]
    problem = ElasticProblem.of(arm, below, multisines, start)
    steps = _steps(problem)
    bent: list[Bins | None] = [None] * len(excitations)
    found = minimise(partial(problem.residuals, bent=bent), problem.at_start, steps, ITERATIONS)
    for _ in range(ROUNDS - 1):
        problem = problem.renewed(found)
        residuals = partial(problem.residuals, bent=bent)
        found = minimise(residuals, found.x, steps, ITERATIONS // 2)
    weighed, problem = problem, problem.renewed(found)
    result = _result(problem, found)
    return replace(
        result,
        tool_residual_m=weighed.tool_residual_m(found),
        link_side_mismatch=weighed.link_side_mismatch(found),
    )


def _steps(problem: ElasticProblem) -> FloatArray:
    """Return the steps of the finite differences."""
    n, b = problem.arm.n, len(problem.arm.base)
    counts = {"stiffness": n, "loss": n, "rotor": n, "body": b, "delay": problem.delays}
    return np.concatenate([np.full(count, STEPS[name]) for name, count in counts.items()])


def _result(problem: ElasticProblem, found: Minimum) -> GearEstimate:
    _require_settled(found.is_settled, "the fit of the gears")
    n, gears = problem.arm.n, problem.gears(found.x)
    covariance = found.covariance
    variance = np.maximum(np.diagonal(covariance), jackknife_variance(problem, found))
    relative = np.sqrt(variance[:n])
    loss = np.sqrt(variance[n : 2 * n]) / np.maximum(np.abs(found.x[n : 2 * n]), 1e-9)
    bend = np.zeros(n)
    for run in problem.excitations:
        _, bent, _, is_settled = solve_links(
            problem.arm, gears, run.theta, run.period_s, run.rows, problem.inertia
        )
        _require_settled(is_settled, f"the motion of the links in run {run.run_id}")
        moving = np.fft.irfft(bent[: len(run.torque) + 1] * run.rows, n=run.rows, axis=0)
        bend = np.maximum(bend, 0.5 * np.ptp(moving, axis=0))
    motors = problem.arm.reflected * gears.rotor
    responses, shares = zip(*(_response(problem, gears, j) for j in range(n)), strict=True)
    return GearEstimate(
        problem.arm.robot.joint_names,
        tuple(joint.unit for joint in problem.arm.robot.joints),
        gears,
        motors,
        np.maximum(relative, MODEL_ERROR),
        np.abs(gears.damping) * np.hypot(loss, np.maximum(relative, MODEL_ERROR)),
        bend,
        np.sqrt(gears.stiffness * (1.0 / motors + 1.0 / problem.inertia)) / (2.0 * math.pi),
        np.array(shares),
        responses,
        problem.delays > 0,
        has_link_encoders=any(each.name == "encoder" for each in problem.channels),
    )


def _require_settled(is_settled: bool, what: str) -> None:
    """Refuse a result of an iteration that has not converged.

    Raises:
        EstimationError: The iteration ended before it had converged.
    """
    if not is_settled:
        raise EstimationError(
            f"{what} has not converged, so no stiffness is given: check that all runs have the same"
            " load, and record them again",
            code="RID-STIFFNESS-RUNS",
        )


def jackknife_variance(problem: ElasticProblem, found: Minimum) -> FloatArray:
    """Return the variance of each unknown by leaving out one run at a time (linearised), (p,).

    With fewer than three runs the variance is zero.
    """
    size = np.maximum(np.linalg.norm(found.jacobian, axis=0), 1e-300)
    jacobian = found.jacobian / size
    whole, count = jacobian.T @ jacobian, len(problem.run_rows)
    changes = np.zeros(len(found.x))
    if count < FEWEST_RUNS:
        return changes
    for rows in problem.run_rows:
        own = jacobian[rows]
        # The pseudo-inverse leaves out parameters that belong to this run only, such as the delay
        # of its plate.
        rest = np.linalg.pinv(whole - own.T @ own, rcond=ONLY_THIS_RUN, hermitian=True)
        changes += (rest @ (own.T @ found.residuals[rows]) / size) ** 2
    return changes * (count - 1) / count


def _response(problem: ElasticProblem, gears: Gears, joint: int) -> tuple[GearResponse, float]:
    """Return the response of an axis on its own lines, and the share of the torque's residual."""
    lines, speeds, torques, fits = [], [], [], []
    for number, run in enumerate(problem.multisines, start=len(problem.excitations)):
        own = run.excited == joint
        predicted = multisine_torque(run, gears)[:, joint]
        friction = problem.friction_of(number, joint, run.torque[:, joint] - predicted)
        lines.append(run.frequency_hz[own])
        speeds.append(2j * np.pi * run.frequency_hz[own] * run.theta[own, joint])
        torques.append((run.torque[:, joint] - friction)[own])
        fits.append(predicted[own])
    speed, torque, fit = (np.concatenate(each) for each in (speeds, torques, fits))
    frequency_hz, place = np.unique(np.concatenate(lines), return_inverse=True)
    power = np.bincount(place, np.abs(speed) ** 2)

    def over_speed(values: Bins) -> Bins:
        cross = values * np.conj(speed)
        parts = np.bincount(place, cross.real) + 1j * np.bincount(place, cross.imag)
        return np.asarray(parts / power)

    share = np.linalg.norm(torque - fit) / np.linalg.norm(torque)
    return GearResponse(frequency_hz, over_speed(torque), over_speed(fit)), float(share)
