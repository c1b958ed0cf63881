"""What a robot's friction remembers of a motion."""

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
"""Direction from which on all of a joint slides."""


def presliding(model: RobotModel) -> tuple[Presliding, ...]:
    """Return the presliding distances of a model, joint by joint; none where it has none."""
    return tuple(p for term in model.terms if isinstance(term, Friction) for p in term.presliding)


def with_memory(
    model: RobotModel,
    q: FloatArray,
    conditions: Conditions | None = None,
    segment: IntArray | None = None,
    *,
    periodic: bool = False,
) -> Conditions:
    """Return the conditions of a motion with what the robot's friction remembers of it.

    Args:
        model: The robot.
        q: Shape (samples, n). Joint positions in the order of time [rad or m].
        conditions: The motion's other conditions.
        segment: Shape (samples,). Number of the segment that a row belongs to; nothing is
            remembered over a gap.
        periodic: The motion is one period of many.
    """
    conditions, own = conditions or Conditions(), presliding(model)
    if not own:
        return conditions
    path = q if model.coupling is None else model.coupling.to_motors(q)
    return replace(conditions, memory=Memory.along(own, path, segment, periodic=periodic))


def sliding(conditions: Conditions, moving: BoolArray) -> BoolArray:
    """Return at which samples the whole of a joint slides, (samples, n): friction is sign(v)'s.

    Those that move; of joints that remember only those so far from a reversal that nothing of it
    is left.
    """
    memory = conditions.memory
    if memory is None:
        return moving
    whole = moving.copy()
    whole[:, list(memory.joints)] &= np.abs(memory.direction) > WHOLE
    return whole


def counted(conditions: Conditions, moving: BoolArray) -> BoolArray:
    """Return which samples' friction is known, (samples, n).

    Those that move; of joints whose memory is known also those at rest and at reversal, but none
    before the motion has gone far enough for the memory to be known.
    """
    memory = conditions.memory
    if memory is None:
        return moving
    known = moving.copy()
    known[:, list(memory.joints)] = memory.known
    return known
