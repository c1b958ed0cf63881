"""Monte Carlo simulation of a payload's estimate, with noise and random errors of assumptions."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Final, cast

import joblib
import numpy as np

from config.arrays import FloatArray
from dynamics.model.robot_model import regressor
from identification.design.search import joblib_backend
from identification.payload.body import reported
from identification.sensitivity.problem import (
    Assumptions,
    Comparison,
    MotionEstimator,
    SensitivityProblem,
)

BATCH: Final = 250


@dataclass(frozen=True)
class PriorUncertainty:
    """Standard deviations of the assumptions, all independent.

    Attributes:
        torque_constants: Relative standard deviation of each axis's torque constant.
        links: Relative standard deviation of each link's mass, first moment and inertia.
        rotors: Relative standard deviation of each rotor's inertia.
        bias: Standard deviation of each axis's constant torque error, in units of 100 times its
            noise.
    """

    torque_constants: float = 0.0
    links: float = 0.0
    rotors: float = 0.0
    bias: float = 0.0


@dataclass(frozen=True, eq=False)
class Draws:
    """Estimates of one batch: values (draws, 10) of `REPORTED`, and the number of the batch."""

    batch: int
    values: FloatArray


def draw_batch(
    problem: SensitivityProblem,
    prior: PriorUncertainty,
    against: Comparison,
    batch: int,
    count: int,
    seed: int,
) -> Draws:
    """Estimate a payload `count` times, each time with other noise and other wrong assumptions.

    A batch costs one set-up of the equations and `count` products with it. Batches are large enough
    to be sent to another machine efficiently.

    Args:
        problem: The robot, its payload, its motion, the noise of every sample.
        prior: Uncertainty of the assumptions.
        against: Comparison that separates the payload from the robot.
        batch, count, seed: Number of the batch, its draws, and the seed of all batches.
    """
    random = np.random.default_rng([seed, batch])
    right = Assumptions()
    estimator = MotionEstimator.of(problem, right, against)
    tau = problem.torque(right, True)
    alone = problem.torque(right, False)
    motion, model = problem.motion, problem.model
    groups = model.parameter_groups
    links = np.zeros((*motion.q.shape, 0))
    values = np.zeros(0)
    if against == "model" and (prior.links or prior.rotors):
        phi = regressor(model, motion.q, motion.v, motion.a, problem.conditions(False))
        parts = [("rigid_body", prior.links), ("rotors", prior.rotors), ("armature", prior.rotors)]
        chosen = [(phi[:, :, groups[g]], share, groups[g]) for g, share in parts if g in groups]
        links = np.concatenate([columns for columns, _, _ in chosen], axis=2)
        values = np.concatenate([share * problem.parameters[s] for _, share, s in chosen])
    found = np.empty((count, 10))
    for row in found:
        gains = 1.0 + prior.torque_constants * random.standard_normal(len(problem.noise_nm))
        bias = 100.0 * prior.bias * problem.noise_nm * random.standard_normal(len(problem.noise_nm))
        measured = tau + problem.noise_nm * random.standard_normal(tau.shape)
        measured = gains * measured + bias
        if against == "difference":
            without = alone + problem.noise_nm * random.standard_normal(tau.shape)
            measured = measured - gains * without - bias
        elif len(values):
            measured = measured - links @ (values * random.standard_normal(len(values)))
        row[:] = reported(estimator.parameters(measured))
    return Draws(batch, found)


def monte_carlo(
    problem: SensitivityProblem,
    prior: PriorUncertainty,
    against: Comparison,
    draws: int,
    *,
    seed: int = 0,
    jobs: int = -1,
    scheduler: str | None = None,
) -> Generator[Draws]:
    """Draw in batches in parallel, and yield each batch as soon as it is finished.

    The draws do not depend on the number of processes.

    Args:
        problem, prior, against, seed: As for `draw_batch`.
        draws: Total number of draws.
        jobs: Number of processes; -1 for one per core.
        scheduler: Address of a Dask scheduler; its workers need this program installed.

    Raises:
        ConfigError: The scheduler cannot be reached, or Dask is not installed.
        EstimationError: The motion does not determine all ten parameters.
    """
    work = joblib.delayed(draw_batch)
    tasks = [
        work(problem, prior, against, batch, min(BATCH, draws - start), seed)
        for batch, start in enumerate(range(0, draws, BATCH))
    ]
    with joblib_backend(scheduler, jobs):
        parallel = joblib.Parallel(n_jobs=jobs, return_as="generator_unordered")
        yield from cast(Generator[Draws], parallel(tasks))


def join_batches(batches: list[Draws]) -> FloatArray:
    """Return the values of all batches in the order of their numbers, (draws, 10)."""
    ordered = sorted(batches, key=lambda draws: draws.batch)
    return np.concatenate([draws.values for draws in ordered])
