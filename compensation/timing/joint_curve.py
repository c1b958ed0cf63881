"""`JointCurve`: the geometric path of the joints between two rests, without time."""

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
"""Numbers of poses to try for a curve; the smallest sufficient one is used.

A motion file can contain 10,000 poses at most.
"""
SLOW: Final = 1e-3  # fraction of the largest speed
STRAIGHT_ON: Final = 0.9999
TURN_BACK: Final = -0.5
"""A motion turns back between two rows if the cosine of the angle between their velocities is
smaller than this."""
SHORTEST: Final = 1e-4  # rad or m: smaller movements of a joint do not count as motion
FARTHEST_OFF: Final = 2e-4  # rad or m


@dataclass(frozen=True, eq=False)
class JointCurve:
    """Joint positions as functions of the path length, with a continuous first derivative.

    Attributes:
        curve: Joint positions over the length; its values have shape (..., n).
    """

    curve: PPoly

    @property
    def ends(self) -> tuple[float, float]:
        """Path lengths of begin and end."""
        return float(self.curve.x[0]), float(self.curve.x[-1])

    def at(self, length: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return joint positions and their first two derivatives, each (len(length), n)."""
        position, slope, bend = (np.ascontiguousarray(self.curve(length, k)) for k in range(3))
        return position, slope, bend

    @classmethod
    def through(cls, points: FloatArray, speeds: Sequence[float] | FloatArray) -> JointCurve:
        """Return the cubic spline through points.

        The length of a chord between two points is the Euclidean norm of the joints' travel times
        at their speed limits.

        Args:
            points: Shape (m, n). Joint positions, m at least 2; each point differs from the
                previous point.
            speeds: Speed limits of the joints.
        """
        knots = np.concatenate([[0.0], np.cumsum(_chords(points, np.asarray(speeds)))])
        return cls(joint_spline(knots, points))


@dataclass(frozen=True, eq=False)
class RestToRest:
    """Part of a motion from one rest to the next.

    Attributes:
        curve: Path of this part.
        rest_s: Duration of the rest at its end [s]; 0 if this rest is a single row.
        off: Largest distance between the motion's rows and the curve [rad or m].
        place: Shape (rows,). Path length at each row of the motion.
    """

    curve: JointCurve
    rest_s: float
    off: float
    place: FloatArray


def curves_of(samples: MotionSamples, speeds: Sequence[float]) -> tuple[float, list[RestToRest]]:
    """Return the duration of the rest before a motion [s], and its parts from rest to rest.

    A part ends at a rest. It also ends if the motion becomes very slow and continues in another
    direction, or if the motion turns back between two rows.

    Args:
        samples: A motion of any kind.
        speeds: Speed limits of the joints.

    Raises:
        ConfigError: The motion does not move, its rows are too far apart to define the path between
            them, or the path needs more poses than a file can contain.
    """
    samples = samples.whole()
    step_s = samples.sample_period_s
    weights = 1.0 / np.asarray(speeds)
    speed = np.linalg.norm(samples.velocity * weights, axis=1)
    if speed.max() <= 0.0 or np.ptp(samples.position, axis=0).max() < SHORTEST:
        raise ConfigError(
            "the motion does not move, so there is nothing to retime", code="RID-TIMING-SHAPE"
        )
    position, velocity = _with_turns(samples.position, samples.velocity * weights, step_s / weights)
    breaks = _find_rests(velocity, np.linalg.norm(velocity, axis=1))
    ways: list[RestToRest] = []
    for (_, begin), (end, after) in pairwise(breaks):
        rest_s = (after - end) * step_s
        points = position[begin : end + 1]
        if np.ptp(points, axis=0).max() < SHORTEST:
            continue
        ways.append(_rest_to_rest(points, np.asarray(speeds), rest_s))
    return (breaks[0][1] - breaks[0][0]) * step_s, ways


def _with_turns(
    position: FloatArray, velocity: FloatArray, scale_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Insert a row at rest between two rows if the motion turns back between them.

    The pose of the new row follows from a constant acceleration from the first row's velocity to
    rest.

    Args:
        position: Shape (rows, n). Joint positions [rad or m].
        velocity: Shape (rows, n). Velocities divided by the speed limits.
        scale_s: Shape (n,). Time between rows, multiplied by each speed limit [rad or m].
    """
    before, after = velocity[:-1], velocity[1:]
    speeds = np.linalg.norm(before, axis=1), np.linalg.norm(after, axis=1)
    turns = np.flatnonzero(np.sum(before * after, axis=1) < TURN_BACK * speeds[0] * speeds[1])
    share = (speeds[0] / np.maximum(speeds[0] + speeds[1], 1e-300))[turns, np.newaxis]
    poses = position[turns] + 0.5 * share * before[turns] * scale_s
    return (
        np.insert(position, turns + 1, poses, axis=0),
        np.insert(velocity, turns + 1, 0.0, axis=0),
    )


def _find_rests(velocity: FloatArray, speed: FloatArray) -> list[tuple[int, int]]:
    """Return the first and last row of each rest; a motion begins and ends with one."""
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


def _rest_to_rest(points: FloatArray, speeds: FloatArray, rest_s: float) -> RestToRest:
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
                f"the motion's path between its rows is uncertain by {off:.2g} rad or m, because"
                " it turns within a few cycles. Make the path turn less sharply, or slow the"
                " motion down",
                code="RID-TIMING-SHAPE",
            )
    raise ConfigError(
        f"{KNOTS[-1]:,} poses approximate the motion's path only to {off:.2g} rad or m, but"
        f" {FARTHEST_OFF:g} is required between two rests: shorten the path (fewer turns), or add"
        " rests",
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
