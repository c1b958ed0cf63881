"""Load data with the inertia as principal moments and axes: KUKA, ABB."""

from __future__ import annotations

import numpy as np

from config.arrays import FloatArray
from config.formats.urdf import rotation_of_rpy, rpy_of_rotation
from identification.payload.body import PayloadBody
from identification.payload.controllers.text import (
    NUMBER,
    Digits,
    comments,
    find_match,
    match_numbers,
)


def _about(mass: float, centre: FloatArray, moments: FloatArray, axes: FloatArray) -> PayloadBody:
    """Return a body with principal moments about axes that are the columns of a rotation."""
    inertia = axes @ np.diag(moments) @ axes.T
    return PayloadBody(mass, centre, (inertia + inertia.T) / 2.0)


# KUKA: mm, principal axes turned by A about z, then B about the new y, then C about the new x.


def to_kuka(body: PayloadBody, origin: tuple[str, ...], digits: Digits) -> str:
    """Write KUKA's LOAD_DATA."""
    moments, axes = body.principal
    c, b, a = (np.degrees(angle) for angle in rpy_of_rotation(axes))
    x, y, z = 1e3 * body.centre_m
    head = (
        *origin,
        "M [kg]; CM X, Y, Z [mm]: centre of gravity from the flange; CM A, B, C [deg]: principal",
        "axes in the flange's (A about Z, then B about Y, then C about X); J [kg m^2]: principal",
        "moments about the centre of gravity. Copy the line into $CONFIG.DAT, with your tool's",
        "number, or enter the values under the tool's load data.",
    )
    return comments(";", head) + (
        f"LOAD_DATA[1]={{M {digits(body.mass_kg)},CM {{X {digits(x)},Y {digits(y)},Z {digits(z)},"
        f"A {digits(a)},B {digits(b)},C {digits(c)}}},"
        f"J {{X {digits(moments[0])},Y {digits(moments[1])},Z {digits(moments[2])}}}}}\n"
    )


def from_kuka(text: str) -> PayloadBody:
    """Read KUKA's LOAD_DATA; raise ValueError for any other text."""
    s = r"\s*"
    pattern = (
        rf"\{{{s}M\s+{NUMBER}{s},{s}CM{s}\{{{s}X\s+{NUMBER}{s},{s}Y\s+{NUMBER}{s},{s}Z\s+{NUMBER}"
        rf"{s},{s}A\s+{NUMBER}{s},{s}B\s+{NUMBER}{s},{s}C\s+{NUMBER}{s}\}}{s},"
        rf"{s}J{s}\{{{s}X\s+{NUMBER}{s},{s}Y\s+{NUMBER}{s},{s}Z\s+{NUMBER}{s}\}}{s}\}}"
    )
    values = match_numbers(
        find_match(pattern, text, "{M ..,CM {X ..,Y ..,Z ..,A ..,B ..,C ..},J {..}}")
    )
    a, b, c = np.radians(values[4:7])
    return _about(float(values[0]), values[1:4] / 1e3, values[7:], rotation_of_rpy(c, b, a))


# ABB: mm, principal axes as a quaternion, scalar first.


def to_abb(body: PayloadBody, origin: tuple[str, ...], digits: Digits) -> str:
    """Write ABB's loaddata."""
    moments, axes = body.principal
    quaternion = ",".join(digits(q) for q in _quaternion(axes))
    centre = ",".join(digits(1e3 * x) for x in body.centre_m)
    inertia = ",".join(digits(moment) for moment in moments)
    head = (
        *origin,
        "loaddata: mass [kg]; cog x, y, z [mm]; aom q1..q4: principal axes as a quaternion, scalar",
        "first; ix, iy, iz [kg m^2]: principal moments about the centre of gravity.",
        "Frame: the wrist (tool0). Use it as the load in a tooldata, or in GripLoad with tool0;",
        "for a payload that a tool holds, ABB requires the frame of that tool instead.",
    )
    return (
        comments("!", head)
        + f"PERS loaddata load1:=[{digits(body.mass_kg)},[{centre}],[{quaternion}],{inertia}];\n"
    )


def from_abb(text: str) -> PayloadBody:
    """Read ABB's loaddata; raise ValueError for any other text."""
    further = rf"\s*,\s*{NUMBER}"
    pattern = (
        rf":=\s*\[\s*{NUMBER}\s*,\s*\[\s*{NUMBER}{2 * further}\s*\]\s*,"
        rf"\s*\[\s*{NUMBER}{3 * further}\s*\]{3 * further}\s*\]"
    )
    values = match_numbers(
        find_match(pattern, text, "loaddata [mass,[x,y,z],[q1,q2,q3,q4],ix,iy,iz]")
    )
    axes = _rotation(values[4:8])
    return _about(float(values[0]), values[1:4] / 1e3, values[8:], axes)


def _quaternion(rotation: FloatArray) -> FloatArray:
    """Return the unit quaternion of a rotation, scalar first and not negative."""
    # The root is taken of the largest of four squares, to avoid division by small values.
    trace = float(np.trace(rotation))
    squares = np.array([trace, *np.diagonal(rotation)])
    largest = int(np.argmax(squares))
    q = np.empty(4)
    if largest == 0:
        q[0] = 1.0 + trace
        q[1] = rotation[2, 1] - rotation[1, 2]
        q[2] = rotation[0, 2] - rotation[2, 0]
        q[3] = rotation[1, 0] - rotation[0, 1]
    else:
        i = largest - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        q[0] = rotation[k, j] - rotation[j, k]
        q[1 + i] = 1.0 + 2.0 * rotation[i, i] - trace
        q[1 + j] = rotation[j, i] + rotation[i, j]
        q[1 + k] = rotation[k, i] + rotation[i, k]
    q /= np.linalg.norm(q)
    return np.asarray(-q if q[0] < 0.0 else q)


def _rotation(quaternion: FloatArray) -> FloatArray:
    size = float(np.linalg.norm(quaternion))
    if abs(size - 1.0) > 1e-3:
        raise ValueError(f"the quaternion has the length {size:.4g} instead of 1")
    w, x, y, z = quaternion / size
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
