"""Segments of a tool-point path: their keys in a motion file, and their curves."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable
from typing import Annotated, Final, Literal, NamedTuple

import numpy as np
from pydantic import Field, model_validator

from config.arrays import FloatArray
from config.errors import ConfigError
from config.model import ConfigModel
from config.plausible import Plausible
from config.quantities import NonNegative, Place, Positive, Vector3

SHORTEST_M: Final = 1e-6
CELLS: Final = 256

Blend = Annotated[NonNegative, Plausible(0.0, 5.0, "m")]

Curve = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
"""Function of parameters x: returns points and their first two derivatives, each (len(x), 3)."""


class KnottedCurve(NamedTuple):
    """A curve as a function of a parameter, and the knots for the integration of its length.

    Attributes:
        knots: Shape (knots,). Parameters, increasing.
        curve: The curve as a function of its parameter.
    """

    knots: FloatArray
    curve: Curve


class PathSegment(ConfigModel):
    """Common keys of all segments.

    Attributes:
        kind: Kind of segment; it decides which other keys there are.
        speed_m_s: Speed of the tool point [m/s]; default: that of the path.
        blend_m: Distance before the segment's end at which the blend to the next segment begins
            [m]; default: that of the path. With 0 the tool point stops in the corner.
    """

    speed_m_s: Annotated[Positive, Plausible(1e-5, 20.0, "m/s")] | None = None
    blend_m: Blend | None = None

    @abstractmethod
    def curve_from(self, start_m: FloatArray, label: str) -> KnottedCurve:
        """Return the segment's curve.

        Args:
            start_m: Shape (3,). End of the previous segment [m].
            label: Name of the segment in messages.

        Raises:
            ConfigError: The segment is degenerate; the text names it.
        """


class LineSegment(PathSegment):
    """A straight line to a point.

    Attributes:
        to_m: End point in the base frame [m].
    """

    kind: Literal["line"]
    to_m: Place

    def curve_from(self, start_m: FloatArray, label: str) -> KnottedCurve:
        """Return the line."""
        end = np.array(self.to_m)
        way = end - start_m
        if np.linalg.norm(way) < SHORTEST_M:
            raise ConfigError(
                f"{label} ends at its start point {_millimetres(end)}: remove it",
                code="RID-PATH-SEGMENT",
            )

        def curve(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            ones = np.ones((len(x), 1))
            return start_m + x[:, np.newaxis] * way, ones * way, 0.0 * ones * way

        return KnottedCurve(np.linspace(0.0, 1.0, 2), curve)


class ArcSegment(PathSegment):
    """A circular arc through one point to an end point.

    Attributes:
        through_m: Point on the arc in the base frame [m].
        to_m: End point in the base frame [m].
    """

    kind: Literal["arc"]
    through_m: Place
    to_m: Place

    def curve_from(self, start_m: FloatArray, label: str) -> KnottedCurve:
        """Return the arc; its centre is where two bisecting planes and the arc's plane meet."""
        through, end = np.array(self.through_m), np.array(self.to_m)
        a, b = through - start_m, end - start_m
        normal = np.cross(a, b)
        size = float(np.linalg.norm(normal))
        if size < 1e-6 * float(np.linalg.norm(a) * np.linalg.norm(b)) or size < SHORTEST_M**2:
            raise ConfigError(
                f"{label}: the points {_millimetres(start_m)}, {_millimetres(through)} and"
                f" {_millimetres(end)} are collinear or equal: give a line, or other points",
                code="RID-PATH-SEGMENT",
            )
        normal = normal / size
        halves = 0.5 * np.array([float(a @ a), float(b @ b), 0.0])
        centre = np.asarray(start_m + np.linalg.solve(np.array([a, b, normal]), halves))
        x, y = start_m - centre, np.cross(normal, start_m - centre)
        ahead = end - centre
        angle = math.atan2(float(ahead @ y), float(ahead @ x)) % (2.0 * math.pi)
        return _circular_curve(centre, x, y, angle)


class CircleSegment(PathSegment):
    """A circle around a centre, with up to 1000 turns; begins at the previous segment's end.

    Attributes:
        centre_m: Centre of the circle in the base frame [m].
        normal: Axis of the circle in the base frame; positive turns are right-handed about it.
        turns: Number of turns; negative turns reverse the direction.
    """

    kind: Literal["circle"]
    centre_m: Place
    normal: Vector3 = (0.0, 0.0, 1.0)
    turns: float = 1.0

    @model_validator(mode="after")
    def _check_normal_and_turns(self) -> CircleSegment:
        if not any(self.normal):
            raise ValueError("normal must not be zero")
        if self.turns == 0.0 or abs(self.turns) > 1000.0:
            raise ValueError(f"turns must be between -1000 and 1000 and not 0: {self.turns}")
        return self

    def curve_from(self, start_m: FloatArray, label: str) -> KnottedCurve:
        """Return the circle with its number of turns."""
        centre, normal = np.array(self.centre_m), np.array(self.normal)
        normal = normal / np.linalg.norm(normal)
        radius = start_m - centre
        height_m, radius_m = float(radius @ normal), float(np.linalg.norm(radius))
        if radius_m < SHORTEST_M or abs(height_m) > 1e-3 * radius_m:
            raise ConfigError(
                f"{label} begins at {_millimetres(start_m)}, {1e3 * abs(height_m):.3g} mm off the"
                f" plane through its centre and {1e3 * radius_m:.3g} mm from its centre: move the"
                " centre, change the normal, or start elsewhere",
                code="RID-PATH-SEGMENT",
            )
        y = np.cross(normal, radius)
        angle = 2.0 * math.pi * self.turns
        return _circular_curve(centre + height_m * normal, radius - height_m * normal, y, angle)


class SplineSegment(PathSegment):
    """A smooth curve (of class C2) through points.

    Attributes:
        through_m: Points in the base frame [m]; the last one is the end of the curve.
    """

    kind: Literal["spline"]
    through_m: tuple[Place, ...] = Field(min_length=2, max_length=10_000)

    def curve_from(self, start_m: FloatArray, label: str) -> KnottedCurve:
        """Return the spline."""
        from scipy.interpolate import CubicSpline  # a slow import that few motions need

        points = np.array([start_m, *self.through_m])
        chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
        if chords.min() < SHORTEST_M:
            number = int(chords.argmin()) + 1
            raise ConfigError(
                f"{label}: point {number}, {_millimetres(points[number])}, equals the previous"
                " point: remove one of the two",
                code="RID-PATH-SEGMENT",
            )
        at = np.concatenate([[0.0], np.cumsum(chords)])
        spline = CubicSpline(at, points)

        def curve(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            return np.asarray(spline(x)), np.asarray(spline(x, 1)), np.asarray(spline(x, 2))

        cells = max(4, -(-CELLS // len(chords)))
        share = np.arange(cells) / cells
        inner = (at[:-1, np.newaxis] + share * np.diff(at)[:, np.newaxis]).ravel()
        knots = np.append(inner, at[-1])
        slowest = np.linalg.norm(curve(knots)[1], axis=1).min()
        if slowest < 1e-3:
            raise ConfigError(
                f"{label} has a cusp: space the points more evenly",
                code="RID-PATH-SEGMENT",
            )
        return KnottedCurve(knots, curve)


Segment = Annotated[
    LineSegment | ArcSegment | CircleSegment | SplineSegment, Field(discriminator="kind")
]


def _circular_curve(centre: FloatArray, x: FloatArray, y: FloatArray, angle: float) -> KnottedCurve:
    def curve(at: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        phi = (angle * at)[:, np.newaxis]
        out = np.cos(phi) * x + np.sin(phi) * y
        onwards = np.cos(phi) * y - np.sin(phi) * x
        return centre + out, angle * onwards, -(angle**2) * out

    return KnottedCurve(np.linspace(0.0, 1.0, 2), curve)


def _millimetres(point: FloatArray) -> str:
    return f"({', '.join(f'{1e3 * x:.1f}' for x in point)}) mm"
