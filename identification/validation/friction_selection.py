"""Which friction a robot's joints have, chosen by the data alone: cross-validation.

Recordings are cut into contiguous parts, since neighbouring rows are not independent. Each part is
predicted by an estimate from all others. A joint gets the simplest terms whose squared error is
within one standard error of the best terms' (the one-standard-error rule: Breiman and others 1984),
the standard error being that of the difference, second by second. Friction acts on its own joint,
so joints choose one by one: first all with the same terms, then each with fewer beside the others.
What they choose together is not taken if the same terms on all joints are better. A term is not
taken if the data do not tell its nonlinear parameters from zero, or leave them at their bounds, or
if friction at low speed came out below Coulomb's: at a reversal that stands for memory. An
offset that they do tell from zero stays, whatever the seconds gain: without it the offset is taken
for gravity, and in other poses it is not.
Information criteria stand beside it: AIC (Akaike 1974) and BIC (Schwarz 1978), with as many
independent values as the band holds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.friction_terms import FrictionTerm
from config.robot.robot import RobotDescription
from identification.choices import STANDSTILL_RAD_S
from identification.equations.segments import cut, thinned
from identification.equations.torque_channel import TorqueChannel
from identification.equations.warming import Warming
from identification.estimation.options import EstimationOptions
from identification.model.options import ModelOptions
from identification.validation.friction_trials import (
    CondensedTrials,
    Terms,
    Trial,
    Trials,
    with_friction,
)
from identification.validation.presliding_choice import PreslidingChoice
from identification.validation.stribeck_choice import StribeckChoice

FOLDS: Final = 6

CLASSICAL: Final[Terms] = ("coulomb", "viscous")
OFFSET: Final[Terms] = ("offset",)
FRICTION_CANDIDATES: Final[tuple[Terms, ...]] = (
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
    presliding : PreslidingChoice or None
        Which joints' friction has memory besides; None where that was not asked.
    stribeck : StribeckChoice or None
        Which joints have Stribeck friction beside memory, or in its place; None where none was
        tried.
    warming : Warming or None
        How joints warm up, whose friction depends on temperature besides; None where they do not
        show it.
    channel : TorqueChannel or None
        What the recorded torque went through; None where that was not asked.
    refused_delay_s : tuple of float
        Delays of each joint's torque that no bus explains and that are not in `channel`, 0 for the
        other joints [s]; empty where none was found.
    """

    joint_names: tuple[str, ...]
    trials: tuple[Trial, ...]
    chosen: tuple[Terms, ...]
    combined: Trial
    presliding: PreslidingChoice | None = None
    stribeck: StribeckChoice | None = None
    warming: Warming | None = None
    channel: TorqueChannel | None = None
    refused_delay_s: tuple[float, ...] = ()

    def robot(self, robot: RobotDescription) -> RobotDescription:
        """Return a robot with the chosen friction terms."""
        robot = with_friction(robot, self.chosen)
        robot = robot if self.presliding is None else self.presliding.robot(robot)
        robot = robot if self.stribeck is None else self.stribeck.robot(robot)
        return robot if self.warming is None else self.warming.robot(robot)


def choose_friction(
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    *,
    options: ModelOptions | None = None,
    candidates: Sequence[Terms] = FRICTION_CANDIDATES,
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
        The recordings are too short, or do not show the models.
    """
    options = replace(options or ModelOptions(), friction_terms=None, nonlinear=None)
    parts = [p for run in signals for p in cut(thinned(run), max(1, folds // len(signals)))]
    if len(parts) < 2 or not candidates:
        raise EstimationError("a comparison needs two parts of recordings, and candidates")
    how = EstimationOptions(model=options, standstill_rad_s=standstill_rad_s)
    trials = CondensedTrials.begin(robot, parts, candidates, how)
    return select(robot.joint_names, candidates, trials, watch)


def select(
    joint_names: tuple[str, ...],
    candidates: Sequence[Terms],
    trials: Trials,
    watch: Watch | None = None,
) -> Comparison:
    """Choose each joint's terms by trials.

    Parameters
    ----------
    joint_names : tuple of str
        Base to flange.
    candidates : sequence of tuple of str
        Terms to compare, from the simplest to the richest.
    trials : Trials
        What judges them.
    watch : callable, optional
        Told of the progress.
    """
    joints, total = range(len(joint_names)), len(candidates) + 1
    rows: list[Trial] = []
    for number, terms in enumerate(candidates):
        if watch is not None:
            watch(number, total, ", ".join(terms))
        rows.append(trials.of([terms] * len(joints), terms))

    def lightened(chosen: list[Terms], some: Iterable[int]) -> tuple[list[Terms], Trial]:
        """Return terms of which some joints have no more than they need beside the others'."""
        combined = trials.of(chosen)
        for j in some:
            for fewer in (c for c in candidates if set(c) < set(chosen[j])):
                if watch is not None:
                    watch(len(rows), total, f"{joint_names[j]} with {', '.join(fewer)}")
                tried = [*chosen[:j], fewer, *chosen[j + 1 :]]
                trial = trials.of(tried)
                if _simplest((trial, combined), j) == 0:
                    chosen, combined = tried, trial
                    break
        return chosen, combined

    # What one joint lacks bends the others' errors while all have the same terms. With each at its
    # own, a joint may turn out to need less.
    chosen, combined = lightened([candidates[_simplest(rows, j)] for j in joints], joints)
    better = _better(rows, combined)
    if better is not None:
        chosen, combined = [better.terms] * len(joints), replace(better, terms=())
    refused: list[set[FrictionTerm]] = [set() for _ in joints]
    while any(doubtful := trials.doubtful(chosen)):
        for j in (j for j in joints if doubtful[j]):
            refused[j].update(doubtful[j])
            left = [row for row in rows if not refused[j] & set(row.terms)] or rows[:1]
            chosen[j] = left[_simplest(left, j)].terms
        chosen, combined = lightened(chosen, [j for j in joints if doubtful[j]])
    bare = [j for j in joints if chosen[j] + OFFSET in candidates]
    if bare:
        tried = [terms + OFFSET if j in bare else terms for j, terms in enumerate(chosen)]
        told = trials.offsets_told(tried)
        if any(told[j] for j in bare):
            chosen = [tried[j] if told[j] else chosen[j] for j in joints]
            combined = trials.of(chosen)
    return Comparison(joint_names, tuple(rows), tuple(chosen), combined)


def _simplest(trials: Sequence[Trial], joint: int) -> int:
    """Return the first trial whose error on a joint is within one standard error of the best."""
    return _first_good(np.array([trial.event_errors[:, joint] for trial in trials]))


def _better(rows: Sequence[Trial], combined: Trial) -> Trial | None:
    """Return the first row that is better than the combined model, all joints together, if any is.

    Better is by more than one standard error; each joint's errors count in units of their mean.
    """
    rivals = [combined, *rows]
    unit = np.nanmean(combined.event_errors, axis=0)
    errors = np.array([np.nansum(trial.event_errors / unit, axis=1) for trial in rivals])
    first = _first_good(errors)
    return None if first == 0 else rivals[first]


def _first_good(errors: FloatArray) -> int:
    """Return the first of errors (trials, events) whose mean is within one standard error of best.

    The standard error is that of the difference. Events with NaN are left out.
    """
    errors = errors[:, ~np.isnan(errors).any(axis=0)]
    if errors.shape[1] < 2:
        return 0
    means = errors.mean(axis=1)
    best = int(np.argmin(means))
    difference = errors - errors[best]
    standard_error = np.std(difference, axis=1, ddof=1) / math.sqrt(errors.shape[1])
    return int(np.argmax(means <= means[best] + standard_error))
