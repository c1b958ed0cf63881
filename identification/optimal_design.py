"""Optimal excitation: many starts, each refined by gradients, each verified on a dense grid."""

from __future__ import annotations

import math
import warnings
from collections.abc import Generator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from typing import Any

import joblib
import numpy as np
from scipy.optimize import minimize

from acquisition.arrays import FloatArray
from acquisition.excitation import FourierTrajectory
from acquisition.motion_samples import plan_motion
from config.errors import ConfigError
from config.motion import FourierMotion
from dynamics.robot_model import RobotModel, regressor, torque
from identification.excitation_problem import ExcitationProblem

PENALTIES = (10.0, 100.0, 1e3, 1e4)
SHRINKING = (1.0, 0.98, 0.95, 0.9, 0.8)
DENSE_POINTS_PER_HARMONIC = 60
PLANNED_MARGIN_M = 0.005


@dataclass(frozen=True)
class LimitUse:
    """How much of one limit a motion uses: `used` of `limit`, in `unit`."""

    what: str
    used: float
    limit: float
    unit: str
    held: bool


@dataclass(frozen=True)
class Candidate:
    """One refined and verified motion.

    Attributes
    ----------
    seed : int
        Where its start was drawn from.
    motion : FourierMotion
        The motion.
    condition_number : float
        Of the model with its hard sign (2.25, 2.26), rows over the expected noise.
    log_det : float
        Log determinant of the information about the base parameters, per parameter.
    uses : tuple of LimitUse
        Torques and clearances on the dense grid.
    broken : tuple of str
        What the motion breaks, in words; empty where it may be driven.
    """

    seed: int
    motion: FourierMotion
    condition_number: float
    log_det: float
    uses: tuple[LimitUse, ...]
    broken: tuple[str, ...]

    def worth(self, problem: ExcitationProblem) -> float:
        """Return the problem's criterion: the smaller the better."""
        if problem.criterion == "condition":
            return self.condition_number
        return -self.log_det


def refine(
    problem: ExcitationProblem,
    seed: int,
    sample_period_s: float,
    *,
    iterations: int = 120,
    periods: int = 16,
    transient_periods: int = 1,
) -> Candidate:
    """Refine one start by L-BFGS with growing penalties, and verify it.

    Where the result breaks a limit by a little, it is drawn together about its middle pose until it
    breaks none.

    Parameters
    ----------
    problem : ExcitationProblem
        What is asked of the motion.
    seed : int
        Where the start is drawn from; the same seed gives the same motion.
    sample_period_s : float
        The cell's cycle time [s].
    iterations : int
        Most iterations a penalty.
    periods, transient_periods : int
        Of the motion file.
    """
    planned = replace(
        problem,
        workspace=problem.workspace.model_copy(
            update={"clearance_m": problem.workspace.clearance_m + PLANNED_MARGIN_M}
        ),
    )
    x = planned.start(seed)
    for penalty in PENALTIES:
        x = minimize(
            planned.value,
            x,
            args=(penalty,),
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": iterations, "maxcor": 30},
        ).x
    for share in SHRINKING:
        motion = problem.to_fourier(problem.shrunk(x, share), periods, transient_periods)
        candidate = verify(problem, motion, sample_period_s, seed)
        if not candidate.broken:
            break
    return candidate


def verify(
    problem: ExcitationProblem, motion: FourierMotion, sample_period_s: float, seed: int = 0
) -> Candidate:
    """Hold a motion against every limit on a dense grid, ramps included for q, v and a."""
    broken: list[str] = []
    try:
        plan_motion(motion, problem.robot, sample_period_s)
    except ConfigError as error:
        broken.append(str(error))
    points = DENSE_POINTS_PER_HARMONIC * problem.harmonics
    trajectory = FourierTrajectory.from_motion(motion, problem.robot, motion.period_s / points)
    times = trajectory.sample_times_s
    q, v, a = (
        f(times) for f in (trajectory.position, trajectory.velocity, trajectory.acceleration)
    )
    model = RobotModel.from_description(problem.robot)
    uses = _torque_uses(problem, model, q, v, a) + _clearance_uses(problem, q)
    broken += [
        f"{use.what}: {use.used:.4g} {use.unit} where {use.limit:.4g} {use.unit} is allowed"
        for use in uses
        if not use.held
    ]
    rows = regressor(model, q, v, a)[:, :, list(problem.base.kept)]
    rows = (rows / problem.expected_noise_nm[:, np.newaxis]).reshape(-1, len(problem.base))
    information = rows.T @ rows / points
    if problem.given is not None:
        information = information + problem.given
    size = np.sqrt(np.diagonal(information))
    if (size == 0.0).any():
        return Candidate(seed, motion, math.inf, -math.inf, uses, tuple(broken))
    eigenvalues = np.linalg.eigvalsh(information / np.outer(size, size))
    smallest = max(float(eigenvalues[0]), 1e-300)
    log_det = float(np.sum(np.log(np.maximum(eigenvalues, 1e-300))) + 2.0 * np.sum(np.log(size)))
    return Candidate(
        seed=seed,
        motion=motion,
        condition_number=math.sqrt(float(eigenvalues[-1]) / smallest),
        log_det=log_det / len(size),
        uses=uses,
        broken=tuple(broken),
    )


def candidates(
    problem: ExcitationProblem,
    seeds: Sequence[int],
    sample_period_s: float,
    *,
    iterations: int = 120,
    periods: int = 16,
    transient_periods: int = 1,
    jobs: int = -1,
    scheduler: str | None = None,
) -> Generator[Candidate]:
    """Refine many starts side by side, and yield each as it is ready.

    Parameters
    ----------
    problem, sample_period_s, iterations, periods, transient_periods
        As for `refine`.
    seeds : sequence of int
        One start each. All of them give the same set of candidates wherever they are computed.
    jobs : int
        Processes; -1 for one a core.
    scheduler : str, optional
        Address of a Dask scheduler; its workers need this program installed.

    Raises
    ------
    ConfigError
        The scheduler cannot be reached, or Dask is not installed.
    """
    work = joblib.delayed(refine)
    tasks = (
        work(
            problem,
            seed,
            sample_period_s,
            iterations=iterations,
            periods=periods,
            transient_periods=transient_periods,
        )
        for seed in seeds
    )
    with _backend(scheduler), warnings.catch_warnings():
        # A caller that has seen enough closes this generator, which is no reason for a warning.
        warnings.filterwarnings("ignore", ".*have been cancelled", UserWarning)
        parallel = joblib.Parallel(n_jobs=jobs, return_as="generator_unordered")
        yield from parallel(tasks)


def _backend(scheduler: str | None) -> Any:
    """Return the context in which joblib computes: this machine, or a Dask cluster."""
    if scheduler is None:
        return nullcontext()
    try:
        from dask.distributed import Client
    except ImportError as error:
        raise ConfigError(
            "--scheduler needs Dask, which is not installed: install rid-daq with its extra"
            " `cluster`, or leave the option out"
        ) from error
    try:
        Client(scheduler, timeout="10s")  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"no Dask scheduler answers at {scheduler}: {error}. Start one with `dask scheduler`,"
            " or leave the option out to use this machine"
        ) from error
    return joblib.parallel_config(backend="dask")


def _torque_uses(
    problem: ExcitationProblem, model: RobotModel, q: FloatArray, v: FloatArray, a: FloatArray
) -> tuple[LimitUse, ...]:
    if problem.parameters is None:
        return ()
    largest = np.abs(torque(model, q, v, a, problem.parameters)).max(axis=0)
    return tuple(
        LimitUse(
            f"torque of {joint.name}",
            float(tau),
            joint.limits.torque,
            "N" if joint.type == "prismatic" else "N m",
            bool(tau <= joint.limits.torque),
        )
        for joint, tau in zip(problem.robot.joints, largest, strict=True)
    )


def _clearance_uses(problem: ExcitationProblem, q: FloatArray) -> tuple[LimitUse, ...]:
    clearances = problem.clearances
    if not len(clearances):
        return ()
    nearest = clearances.distances(q).min(axis=0)
    margin = clearances.margin_m
    return tuple(
        LimitUse(f"distance between {name}", float(distance), margin, "m", bool(distance >= margin))
        for name, distance in zip(clearances.names, nearest, strict=True)
    )
