"""The search for an optimal excitation as a command runs it: progress, budget, interruption."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass

import numpy as np
import typer

from acquisition.motion.fourier import samples_of_period
from acquisition.supervision.stop_reason import StopCode
from config.arrays import FloatArray
from config.cell.cell import CellConfig
from config.errors import ConfigError
from config.process.termination import signals_handled
from config.robot.robot import RobotDescription
from dynamics.model.cad import cad_parameters
from dynamics.model.robot_model import RobotModel, regressor
from identification.calibration.base_reaction import base_limits, with_known_mass
from identification.design.criteria import Condition, Criterion, DOptimal, Goals
from identification.design.model import design_model
from identification.design.problem import ExcitationProblem
from identification.design.search import Candidate, candidates
from identification.estimation.estimate import Estimate
from identification.model.base_parameters import BaseParameters, base_parameters
from rid_daq.terminal.console import Console
from rid_daq.terminal.exit_codes import exit_code_of_stop

EXPECTED_NOISE_SHARE = 0.01
LIMIT_FRACTION = 0.95
SEEDS_APART = 10_000
TORQUE = "torque"
TORQUE_POSES = 50


@dataclass(frozen=True)
class Trial:
    """One start of a search: when it was ready, and what came of it."""

    elapsed_s: float
    seed: int
    objective: float
    broken: tuple[str, ...]


@dataclass(frozen=True)
class Search:
    """A finished search: the best motion that breaks nothing, and every trial in time."""

    criterion: Criterion
    best: Candidate
    trials: tuple[Trial, ...]
    interrupted_by: signal.Signals | None

    @property
    def curve(self) -> tuple[Trial, ...]:
        """The trials that were the best so far when they were ready."""
        best: list[Trial] = []
        for trial in self.trials:
            if not trial.broken and (not best or trial.objective < best[-1].objective):
                best.append(trial)
        return tuple(best)


def chosen_criterion(robot: RobotDescription, name: str, wanted: Sequence[str]) -> Criterion:
    """Return the criterion of a command's words.

    Parameters
    ----------
    robot : RobotDescription
        The robot.
    name : str
        "condition" or "d-optimal", where nothing is wanted in particular.
    wanted : sequence of str
        Base parameters by name, or `torque` for what the model predicts all over the limits.

    Raises
    ------
    ConfigError
        A name is none of the base parameters.
    """
    if not wanted:
        return Condition() if name == "condition" else DOptimal()
    model = design_model(robot)
    base = base_parameters(model)
    rows: list[FloatArray] = []
    for parameter in wanted:
        if parameter == TORQUE:
            rows += list(_predictions(robot, model, base))
        elif parameter in base.names:
            rows.append(np.eye(len(base))[base.names.index(parameter)])
        else:
            raise ConfigError(
                f"--for {parameter}: is not one of the parameters that torques can tell, which are"
                f" {TORQUE}, {', '.join(base.names)}"
            )
    return Goals(np.array(rows))


def excitation_problem(
    cell: CellConfig,
    robot: RobotDescription,
    *,
    period_s: float,
    harmonics: int,
    criterion: Criterion,
    model: Estimate | None = None,
    given: Sequence[Estimate] = (),
) -> ExcitationProblem:
    """Put a design task together from a cell and what is known of its robot.

    Torque limits are held by `model`, else by the robot file's `cad`, else not at all. The noise
    to expect is what `model` or an earlier estimate left over, else a share of the torque limits.

    Raises
    ------
    ConfigError
        A model is of another robot or has other terms, or the period does not suit the cell.
    """
    samples = samples_of_period(period_s, cell.cycle_time_s)
    if 2 * harmonics >= samples:
        raise ConfigError(
            f"harmonic {harmonics} of a period of {samples} cycles is beyond half the sampling"
            " frequency: use fewer harmonics or a longer period"
        )
    planned = design_model(robot)
    noise = EXPECTED_NOISE_SHARE * np.array([joint.limits.torque for joint in robot.joints])
    known = [*given, *([model] if model is not None else [])]
    for estimate in known:
        if estimate.robot.joint_names != robot.joint_names:
            raise ConfigError(
                f"a model is of robot {estimate.robot.name!r}, the cell's is {robot.name!r}: give"
                " models of this robot"
            )
    if known:
        noise = np.maximum(known[-1].residual_nm, 1e-4 * noise)
    parameters = None
    if model is not None:
        parameters = _standard_values(planned, model)
    elif robot.cad is not None:
        parameters = cad_parameters(planned, robot)[0]
    return ExcitationProblem(
        robot=robot,
        period_s=period_s,
        harmonics=harmonics,
        criterion=criterion,
        limit_fraction=LIMIT_FRACTION,
        expected_noise_nm=noise,
        parameters=parameters,
        given=_information(base_parameters(planned), given) if given else None,
        workspace=cell.workspace,
        base_limits=_base_limits(cell, parameters, model),
    )


def _base_limits(
    cell: CellConfig, parameters: FloatArray | None, model: Estimate | None
) -> FloatArray | None:
    """Return what the base may see, where the cell says so and a model can tell."""
    if cell.plate is None or cell.plate.limits is None or parameters is None:
        return None
    if model is not None and model.options.kind == "internal":
        return None
    return base_limits(cell.plate.limits)


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
    seeds = range(SEEDS_APART * seed, SEEDS_APART * seed + starts)
    stream = candidates(problem, seeds, cell.cycle_time_s, periods=periods, scheduler=scheduler)
    with (
        signals_handled(_leave_once()) as interruption,
        console.progress("Designing", float(starts), "starts") as shown,
        closing(stream),
        suppress(KeyboardInterrupt),
    ):
        for candidate in stream:
            elapsed_s = time.monotonic() - began_s
            check = candidate.check
            trials.append(Trial(elapsed_s, candidate.seed, check.objective, check.broken))
            if not check.broken and (best is None or _key(candidate) < _key(best)):
                best = candidate
            line = "none holds every limit yet"
            if best is not None:
                line = f"best {problem.criterion.describe(best.check.objective)}"
            shown.update(float(len(trials)), line)
            if budget_s is not None and elapsed_s >= budget_s:
                break
    if best is None:
        if interruption.signal is not None:
            console.say("Interrupted before any motion was found; nothing was written.")
            raise typer.Exit(exit_code_of_stop(StopCode.INTERRUPTED, interruption.signal))
        reasons = trials[-1].broken[:3] if trials else ("there was no time for any",)
        raise ConfigError(
            f"none of {len(trials)} starts gave a motion that holds every limit; the last one:"
            f" {'; '.join(reasons)}. Take more --starts, a longer --period, or look at the limits,"
            " bodies and workspace"
        )
    return Search(problem.criterion, best, tuple(trials), interruption.signal)


def _leave_once() -> Callable[[], None]:
    """Return what interrupts the search at its first call, and lets it clean up at others."""
    left = False

    def leave() -> None:
        nonlocal left
        if not left:
            left = True
            raise KeyboardInterrupt

    return leave


def _key(candidate: Candidate) -> tuple[float, int]:
    """Order candidates, so that the order in which they arrive does not matter."""
    return (candidate.check.objective, candidate.seed)


def _predictions(robot: RobotDescription, model: RobotModel, base: BaseParameters) -> FloatArray:
    """Return what predicts the torques of random motions within the limits, (rows, b)."""
    random = np.random.default_rng(0)
    limits = [joint.limits for joint in robot.joints]
    shape = (TORQUE_POSES, len(limits))
    low, high = ([getattr(x, f"position_{end}") for x in limits] for end in ("min", "max"))
    q = random.uniform(low, high, shape)
    v = random.uniform(-1.0, 1.0, shape) * [each.velocity for each in limits]
    a = random.uniform(-1.0, 1.0, shape) * [each.acceleration for each in limits]
    return base.columns(regressor(model, q, v, a)).reshape(-1, len(base))


def _standard_values(planned: RobotModel, estimate: Estimate) -> FloatArray:
    """Return an estimate's parameters in the order of the planned model, 0 where it has none."""
    standard = estimate.standard_values
    if estimate.options.kind != "internal":
        standard = estimate.base.to_standard(with_known_mass(estimate)[0])
    found = dict(zip(estimate.base.standard_names, standard, strict=True))
    return np.array([found.get(name, 0.0) for name in planned.parameter_names])


def _information(base: BaseParameters, given: Sequence[Estimate]) -> FloatArray:
    """Return what earlier estimates know, for one sample of a run worth as many equations.

    Friction is left out: it changes from day to day, and is estimated anew (theory: section 4).
    """
    information = np.zeros((len(base), len(base)))
    for estimate in given:
        carried = [k for k, rigid in enumerate(_carried(estimate)) if rigid]
        words = [estimate.base.expressions[k] for k in carried]
        missing = [text for text in words if text not in base.expressions]
        if missing:
            raise ConfigError(
                f"the model of robot {estimate.robot.name!r} knows {missing[0]}, which this cell's"
                " robot has not: give models of the same robot file with all its terms"
            )
        places = [base.expressions.index(text) for text in words]
        covariance = estimate.covariance_residual[np.ix_(carried, carried)]
        samples = estimate.equations / len(estimate.robot.joints)
        information[np.ix_(places, places)] += np.linalg.inv(covariance) / samples
    return information


def _carried(estimate: Estimate) -> list[bool]:
    """Return which base parameters are worth as much tomorrow: all but friction's."""
    friction = estimate.model.parameter_groups.get("friction", slice(0, 0))
    changing = set(range(*friction.indices(len(estimate.model.parameter_names))))
    return [head not in changing for head in estimate.base.kept]
