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
"""Smallest magnitude of the hysteretic direction at which the whole joint counts as sliding."""


def presliding_of_model(model: RobotModel) -> tuple[Presliding, ...]:
    """Return the presliding parameters of a model, joint by joint; empty without presliding."""
    return tuple(p for term in model.terms if isinstance(term, Friction) for p in term.presliding)


def with_presliding_history(
    model: RobotModel,
    q: FloatArray,
    conditions: Conditions | None = None,
    segment: IntArray | None = None,
    *,
    periodic: bool = False,
) -> Conditions:
    """Return the conditions of a motion, with the presliding hysteresis computed along its path.

    Args:
        model: The robot.
        q: Shape (samples, n). Joint positions in the order of time [rad or m].
        conditions: The motion's other conditions.
        segment: Shape (samples,). Number of the recording's segment to which each row belongs; at a
            new segment, after a gap, the hysteresis starts again from its initial state.
        periodic: True if q is one period of a periodic motion.
    """
    conditions, own = conditions or Conditions(), presliding_of_model(model)
    if not own:
        return conditions
    path = q if model.coupling is None else model.coupling.to_motors(q)
    return replace(conditions, memory=Memory.along(own, path, segment, periodic=periodic))


def sliding_samples(conditions: Conditions, moving: BoolArray) -> BoolArray:
    """Return True if the whole joint slides, so that its friction follows sign(v), (samples, n).

    A joint without presliding slides in all samples in which it is `moving`. For a joint with
    presliding, the samples that are still affected by a reversal are False too.
    """
    memory = conditions.memory
    if memory is None:
        return moving
    whole = moving.copy()
    whole[:, list(memory.joints)] &= np.abs(memory.direction) > WHOLE
    return whole


def samples_with_known_friction(conditions: Conditions, moving: BoolArray) -> BoolArray:
    """Return True if the friction of a joint can be computed, (samples, n).

    For a joint without presliding, these are the samples in which it is `moving`. For a joint with
    presliding, they are the samples in which its hysteresis is known, also at rest and at
    reversals.
    """
    memory = conditions.memory
    if memory is None:
        return moving
    known = moving.copy()
    known[:, list(memory.joints)] = memory.known
    return known
