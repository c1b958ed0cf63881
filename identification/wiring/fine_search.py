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
from identification.wiring.golden_section import golden_section
from identification.wiring.mistakes import (
    Mistake,
    MistakeKind,
    factor_of_one,
    late_torques,
    order_mistake,
    position_factor,
    robot_mistake,
    scale_mistake,
    torque_factor,
)
from identification.wiring.possible import keeps_limits
from identification.wiring.signals import WiredSignals, tried_delays_s
from identification.wiring.trial import CondensedEquations

LENGTHS: Final = (0.5, 0.625, 0.8, 1.25, 1.6, 2.0)
LINKS: Final = (0.625, 0.8, 1.25, 1.6)
OFFSETS: Final = (0.625, 1.6)
TORQUES: Final = (0.5, 0.67, 0.8, 1.25, 1.5, 2.0)
POSITIONS: Final = (0.5, 0.8, 1.25, 2.0)
NEAR: Final = math.log(1.3)
FACTOR_STEP: Final = 0.01
"""Accuracy of a factor that is named in a finding, relative."""

CLOCKS: Final = (0.5, 2.0)
DELAYS_S: Final = (0.02, 0.04, 0.08, 0.15)
NEAR_TIMES: Final = 2.0
"""Largest ratio of a delay of `DELAYS_S` and a delay that is tried afterwards."""
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

    With the mistake corrected, the errors of both fitted and held-out parts must be smaller, the
    gain must be distinct from zero over the parts, and the joints' limits and the arm's weight must
    be respected.

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
    return FineMistake(_refine(best, signals, stated), near[:2], ratio, explains)


def _refine(mistake: Mistake, signals: WiredSignals, stated: FlexibleFit) -> Mistake:
    """Return the mistake; the best factor or delay replaces that from the list."""
    n = len(signals.robot.joints)

    def error(other: Mistake) -> float:
        return float(stated.fit_other(other.correct(signals), other.torque).held_out.sum())

    if mistake.delay_s:
        ratios = [(each, each / mistake.delay_s) for each in tried_delays_s()]
        near = [each for each, ratio in ratios if 1.0 / NEAR_TIMES <= ratio <= NEAR_TIMES]
        return min((late_torques(n, (), each) for each in near), key=error)
    makers = {
        MistakeKind.TORQUE_FACTOR: torque_factor,
        MistakeKind.POSITION_FACTOR: _gear_factor if mistake.what else position_factor,
    }
    make = makers.get(mistake.kind)
    if make is None:
        return mistake
    (joint,) = mistake.joints

    def cost(logarithm: float) -> float:
        return error(make(n, joint, math.exp(logarithm)))

    middle = math.log(mistake.factor)
    best = math.exp(golden_section(cost, middle - NEAR, middle + NEAR, FACTOR_STEP))
    refined = make(n, joint, best)
    return refined if keeps_limits(refined, signals, refined.correct(signals)) else mistake


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
        for factor in POSITIONS:
            yield position_factor(n, j, factor)
            yield _gear_factor(n, j, factor)
        for factor in TORQUES:
            yield torque_factor(n, j, factor)
    for j in range(n - 1):
        order = list(range(n))
        order[j], order[j + 1] = j + 1, j
        yield order_mistake(MistakeKind.AXIS_ORDER, (j, j + 1), order)
    for clock in CLOCKS:
        yield replace(scale_mistake(MistakeKind.CLOCK, (), clock, n=n), clock=clock)
    for delay_s in DELAYS_S:
        yield late_torques(n, (), delay_s)
        yield late_torques(n, (), -delay_s)


def _gear_factor(n: int, j: int, factor: float) -> Mistake:
    mistake = replace(
        position_factor(n, j, factor), torque=np.diag(factor_of_one(n, j, 1.0 / factor))
    )
    what = (
        f"computed with another gear ratio: multiply the position by {factor:.3g} and the torque by"
        f" {1.0 / factor:.3g}"
    )
    return replace(mistake, what=what)


def _lengths(robot: RobotDescription) -> Iterator[Mistake]:
    rows = range(len(robot.kinematics.rows))
    for factor in LENGTHS:
        what = f"the lengths in the kinematic table must be about {factor:g} times what is stated"
        yield table_factors(robot, (), what, {i: {"a_m": factor, "d_m": factor} for i in rows})
    for i in rows:
        for key, factors in (("a_m", LINKS), ("d_m", OFFSETS if i else ())):
            if abs(getattr(robot.kinematics.rows[i], key)) < ABOUT:
                continue
            for factor in factors:
                what = f"{key} of row {i + 1} must be about {factor:g} times what is stated"
                yield table_factors(robot, (i,), what, {i: {key: factor}})


def _axes(robot: RobotDescription) -> Iterator[Mistake]:
    """Yield wrong signs of one twist angle (alpha), and of two consecutive ones."""
    twisted = [
        i for i, row in enumerate(robot.kinematics.rows) if abs(math.sin(row.alpha_rad)) > ABOUT
    ]
    sets = [(i,) for i in twisted] + list(pairwise(twisted))
    for own in sets:
        named = " and ".join(str(i + 1) for i in own)
        what = f"alpha_rad of row {named} has the wrong sign"
        yield table_factors(robot, own, what, {i: {"alpha_rad": -1.0} for i in own})


def table_factors(
    robot: RobotDescription,
    joints: tuple[int, ...],
    what: str,
    factors: dict[int, dict[str, float]],
) -> Mistake:
    """Return the mistake of wrong numbers in the kinematic table.

    Args:
        robot: The robot as described in its file.
        joints: The rows concerned, from 0; empty for all rows.
        what: The mistake in words.
        factors: Factors of the stated numbers, by row and key.
    """
    table = robot.kinematics

    def right(i: int, row: KinematicRow) -> KinematicRow:
        own = factors.get(i, {})
        return row.model_copy(update={key: own[key] * getattr(row, key) for key in own})

    rows = tuple(right(i, row) for i, row in enumerate(table.rows))
    other = robot.model_copy(update={"kinematics": table.model_copy(update={"rows": rows})})
    return replace(robot_mistake(MistakeKind.KINEMATICS, joints, other), what=what)


def _supports_weight(mistake: Mistake, undone: WiredSignals, signals: WiredSignals) -> bool:
    condensed = CondensedEquations.of(signals if mistake.multiplies else undone)
    torque = mistake.torque if mistake.multiplies else np.eye(len(mistake.offset_rad))
    return condensed.supports_weight(mistake, torque)
