"""Three-dimensional vectors and joint frames of `Lanes`; the compiler inlines these functions.

Vectors are tuples, so that the compiler can keep them in registers.
"""

from __future__ import annotations

from config.arrays import FloatArray
from dynamics.kernels.simd import Lanes, Samples, floor, kernel, load, spread, store

Vector = tuple[Lanes, Lanes, Lanes]
Rotation = tuple[Vector, Vector, Vector]  # its columns


@kernel
def eight_indices(first: int, samples: int) -> Samples:
    """Return the indices of eight consecutive samples; repeat the last index if there are fewer."""
    last = samples - 1
    return (
        first,
        min(first + 1, last),
        min(first + 2, last),
        min(first + 3, last),
        min(first + 4, last),
        min(first + 5, last),
        min(first + 6, last),
        min(first + 7, last),
    )


@kernel
def sin_cos(x: Lanes) -> tuple[Lanes, Lanes]:
    """Return sine and cosine with an error of about 3e-16 at most for |x| up to a million.

    The angle is reduced to |r| <= pi/4 with pi/2 in three parts (Cody and Waite 1980); then the
    minimax polynomials of Cephes are used (Moshier 1992).
    """
    n = floor(x * 0.6366197723675814 + 0.5)
    r = x - n * 1.57079625129699707031
    r = r - n * 7.54978941586159635335e-8
    r = r - n * 5.39030252995776476554e-15
    z = r * r
    s = 1.58962301576546568060e-10 * z - 2.50507477628578072866e-8
    s = s * z + 2.75573136213857245213e-6
    s = s * z - 1.98412698295895385996e-4
    s = s * z + 8.33333333332211858878e-3
    s = s * z - 1.66666666666666307295e-1
    s = r + r * z * s
    c = -1.13585365213876817300e-11 * z + 2.08757008419747316778e-9
    c = c * z - 2.75573141792967388112e-7
    c = c * z + 2.48015872888517045348e-5
    c = c * z - 1.38888888888730564116e-3
    c = c * z + 4.16666666666665929218e-2
    c = 1.0 - 0.5 * z + z * z * c
    half = floor(0.5 * n)
    odd = n - 2.0 * half  # 1 if sine and cosine are swapped
    even = 1.0 - odd
    sign = 1.0 - 2.0 * (half - 2.0 * floor(0.5 * half))
    return sign * (even * s + odd * c), sign * (even * c - odd * s)


@kernel
def joint_frame(
    row: FloatArray, fixed: FloatArray, prismatic: bool, q: Lanes
) -> tuple[Rotation, Vector]:
    """Return rotation and origin of a link's frame, relative to the previous link's frame."""
    slide = q if prismatic else spread(0.0)
    d = row[4] + slide
    s, c = sin_cos(row[2] + (q - slide))
    x = (fixed[0, 0], fixed[1, 0], fixed[2, 0])
    y = (fixed[0, 1], fixed[1, 1], fixed[2, 1])
    z = (spread(fixed[0, 2]), spread(fixed[1, 2]), spread(fixed[2, 2]))
    rotation = (add(scale(c, x), scale(s, y)), add(scale(c, y), scale(-s, x)), z)
    return rotation, (row[3] + d * z[0], d * z[1], d * z[2])


@kernel
def angular_motion(
    rotation: Rotation, w: Vector, dw: Vector, prismatic: bool, qd: Lanes, qdd: Lanes
) -> tuple[Vector, Vector]:
    """Return angular velocity and acceleration of the link after a joint, in its own frame."""
    w, dw = turn(rotation, w), turn(rotation, dw)
    if not prismatic:
        dw = (dw[0] + w[1] * qd, dw[1] - w[0] * qd, dw[2] + qdd)
        w = (w[0], w[1], w[2] + qd)
    return w, dw


@kernel
def turn(rotation: Rotation, v: Vector) -> Vector:
    """Transform a vector from the previous link's frame to a link's frame by a rotation."""
    return (dot(rotation[0], v), dot(rotation[1], v), dot(rotation[2], v))


@kernel
def turn_back(rotation: Rotation, v: Vector) -> Vector:
    """Transform a vector from a link's frame to the previous link's frame by a rotation."""
    return add(scale(v[0], rotation[0]), add(scale(v[1], rotation[1]), scale(v[2], rotation[2])))


@kernel
def zero_vector() -> Vector:
    """Return the zero vector."""
    return (spread(0.0), spread(0.0), spread(0.0))


@kernel
def unit_vector(axis: int) -> Vector:
    """Return the unit vector of axis 0, 1 or 2; the zero vector for any other number."""
    return (
        spread(1.0 if axis == 0 else 0.0),
        spread(1.0 if axis == 1 else 0.0),
        spread(1.0 if axis == 2 else 0.0),
    )


@kernel
def cross(a: Vector, b: Vector) -> Vector:
    """Return a x b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@kernel
def dot(a: Vector, b: Vector) -> Lanes:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def add(a: Vector, b: Vector) -> Vector:
    """Return a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@kernel
def scale(factor: Lanes, a: Vector) -> Vector:
    """Return factor * a."""
    return (factor * a[0], factor * a[1], factor * a[2])


@kernel
def load_vector(array: FloatArray, k: int) -> Vector:
    """Return vector k of an array of vectors, (count, 3, 8)."""
    return (load(array, k, 0), load(array, k, 1), load(array, k, 2))


@kernel
def store_vector(v: Vector, array: FloatArray, k: int) -> None:
    """Set vector k of an array of vectors, (count, 3, 8)."""
    store(v[0], array, k, 0)
    store(v[1], array, k, 1)
    store(v[2], array, k, 2)


@kernel
def accumulate(v: Vector, array: FloatArray, k: int) -> None:
    """Add to vector k of an array of vectors, (count, 3, 8)."""
    store_vector(add(load_vector(array, k), v), array, k)
