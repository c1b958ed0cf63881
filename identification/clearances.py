"""`Clearances`: how far the robot's bodies stay from one another and from what is around them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import coal
import numpy as np

from acquisition.arrays import FloatArray
from config.bodies import Body, Box, Capsule, Plane, Workspace
from config.robot import RobotDescription
from dynamics.kinematics import Chain, link_transforms, point_jacobian

POINT_RADIUS_M = 1e-4


@dataclass(frozen=True)
class _Solid:
    """A shape of coal, the link that carries it, and its place in that link's frame."""

    name: str
    link: int
    shape: coal.CollisionGeometry
    rotation: FloatArray
    centre: FloatArray


@dataclass(frozen=True, eq=False)
class Clearances:
    """The pairs of solids whose distance counts.

    Bodies of the same link or of neighbouring links are not held against one another: they touch
    by design. A robot without bodies is held against the surroundings with its tool point alone.

    Attributes
    ----------
    chain : Chain
        The robot's geometry.
    pairs : tuple of (solid, solid)
        What must stay apart.
    margin_m : float
        The least distance.
    """

    chain: Chain
    pairs: tuple[tuple[_Solid, _Solid], ...]
    margin_m: float

    @classmethod
    def of(cls, robot: RobotDescription, workspace: Workspace | None = None) -> Clearances:
        """Take the pairs out of a robot's bodies and a cell's workspace."""
        workspace = workspace or Workspace()
        chain = Chain.from_description(robot)
        bodies = [_body_solid(body, number) for number, body in enumerate(robot.bodies, start=1)]
        pairs = [
            (first, second)
            for first, second in combinations(bodies, 2)
            if abs(first.link - second.link) > 1
        ]
        around = [_plane_solid(plane) for plane in workspace.planes]
        for box in workspace.boxes:
            around += _box_solids(box)
        moving = [body for body in bodies if body.link > 0]
        if around and not moving:
            ball = coal.Sphere(POINT_RADIUS_M)
            moving = [_Solid("the tool point", chain.n, ball, np.eye(3), chain.tool_m)]
        pairs += [(outside, body) for outside in around for body in moving]
        return cls(chain, tuple(pairs), workspace.clearance_m)

    def __len__(self) -> int:
        return len(self.pairs)

    @property
    def names(self) -> tuple[str, ...]:
        """What each pair is called in a message."""
        return tuple(f"{first.name} and {second.name}" for first, second in self.pairs)

    def distances(self, q: FloatArray) -> FloatArray:
        """Return the distance of each pair, negative where they overlap, (samples, pairs) [m]."""
        return self._measure(q)[0]

    def shortfall(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return by how much each pair is too close, and how that changes with the joints.

        Parameters
        ----------
        q : (samples, n) array
            Joint positions [rad or m].

        Returns
        -------
        shortfall : (samples, pairs) array
            Least distance less distance where that is positive, else 0 [m].
        gradient : (samples, n) array
            Derivative of half the sum over the pairs of the squared shortfalls of each sample.
        """
        distance, first_points, second_points, normals = self._measure(q)
        short = np.maximum(self.margin_m - distance, 0.0)
        gradient = np.zeros_like(q)
        rows, columns = np.nonzero(short)
        if len(rows) == 0:
            return short, gradient
        transforms = link_transforms(self.chain, q)[rows]
        for points, side, sign in ((first_points, 0, 1.0), (second_points, 1, -1.0)):
            links = np.array([self.pairs[c][side].link for c in columns])
            moved = point_jacobian(self.chain, transforms, links, points[rows, columns])
            along = np.einsum("sd,sdn->sn", normals[rows, columns], moved)
            np.add.at(gradient, rows, sign * short[rows, columns, np.newaxis] * along)
        return short, gradient

    def _measure(self, q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return distances, the nearest points of both solids, and the normals between them."""
        shape = (len(q), len(self.pairs))
        distance = np.full(shape, np.inf)
        first_points, second_points, normals = (np.zeros((*shape, 3)) for _ in range(3))
        if not self.pairs:
            return distance, first_points, second_points, normals
        solids = {id(solid): solid for pair in self.pairs for solid in pair}
        links = link_transforms(self.chain, q)
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        for sample in range(len(q)):
            places = {key: _place(solid, links[sample]) for key, solid in solids.items()}
            for column, (first, second) in enumerate(self.pairs):
                result.clear()
                distance[sample, column] = coal.distance(
                    first.shape,
                    places[id(first)],
                    second.shape,
                    places[id(second)],
                    request,
                    result,
                )
                first_points[sample, column] = result.getNearestPoint1()
                second_points[sample, column] = result.getNearestPoint2()
                normals[sample, column] = result.normal
        return distance, first_points, second_points, normals


def _place(solid: _Solid, links: FloatArray) -> coal.Transform3s:
    if solid.link == 0:
        return coal.Transform3s(solid.rotation, solid.centre)
    rotation, origin = links[solid.link - 1, :3, :3], links[solid.link - 1, :3, 3]
    return coal.Transform3s(rotation @ solid.rotation, rotation @ solid.centre + origin)


def _body_solid(body: Body, number: int) -> _Solid:
    name = f"link {body.link}'s body {number}" if body.link else f"the base's body {number}"
    if isinstance(body, Capsule):
        start, end = np.array(body.start_m), np.array(body.end_m)
        length = float(np.linalg.norm(end - start))
        shape = coal.Capsule(body.radius_m, length) if length else coal.Sphere(body.radius_m)
        return _Solid(name, body.link, shape, _z_along(end - start), (start + end) / 2.0)
    points = coal.StdVec_Vec3s()
    for point in body.points_m:
        points.append(np.array(point))
    hull = coal.Convex.convexHull(points, True, "Qt")
    return _Solid(name, body.link, hull, np.eye(3), np.zeros(3))


def _plane_solid(plane: Plane) -> _Solid:
    """Return the half-space behind a plane, where the robot must not be."""
    half = coal.Halfspace(np.array(plane.normal), plane.offset_m)
    return _Solid(plane.name, 0, half, np.eye(3), np.zeros(3))


def _box_solids(box: Box) -> list[_Solid]:
    low, high = np.array(box.min_m), np.array(box.max_m)
    if box.keep == "out":
        solid = coal.Box(*(high - low))
        return [_Solid(box.name, 0, solid, np.eye(3), (low + high) / 2.0)]
    walls = [(axis, low[k]) for k, axis in enumerate(np.eye(3))]
    walls += [(-axis, -high[k]) for k, axis in enumerate(np.eye(3))]
    return [
        _Solid(box.name, 0, coal.Halfspace(normal, offset), np.eye(3), np.zeros(3))
        for normal, offset in walls
    ]


def _z_along(direction: FloatArray) -> FloatArray:
    """Return a rotation whose third column points along a vector; the identity for none."""
    length = np.linalg.norm(direction)
    if length == 0.0:
        return np.eye(3)
    z = direction / length
    other = np.eye(3)[int(np.argmin(np.abs(z)))]
    x = np.cross(other, z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])
