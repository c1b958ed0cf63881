"""`Clearances`: distances between the robot's bodies, and from them to the workspace's solids."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import coal  # pyright: ignore[reportMissingImports]
import numpy as np

from config.arrays import FloatArray, IntArray
from config.errors import ConfigError
from config.robot.bodies import Workspace
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain, link_transforms, point_jacobian
from dynamics.geometry.solids import Solid, ball, body_solid, box_solids, plane_solid

POINT_RADIUS_M = 1e-4
_ROUNDED_M = 1e-9


@dataclass(frozen=True)
class Touch:
    """Distances of pairs of solids, one row per measured pair and pose.

    Attributes:
        distance: Shape (rows,). Distances [m]; negative if the solids overlap.
        points: Two arrays, (rows, 3). The nearest points on the first and the second solid, in the
            base frame [m].
        normals: Shape (rows, 3). Unit vectors from the first to the second solid, base frame.
    """

    distance: FloatArray
    points: tuple[FloatArray, FloatArray]
    normals: FloatArray


@dataclass(frozen=True, eq=False)
class Clearances:
    """Pairs of solids whose distance is checked.

    Bodies that touch by design are not checked against each other: bodies of the same link or of
    neighbouring links, and the pairs in `may_touch` of the robot file. If no link that moves has
    a body, the tool point is checked against the workspace instead. Lower bounds from enclosing
    capsules avoid the exact computation of most distances.

    Attributes:
        chain: The robot's geometry.
        pairs: Pairs of solids that must stay apart; the second solid of each pair is a body of the
            robot or its tool point.
        margin_m: The smallest allowed distance.
    """

    chain: Chain
    pairs: tuple[tuple[Solid, Solid], ...]
    margin_m: float

    @classmethod
    def of(cls, robot: RobotDescription, workspace: Workspace | None = None) -> Clearances:
        """Return the pairs to check for a robot's bodies and the solids of a cell's workspace."""
        workspace = workspace or Workspace()
        chain = Chain.from_description(robot)
        bodies = [body_solid(body, number) for number, body in enumerate(robot.bodies, start=1)]
        touching = {frozenset(pair) for pair in robot.may_touch}
        pairs = [
            (first, second)
            for first, second in combinations(bodies, 2)
            if abs(first.link - second.link) > 1
            and frozenset((first.body, second.body)) not in touching
        ]
        around = [plane_solid(plane) for plane in workspace.planes]
        for box in workspace.boxes:
            around += box_solids(box)
        moving = [body for body in bodies if body.link > 0]
        if around and not moving:
            moving = [ball("the tool point", chain.n, chain.tool_m, POINT_RADIUS_M)]
        pairs += [(outside, body) for outside in around for body in moving]
        return cls(chain, tuple(pairs), workspace.clearance_m)

    def __len__(self) -> int:
        return len(self.pairs)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the pairs for messages."""
        return tuple(f"{first.name} and {second.name}" for first, second in self.pairs)

    def nearest(self, q: FloatArray) -> FloatArray:
        """Return each pair's smallest distance, (pairs,) [m], over the poses q, (samples, n).

        The distance is negative if the two solids overlap.
        """
        links = link_transforms(self.chain, q)
        bounds = self.lower_bounds(links)
        nearest = np.full(len(self), np.inf)
        for column in range(len(self)):
            order = np.argsort(bounds[:, column])
            for rows in np.array_split(order, math.ceil(len(order) / 8)):
                if bounds[rows[0], column] >= nearest[column]:
                    break
                found = self.measure(links, rows, np.full(len(rows), column)).distance
                nearest[column] = min(nearest[column], float(found.min()))
        return nearest

    def is_clear(self, q: FloatArray) -> bool:
        """Return True if every pair keeps the margin in all poses q, (samples, n)."""
        links = link_transforms(self.chain, q)
        rows, columns = self._near(links)
        return all(
            bool(
                (self.measure(links, rows[k:][:8], columns[k:][:8]).distance >= self.margin_m).all()
            )
            for k in range(0, len(rows), 8)
        )

    def clear_pose(self, first: FloatArray, others: FloatArray, robot: str) -> FloatArray:
        """Return a pose (n,) that keeps the margin: `first`, or else one of `others` (poses, n).

        Raises:
            ConfigError: No pose keeps the margin; the message contains `robot` as the robot's name.
        """
        for pose in (first, *others):
            if self.is_clear(pose[np.newaxis]):
                return np.asarray(pose)
        raise ConfigError(
            f"robot {robot!r}: none of {1 + len(others)} poses keeps the robot clear of itself"
            " and of the workspace: check `bodies` in the robot file and `workspace` in the cell"
            " file",
            code="RID-DESIGN-NONE",
        )

    def shortfall(self, q: FloatArray) -> tuple[float, FloatArray]:
        """Return the sum of squares by which distances fall short of the margin, and its gradient.

        Args:
            q: Shape (samples, n). Joint positions [rad or m].

        Returns:
            `squares`. Sum over samples and pairs of (margin - distance)^2 for distances below the
            margin [m^2]. `gradient`, shape (samples, n). Derivatives of `squares` by the joint
            positions.
        """
        gradient = np.zeros_like(q)
        links = link_transforms(self.chain, q)
        rows, columns = self._near(links)
        touch = self.measure(links, rows, columns)
        short = self.margin_m - touch.distance
        close = short > 0.0
        rows, columns, short = rows[close], columns[close], short[close]
        for side, sign in ((0, 2.0), (1, -2.0)):
            carriers = np.array([self.pairs[c][side].link for c in columns], dtype=np.intp)
            moved = point_jacobian(self.chain, links[rows], carriers, touch.points[side][close])
            along = np.einsum("sd,sdn->sn", touch.normals[close], moved)
            np.add.at(gradient, rows, sign * short[:, np.newaxis] * along)
        return float(short @ short), gradient

    def lower_bounds(self, links: FloatArray) -> FloatArray:
        """Return a lower bound of the distance in each pair, (samples, pairs) [m]."""
        lines = self._lines(links)
        bounds = np.empty((len(links), len(self)))
        for column, (first, second) in enumerate(self.pairs):
            bounds[:, column] = _bound(first, lines[id(first)], second, lines[id(second)])
        return bounds

    def _near(self, links: FloatArray) -> tuple[IntArray, IntArray]:
        """Return sample and pair numbers of the distances that may be below the margin.

        For two bodies of the robot, the lower bound is computed only if the spheres around them
        come close. The result is ordered by samples.
        """
        lines = self._lines(links)
        samples, pairs = [], []
        for column, rows in self._balls_meet(lines):
            first, second = self.pairs[column]
            line, other = lines[id(first)], lines[id(second)]
            line, other = (line[0][rows], line[1][rows]), (other[0][rows], other[1][rows])
            rows = rows[_bound(first, line, second, other) < self.margin_m]
            samples.append(rows)
            pairs.append(np.full(len(rows), column))
        row = np.concatenate([np.zeros(0, np.intp), *samples])
        column_of = np.concatenate([np.zeros(0, np.intp), *pairs])
        order = np.lexsort((column_of, row))
        return row[order], column_of[order]

    def _balls_meet(
        self, lines: dict[int, tuple[FloatArray, FloatArray]]
    ) -> Iterator[tuple[int, IntArray]]:
        """Yield pairs whose enclosing spheres violate the margin, with the samples of violation.

        Solids of the workspace have no enclosing sphere; their pairs are yielded with all samples.
        """
        if not self.pairs:
            return
        numbers = {key: number for number, key in enumerate(lines)}
        centres = np.stack([centre for centre, _ in lines.values()], axis=1)
        inner = centres @ centres.transpose(0, 2, 1)
        squares = np.diagonal(inner, axis1=1, axis2=2)
        squared_gap = squares[:, :, np.newaxis] + squares[:, np.newaxis] - 2.0 * inner
        reach = np.array([solid.reach for solid in self._solids().values()])
        reach = reach[:, np.newaxis] + reach + (self.margin_m + _ROUNDED_M)
        close = squared_gap < reach * reach
        some = np.asarray(close.any(axis=0))
        for column, (first, second) in enumerate(self.pairs):
            if isinstance(first.shape, coal.Halfspace | coal.Box):
                yield column, np.arange(len(close))
                continue
            ends = numbers[id(first)], numbers[id(second)]
            if some[ends]:
                yield column, np.flatnonzero(close[:, *ends])

    def _solids(self) -> dict[int, Solid]:
        """Return all solids of the pairs, each once, by the `id` of the object."""
        return {id(solid): solid for pair in self.pairs for solid in pair}

    def _lines(self, links: FloatArray) -> dict[int, tuple[FloatArray, FloatArray]]:
        """Return `centre` and `half` of each solid in the base frame, by the `id` of the object."""
        return {key: solid.line(links) for key, solid in self._solids().items()}

    def measure(self, links: FloatArray, rows: IntArray, columns: IntArray) -> Touch:
        """Compute, by the library coal, the distance of pair `columns[k]` in sample `rows[k]`."""
        distance, normals = np.empty(len(rows)), np.empty((len(rows), 3))
        points = np.empty((len(rows), 3)), np.empty((len(rows), 3))
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        for k, (row, column) in enumerate(zip(rows, columns, strict=True)):
            first, second = self.pairs[column]
            result.clear()
            distance[k] = coal.distance(
                first.shape,
                first.place(links[row]),
                second.shape,
                second.place(links[row]),
                request,
                result,
            )
            normals[k] = result.normal
            points[0][k] = result.getNearestPoint1() + first.margin * normals[k]
            points[1][k] = result.getNearestPoint2() - second.margin * normals[k]
            distance[k] -= first.margin + second.margin
        return Touch(distance, points, normals)


def _bound(
    first: Solid,
    line: tuple[FloatArray, FloatArray],
    second: Solid,
    other: tuple[FloatArray, FloatArray],
) -> FloatArray:
    """Return a lower bound of the distance of two solids, (samples,) [m].

    The capsule of a body replaces the body; `first` can also be a half-space or a box.
    """
    centre, half = other
    if isinstance(first.shape, coal.Halfspace):
        height = centre @ first.shape.n - np.abs(half @ first.shape.n) - first.shape.d
        return np.asarray(height - second.radius)
    if isinstance(first.shape, coal.Box):
        # Distance from the box to the axis-aligned bounding box of the capsule's line segment.
        size = first.shape.halfSide + np.abs(half)
        beyond = np.maximum(np.abs(centre - first.centre) - size, 0.0)
        return np.asarray(np.linalg.norm(beyond, axis=1) - second.radius)
    return _line_distance(*line, centre, half) - first.radius - second.radius


def _line_distance(
    first: FloatArray, half_first: FloatArray, second: FloatArray, half_second: FloatArray
) -> FloatArray:
    """Return the distances of two line segments, (samples,); Ericson (2005), section 5.1.9."""
    r = first - second
    a, b, e, c, f = (
        np.einsum("sd,sd->s", left, right)
        for left, right in (
            (half_first, half_first),
            (half_first, half_second),
            (half_second, half_second),
            (half_first, r),
            (half_second, r),
        )
    )
    along_first = _clipped_quotient(b * f - c * e, a * e - b * b)
    along_second = _clipped_quotient(b * along_first + f, e)
    along_first = _clipped_quotient(b * along_second - c, a)
    offset = r + along_first[:, np.newaxis] * half_first - along_second[:, np.newaxis] * half_second
    return np.asarray(np.linalg.norm(offset, axis=1))


def _clipped_quotient(numerator: FloatArray, denominator: FloatArray) -> FloatArray:
    """Return numerator / denominator, limited to -1..1; 0 if the denominator is almost 0."""
    safe = np.where(denominator > 1e-12, denominator, 1.0)
    return np.clip(np.where(denominator > 1e-12, numerator / safe, 0.0), -1.0, 1.0)
