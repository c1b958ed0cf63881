"""`Body`: the space that a link occupies, for collision checks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from config.model import ConfigModel, refuse_same_names
from config.plausible import Plausible

Point = Annotated[tuple[float, float, float], Plausible(0.0, 200.0, "m")]
BodyName = Annotated[str, Field(max_length=80)]
Length = Annotated[float, Field(gt=0.0), Plausible(1e-4, 5.0, "m")]


class Capsule(ConfigModel):
    """A cylinder with hemispherical ends; a sphere if both ends are the same point.

    Attributes:
        kind: Kind of body.
        link: The link in whose frame the points are, 0 for the base.
        name: Name of the body in messages and in `may_touch`; without it, messages show its number.
        start_m: First end of the axis.
        end_m: Second end of the axis.
        radius_m: Radius.
    """

    kind: Literal["capsule"]
    link: Annotated[int, Field(ge=0)]
    name: BodyName = ""
    start_m: Point
    end_m: Point
    radius_m: Length


class Hull(ConfigModel):
    """The convex hull of some points, such as a simplified mesh, and a margin around it.

    Attributes:
        kind: Kind of body.
        link: The link in whose frame the points are, 0 for the base.
        name: Name of the body in messages and in `may_touch`; without it, messages show its number.
        points_m: The points.
        radius_m: Margin: all points within this distance of the hull belong to the body.
    """

    kind: Literal["hull"]
    link: Annotated[int, Field(ge=0)]
    name: BodyName = ""
    points_m: tuple[Point, ...] = Field(min_length=4, max_length=2000)
    radius_m: Annotated[float, Field(ge=0.0), Plausible(1e-5, 1.0, "m")] = 0.0

    @model_validator(mode="after")
    def _check_volume(self) -> Hull:
        points = np.array(self.points_m)
        sizes = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
        if sizes[2] <= 1e-6 * sizes[0]:
            raise ValueError("points_m lie in one plane: give points that span a volume")
        return self


Body = Annotated[Capsule | Hull, Field(discriminator="kind")]


class Plane(ConfigModel):
    """A wall or floor in the base frame: the robot stays on the side `normal` . p > `offset_m`.

    Attributes:
        name: Name of the plane in messages.
        normal: Direction towards the robot.
        offset_m: Distance of the plane from the origin, along the normal.
    """

    name: str
    normal: tuple[float, float, float]
    offset_m: Annotated[float, Plausible(0.0, 200.0, "m")]

    @model_validator(mode="after")
    def _check_normal(self) -> Plane:
        length = sum(c * c for c in self.normal) ** 0.5
        if abs(length - 1.0) > 1e-6:
            raise ValueError(
                f"normal must be a unit vector, its length is {length:.6g}; divide it by its length"
            )
        return self


class Box(ConfigModel):
    """A box along the axes of the base frame.

    Attributes:
        name: Name of the box in messages.
        keep: The robot stays `out` of the box or `in` it.
        min_m: Corner with the smallest coordinates.
        max_m: Corner with the largest coordinates.
    """

    name: str
    keep: Literal["out", "in"]
    min_m: Point
    max_m: Point

    @model_validator(mode="after")
    def _check_corners(self) -> Box:
        if any(low >= high for low, high in zip(self.min_m, self.max_m, strict=True)):
            raise ValueError(f"min_m {self.min_m} must be below max_m {self.max_m} on every axis")
        return self


class Workspace(ConfigModel):
    """The space in which the robot may move; bodies of the base (link 0) may be outside.

    Attributes:
        planes: Walls and floors.
        boxes: Boxes that the robot stays out of or stays in.
        clearance_m: Smallest distance between two bodies, or of a body from the edges of the space.
    """

    planes: tuple[Plane, ...] = ()
    boxes: tuple[Box, ...] = ()
    clearance_m: Annotated[float, Field(ge=0.0), Plausible(1e-4, 1.0, "m")] = 0.02


def refuse_unknown_pairs(bodies: Sequence[Body], may_touch: Sequence[tuple[str, str]]) -> None:
    """Raise ValueError if two bodies share a name, or a pair does not name two bodies."""
    names = [body.name for body in bodies if body.name]
    refuse_same_names(names, "bodies")
    for first, second in may_touch:
        if first == second or not {first, second} <= set(names):
            raise ValueError(
                f"may_touch has {first!r} and {second!r}: give the names of two different bodies;"
                f" bodies are {', '.join(names) or 'without names'}"
            )
