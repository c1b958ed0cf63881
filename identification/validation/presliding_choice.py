"""Which joints' friction remembers where it came from: chosen by the data, as other terms are.

With presliding the samples at rest and at reversal can be predicted. A joint gets it where that
lowers its squared error on parts of the recordings that a fit has not seen, rest and reversal
included, by more than one standard error of the difference, second by second (Breiman and others
1984). The parameters that are not linear are those of all data in every fold. A distance that the
data do not tell from zero, or that ends at a bound, is not taken.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import BoolArray, FloatArray, IntArray
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from identification.equations.segments import cut, thinned
from identification.equations.time_domain import TimeBlock, time_blocks
from identification.estimation.fitted_signals import FittedSignals, fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.estimation.smoothed_fit import weighted_by_residuals
from identification.model.torque_columns import torque_structure
from identification.regression.least_squares import Triangle

FOLDS: Final = 6
STARTS: Final = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2)
"""Presliding distances from which the fit begins [rad or m]: each joint from its best."""
DISTINCT_SIGMAS: Final = 2.0
FEWEST_SECONDS: Final = 4


@dataclass(frozen=True, eq=False)
class PreslidingChoice:
    """Which joints have presliding, and what that is worth.

    Attributes
    ----------
    joint_names : tuple of str
        Base to flange.
    distances : tuple of float or None
        Presliding distance of each joint that has it [rad or m].
    error_nm : ndarray, shape (2, n)
        RMS error of each joint without and with it on parts left out, standstill and reversal
        included [N m or N].
    """

    joint_names: tuple[str, ...]
    distances: tuple[float | None, ...]
    error_nm: FloatArray

    def robot(self, robot: RobotDescription) -> RobotDescription:
        """Return a robot with the chosen presliding."""
        return _with_presliding(robot, self.distances)


def choose_presliding(
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    options: EstimationOptions | None = None,
    *,
    folds: int = FOLDS,
) -> PreslidingChoice:
    """Choose the joints whose friction has memory.

    Parameters
    ----------
    robot : RobotDescription
        The robot with its other friction terms.
    signals : sequence of SmoothedSignals
        The recordings of the training runs. They are `thinned`.
    options : EstimationOptions, optional
        The other terms of the model, and from which speed on a joint moves.
    folds : int
        Parts that the recordings are cut into.

    Raises
    ------
    EstimationError
        The recordings are too short, or do not show the model.
    """
    options = options or EstimationOptions()
    nothing = (None,) * len(robot.joints)
    robot = _with_presliding(robot, nothing)
    parts = [p for run in signals for p in cut(thinned(run), max(1, folds // len(signals)))]
    if len(parts) < 2:
        raise EstimationError("a comparison needs two parts of recordings")
    plain = fit_smoothed(robot, parts, options)
    start = _start(robot, plain, options)
    full = fit_smoothed(_with_presliding(robot, start), parts, options)
    errors = _errors(plain, full)
    worth, sigmas = _worth(errors), full.estimate().nonlinear_sigma
    distances: list[float | None] = list(nothing)
    names = full.model.nonlinear_names
    for j, joint in enumerate(robot.joint_names):
        at = names.index(f"dp_{joint}")
        value, sigma = float(full.model.nonlinear_values[at]), float(sigmas[at])
        doubtful = value < DISTINCT_SIGMAS * sigma or names[at] in full.model.nonlinear_at_bound
        if worth[j] and not doubtful:
            distances[j] = float(f"{value:.3g}")
    return PreslidingChoice(
        robot.joint_names, tuple(distances), np.sqrt(np.nanmean(errors, axis=1))
    )


def _with_presliding(
    robot: RobotDescription, distances: Sequence[float | None]
) -> RobotDescription:
    joints = []
    for joint, distance in zip(robot.joints, distances, strict=True):
        friction = tuple(term for term in joint.friction if term != "presliding")
        update: dict[str, object] = {"friction": friction}
        if distance is not None:
            update = {"friction": (*friction, "presliding"), "presliding_distance": distance}
        joints.append(joint.model_copy(update=update))
    return robot.model_copy(update={"joints": tuple(joints)})


def _start(
    robot: RobotDescription, plain: FittedSignals, options: EstimationOptions
) -> list[float]:
    """Return the distance of `STARTS` that fits each joint best, gears losing nothing yet."""
    residuals = []
    for distance in STARTS:
        tried = _with_presliding(robot, [distance] * len(robot.joints))
        residuals.append(plain.problem.fit(options.model.build(tried), None).residual_nm)
    return [STARTS[k] for k in np.argmin(residuals, axis=0)]


@dataclass(frozen=True, eq=False)
class _Second:
    """What a second says of each joint to a fit, and what a fit is judged on."""

    train: tuple[Triangle, ...]
    judge: tuple[Triangle, ...]


def _errors(plain: FittedSignals, full: FittedSignals) -> FloatArray:
    """Return mean squared errors on seconds left out, (2, seconds, n); NaN where nothing counts.

    Without and with memory, judged on the same samples: those whose memory is known.
    """
    events = [int(run.event[-1]) + 1 for run in plain.problem.runs]
    part = np.repeat(np.arange(len(events)), events)
    errors = np.full((2, len(part), plain.model.chain.n), np.nan)
    for own, seconds in zip(errors, zip(*_seconds(plain, full), strict=True), strict=True):
        for left_out in range(len(events)):
            rest = [s.train for s, p in zip(seconds, part, strict=True) if p != left_out]
            joined = [_joined(of_joint) for of_joint in zip(*rest, strict=True)]
            names = tuple(map(str, range(joined[0].parameters)))
            values = weighted_by_residuals(joined, [], names)[0].values
            for number in np.flatnonzero(part == left_out):
                for j, triangle in enumerate(seconds[number].judge):
                    if triangle.rows:
                        own[number, j] = triangle.residual_sum(values) / triangle.rows
    return errors


def _seconds(plain: FittedSignals, full: FittedSignals) -> Iterator[tuple[_Second, _Second]]:
    """Yield what each second says of the model without memory, and of that with it."""
    widths = [len(fitted.base) for fitted in (plain, full)]
    structures = [torque_structure(fitted.model, fitted.base, False) for fitted in (plain, full)]
    held: tuple[_Second, _Second] | None = None
    current = 0
    for blocks in zip(_blocks(plain), _blocks(full), strict=True):
        event, judged = blocks[1].event, blocks[1].use
        trained = (blocks[0].use, judged)
        edges = np.flatnonzero(np.diff(event)) + 1
        for rows in np.split(np.arange(len(event)), edges):
            if held is not None and event[rows[0]] != current:
                yield held
                held = None
            current = int(event[rows[0]])
            before = held or (None, None)
            without, remembering = (
                _Second(
                    _triangles(block, rows, use, width, structure, own.train if own else None),
                    _triangles(block, rows, judged, width, structure, own.judge if own else None),
                )
                for block, use, width, structure, own in zip(
                    blocks, trained, widths, structures, before, strict=True
                )
            )
            held = (without, remembering)
    if held is not None:
        yield held


def _blocks(fitted: FittedSignals) -> Iterator[TimeBlock]:
    problem = fitted.problem
    return time_blocks(
        fitted.model,
        fitted.base,
        problem.runs,
        problem.standstill_rad_s,
        fitted.standard,
        low_passed=True,
    )


def _triangles(
    block: TimeBlock,
    rows: IntArray,
    use: BoolArray,
    width: int,
    structure: tuple[IntArray, ...],
    before: tuple[Triangle, ...] | None,
) -> tuple[Triangle, ...]:
    """Return the triangles of some rows of a block, one a joint, added to those before."""
    found = before or tuple(Triangle.empty(width, columns) for columns in structure)
    out = []
    for j, (columns, triangle) in enumerate(zip(structure, found, strict=True)):
        mine = rows[use[rows, j]]
        out.append(triangle.add(block.columns[mine[:, np.newaxis], j, columns], block.rhs[mine, j]))
    return tuple(out)


def _joined(triangles: Sequence[Triangle]) -> Triangle:
    """Return the triangles of one joint together."""
    factor = np.vstack([triangle.factor for triangle in triangles])
    rows = sum(triangle.rows for triangle in triangles)
    first = triangles[0]
    return Triangle.empty(first.parameters, first.columns).add(factor[:, :-1], factor[:, -1], rows)


def _worth(errors: FloatArray) -> BoolArray:
    """Return the joints on which memory is better by more than one standard error, (n,)."""
    gain = errors[0] - errors[1]
    seconds = np.sum(~np.isnan(gain), axis=0)
    worth = np.zeros(gain.shape[1], dtype=bool)
    for j in np.flatnonzero(seconds >= FEWEST_SECONDS):
        own = gain[~np.isnan(gain[:, j]), j]
        worth[j] = own.mean() > np.std(own, ddof=1) / math.sqrt(len(own))
    return worth
