"""Which friction a robot's joints have, chosen by the data alone: cross-validation.

Recordings are cut into contiguous parts, since neighbouring rows are not independent. Each part is
predicted by an estimate from all others. A joint gets the simplest terms whose squared error is
within one standard error of the best terms' (the one-standard-error rule: Breiman and others 1984),
the standard error being that of the difference, second by second. Friction acts on its own joint,
so joints choose one by one: first all with the same terms, then each with fewer beside the others.
Information criteria stand beside it: AIC (Akaike 1974) and BIC (Schwarz 1978), with as many
independent values as the band holds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.robot import FrictionTerm, RobotDescription
from identification.equations.segments import cut, thinned
from identification.estimation.condensed import CondensedRecordings
from identification.estimation.options import STANDSTILL_RAD_S, EstimationOptions
from identification.model.options import ModelOptions

FOLDS: Final = 6
NONLINEAR: Final[tuple[FrictionTerm, ...]] = ("load", "stribeck")

CLASSICAL: Final[tuple[FrictionTerm, ...]] = ("coulomb", "viscous")
FRICTION_CANDIDATES: Final[tuple[tuple[FrictionTerm, ...], ...]] = (
    CLASSICAL,
    (*CLASSICAL, "offset"),
    (*CLASSICAL, "offset", "cubic"),
    (*CLASSICAL, "offset", "cube_root"),
    (*CLASSICAL, "offset", "load"),
    (*CLASSICAL, "offset", "stribeck"),
    (*CLASSICAL, "offset", "cube_root", "cubic"),
    (*CLASSICAL, "offset", "cubic", "load"),
    (*CLASSICAL, "offset", "cube_root", "load"),
    (*CLASSICAL, "offset", "cube_root", "cubic", "load"),
)
"""From the simplest to the richest."""

Watch = Callable[[int, int, str], None]
"""Told how many of how many candidates are done, and which is next."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One candidate, judged on data that it has not seen.

    Attributes
    ----------
    terms : tuple of str
        The friction terms of every joint; empty for the model put together joint by joint.
    error_nm : ndarray, shape (n,)
        RMS error of each joint on moving samples of the parts left out [N m or N].
    event_errors : ndarray, shape (events, n)
        Mean squared error of each second; NaN where the joint did not move.
    parameters : int
        Linear and nonlinear parameters.
    aic, bic : float
        Information criteria of the fit to all data; the smaller the better.
    """

    terms: tuple[FrictionTerm, ...]
    error_nm: FloatArray
    event_errors: FloatArray
    parameters: int
    aic: float
    bic: float


@dataclass(frozen=True, eq=False)
class Comparison:
    """The trials, and what was chosen.

    Attributes
    ----------
    joint_names : tuple of str
        Base to flange.
    trials : tuple of Trial
        One a candidate, in the order of complexity.
    chosen : tuple of tuple of str
        Each joint's friction terms.
    combined : Trial
        The model with each joint's own terms.
    """

    joint_names: tuple[str, ...]
    trials: tuple[Trial, ...]
    chosen: tuple[tuple[FrictionTerm, ...], ...]
    combined: Trial

    def robot(self, robot: RobotDescription) -> RobotDescription:
        """Return a robot with the chosen friction terms."""
        return with_friction(robot, self.chosen)


def choose_friction(
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    *,
    options: ModelOptions | None = None,
    candidates: Sequence[tuple[FrictionTerm, ...]] = FRICTION_CANDIDATES,
    standstill_rad_s: float = STANDSTILL_RAD_S,
    folds: int = FOLDS,
    watch: Watch | None = None,
) -> Comparison:
    """Choose each joint's friction terms.

    Parameters
    ----------
    robot : RobotDescription
        The robot; its own friction terms do not count.
    signals : sequence of SmoothedSignals
        The recordings of the training runs; never those of the validation. They are `thinned`.
    options : ModelOptions, optional
        The other terms of the model.
    candidates : sequence of tuple of str
        Terms to compare, from the simplest to the richest.
    standstill_rad_s : float
        Slower samples do not count.
    folds : int
        Parts that the recordings are cut into.
    watch : callable, optional
        Told of the progress.

    Raises
    ------
    EstimationError
        The recordings are too short, or do not show the simplest model.
    """
    options = replace(options or ModelOptions(), friction_terms=None, nonlinear=None)
    parts = [part for run in signals for part in cut(thinned(run), max(1, folds // len(signals)))]
    if len(parts) < 2 or not candidates:
        raise EstimationError("a comparison needs two parts of recordings, and candidates")
    everything: tuple[FrictionTerm, ...] = tuple(
        dict.fromkeys(term for terms in candidates for term in terms)
    )
    linear = max(candidates, key=lambda terms: len(_linear(terms)))
    data = CondensedRecordings.of(
        with_friction(robot, [everything] * len(robot.joints)),
        with_friction(robot, [_linear(linear)] * len(robot.joints)),
        parts,
        EstimationOptions(model=options, standstill_rad_s=standstill_rad_s),
    )
    trials: list[Trial] = []
    for number, terms in enumerate(candidates):
        if watch is not None:
            watch(number, len(candidates) + 1, ", ".join(terms))
        alike = with_friction(robot, [terms] * len(robot.joints))
        trials.append(_trial(data, parts, alike, terms))
    best = [_simplest(trials, j) for j in range(len(robot.joints))]
    chosen = [candidates[number] for number in best]
    # What one joint lacks bends the others' errors while all have the same terms. With each at its
    # own, a joint may turn out to need less.
    combined = _trial(data, parts, with_friction(robot, chosen), ())
    for j, terms in enumerate(chosen):
        for fewer in (c for c in candidates if set(c) < set(terms)):
            if watch is not None:
                name = robot.joint_names[j]
                watch(len(candidates), len(candidates) + 1, f"{name} with {', '.join(fewer)}")
            tried = [*chosen[:j], fewer, *chosen[j + 1 :]]
            trial = _trial(data, parts, with_friction(robot, tried), ())
            if _simplest((trial, combined), j) == 0:
                chosen, combined = tried, trial
                break
    return Comparison(
        joint_names=robot.joint_names,
        trials=tuple(trials),
        chosen=tuple(chosen),
        combined=combined,
    )


def _linear(terms: tuple[FrictionTerm, ...]) -> tuple[FrictionTerm, ...]:
    return tuple(term for term in terms if term not in NONLINEAR)


def with_friction(
    robot: RobotDescription, terms: Sequence[tuple[FrictionTerm, ...]]
) -> RobotDescription:
    """Return a robot whose joints have these friction terms, one tuple a joint."""
    joints = (
        joint.model_copy(
            update={"friction": own, "efficiency": None if "load" in own else joint.efficiency}
        )
        for joint, own in zip(robot.joints, terms, strict=True)
    )
    return robot.model_copy(update={"joints": tuple(joints)})


def _trial(
    data: CondensedRecordings,
    parts: Sequence[SmoothedSignals],
    robot: RobotDescription,
    terms: tuple[FrictionTerm, ...],
) -> Trial:
    problem = data.problem(robot)
    whole = problem.fit()
    # Each fold starts from the nonlinear parameters of all data, and finds its own.
    errors = np.concatenate(
        [
            problem.mean_squares(problem.fit(whole.model, left_out=part), part)
            for part in range(len(parts))
        ]
    )
    duration_s = sum(len(part) * part.sample_period_s for part in parts)
    moving = whole.fit.rows_used / sum(len(part) for part in parts)
    values = 2.0 * parts[0].cutoff_hz * duration_s * moving
    fit = float(np.sum(values * np.log(whole.fit.residual_nm**2)))
    return Trial(
        terms=terms,
        error_nm=np.sqrt(np.nanmean(errors, axis=0)),
        event_errors=errors,
        parameters=whole.parameters,
        aic=fit + 2.0 * whole.parameters,
        bic=fit + math.log(float(values.sum())) * whole.parameters,
    )


def _simplest(trials: Sequence[Trial], joint: int) -> int:
    """Return the first trial whose error on a joint is within one standard error of the best."""
    errors = np.array([trial.event_errors[:, joint] for trial in trials])
    errors = errors[:, ~np.isnan(errors).any(axis=0)]
    if errors.shape[1] < 2:
        return 0
    means = errors.mean(axis=1)
    best = int(np.argmin(means))
    difference = errors - errors[best]
    standard_error = np.std(difference, axis=1, ddof=1) / math.sqrt(errors.shape[1])
    return int(np.argmax(means <= means[best] + standard_error))
