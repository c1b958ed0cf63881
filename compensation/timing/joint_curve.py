"""`JointCurve`: where a motion leads the joints, without when; between its rests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from scipy.interpolate import PPoly

from acquisition.motion.paths.joint_spline import joint_spline
from acquisition.motion.samples import MotionSamples
from config.arrays import FloatArray
from config.errors import ConfigError

KNOTS: Final = (1000, 2000, 4000, 8000)
"""How many poses a way is told by at most: the first that are enough; a file takes 10,000."""
SLOW: Final = 1e-3  # of the largest speed
STRAIGHT_ON: Final = 0.9999
SHORTEST: Final = 1e-4  # rad or m of any joint: less than that is no way
FARTHEST_OFF: Final = 2e-4  # rad or m


@dataclass(frozen=True, eq=False)
class JointCurve:
    """The joints as functions of a path's length, of class C1 with a second derivative.

    Attributes:
        curve: Joint positions over the length; its values have shape (..., n).
    """

    curve: PPoly

    @property
    def ends(self) -> tuple[float, float]:
        """Where the path begins and ends."""
        return float(self.curve.x[0]), float(self.curve.x[-1])

    def at(self, length: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return joint positions and their two derivatives by the length, each (len(length), n)."""
        position, slope, bend = (np.ascontiguousarray(self.curve(length, k)) for k in range(3))
        return position, slope, bend

    @classmethod
    def through(cls, points: FloatArray, speeds: Sequence[float] | FloatArray) -> JointCurve:
        """Return the cubic spline through points, measured by the time that chords would take.

        Args:
            points: Shape (m, n). Joint positions, m at least 2; each unlike the one before.
            speeds: The joints' speed limits.
        """
        knots = np.concatenate([[0.0], np.cumsum(_chords(points, np.asarray(speeds)))])
        return cls(joint_spline(knots, points))


@dataclass(frozen=True, eq=False)
class RestToRest:
    """A motion's way from one rest to the next.

    Attributes:
        curve: The way.
        rest_s: How long the motion rests at its end, or in its last row [s].
        off: How far the motion's own rows are off the curve [rad or m].
        place: Shape (rows,). How far along the curve each of them is.
    """

    curve: JointCurve
    rest_s: float
    off: float
    place: FloatArray


def curves_of(samples: MotionSamples, speeds: Sequence[float]) -> tuple[float, list[RestToRest]]:
    """Return how long a motion rests before it begins, and its ways from rest to rest.

    A way ends where the motion stands still, or nearly, and goes on in another direction.

    Args:
        samples: The motion, of any kind.
        speeds: The joints' speed limits.

    Raises:
        ConfigError: The motion goes nowhere, or its rows are too far apart to say what lies
            between.
    """
    samples = samples.whole()
    step_s = samples.sample_period_s
    weights = 1.0 / np.asarray(speeds)
    speed = np.linalg.norm(samples.velocity * weights, axis=1)
    if speed.max() <= 0.0 or np.ptp(samples.position, axis=0).max() < SHORTEST:
        raise ConfigError(
            "the motion does not move: there is nothing to be timed", code="RID-TIMING-SHAPE"
        )
    breaks = _rests(samples.velocity * weights, speed)
    ways: list[RestToRest] = []
    for (_, begin), (end, after) in pairwise(breaks):
        rest_s = (after - end) * step_s
        points = samples.position[begin : end + 1]
        if np.ptp(points, axis=0).max() < SHORTEST:
            continue
        ways.append(_way(points, np.asarray(speeds), rest_s))
    return (breaks[0][1] - breaks[0][0]) * step_s, ways


def _rests(velocity: FloatArray, speed: FloatArray) -> list[tuple[int, int]]:
    """Return the first and last row of each rest; the motion begins and ends with one."""
    slow = speed <= SLOW * speed.max()
    slow[[0, -1]] = True
    edges = np.flatnonzero(np.diff(np.concatenate([[False], slow, [False]]).astype(np.int8)))
    found = []
    for first, after in edges.reshape(-1, 2).tolist():
        last = after - 1
        rows = np.flatnonzero(speed[first:after] <= 0.0) + first
        if first == 0 or after == len(speed):
            edge = 0 if first == 0 else last
            found.append((int(rows[0]), int(rows[-1])) if len(rows) else (edge, edge))
            continue
        way = velocity[first - 1] @ velocity[after]
        turns = way < STRAIGHT_ON * speed[first - 1] * speed[after]
        if len(rows):
            found.append((int(rows[0]), int(rows[-1])))
        elif turns:
            middle = first + int(speed[first:after].argmin())
            found.append((middle, middle))
    return found


def _way(points: FloatArray, speeds: FloatArray, rest_s: float) -> RestToRest:
    chords = _chords(points, speeds)
    along = np.concatenate([[0.0], np.cumsum(chords)])
    off = np.inf
    for most in KNOTS:
        curve = _curve(points, along, min(most, len(points)))
        off = float(np.abs(curve.curve(along) - points).max())
        if off <= FARTHEST_OFF:
            return RestToRest(curve, rest_s, off, along)
        if most >= len(points):
            raise ConfigError(
                f"between its rows the motion's path cannot be told to better than {off:.2g} rad or"
                " m: it turns within a few cycles. Let it turn less sharply, or drive it slower",
                code="RID-TIMING-SHAPE",
            )
    raise ConfigError(
        f"{KNOTS[-1]:,} poses tell the motion's path to {off:.2g} rad or m only, from one rest to"
        f" the next, and {FARTHEST_OFF:g} is wanted: make it shorter (fewer turns), or let it rest"
        " in between",
        code="RID-TIMING-SHAPE",
    )


def _curve(points: FloatArray, along: FloatArray, most: int) -> JointCurve:
    """Return the spline through some of the points, at nearly equal distances."""
    least = along[-1] / most
    kept = [0]
    for row in range(1, len(points)):
        if along[row] - along[kept[-1]] >= least and along[-1] - along[row] >= 0.5 * least:
            kept.append(row)
    kept.append(len(points) - 1)
    knots = along[kept]
    return JointCurve(joint_spline(knots, points[kept]))


def _chords(points: FloatArray, speeds: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(np.diff(points, axis=0) / speeds, axis=1))
