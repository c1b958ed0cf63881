"""Geometry of a path: segments and the blends between them, as functions of the path length.

A blend is the quintic that leaves one segment and joins the next with equal direction and
curvature. Therefore direction and curvature are continuous between two stops.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from acquisition.motion.paths.segments import CELLS, SHORTEST_M, Curve, Segment
from config.arrays import FloatArray, IntArray
from config.errors import ConfigError

SAME_DIRECTION: Final = 1e-9
SAME_CURVATURE: Final = 1e-6
TURNS_BACK: Final = -0.999
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)


class PathPoints(NamedTuple):
    """Points of a path; each array has the shape (len(s), 3).

    Attributes:
        point_m, direction, curvature: Position [m], unit tangent, and its derivative with respect
            to the length [1/m].
    """

    point_m: FloatArray
    direction: FloatArray
    curvature: FloatArray


@dataclass(frozen=True, eq=False)
class PathPiece:
    """One curve of a path, a segment or a blend, as a function of its length.

    Attributes:
        label: Name of the curve in messages.
        curve: The curve as a function of its parameter.
        knots, lengths: Parameters, and the length up to each parameter [m].
        speed_m_s: Requested speed [m/s].
    """

    label: str
    curve: Curve
    knots: FloatArray
    lengths: FloatArray
    speed_m_s: float

    @property
    def length_m(self) -> float:
        """Length of the whole curve."""
        return float(self.lengths[-1])

    def parameters(self, length_m: FloatArray) -> FloatArray:
        """Return the curve's parameters at lengths from its start, by Newton's method."""
        cell = np.clip(np.searchsorted(self.lengths, length_m, "right") - 1, 0, len(self.knots) - 2)
        first, size = self.knots[cell], np.diff(self.knots)[cell]
        whole = np.diff(self.lengths)[cell]
        x = first + size * (length_m - self.lengths[cell]) / whole
        for _ in range(4):
            done = self.lengths[cell] + _length_between(self.curve, first, x)
            speed = np.linalg.norm(self.curve(x)[1], axis=1)
            x = x + (length_m - done) / np.maximum(speed, 1e-300)
        return np.asarray(x)

    def at(self, length_m: FloatArray) -> PathPoints:
        """Return the curve's points at lengths from its start."""
        point, first, second = self.curve(self.parameters(length_m))
        speed = np.linalg.norm(first, axis=1, keepdims=True)
        direction = first / speed
        across = second - direction * (direction * second).sum(axis=1, keepdims=True)
        return PathPoints(point, direction, across / speed**2)

    def cut(self, begin_m: float, end_m: float) -> PathPiece:
        """Return the part of the curve between two lengths."""
        begin, end = self.parameters(np.array([begin_m, end_m])).tolist()
        return measure_curve(
            self.label, self.curve, np.linspace(begin, end, CELLS + 1), self.speed_m_s
        )


@dataclass(frozen=True, eq=False)
class PathSection:
    """A part of a path from rest to rest: smoothly connected pieces."""

    pieces: tuple[PathPiece, ...]

    @property
    def ends_m(self) -> FloatArray:
        """Length from the section's start to the end of each piece [m]."""
        return np.cumsum([piece.length_m for piece in self.pieces])

    @property
    def length_m(self) -> float:
        """Length of the section."""
        return float(self.ends_m[-1])

    def piece_at(self, length_m: FloatArray) -> IntArray:
        """Return the indices of the pieces that contain lengths from the section's start."""
        found = np.searchsorted(self.ends_m, length_m)
        return np.asarray(np.minimum(found, len(self.pieces) - 1), dtype=np.int64)

    def where(self, length_m: float) -> str:
        """Return a description of the place at a length from the section's start."""
        number = int(self.piece_at(np.array([length_m]))[0])
        into_m = length_m - float(self.ends_m[number]) + self.pieces[number].length_m
        return f"{self.pieces[number].label}, {1e3 * into_m:.0f} mm into it"

    def at(self, length_m: FloatArray) -> PathPoints:
        """Return the path's points at lengths from the start of the section."""
        number = self.piece_at(length_m)
        found = PathPoints(*(np.empty((len(length_m), 3)) for _ in range(3)))
        for k in np.unique(number).tolist():
            here = number == k
            piece = self.pieces[k]
            begin = float(self.ends_m[k]) - piece.length_m
            part = piece.at(np.clip(length_m[here] - begin, 0.0, piece.length_m))
            for whole, values in zip(found, part, strict=True):
                whole[here] = values
        return found


def measure_curve(label: str, curve: Curve, knots: FloatArray, speed_m_s: float) -> PathPiece:
    """Return a curve as a function of its length, which is measured from knot to knot."""
    cells = _length_between(curve, knots[:-1], knots[1:])
    return PathPiece(label, curve, knots, np.concatenate([[0.0], np.cumsum(cells)]), speed_m_s)


def path_sections(
    start_m: Sequence[float], segments: Sequence[Segment], speed_m_s: float, blend_m: float
) -> tuple[PathSection, ...]:
    """Return the parts of a path from rest to rest.

    Args:
        start_m: Start point [m].
        segments: Segments of the path.
        speed_m_s, blend_m: Speed, and blend distance [m], of segments without their own values.

    Raises:
        ConfigError: A segment is degenerate, or reverses the direction at a blend; the text names
            it.
    """
    whole, at = [], np.array(start_m)
    for number, segment in enumerate(segments, start=1):
        label = f"segment {number} ({segment.kind})"
        knots, curve = segment.curve_from(at, label)
        whole.append(measure_curve(label, curve, knots, segment.speed_m_s or speed_m_s))
        at = curve(knots[-1:])[0][0]
    joints = [
        _connect(whole[k], whole[k + 1], segment.blend_m, blend_m, k + 1)
        for k, segment in enumerate(segments[:-1])
    ]
    parts: list[PathSection] = []
    pieces: list[PathPiece] = []
    begin_m = 0.0
    for k, piece in enumerate(whole):
        joint = joints[k] if k < len(joints) else None
        end_m = piece.length_m - (0.0 if joint is None else joint.reach_m)
        if end_m - begin_m > SHORTEST_M:
            untouched = begin_m == 0.0 and end_m == piece.length_m
            pieces.append(piece if untouched else piece.cut(begin_m, end_m))
        begin_m = 0.0
        if joint is None or joint.stops:
            parts.append(PathSection(tuple(pieces)))
            pieces = []
        elif joint.reach_m > 0.0:
            begin_m = joint.reach_m
            pieces.append(_blend(piece, whole[k + 1], joint.reach_m, k + 1))
    return tuple(parts)


class _Connection(NamedTuple):
    """Connection of two segments: a stop, a blend of `reach_m` on both sides, or neither."""

    stops: bool
    reach_m: float


def _connect(
    before: PathPiece, after: PathPiece, own_m: float | None, default_m: float, number: int
) -> _Connection:
    ends = before.at(np.array([before.length_m])), after.at(np.array([0.0]))
    straight_on = float(ends[0].direction[0] @ ends[1].direction[0])
    bend = float(np.abs(ends[0].curvature - ends[1].curvature).max())
    if 1.0 - straight_on < SAME_DIRECTION and bend < SAME_CURVATURE:
        return _Connection(stops=False, reach_m=0.0)
    wanted_m = default_m if own_m is None else own_m
    if wanted_m == 0.0:
        return _Connection(stops=True, reach_m=0.0)
    if straight_on < TURNS_BACK:
        raise ConfigError(
            f"segments {number} and {number + 1} reverse the direction and cannot be blended: set"
            f" blend_m: 0 in segment {number} to stop there",
            code="RID-PATH-SEGMENT",
        )
    return _Connection(False, min(wanted_m, 0.5 * before.length_m, 0.5 * after.length_m))


def _blend(before: PathPiece, after: PathPiece, reach_m: float, number: int) -> PathPiece:
    """Return the quintic blend from one segment to the next, from its control points."""
    leave, meet = before.at(np.array([before.length_m - reach_m])), after.at(np.array([reach_m]))
    speed = 2.0 * reach_m
    ends = []
    for end, way in ((leave, 1.0), (meet, -1.0)):
        first = end.point_m[0] + way * speed / 5.0 * end.direction[0]
        bend = speed**2 / 20.0 * end.curvature[0]
        ends.append((end.point_m[0], first, 2.0 * first - end.point_m[0] + bend))
    points = np.array([*ends[0], *ends[1][::-1]])
    slopes = 5.0 * np.diff(points, axis=0)
    bends = 4.0 * np.diff(slopes, axis=0)

    def curve(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        return _bernstein(x, points), _bernstein(x, slopes), _bernstein(x, bends)

    label = f"the corner between segments {number} and {number + 1}"
    slower = min(before.speed_m_s, after.speed_m_s)
    return measure_curve(label, curve, np.linspace(0.0, 1.0, CELLS + 1), slower)


def _bernstein(x: FloatArray, points: FloatArray) -> FloatArray:
    degree = len(points) - 1
    shares = [math.comb(degree, k) * x**k * (1.0 - x) ** (degree - k) for k in range(degree + 1)]
    return np.asarray(np.stack(shares, axis=1) @ points)


def _length_between(curve: Curve, begin: FloatArray, end: FloatArray) -> FloatArray:
    """Return the lengths between pairs of parameters, by Gauss's rule of five points."""
    half = 0.5 * (end - begin)
    x = (begin + half)[:, np.newaxis] + half[:, np.newaxis] * _NODES
    speed = np.linalg.norm(curve(x.ravel())[1], axis=1).reshape(x.shape)
    return np.asarray((speed @ _WEIGHTS) * half)
