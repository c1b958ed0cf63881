"""Conversion of joint axes, given as lines in space, to modified Denavit-Hartenberg rows.

If two neighbouring axes are far from parallel, x is their common normal (Khalil and Kleinfinger
1986). If they are nearly parallel, their common normal may lie arbitrarily far away, and Hayati's
angle beta is used (Hayati 1983). Both descriptions are exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.robot.kinematic_table import KinematicRow

NEARLY_PARALLEL: Final = 0.17  # sine of the angle, about 10 degrees
_EXACT: Final = 1e-12


@dataclass(frozen=True, eq=False)
class AxisPoses:
    """Denavit-Hartenberg rows with the placement of their frames at position zero.

    Attributes:
        origin_m: Shape (3,). Origin of frame 0 in the root frame; frame 0 has the root frame's
            axes.
        rows: One per joint, modified convention.
        frames: Shape (n + 1, 4, 4). Frames 0 to n in the root frame at position zero.
    """

    origin_m: FloatArray
    rows: tuple[KinematicRow, ...]
    frames: FloatArray


def rows_of_axes(points_m: FloatArray, directions: FloatArray, last: FloatArray) -> AxisPoses:
    """Return the modified Denavit-Hartenberg rows of a chain of joint axes.

    Frame 0 is the root frame if row 1 can start from it; otherwise it is the root frame translated
    to the first axis, without rotation.

    Args:
        points_m: Shape (n, 3). A point on each axis, in the root frame, all joints at zero; a
            frame's origin is put there if the geometry does not determine it.
        directions: Shape (n, 3). Unit vectors along the axes, in the sense of positive motion.
        last: Shape (3, 3). Rotation of the tool in the root frame. The x axis of the last frame is
            as close as possible to the tool's x axis.
    """
    n = len(points_m)
    origin, x = _root_frame(points_m[0], directions[0])
    frames = np.zeros((n + 1, 4, 4))
    frames[0] = _frame(np.eye(3), origin)
    rows: list[KinematicRow] = []
    place, x_before = origin, x
    for i in range(n):
        # In frame i, x_before points from `place` on axis i to `crossing` on axis i + 1.
        z = frames[i, :3, 2]
        crossing, a = _crossing(place, z, x_before, points_m[i], directions[i])
        if i + 1 < n:
            foot, x_next = _next_origin(
                points_m[i], directions[i], points_m[i + 1], directions[i + 1], x_before
            )
        else:
            foot, x_next = points_m[i], _perpendicular(last[:, 0], directions[i])
        start = np.column_stack([x_before, np.cross(z, x_before), z])
        end = np.column_stack([x_next, np.cross(directions[i], x_next), directions[i]])
        w = start.T @ directions[i]
        if _sine(z, directions[i]) >= NEARLY_PARALLEL and i > 0:
            w[0] = 0.0  # x is the common normal
        alpha, beta = np.arctan2(-w[1], w[2]), np.arctan2(w[0], np.hypot(w[1], w[2]))
        rest = (_about_x(alpha) @ _about_y(beta)).T @ start.T @ end
        d = float((foot - crossing) @ directions[i])
        theta = np.arctan2(rest[1, 0], rest[0, 0])
        rows.append(
            KinematicRow(
                alpha_rad=_round_off(alpha),
                beta_rad=_round_off(beta),
                theta_rad=_round_off(theta),
                a_m=_round_off(a),
                d_m=_round_off(d),
            )
        )
        frames[i + 1] = _frame(np.real(end), foot)
        place, x_before = foot, x_next
    return AxisPoses(origin, tuple(rows), frames)


def _root_frame(point: FloatArray, direction: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return origin and x axis of frame 0.

    Frame 0 is the root frame if axis 1 crosses the root's x axis. Otherwise its origin is on axis
    1.
    """
    x = np.array([1.0, 0.0, 0.0])
    across = direction[1:]
    length = across @ across
    nearest = point - direction * ((across @ point[1:]) / length if length > _EXACT else point[0])
    size = max(1.0, float(np.abs(point).max()))
    if np.abs(nearest[1:]).max() <= _EXACT * size:
        return np.zeros(3), x
    return np.array(point), x


def _next_origin(
    p: FloatArray, u: FloatArray, p_next: FloatArray, u_next: FloatArray, x_before: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return a frame's origin on its axis (p, u), and its x, which points to the next axis."""
    normal = np.cross(u, u_next)
    sine = float(np.linalg.norm(normal))
    size = max(1.0, float(np.abs(p).max()), float(np.abs(p_next).max()))
    if sine < NEARLY_PARALLEL:
        crossing = p_next - u_next * (((p_next - p) @ u) / (u_next @ u))
        across = crossing - p
        length = float(np.linalg.norm(across))
        if length <= _EXACT * size:
            return p, _perpendicular(x_before, u)
        return p, _perpendicular(across / length, u)
    x = normal / sine
    between = p_next - p
    foot = p + u * (np.cross(between, u_next) @ normal / sine**2)
    distance = float(between @ x)
    backwards = distance < 0.0 if abs(distance) > _EXACT * size else x @ x_before < -_EXACT
    return foot, -x if backwards else x


def _crossing(
    place: FloatArray, z: FloatArray, x: FloatArray, p: FloatArray, u: FloatArray
) -> tuple[FloatArray, float]:
    """Return the point of axis (p, u) on the line from `place` along x, and the distance to it."""
    if _sine(z, u) < NEARLY_PARALLEL:
        crossing = p - u * (((p - place) @ z) / (u @ z))
        return crossing, float((crossing - place) @ x)
    # At the root, x is given and is not normal to u. Solve for the point at which the two lines
    # intersect.
    system = np.column_stack([x, -u])
    along, back = np.linalg.lstsq(system, p - place, rcond=None)[0]
    return p + back * u, float(along)


def _perpendicular(wanted: FloatArray, u: FloatArray) -> FloatArray:
    """Return the unit vector normal to u that is closest to `wanted`."""
    for candidate in (wanted, *np.eye(3)):
        x = candidate - u * (candidate @ u)
        length = float(np.linalg.norm(x))
        if length > 1e-3:
            x = x / length
            x = x - u * (x @ u)
            return np.asarray(x / np.linalg.norm(x))
    raise AssertionError("an axis cannot be parallel to x, y and z")


def _sine(u: FloatArray, w: FloatArray) -> float:
    return float(np.linalg.norm(np.cross(u, w)))


def _frame(rotation: FloatArray, origin: FloatArray) -> FloatArray:
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = rotation, origin
    return frame


def _about_x(angle: float) -> FloatArray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def _about_y(angle: float) -> FloatArray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def _round_off(value: float) -> float:
    """Return a value without rounding errors: values close to 0, ±pi/2 and ±pi become exact."""
    rounded = round(float(value), 15)
    for exact in (0.0, np.pi, -np.pi, np.pi / 2.0, -np.pi / 2.0):
        if abs(value - exact) < 4e-15:
            return abs(exact) if abs(exact) == np.pi else float(exact)
    return rounded if abs(rounded) >= _EXACT else 0.0
