"""`Memory`: the hysteretic direction of motion of joints with presliding, sample by sample.

The memory is a condition of a motion, like the load of the gears. The direction depends on the
joint's past path. Therefore it is computed along the whole path first, and each block of samples
gets its part. For joints with presliding, friction terms use this direction instead of sign(v).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from config.arrays import BoolArray, FloatArray, IntArray
from dynamics.kernels.presliding import (
    BY_DISTANCE,
    BY_SHARE,
    DIRECTION,
    FOUND,
    KNOWN,
    drive_presliding,
    initial_state,
)
from dynamics.terms.term_parameter import NonlinearParameter


@dataclass(frozen=True)
class Presliding:
    """Presliding hysteresis of a joint (from 0).

    Attributes:
        distance: Displacement from rest after which the whole joint slides [rad or m].
        share: Fraction of its friction with hysteresis, while the rest is rigid; None for all of
            it.
    """

    joint: int
    distance: NonlinearParameter
    share: NonlinearParameter | None = None

    @property
    def share_value(self) -> float:
        """Fraction of the friction with hysteresis."""
        return 1.0 if self.share is None else self.share.value


@dataclass(frozen=True, eq=False)
class Memory:
    """Directions of motion of the joints with presliding.

    Attributes:
        joints: Joints (from 0) with presliding, one per column.
        direction: Shape (samples, columns). Replaces sign(v), from -1 to 1.
        by_distance: Shape (samples, columns). Its derivative by the presliding distance [1/rad or
            1/m].
        by_share: Shape (samples, columns). Its derivative by the fraction of the friction with
            hysteresis.
        known: Shape (samples, columns). True if the direction depends only on the motion, and no
            longer on the joint's initial state.
    """

    joints: tuple[int, ...]
    direction: FloatArray
    by_distance: FloatArray
    by_share: FloatArray
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
        """Compute the directions along a path.

        Args:
            presliding: Parameters of the hysteresis of each joint.
            path: Shape (samples, n). Positions of the actuators, link side, in the order of time
                [rad or m].
            segment: Shape (samples,). Number of the segment of each row; the hysteresis starts
                afresh after a gap.
            periodic: The path is one period of a periodic motion; it is followed twice.
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
                    drive_presliding(rows, own.distance.value, own.share_value, state, found)
        return cls(
            joints=tuple(own.joint for own in presliding),
            direction=out[:, :, DIRECTION],
            by_distance=out[:, :, BY_DISTANCE],
            by_share=out[:, :, BY_SHARE],
            known=out[:, :, KNOWN] > 0.0,
        )

    def known_through(self, segment: IntArray, rows: int) -> BoolArray:
        """Return True for samples in which a low-passed direction is known, (samples, columns).

        Args:
            segment: Shape (samples,). Number of the segment of each row; each was low-passed
                separately.
            rows: Number of rows over which the low-pass spreads an unknown value.
        """
        starts = np.concatenate([[0], np.flatnonzero(np.diff(segment)) + 1])
        number = np.arange(len(segment))
        first = starts[np.searchsorted(starts, number, side="right") - 1]
        return np.asarray(self.known[np.maximum(number - rows, first)])

    def of(self, joint: int) -> FloatArray | None:
        """Return the direction of a joint, (samples,); None for a joint without presliding."""
        return self.direction[:, self.joints.index(joint)] if joint in self.joints else None

    def slopes(self, own: Presliding) -> tuple[tuple[NonlinearParameter, FloatArray], ...]:
        """Return a joint's nonlinear parameters, each with the direction's derivative, (samples,).

        Args:
            own: Hysteresis of one of `joints`.
        """
        column = self.joints.index(own.joint)
        by_distance = (own.distance, self.by_distance[:, column])
        if own.share is None:
            return (by_distance,)
        return (by_distance, (own.share, self.by_share[:, column]))

    def part(self, samples: slice) -> Memory:
        """Return the directions of some of the samples."""
        return Memory(
            self.joints,
            self.direction[samples],
            self.by_distance[samples],
            self.by_share[samples],
            self.known[samples],
        )
