"""`Memory`: the direction of motion that a joint's friction remembers, sample by sample.

A circumstance of a motion, as its load is: which way a joint slides depends on where it came from,
so that it is computed along the whole path and handed to the terms with each part of it. Terms that
jump with sign(v) take the remembered direction of joints that have one.
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
    begin,
    follow,
)
from dynamics.terms.term_parameter import NonlinearParameter


@dataclass(frozen=True)
class Presliding:
    """How a joint (from 0) gives way before it slides.

    Attributes:
        joint: Which joint.
        distance: What it is moved until all of it slides [rad or m].
        share: Share of its friction that gives way so, while the rest holds at once; None for all
            of it.
    """

    joint: int
    distance: NonlinearParameter
    share: NonlinearParameter | None = None

    @property
    def share_value(self) -> float:
        """Share of the friction that gives way."""
        return 1.0 if self.share is None else self.share.value


@dataclass(frozen=True, eq=False)
class Memory:
    """What the joints with presliding remember.

    Attributes:
        joints: Joints (from 0) with presliding, one a column.
        direction: Shape (samples, columns). In place of sign(v), from -1 to 1.
        by_distance: Shape (samples, columns). Its derivative by the presliding distance [1/rad or
            1/m].
        by_share: Shape (samples, columns). Its derivative by the share of the friction that gives
            way.
        known: Shape (samples, columns). Whether it depends on the motion alone, and no more on how
            the joint stood before.
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
        """Follow a path.

        Args:
            presliding: How the joints give way.
            path: Shape (samples, n). Positions of the actuators, link side, in the order of time
                [rad or m].
            segment: Shape (samples,). Number of the segment that a row belongs to; nothing is
                remembered over a gap.
            periodic: The path is one period of a motion that repeats: it is gone through twice.
        """
        out = np.zeros((len(path), len(presliding), FOUND))
        starts = [0, len(path)]
        if segment is not None:
            starts[1:1] = (np.flatnonzero(np.diff(segment)) + 1).tolist()
        for column, own in enumerate(presliding):
            positions = np.ascontiguousarray(path[:, own.joint])
            for first, end in itertools.pairwise(starts):
                state = begin()
                rows, found = positions[first:end], out[first:end, column]
                for _ in range(1 + periodic):
                    follow(rows, own.distance.value, own.share_value, state, found)
        return cls(
            joints=tuple(own.joint for own in presliding),
            direction=out[:, :, DIRECTION],
            by_distance=out[:, :, BY_DISTANCE],
            by_share=out[:, :, BY_SHARE],
            known=out[:, :, KNOWN] > 0.0,
        )

    def known_through(self, segment: IntArray, rows: int) -> BoolArray:
        """Return where a low-passed direction is known, (samples, columns).

        Args:
            segment: Shape (samples,). Number of the segment that a row belongs to; each was
                low-passed on its own.
            rows: How many rows the low-pass carries what is not known into what follows.
        """
        starts = np.concatenate([[0], np.flatnonzero(np.diff(segment)) + 1])
        number = np.arange(len(segment))
        first = starts[np.searchsorted(starts, number, side="right") - 1]
        return np.asarray(self.known[np.maximum(number - rows, first)])

    def of(self, joint: int) -> FloatArray | None:
        """Return the direction of a joint, (samples,); None where it remembers nothing."""
        return self.direction[:, self.joints.index(joint)] if joint in self.joints else None

    def slopes(self, own: Presliding) -> tuple[tuple[NonlinearParameter, FloatArray], ...]:
        """Return a joint's nonlinear parameters, each with the direction's derivative, (samples,).

        Args:
            own: How one of `joints` gives way.
        """
        column = self.joints.index(own.joint)
        by_distance = (own.distance, self.by_distance[:, column])
        if own.share is None:
            return (by_distance,)
        return (by_distance, (own.share, self.by_share[:, column]))

    def part(self, samples: slice) -> Memory:
        """Return what is remembered in some of the samples."""
        return Memory(
            self.joints,
            self.direction[samples],
            self.by_distance[samples],
            self.by_share[samples],
            self.known[samples],
        )
