"""`Memory`: the hysteretic direction of motion of joints with presliding, for each sample.

For joints with presliding, friction terms use this direction instead of sign(v). It depends on the
joint's path up to the sample. Therefore it is computed along the whole path before the torque, and
it is one of the `Conditions` of a motion.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from config.arrays import BoolArray, FloatArray, IntArray
from dynamics.kernels.presliding import (
    BY_DISTANCE,
    BY_FRACTION,
    DIRECTION,
    FOUND,
    KNOWN,
    drive_presliding,
    initial_state,
)
from dynamics.terms.term_parameter import NonlinearParameter


@dataclass(frozen=True)
class Presliding:
    """Parameters of the presliding hysteresis of a joint (from 0).

    Attributes:
        distance: Displacement from rest after which the whole joint slides [rad or m].
        fraction: Fraction of the joint's friction that has hysteresis, while the rest is rigid
            (Coulomb); None if all friction has hysteresis.
    """

    joint: int
    distance: NonlinearParameter
    fraction: NonlinearParameter | None = None

    @property
    def fraction_value(self) -> float:
        """Fraction of the joint's friction that has hysteresis; 1 if `fraction` is None."""
        return 1.0 if self.fraction is None else self.fraction.value


@dataclass(frozen=True, eq=False)
class Memory:
    """Hysteretic directions of motion of all joints with presliding.

    Attributes:
        joints: Joints (from 0) with presliding, in the order of the columns.
        direction: Shape (samples, columns). Direction from -1 to 1, which replaces sign(v).
        by_distance: Shape (samples, columns). Derivative of the direction by the presliding
            distance [1/rad or 1/m].
        by_fraction: Shape (samples, columns). Derivative of the direction by the presliding
            fraction.
        known: Shape (samples, columns). True if the direction no longer depends on the joint's
            unknown initial state.
    """

    joints: tuple[int, ...]
    direction: FloatArray
    by_distance: FloatArray
    by_fraction: FloatArray
    known: BoolArray

    @classmethod
    def along(
        cls,
        presliding: Sequence[Presliding],
        path: FloatArray,
        segment: IntArray | None = None,
        *,
        periodic: bool = False,
    ) -> Memory:
        """Compute the hysteretic directions along a path.

        Args:
            presliding: Parameters of each joint with presliding.
            path: Shape (samples, n). Positions of the actuators, link side, in the order of time
                [rad or m].
            segment: Shape (samples,). Number of the recording's segment to which each row belongs;
                at a new segment, after a gap, the hysteresis starts again from its initial state.
            periodic: True if the path is one period of a periodic motion; the period is then
                computed twice, and the second result is returned.
        """
        out = np.zeros((len(path), len(presliding), FOUND))
        starts = [0, len(path)]
        if segment is not None:
            starts[1:1] = (np.flatnonzero(np.diff(segment)) + 1).tolist()
        for column, own in enumerate(presliding):
            positions = np.ascontiguousarray(path[:, own.joint])
            for first, end in itertools.pairwise(starts):
                state = initial_state()
                rows, found = positions[first:end], out[first:end, column]
                for _ in range(1 + periodic):
                    drive_presliding(rows, own.distance.value, own.fraction_value, state, found)
        return cls(
            joints=tuple(own.joint for own in presliding),
            direction=out[:, :, DIRECTION],
            by_distance=out[:, :, BY_DISTANCE],
            by_fraction=out[:, :, BY_FRACTION],
            known=out[:, :, KNOWN] > 0.0,
        )

    def known_through(self, segment: IntArray, rows: int) -> BoolArray:
        """Return True if a direction is known even after low-pass filtering, (samples, columns).

        Args:
            segment: Shape (samples,). Number of the segment of each row; each segment was filtered
                separately.
            rows: Number of rows that the filter affects after an unknown value.
        """
        starts = np.concatenate([[0], np.flatnonzero(np.diff(segment)) + 1])
        number = np.arange(len(segment))
        first = starts[np.searchsorted(starts, number, side="right") - 1]
        return np.asarray(self.known[np.maximum(number - rows, first)])

    def of(self, joint: int) -> FloatArray | None:
        """Return the directions of a joint, (samples,); None for a joint without presliding."""
        return self.direction[:, self.joints.index(joint)] if joint in self.joints else None

    def slopes(self, own: Presliding) -> tuple[tuple[NonlinearParameter, FloatArray], ...]:
        """Return a joint's presliding parameters, with the direction's derivatives, (samples,).

        Args:
            own: Presliding parameters of one of `joints`.
        """
        column = self.joints.index(own.joint)
        by_distance = (own.distance, self.by_distance[:, column])
        if own.fraction is None:
            return (by_distance,)
        return (by_distance, (own.fraction, self.by_fraction[:, column]))

    def part(self, samples: slice) -> Memory:
        """Return the directions for a range of samples."""
        return Memory(
            self.joints,
            self.direction[samples],
            self.by_distance[samples],
            self.by_fraction[samples],
            self.known[samples],
        )
