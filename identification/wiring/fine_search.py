"""`find_fine_mistake`: mistakes that hardly change the residual of a simple fit.

On arms with six axes, wrong lengths, axes, gears or a wrong clock have little visible effect on the
torques: the many parameters compensate most of it, and friction hides the rest. `FlexibleFit` makes
the effect visible.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from config.robot.kinematic_table import KinematicRow
from config.robot.robot import RobotDescription
from identification.wiring.flexible_fit import FlexibleFit
from identification.wiring.mistakes import (
    Mistake,
    MistakeKind,
    order_mistake,
    robot_mistake,
    scale_mistake,
)
from identification.wiring.possible import keeps_limits
from identification.wiring.signals import WiredSignals
from identification.wiring.trial import CondensedEquations

LENGTHS: Final = (0.5, 0.625, 0.8, 1.25, 1.6, 2.0)
LINKS: Final = (0.625, 0.8, 1.25, 1.6)
OFFSETS: Final = (0.625, 1.6)
FACTORS: Final = (0.5, 2.0)
CLOCKS: Final = (0.5, 2.0)
ABOUT: Final = 1e-6
FITTED_RATIO: Final = 0.97
HELD_OUT_RATIO: Final = 0.94
STUDENT: Final = -2.0
AS_GOOD: Final = 0.05
EXPLAINED_SHARE: Final = 0.15


@dataclass(frozen=True, eq=False)
class FineMistake:
    """A mistake that is visible on held-out parts.

    Attributes:
        mistake: The best explanation.
        alternatives: Other mistakes that explain nearly as much.
        ratio: Squared error of held-out parts with the mistake corrected, relative to that as
            stated.
        explains: True if the residual of every joint is small after the correction.
    """

    mistake: Mistake
    alternatives: tuple[Mistake, ...]
    ratio: float
    explains: bool


def find_fine_mistake(signals: WiredSignals) -> FineMistake | None:
    """Return the mistake that explains held-out parts best; None if none does distinctly better.

    With the mistake corrected, the errors of both fitted and held-out parts must be smaller, and
    the gain must be distinct from zero over the parts.

    Args:
        signals: The signals and the robot as stated in the files.
    """
    stated = FlexibleFit.of(signals)
    if stated is None:
        return None
    found = []
    for mistake in fine_mistakes(signals.robot):
        undone = mistake.correct(signals)
        if not keeps_limits(mistake, signals, undone):
            continue
        fit = stated.fit_other(undone, mistake.torque)
        ratio = float(fit.held_out.sum() / stated.held_out.sum())
        fitted = float(fit.fitted.sum() / stated.fitted.sum())
        if fitted > FITTED_RATIO or ratio > HELD_OUT_RATIO:
            continue
        gains = np.log(fit.held_out / stated.held_out)
        spread = float(np.std(gains, ddof=1)) / math.sqrt(len(gains))
        if float(np.mean(gains)) < STUDENT * spread and _supports_weight(mistake, undone, signals):
            found.append((ratio, mistake, bool(np.all(fit.held_out_share < EXPLAINED_SHARE))))
    if not found:
        return None
    found.sort(key=lambda each: each[0])
    ratio, best, explains = found[0]
    near = tuple(mistake for other, mistake, _ in found[1:] if other - ratio < AS_GOOD * ratio)
    return FineMistake(best, near[:2], ratio, explains)


def table_mistake(signals: WiredSignals) -> Mistake:
    """Return the mistake of a kinematic table with more than one wrong number."""
    what = "the kinematic table does not fit the robot, in more than one number"
    return replace(robot_mistake(MistakeKind.KINEMATICS, (), signals.robot), what=what)


def fine_mistakes(robot: RobotDescription) -> Iterator[Mistake]:
    """Yield wrong lengths and axes of the kinematic table, wrong gears, factors, orders, clocks."""
    n = len(robot.joints)
    yield from _lengths(robot)
    yield from _axes(robot)
    for j in range(n):
        for factor in FACTORS:
            alone = np.ones(n)
            alone[j] = factor
            yield scale_mistake(MistakeKind.POSITION_FACTOR, (j,), factor, n=n, position=alone)
            yield scale_mistake(MistakeKind.TORQUE_FACTOR, (j,), factor, n=n, torque=alone)
            gear = scale_mistake(
                MistakeKind.POSITION_FACTOR, (j,), factor, n=n, position=alone, torque=1.0 / alone
            )
            gear_words = (
                f"computed with another gear ratio: multiply the position by {factor:g} and the"
                f" torque by {1.0 / factor:g}"
            )
            yield replace(gear, what=gear_words)
    for j in range(n - 1):
        order = list(range(n))
        order[j], order[j + 1] = j + 1, j
        yield order_mistake(MistakeKind.AXIS_ORDER, (j, j + 1), order)
    for clock in CLOCKS:
        yield replace(scale_mistake(MistakeKind.CLOCK, (), clock, n=n), clock=clock)


def _lengths(robot: RobotDescription) -> Iterator[Mistake]:
    rows = range(len(robot.kinematics.rows))
    for factor in LENGTHS:
        what = f"the lengths in the kinematic table must be about {factor:g} times what is stated"
        yield _table(robot, (), what, {i: {"a_m": factor, "d_m": factor} for i in rows})
    for i in rows:
        for key, factors in (("a_m", LINKS), ("d_m", OFFSETS if i else ())):
            if abs(getattr(robot.kinematics.rows[i], key)) < ABOUT:
                continue
            for factor in factors:
                what = f"{key} of row {i + 1} must be about {factor:g} times what is stated"
                yield _table(robot, (i,), what, {i: {key: factor}})


def _axes(robot: RobotDescription) -> Iterator[Mistake]:
    """Yield wrong signs of one twist angle (alpha), and of two consecutive ones."""
    twisted = [
        i for i, row in enumerate(robot.kinematics.rows) if abs(math.sin(row.alpha_rad)) > ABOUT
    ]
    sets = [(i,) for i in twisted] + list(pairwise(twisted))
    for own in sets:
        named = " and ".join(str(i + 1) for i in own)
        what = f"alpha_rad of row {named} has the wrong sign"
        yield _table(robot, own, what, {i: {"alpha_rad": -1.0} for i in own})


def _table(
    robot: RobotDescription,
    joints: tuple[int, ...],
    what: str,
    factors: dict[int, dict[str, float]],
) -> Mistake:
    table = robot.kinematics

    def right(i: int, row: KinematicRow) -> KinematicRow:
        own = factors.get(i, {})
        return row.model_copy(update={key: own[key] * getattr(row, key) for key in own})

    rows = tuple(right(i, row) for i, row in enumerate(table.rows))
    other = robot.model_copy(update={"kinematics": table.model_copy(update={"rows": rows})})
    return replace(robot_mistake(MistakeKind.KINEMATICS, joints, other), what=what)


def _supports_weight(mistake: Mistake, undone: WiredSignals, signals: WiredSignals) -> bool:
    condensed = CondensedEquations.of(undone if mistake.moves else signals)
    torque = np.eye(len(mistake.offset_rad)) if mistake.moves else mistake.torque
    return condensed.supports_weight(mistake, torque)
