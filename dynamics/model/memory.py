"""Presliding hysteresis of a robot's friction along a motion."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from config.arrays import BoolArray, FloatArray, IntArray
from dynamics.model.robot_model import RobotModel
from dynamics.terms.conditions import Conditions
from dynamics.terms.friction import Friction
from dynamics.terms.memory import Memory, Presliding

WHOLE: Final = 1.0 - 1e-9
"""Magnitude of the direction from which on the whole joint slides."""


def presliding_of_model(model: RobotModel) -> tuple[Presliding, ...]:
    """Return the presliding distances of a model, joint by joint; empty if it has none."""
    return tuple(p for term in model.terms if isinstance(term, Friction) for p in term.presliding)


def with_presliding_history(
    model: RobotModel,
    q: FloatArray,
    conditions: Conditions | None = None,
    segment: IntArray | None = None,
    *,
    periodic: bool = False,
) -> Conditions:
    """Return the conditions of a motion, including the presliding hysteresis along it.

    Args:
        model: The robot.
        q: Shape (samples, n). Joint positions in the order of time [rad or m].
        conditions: The motion's other conditions.
        segment: Shape (samples,). Number of the segment of each row; the hysteresis starts afresh
            after a gap.
        periodic: The motion is one period of a periodic motion.
    """
    conditions, own = conditions or Conditions(), presliding_of_model(model)
    if not own:
        return conditions
    path = q if model.coupling is None else model.coupling.to_motors(q)
    return replace(conditions, memory=Memory.along(own, path, segment, periodic=periodic))


def sliding_samples(conditions: Conditions, moving: BoolArray) -> BoolArray:
    """Return the samples in which a whole joint slides, (samples, n): friction follows sign(v).

    These are the samples that move. For a joint with presliding, samples that are still affected by
    a reversal are excluded.
    """
    memory = conditions.memory
    if memory is None:
        return moving
    whole = moving.copy()
    whole[:, list(memory.joints)] &= np.abs(memory.direction) > WHOLE
    return whole


def samples_with_known_friction(conditions: Conditions, moving: BoolArray) -> BoolArray:
    """Return the samples in which friction is known, (samples, n).

    These are the samples that move. For a joint with presliding they are the samples in which its
    hysteresis is known, at rest and at a reversal too.
    """
    memory = conditions.memory
    if memory is None:
        return moving
    known = moving.copy()
    known[:, list(memory.joints)] = memory.known
    return known
