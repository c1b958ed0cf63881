"""Optimal excitation: many random starts, refined by gradients and verified on a dense grid."""

from __future__ import annotations

import warnings
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import cast

import joblib
from scipy.optimize import minimize

from acquisition.motion.kinds.fourier import FourierMotion
from config.arrays import FloatArray
from config.errors import ConfigError
from config.process.termination import signals_blocked
from identification.design.problem import ExcitationProblem
from identification.design.verification import MotionCheck, check_motion

PENALTIES = (10.0, 10.0, 30.0, 100.0)
ITERATIONS = 200
LATER_SHARE = 0.3
SHRINKING = (0.98, 0.95, 0.9, 0.8, 0.65, 0.5)
SMALLER_STILL = (0.8, 0.6, 0.45, 0.35, 0.25, 0.18, 0.12, 0.08)
"""Factors to try on the amplitudes: first about the middle pose, then about a resting pose."""
PLANNED_MARGIN_M = 0.005
SCHEDULER_TIMEOUT_S = 10.0


@dataclass(frozen=True)
class Candidate:
    """One refined motion.

    Attributes:
        seed: Seed of its start.
        check: Result of its verification.
        amplitude: Factor by which the refined amplitudes were reduced to satisfy the limits.
    """

    seed: int
    motion: FourierMotion
    check: MotionCheck
    amplitude: float = 1.0


def refine_start(
    problem: ExcitationProblem,
    seed: int,
    sample_period_s: float,
    *,
    iterations: int = ITERATIONS,
    periods: int = 16,
) -> Candidate:
    """Refine one start by an augmented Lagrangian and L-BFGS, and verify it on a dense grid.

    If the result violates a limit, its amplitudes are reduced about its middle pose until it
    satisfies all limits. If half the amplitudes still violate a limit, the motion is moved to the
    start's pose, in which the robot can rest, and reduced there. Even then it can violate a limit
    (`Candidate.check`).

    Args:
        problem: The design task.
        seed: Seed of the start; the same seed gives the same motion.
        sample_period_s: The cell's cycle time [s].
        iterations: Largest number of iterations of the first minimisation; later ones have fewer.
        periods: Periods of the motion file.

    Raises:
        ConfigError: No pose is found in which the robot can rest.
    """
    planned = problem.with_clearance(PLANNED_MARGIN_M)
    x = start = planned.start(seed)
    shifts = planned.no_shifts()
    before = PENALTIES[0]
    most = iterations
    for penalty in PENALTIES:
        shifts = tuple(shift * (before / penalty) for shift in shifts)
        x = minimize(
            planned.value,
            x,
            args=(penalty, shifts),
            jac=True,
            method="L-BFGS-B",
            options={"maxiter": most, "maxcor": 30},
        ).x
        shifts = planned.next_shifts(x, shifts)
        before = penalty
        most = max(1, int(LATER_SHARE * iterations))

    def candidate(x: FloatArray, share: float) -> Candidate:
        motion = problem.to_fourier(problem.with_smaller_amplitudes(x, share), periods)
        check = check_motion(problem, motion, sample_period_s)
        return Candidate(seed, motion, check, share)

    own = problem.within_limits(x)
    found = candidate(own, 1.0)
    sizes = [(own, share) for share in SHRINKING]
    resting = problem.within_limits(problem.about_pose_of(x, start))
    for smaller, share in [*sizes, *((resting, share) for share in SMALLER_STILL)]:
        if not found.check.broken:
            break
        found = candidate(smaller, share)
    return found


def candidates(
    problem: ExcitationProblem,
    seeds: Sequence[int],
    sample_period_s: float,
    *,
    iterations: int = ITERATIONS,
    periods: int = 16,
    jobs: int = -1,
    scheduler: str | None = None,
) -> Generator[Candidate]:
    """Refine many starts in parallel, and yield each as soon as it is finished.

    Args:
        problem, sample_period_s, iterations, periods: As for `refine_start`.
        seeds: Seed of each start. The candidates do not depend on the number of processes.
        jobs: Number of processes; -1 for one per core.
        scheduler: Address of a Dask scheduler; its workers need this program installed.

    Raises:
        ConfigError: The scheduler cannot be reached, or Dask is not installed.
    """
    work = joblib.delayed(refine_start)
    tasks = (
        work(problem, seed, sample_period_s, iterations=iterations, periods=periods)
        for seed in seeds
    )
    with joblib_backend(scheduler, jobs), warnings.catch_warnings():
        # A caller may close this generator early: suppress joblib's warning about this.
        warnings.filterwarnings("ignore", ".*have been cancelled", UserWarning)
        parallel = joblib.Parallel(n_jobs=jobs, return_as="generator_unordered")
        yield from cast(Generator[Candidate], parallel(tasks))


@contextmanager
def joblib_backend(scheduler: str | None, jobs: int) -> Iterator[None]:
    """Select the joblib backend: this machine, or a Dask cluster."""
    if scheduler is None:
        # One thread per process, because the rounding of a sum depends on the number of threads.
        with joblib.parallel_config(backend="loky", inner_max_num_threads=1):
            with signals_blocked():
                joblib.Parallel(n_jobs=jobs)([joblib.delayed(int)()])
            yield
        return
    try:
        from dask.distributed import Client
    except ImportError as error:
        raise ConfigError(
            "--scheduler needs Dask, which is not installed: install rid-daq with the extra"
            " `cluster`, or omit the option",
            code="RID-INSTALL-LIBRARY",
        ) from error
    try:
        client = Client(scheduler, timeout=SCHEDULER_TIMEOUT_S)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"no Dask scheduler responds at {scheduler}: {error}. Start one with `dask"
            " scheduler`, or omit the option to use this machine",
            code="RID-DESIGN-SCHEDULER",
        ) from error
    with client, joblib.parallel_config(backend="dask"):
        yield
