"""`find_mistakes`: the mistakes that explain recordings far better than what the files say."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from identification.wiring.mistakes import OFFSET_STEPS, Kind, Mistake, common_mistakes, offset
from identification.wiring.signals import WiredSignals
from identification.wiring.trial import Condensed, Trial

AS_GOOD: Final = 0.1
MOST_MISTAKES: Final = 3
MOST_ALTERNATIVES: Final = 3
ANGLE_STEP_RAD: Final = 1e-3


@dataclass(frozen=True, eq=False)
class Found:
    """A mistake that was found, and what else explains the data as well.

    Attributes
    ----------
    mistake : Mistake
        The best explanation.
    alternatives : tuple of Mistake
        Others that are as good.
    before, after : Trial
        The fit with the mistake, and with it undone.
    """

    mistake: Mistake
    alternatives: tuple[Mistake, ...]
    before: Trial
    after: Trial

    @property
    def times_better(self) -> FloatArray:
        """By which factor each joint's residual falls, shape (n,)."""
        return np.asarray(self.before.residual_share / self.after.residual_share)


def find_mistakes(signals: WiredSignals) -> tuple[Found, ...]:
    """Try the common mistakes on recordings, and those left on what one undone leaves.

    Parameters
    ----------
    signals : WiredSignals
        What the files say.

    Returns
    -------
    tuple of Found
        One after the other; empty where none explains the data far better.
    """
    found: list[Found] = []
    while len(found) < MOST_MISTAKES:
        better = _best(signals)
        if better is None:
            break
        found.append(better)
        if better.after.good:
            break
        signals = better.mistake.undone(signals)
    return tuple(found)


def _best(signals: WiredSignals) -> Found | None:
    stated = Condensed.of(signals)
    before = stated.trial(np.eye(len(signals.robot.joints)))
    tried: list[tuple[float, Mistake, Trial]] = []
    for mistake in common_mistakes(signals.robot):
        if mistake.moves:
            condensed = Condensed.of(mistake.undone(signals))
            after = condensed.trial(np.eye(len(signals.robot.joints)))
        else:
            after = stated.trial(mistake.torque)
        tried.append((after.cost, mistake, after))
    tried.sort(key=lambda each: each[0])
    cost, best, after = tried[0]
    if best.kind is Kind.POSITION_OFFSET:
        best, after = _exact(signals, best)
    if not after.far_better_than(before):
        return None
    near = [mistake for other, mistake, _ in tried[1:] if other - cost < AS_GOOD]
    return Found(best, _distinct(best, near), before, after)


def _exact(signals: WiredSignals, near: Mistake) -> tuple[Mistake, Trial]:
    """Return the best zero position near one that was tried."""
    (joint,), still = near.joints, np.eye(len(signals.robot.joints))

    def cost(angle: float) -> float:
        moved = offset(signals.robot, joint, angle).undone(signals)
        return Condensed.of(moved).trial(still).cost

    half = math.pi / OFFSET_STEPS
    angle = _lowest(cost, near.factor - 2.0 * half, near.factor + 2.0 * half)
    best = offset(signals.robot, joint, angle)
    return best, Condensed.of(best.undone(signals)).trial(still)


def _lowest(cost: Callable[[float], float], low: float, high: float) -> float:
    """Return where a cost with one valley is lowest, by golden sections.

    `scipy.optimize`, which could do it, takes more memory and time to load than all trials.
    """
    share = 0.5 * (math.sqrt(5.0) - 1.0)
    left, right = high - share * (high - low), low + share * (high - low)
    of_left, of_right = cost(left), cost(right)
    while high - low > ANGLE_STEP_RAD:
        if of_left < of_right:
            high, right, of_right = right, left, of_left
            left = high - share * (high - low)
            of_left = cost(left)
        else:
            low, left, of_left = left, right, of_right
            right = low + share * (high - low)
            of_right = cost(right)
    return 0.5 * (low + high)


def _distinct(best: Mistake, near: list[Mistake]) -> tuple[Mistake, ...]:
    """Return alternatives of other kinds or joints: of a zero position only the best angle."""
    seen, kept = {(best.kind, best.joints)}, []
    for mistake in near:
        own = (mistake.kind, mistake.joints)
        if own not in seen and mistake.kind is not Kind.POSITION_OFFSET:
            kept.append(mistake)
        seen.add(own)
    return tuple(kept[:MOST_ALTERNATIVES])
