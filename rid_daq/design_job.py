"""The search for an optimal excitation as a command runs it: progress, budget, interruption."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass

import numpy as np

from config.cell import CellConfig
from config.errors import ConfigError
from config.robot import RobotDescription
from dynamics.cad import cad_parameters
from dynamics.robot_model import RobotModel
from identification.estimate import Estimate
from identification.excitation_problem import Criterion, ExcitationProblem
from identification.optimal_design import Candidate, candidates
from rid_daq.console import Console

EXPECTED_NOISE_SHARE = 0.01
SEEDS_APART = 10_000


@dataclass(frozen=True)
class Trial:
    """One start of a search: when it was ready, and what came of it."""

    elapsed_s: float
    seed: int
    worth: float
    broken: tuple[str, ...]


@dataclass(frozen=True)
class Search:
    """A finished search: the best motion that breaks nothing, and every trial."""

    best: Candidate
    trials: tuple[Trial, ...]
    interrupted: bool


def excitation_problem(
    cell: CellConfig,
    robot: RobotDescription,
    *,
    period_s: float,
    periods: int,
    harmonics: int,
    criterion: Criterion,
    model: Estimate | None = None,
    given: Sequence[Estimate] = (),
) -> ExcitationProblem:
    """Put a design task together from a cell and what is known of its robot.

    Torque limits are held by `model`, else by the robot file's `cad`, else not at all. Earlier
    estimates count with their information over the samples of the new run.

    Raises
    ------
    ConfigError
        A model is of another robot or has other terms.
    """
    full = RobotModel.from_description(robot)
    parameters = None
    noise = EXPECTED_NOISE_SHARE * np.array([joint.limits.torque for joint in robot.joints])
    for estimate in (*given, *([model] if model is not None else [])):
        if estimate.base.standard_names != full.parameter_names:
            raise ConfigError(
                f"the model of robot {estimate.robot.name!r} has other parameters than this cell's"
                f" robot {robot.name!r}: give models of this robot with all its terms"
            )
    if model is not None:
        parameters = np.zeros(len(full.parameter_names))
        parameters[list(model.base.kept)] = model.values
        noise = np.maximum(model.residual_nm, 1e-4 * noise)
    elif robot.cad is not None:
        parameters, _ = cad_parameters(full, robot)
    information = None
    if given:
        rows = periods * period_s / cell.cycle_time_s
        parts = [np.linalg.inv(estimate.covariance_residual) for estimate in given]
        information = np.asarray(np.sum(parts, axis=0)) / rows
    return ExcitationProblem(
        robot=robot,
        period_s=period_s,
        harmonics=harmonics,
        criterion=criterion,
        limit_fraction=0.9,
        expected_noise_nm=noise,
        parameters=parameters,
        given=information,
        workspace=cell.workspace,
    )


def search(
    problem: ExcitationProblem,
    cell: CellConfig,
    console: Console,
    *,
    seed: int,
    starts: int,
    periods: int,
    budget_s: float | None = None,
    scheduler: str | None = None,
) -> Search:
    """Refine start after start, and keep the best that breaks no limit.

    The result belongs to seed and starts alone, however many processes take part; a budget ends
    the search early, so that then the machine's speed has a say. An interruption (Ctrl-C) ends it
    with the best so far.

    Raises
    ------
    ConfigError
        No motion of any start holds every limit.
    """
    began_s = time.monotonic()
    trials: list[Trial] = []
    best: Candidate | None = None
    interrupted = False
    seeds = range(SEEDS_APART * seed, SEEDS_APART * seed + starts)
    stream = candidates(problem, seeds, cell.cycle_time_s, periods=periods, scheduler=scheduler)
    with console.progress("Designing", float(starts), "starts") as shown, closing(stream):
        try:
            for candidate in stream:
                elapsed_s = time.monotonic() - began_s
                worth = candidate.worth(problem)
                trials.append(Trial(elapsed_s, candidate.seed, worth, candidate.broken))
                if not candidate.broken and (
                    best is None or _key(problem, candidate) < _key(problem, best)
                ):
                    best = candidate
                line = "none holds every limit yet"
                if best is not None:
                    line = f"best condition number {best.condition_number:.3g}"
                shown.update(float(len(trials)), line)
                if budget_s is not None and elapsed_s >= budget_s:
                    break
        except KeyboardInterrupt:
            interrupted = True
    if best is None:
        reasons = trials[-1].broken[:3] if trials else ("it was interrupted",)
        raise ConfigError(
            f"none of {len(trials)} starts gave a motion that holds every limit; the last one:"
            f" {'; '.join(reasons)}. Take more --starts, a longer --period, or look at the limits,"
            " bodies and workspace"
        )
    return Search(best, tuple(trials), interrupted)


def _key(problem: ExcitationProblem, candidate: Candidate) -> tuple[float, int]:
    """Order candidates, so that the order in which they arrive does not matter."""
    return (candidate.worth(problem), candidate.seed)
