"""Motion files of paths: lines, arcs and splines of the tool point, and joint positions."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from config.model import ConfigModel
from config.robot.robot import NonNegative, Positive, Vector3

Fraction = Annotated[float, Field(gt=0.0, le=1.0)]
JointRow = tuple[float, ...]


class PathSegment(ConfigModel):
    """What every segment of a path may say; the path's own values hold where it does not.

    `blend_m` is the distance before its end at which the path leaves it to round the corner to the
    next one; with 0 the tool point stops in the corner.
    """

    speed_m_s: Positive | None = None
    blend_m: NonNegative | None = None


class LineSegment(PathSegment):
    """A straight line to a point."""

    kind: Literal["line"]
    to_m: Vector3


class ArcSegment(PathSegment):
    """A circular arc through one point to another."""

    kind: Literal["arc"]
    through_m: Vector3
    to_m: Vector3


class CircleSegment(PathSegment):
    """`turns` round a centre, in the plane through it whose normal is given, right-handed.

    It begins where the segment before it ends; negative turns go the other way.
    """

    kind: Literal["circle"]
    centre_m: Vector3
    normal: Vector3 = (0.0, 0.0, 1.0)
    turns: float = 1.0

    @model_validator(mode="after")
    def _goes_somewhere(self) -> CircleSegment:
        if not any(self.normal):
            raise ValueError("normal must not be zero")
        if self.turns == 0.0 or abs(self.turns) > 1000.0:
            raise ValueError(f"turns must be between -1000 and 1000 and not 0: {self.turns}")
        return self


class SplineSegment(PathSegment):
    """A smooth curve (of class C2) through points, the last of which is its end."""

    kind: Literal["spline"]
    through_m: tuple[Vector3, ...] = Field(min_length=2, max_length=10_000)


Segment = Annotated[
    LineSegment | ArcSegment | CircleSegment | SplineSegment, Field(discriminator="kind")
]


class PathMotion(ConfigModel):
    """The tool point follows lines, arcs, circles and splines, from rest to rest.

    Points are in the base frame. `near` (one value a joint) chooses among the ways in which the arm
    reaches the start, and the orientation that the flange keeps. Along the path the speed changes
    within `acceleration_m_s2` and `jerk_m_s3`; across it, in curves, both hold as well. Where that
    or a joint's limit asks for it the path is driven more slowly than `speed_m_s`, unless
    `keep_speed` says that this is an error. The tool point rests for `dwell_s` at the start, the
    end, and in corners without a blend.
    """

    kind: Literal["path"]
    robot: str
    start_m: Vector3
    near: JointRow = Field(min_length=1)
    speed_m_s: Positive
    acceleration_m_s2: Positive = 4.0
    jerk_m_s3: Positive = 80.0
    blend_m: NonNegative = 0.0
    keep_speed: bool = False
    dwell_s: Annotated[float, Field(ge=0.0, le=60.0)] = 0.2
    segments: tuple[Segment, ...] = Field(min_length=1, max_length=10_000)


class JointPathMotion(ConfigModel):
    """A smooth curve (of class C2) through poses, from rest to rest, as fast as is allowed.

    Every row of `points` has one value a joint, base to flange [rad or m]. `speed_fraction` is of
    the joints' limits of velocity and acceleration; the acceleration takes `jerk_time_s` to change
    from one limit to the other.
    """

    kind: Literal["joint_path"]
    robot: str
    points: tuple[JointRow, ...] = Field(min_length=2, max_length=10_000)
    speed_fraction: Fraction = 0.5
    jerk_time_s: Positive = 0.1
    dwell_s: Annotated[float, Field(ge=0.0, le=60.0)] = 0.2


class JointTableMotion(ConfigModel):
    """Joint positions over time, from a CSV `file` beside the motion file, or written in it.

    The file has a column `time_s` and one a joint, by its name [rad or m]; a smooth curve (of class
    C4) goes through its rows. It must begin and end at rest. Written in the motion file itself,
    `joints` names the columns of `position`.
    """

    kind: Literal["joint_table"]
    robot: str
    file: str | None = None
    joints: tuple[str, ...] = ()
    time_s: tuple[float, ...] = Field(default=(), max_length=1_000_000)
    position: tuple[JointRow, ...] = Field(default=(), max_length=1_000_000)
    dwell_s: Annotated[float, Field(ge=0.0, le=60.0)] = 0.2

    @model_validator(mode="after")
    def _one_source(self) -> JointTableMotion:
        if (self.file is None) == (not self.time_s):
            raise ValueError("give either file, or joints, time_s and position")
        if len(self.time_s) != len(self.position):
            raise ValueError(
                f"time_s has {len(self.time_s)} rows, position {len(self.position)}: give the same"
            )
        for number, row in enumerate(self.position, start=1):
            if len(row) != len(self.joints):
                raise ValueError(
                    f"row {number} of position has {len(row)} values for {len(self.joints)} joints"
                )
        return self
