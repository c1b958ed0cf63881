"""`Solid`: a body of the robot or of its surroundings, as a shape of the library coal."""

from __future__ import annotations

import math
from dataclasses import dataclass

import coal  # pyright: ignore[reportMissingImports]
import numpy as np

from config.arrays import FloatArray
from config.robot.bodies import Body, Box, Capsule, Plane


@dataclass(frozen=True)
class Solid:
    """A collision shape (of the library coal), the link that carries it, and its pose on the link.

    A capsule encloses the solid: all points within `radius` of a line segment, whose middle is
    `centre` and whose ends are `centre` ± `half`. Solids of the workspace have no capsule. `body`
    is the name of the body in the robot file; empty for solids of the workspace. All points within
    `margin` of the shape belong to the solid.
    """

    name: str
    link: int
    shape: coal.CollisionGeometry
    rotation: FloatArray
    centre: FloatArray
    half: FloatArray
    radius: float
    body: str = ""
    margin: float = 0.0

    @property
    def reach(self) -> float:
        """Radius of the sphere around `centre` that encloses the capsule [m]."""
        return self.radius + float(np.linalg.norm(self.half))

    def line(self, links: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return `centre` and `half` in the base frame, (samples, 3) each.

        Args:
            links: Shape (samples, n, 4, 4). Transforms from the link frames to the base frame.
        """
        if self.link == 0:
            shape = (len(links), 3)
            return np.broadcast_to(self.centre, shape), np.broadcast_to(self.half, shape)
        link = links[:, self.link - 1]
        rotation, origin = link[:, :3, :3], link[:, :3, 3]
        return np.asarray(rotation @ self.centre + origin), np.asarray(rotation @ self.half)

    def place(self, links: FloatArray) -> coal.Transform3s:
        """Return the shape's pose in the base frame, for the links of one sample, (n, 4, 4)."""
        if self.link == 0:
            return coal.Transform3s(self.rotation, self.centre)
        rotation, origin = links[self.link - 1, :3, :3], links[self.link - 1, :3, 3]
        return coal.Transform3s(rotation @ self.rotation, rotation @ self.centre + origin)


def body_solid(body: Body, number: int) -> Solid:
    """Return a body of the robot file as a solid; a body without name is named by its number."""
    carrier = f"link {body.link}" if body.link else "the base"
    name = f"{carrier}'s body {body.name or number}"
    if isinstance(body, Capsule):
        start, end = np.array(body.start_m), np.array(body.end_m)
        centre, half = (start + end) / 2.0, (end - start) / 2.0
        if not half.any():
            return ball(name, body.link, centre, body.radius_m, body.name)
        shape = coal.Capsule(body.radius_m, 2.0 * float(np.linalg.norm(half)))
        turn = _z_along(half)
        return Solid(name, body.link, shape, turn, centre, half, body.radius_m, body.name)
    corners = np.array(body.points_m)
    centre, half, radius = _enclosing_capsule(corners)
    points = coal.StdVec_Vec3s()
    for corner in corners:
        points.append(corner - centre)
    hull = coal.Convex.convexHull(points, True, "Qt")
    radius += body.radius_m
    return Solid(name, body.link, hull, np.eye(3), centre, half, radius, body.name, body.radius_m)


def _enclosing_capsule(points: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """Return a capsule that contains points, (points, 3): its centre, half axis (3,) and radius.

    Its axis is the first principal axis of the points, along which they scatter most.
    """
    middle = points.mean(axis=0)
    axis = np.linalg.svd(points - middle, full_matrices=False)[2][0]
    along = (points - middle) @ axis
    across = points - middle - along[:, np.newaxis] * axis
    centre_across = (across.min(axis=0) + across.max(axis=0)) / 2.0
    centre_across -= (centre_across @ axis) * axis
    offset = np.linalg.norm(across - centre_across, axis=1)
    radius = float(offset.max())
    cap = np.sqrt(np.maximum(radius**2 - offset**2, 0.0))
    low, high = float((along + cap).min()), float((along - cap).max())
    if low > high:
        low = high = (low + high) / 2.0
    centre = middle + centre_across + 0.5 * (low + high) * axis
    return centre, 0.5 * (high - low) * axis, radius


def ball(name: str, link: int, centre: FloatArray, radius: float, body: str = "") -> Solid:
    """Return a ball around `centre`, (3,) [m], in the frame of the link, as a solid."""
    return Solid(name, link, coal.Sphere(radius), np.eye(3), centre, np.zeros(3), radius, body)


def plane_solid(plane: Plane) -> Solid:
    """Return the half-space behind a plane as a solid that the robot must not enter."""
    return _half_space(plane.name, np.array(plane.normal), plane.offset_m)


def _half_space(name: str, normal: FloatArray, offset: float) -> Solid:
    shape = coal.Halfspace(normal, offset)
    return Solid(name, 0, shape, np.eye(3), np.zeros(3), np.zeros(3), math.inf)


def box_solids(box: Box) -> list[Solid]:
    """Return the box as one solid, or the half-spaces behind the six walls of a box to stay in."""
    low, high = np.array(box.min_m), np.array(box.max_m)
    if box.keep == "out":
        shape, centre = coal.Box(*(high - low)), (low + high) / 2.0
        return [Solid(box.name, 0, shape, np.eye(3), centre, np.zeros(3), math.inf)]
    walls = [_half_space(box.name, axis, low[k]) for k, axis in enumerate(np.eye(3))]
    return walls + [_half_space(box.name, -axis, -high[k]) for k, axis in enumerate(np.eye(3))]


def _z_along(direction: FloatArray) -> FloatArray:
    """Return a rotation whose third column is the direction of a vector."""
    z = direction / np.linalg.norm(direction)
    other = np.eye(3)[int(np.argmin(np.abs(z)))]
    x = np.cross(other, z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])
