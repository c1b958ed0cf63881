"""`wrong_scale`, `wrong_quantity`: torques in a wrong unit, or columns that are not torques.

Such data can fit a robot well. Torques scaled by a common factor fit an arm that is heavier by this
factor. Torques without gravity fit an arm without weight. Accelerations fit an arm of inertia 1.
The arm's known masses and the recorded motion reveal the mistake.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from config.arrays import BoolArray
from identification.wiring.common_mistakes import torque_units
from identification.wiring.gravity import GravitySearch
from identification.wiring.mistakes import Mistake, MistakeKind, robot_mistake, scale_mistake
from identification.wiring.moved_mass import moved_masses
from identification.wiring.possible import keeps_limits
from identification.wiring.signals import WiredSignals
from identification.wiring.trial import CondensedEquations, rows_used

AS_GOOD: Final = 0.1
KNOWN_SIGMAS: Final = 5.0
"""Smallest ratio of weight to standard deviation for which a torque factor is proposed."""
COPY_SHARE: Final = 0.15
COPY_FACTOR: Final = 0.05
ABSOLUTE: Final = "absolute value"
FEWEST_UNSIGNED: Final = 2
BELOW_ZERO: Final = 0.05
"""A filter can make an unsigned torque negative, up to this fraction of its largest value."""
NEAR_ZERO: Final = 0.1
HELD: Final = 0.3
"""Share of the moving mass's weight from which a force counts as one that contains gravity."""


def wrong_scale(
    signals: WiredSignals, stated: CondensedEquations, gravity: GravitySearch
) -> tuple[Mistake, ...]:
    """Return mistakes of all torques together, the best explanation first.

    Args:
        signals: The signals and the robot as stated in the files.
        stated: The equations of these signals.
        gravity: The same equations for any gravity direction.

    Returns:
        Empty if the torques are plausible for the robot, or if they do not show the right scale.
    """
    n = len(signals.robot.joints)
    still = np.eye(n)
    weight, fit = stated.arm_weight(still), stated.held_out(still)
    if weight is None or weight.is_plausible or not stated.explains_weight(fit):
        return ()
    low, high = weight.plausible
    unloaded = gravity.without().held_out(still).cost <= fit.cost + AS_GOOD
    if weight.share < low and unloaded and not _are_light(signals):
        nothing = signals.robot.model_copy(update={"gravity_m_s2": (0.0, 0.0, 0.0)})
        return (robot_mistake(MistakeKind.GRAVITY_REMOVED, (), nothing),)
    units: list[tuple[float, Mistake]] = []
    for unit in torque_units(signals.robot):
        right, after = stated.arm_weight(unit.torque), stated.held_out(unit.torque)
        possible = keeps_limits(unit, signals, unit.correct(signals))
        if right is None or not possible or after.cost > fit.cost + AS_GOOD:
            continue
        if low <= right.share <= high:
            units.append((abs(math.log(right.share)), unit))
    if units:
        return tuple(unit for _, unit in sorted(units, key=lambda each: each[0]))
    if abs(weight.share) < KNOWN_SIGMAS * weight.sigma:
        return ()  # the weight is only noise, so its inverse is meaningless
    factor = 1.0 / weight.share
    every = scale_mistake(MistakeKind.TORQUE_FACTOR, (), factor, n=n, torque=np.full(n, factor))
    return (every,) if keeps_limits(every, signals, every.correct(signals)) else ()


def _are_light(signals: WiredSignals) -> bool:
    """Return True if the forces on vertical prismatic joints contain weight, but of a light arm.

    The weight on such joints is constant, so every fit explains forces without it. A wrong scale
    is the explanation if these forces also accelerate the joints with too small a mass, or if their
    weight is a large fraction of that of the mass.
    """
    held = [each for each in moved_masses(signals) if each.held is not None]
    return bool(held) and all(each.is_light or (each.held or 0.0) > HELD for each in held)


def wrong_quantity(signals: WiredSignals) -> Mistake | None:
    """Return the mistake of torque columns that contain no torques, or torques without sign."""
    use = rows_used(signals)
    joints = np.flatnonzero(use.any(axis=0))
    if _are_unsigned(signals, use):
        unsigned = scale_mistake(MistakeKind.TORQUE_QUANTITY, (), 1.0, n=use.shape[1])
        return replace(unsigned, what=ABSOLUTE)
    for what, motion in (
        ("acceleration", signals.acceleration),
        ("velocity", signals.velocity),
        ("position", signals.position),
    ):
        factors, shares = np.full(use.shape[1], np.nan), np.full(use.shape[1], np.nan)
        for j in joints:
            torque, column = signals.torque_nm[use[:, j], j], motion[use[:, j], j]
            factors[j] = torque @ column / max(float(column @ column), 1e-300)
            rest = np.linalg.norm(torque - factors[j] * column)
            shares[j] = rest / max(float(np.linalg.norm(torque)), 1e-300)
        alike = shares < COPY_SHARE
        one = alike & (np.abs(factors - 1.0) < COPY_FACTOR)
        common = np.ptp(factors[joints]) < COPY_FACTOR * np.abs(factors[joints]).max()
        every = len(joints) > 1 and bool(np.all(alike[joints])) and bool(common)
        if every or one.any():
            named = joints if every else np.flatnonzero(one)
            n = use.shape[1]
            everyone = len(named) == n
            mistake = scale_mistake(
                MistakeKind.TORQUE_QUANTITY, () if everyone else tuple(named.tolist()), 1.0, n=n
            )
            return replace(mistake, what=what)
    return None


def _are_unsigned(signals: WiredSignals, use: BoolArray) -> bool:
    """Return True if no torque is negative, although two joints that turn back reach zero."""
    joints = np.flatnonzero(use.any(axis=0))
    torque, speed = signals.torque_nm[:, joints], signals.velocity[:, joints]
    most, least = torque.max(axis=0), torque.min(axis=0)
    back = (speed.min(axis=0) < 0.0) & (speed.max(axis=0) > 0.0)
    reach_zero = int(np.sum(back & (least < NEAR_ZERO * most)))
    return reach_zero >= FEWEST_UNSIGNED and bool(np.all(least > -BELOW_ZERO * most))
