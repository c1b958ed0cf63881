"""`find_mistakes`: the mistakes whose correction explains recordings far better."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from config.arrays import FloatArray
from identification.wiring.common_mistakes import OFFSET_STEPS, common_mistakes
from identification.wiring.fine_search import find_fine_mistake, table_mistake
from identification.wiring.golden_section import golden_section
from identification.wiring.gravity import GravitySearch
from identification.wiring.mistakes import Mistake, MistakeKind, zero_mistake
from identification.wiring.possible import keeps_limits, keeps_torques
from identification.wiring.scale import wrong_quantity, wrong_scale
from identification.wiring.signals import WiredSignals
from identification.wiring.trial import CondensedEquations, WiringTrial, plain_model
from identification.wiring.weight import ArmWeight

AS_GOOD: Final = 0.1
OBLIQUE_GAIN: Final = 0.3
"""Decrease of the cost from which an oblique gravity excludes a wrong zero of the first joint.

Such a zero turns gravity around the first axis, so an oblique gravity, which has one more unknown,
always fits at least as well.
"""
MOST_MISTAKES: Final = 3
MOST_ALTERNATIVES: Final = 3
ANGLE_STEP_RAD: Final = 1e-3
SCREENED_RAD: Final = 0.1
"""Largest error of a zero position that was searched on a subset of the rows [rad]."""


@dataclass(frozen=True, eq=False)
class FoundMistake:
    """A mistake that was found, and others that explain the data as well.

    Attributes:
        mistake: The best explanation.
        alternatives: Other mistakes that explain the data as well.
        before, after: The fit with the mistake, and with the mistake corrected.
        weight: Weight of the arm from the torques as stated, if only this weight reveals the
            mistake.
        held_out_ratio: Squared error of held-out parts with the mistake corrected, relative to that
            as stated, if this ratio reveals the mistake.
    """

    mistake: Mistake
    alternatives: tuple[Mistake, ...]
    before: WiringTrial
    after: WiringTrial
    weight: ArmWeight | None = None
    held_out_ratio: float | None = None

    @property
    def times_better(self) -> FloatArray:
        """Factor by which each joint's residual falls after the correction, shape (n,)."""
        return np.asarray(self.before.residual_share / self.after.residual_share)


@dataclass(frozen=True, eq=False)
class _CorrectedMistake:
    """A corrected mistake; the fit and the prediction of held-out parts afterwards."""

    mistake: Mistake
    after: WiringTrial
    held_out: WiringTrial


def find_mistakes(signals: WiredSignals, *, fine: bool = True) -> tuple[FoundMistake, ...]:
    """Try the common mistakes on recordings, then further mistakes after a correction.

    A common mistake is accepted if the corrected data satisfy three conditions:
    - The model explains both fitted and held-out parts far better.
    - Motion and torques keep the robot file's limits.
    - The torques support the arm's weight.

    Args:
        signals: The signals and the robot as stated in the files.
        fine: True to search also for mistakes that hardly change the residual of a simple fit.

    Returns:
        Mistakes one after the other; empty if none explains the data far better.
    """
    found: list[FoundMistake] = []
    fits = False
    while len(found) < MOST_MISTAKES:
        stated = CondensedEquations.of(signals)
        wrong = wrong_quantity(signals)
        if wrong is not None:
            before = stated.trial(np.eye(len(signals.robot.joints)))
            return (*found, FoundMistake(wrong, (), before, before))
        gravity = GravitySearch.of(signals, stated)
        better = None if fits else _best_common_mistake(signals, stated, gravity)
        better = better or _scale_mistake_found(signals, stated, gravity)
        if better is None:
            break
        found.append(better)
        if better.mistake.kind is MistakeKind.GRAVITY_REMOVED:
            return tuple(found)
        signals, fits = better.mistake.correct(signals), better.after.good
    return _add_fine_mistake(tuple(found), signals) if fine else tuple(found)


def _add_fine_mistake(
    found: tuple[FoundMistake, ...], signals: WiredSignals
) -> tuple[FoundMistake, ...]:
    """Return the mistakes, and one more if it is visible only on held-out parts.

    If a large residual, an implausible weight or another such mistake remains after the best
    correction, no single mistake explains the data: the kinematic table is wrong. All other
    mistakes found are then discarded, because they only compensate the wrong table.
    """
    fine = find_fine_mistake(signals)
    if fine is None:
        return found
    undone = fine.mistake.correct(signals)
    still = np.eye(len(signals.robot.joints))
    before, after = (CondensedEquations.of(each).trial(still) for each in (signals, undone))
    own = FoundMistake(fine.mistake, fine.alternatives, before, after, held_out_ratio=fine.ratio)
    weight = find_impossibilities(undone)[1]
    further = find_fine_mistake(undone)
    plausible = weight is None or weight.is_plausible
    if fine.explains and plausible and further is None:
        return (*found, own)
    return (replace(own, mistake=table_mistake(signals), alternatives=()),)


def find_impossibilities(signals: WiredSignals) -> tuple[tuple[str, ...], ArmWeight | None]:
    """Return the joints whose friction drives instead of braking, and the arm's weight.

    Args:
        signals: The signals and the robot as stated in the files.

    Returns:
        `driving`. Joints whose friction has negative power, whichever part of the recordings is
        left out.
        `weight`. None if gravity loads no joint, or if the torques of the loaded joints are not
        explained.
    """
    still = np.eye(len(signals.robot.joints))
    stated = CondensedEquations.of(signals)
    fit, weight = stated.held_out(still), stated.arm_weight(still)
    driving = tuple(signals.robot.joint_names[j] for j in np.flatnonzero(fit.driving))
    return driving, weight if stated.explains_weight(fit) else None


def _best_common_mistake(
    signals: WiredSignals, stated: CondensedEquations, gravity: GravitySearch
) -> FoundMistake | None:
    still = np.eye(len(signals.robot.joints))
    before, before_out = stated.trial(still), stated.held_out(still)
    few = before.overfits(before_out)
    mistakes = [*common_mistakes(signals.robot), *gravity.mistakes()]
    tried: list[_CorrectedMistake] = []
    some, model = signals.thin(), plain_model(signals)
    screened = CondensedEquations.of(some, model).trial(still)
    for mistake in _refine_zero_positions(some, mistakes):
        if not mistake.multiplies:
            undone = mistake.correct(some)
            own = model if mistake.robot is None else plain_model(undone)
            after = CondensedEquations.of(undone, own).trial(still)
            if not after.may_be_better_than(screened, before.impossible):
                continue
        if mistake.kind is MistakeKind.POSITION_OFFSET:
            mistake = _best_zero(signals, mistake, SCREENED_RAD)
        undone = mistake.correct(signals)
        if not (keeps_limits(mistake, signals, undone) and keeps_torques(mistake, signals, undone)):
            continue
        condensed = stated if mistake.multiplies else CondensedEquations.of(undone)
        torque = mistake.torque if mistake.multiplies else still
        after = condensed.trial(torque)
        if not after.far_better_than(before, few_data=few):
            continue
        held_out = condensed.held_out(torque)
        if held_out.far_better_than(before_out, few_data=few) and condensed.supports_weight(
            mistake, torque
        ):
            tried.append(_CorrectedMistake(mistake, after, held_out))
    if not tried:
        return None
    tried.sort(key=lambda each: each.held_out.cost)
    best = tried[0]
    if gravity.is_oblique(best.mistake):
        best = next(
            (
                each
                for each in tried[1:]
                if gravity.is_turned(best.mistake, each.mistake)
                or (
                    each.mistake.is_first_zero
                    and each.held_out.cost - best.held_out.cost < OBLIQUE_GAIN
                )
            ),
            best,
        )
    near = [
        each.mistake
        for each in tried
        if each is not best and each.held_out.cost - best.held_out.cost < AS_GOOD
    ]
    return FoundMistake(
        best.mistake, _distinct_alternatives(best.mistake, near), before, best.after
    )


def _scale_mistake_found(
    signals: WiredSignals, stated: CondensedEquations, gravity: GravitySearch
) -> FoundMistake | None:
    """Return a mistake of all torques together that only the arm's weight reveals."""
    wrong = wrong_scale(signals, stated, gravity)
    if not wrong:
        return None
    still = np.eye(len(signals.robot.joints))
    before, weight = stated.trial(still), stated.arm_weight(still)
    return FoundMistake(
        wrong[0], _distinct_alternatives(wrong[0], list(wrong[1:])), before, before, weight
    )


def _refine_zero_positions(signals: WiredSignals, mistakes: list[Mistake]) -> list[Mistake]:
    """Return the mistakes; each joint's best zero position replaces the tried grid."""
    still, model = np.eye(len(signals.robot.joints)), plain_model(signals)
    grids: dict[int, list[Mistake]] = {}
    for mistake in mistakes:
        if mistake.kind is MistakeKind.POSITION_OFFSET:
            grids.setdefault(mistake.joints[0], []).append(mistake)
    exact = []
    for grid in grids.values():
        near = min(
            grid,
            key=lambda each: CondensedEquations.of(each.correct(signals), model).trial(still).cost,
        )
        exact.append(_best_zero(signals, near, 2.0 * math.pi / OFFSET_STEPS))
    return [each for each in mistakes if each.kind is not MistakeKind.POSITION_OFFSET] + exact


def _best_zero(signals: WiredSignals, near: Mistake, within_rad: float) -> Mistake:
    """Return the wrong zero position that fits best, within `within_rad` of another one."""
    still, model = np.eye(len(signals.robot.joints)), plain_model(signals)
    (joint,), middle = near.joints, near.factor

    def cost(angle: float) -> float:
        undone = zero_mistake(signals.robot, joint, angle).correct(signals)
        return CondensedEquations.of(undone, model).trial(still).cost

    angle = golden_section(cost, middle - within_rad, middle + within_rad, ANGLE_STEP_RAD)
    return zero_mistake(signals.robot, joint, angle)


def _distinct_alternatives(best: Mistake, near: list[Mistake]) -> tuple[Mistake, ...]:
    """Return the alternatives that differ in kind or joints, without wrong zero positions."""
    seen, kept = {(best.kind, best.joints, best.what)}, []
    for mistake in near:
        own = (mistake.kind, mistake.joints, mistake.what)
        if own not in seen and mistake.kind is not MistakeKind.POSITION_OFFSET:
            kept.append(mistake)
        seen.add(own)
    return tuple(kept[:MOST_ALTERNATIVES])
