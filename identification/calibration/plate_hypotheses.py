"""`plate_hypotheses`: possible mistakes in a plate's description, each with its correction.

The base wrench is linear in the plate's sizes, its position and each channel's sensitivity. Their
right values are therefore solved for together with the robot's parameters. Rotations of the plate,
and reversed or permuted channels, are tried one by one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations, product
from typing import Final

import numpy as np

from acquisition.recording.plate_geometry import WRENCH_NAMES, base_wrench_matrix
from config.arrays import FloatArray
from config.cell.plate import CHANNEL_NAMES, CHANNELS, PlateDescription, PlatePlace
from identification.calibration.plate_equations import PlateEquations
from identification.calibration.plate_mistake import PlateKind

SENSITIVITY_KEY: Final = "amplifier.sensitivity_pc_n"
ORDER_KEY: Final = "amplifier"
LEAST_CHANGE: Final = 0.1
"""Smallest relative error of a size or a sensitivity that counts as a mistake."""
LEAST_SHIFT_M: Final = 0.01
YAW_STEP_DEG: Final = 15
LEAST_YAW_DEG: Final = 3.0
HORIZONTAL: Final = 4
"""Number of channels for horizontal forces; they precede those for vertical forces."""
GROUPS: Final = ((0, 1), (2, 3), (0, 1, 2, 3), (4, 5, 6, 7))
"""Sets of channels with one kind of sensor: for x, for y, for x and y, and for z."""
WRENCH_GROUPS: Final = ((0, 1), (3, 4), (0, 1, 2), (3, 4, 5))
"""Sets of components of a wrench: horizontal forces and moments, all forces, all moments."""


@dataclass(frozen=True, eq=False)
class PlateHypothesis:
    """A possible mistake in a plate's description.

    Attributes:
        kind: Kind of the mistake.
        key: The wrong key of `plate`.
        stated, right: As in `PlateMistake`.
        words: The mistake in words.
        matrix: Shape (6, c). The wrench matrix without the mistake.
        free: Number of values that were fitted.
    """

    kind: PlateKind
    key: str
    stated: tuple[float, ...]
    right: tuple[float, ...]
    words: str
    matrix: FloatArray
    free: int = 0


def plate_hypotheses(equations: PlateEquations, plate: PlatePlace) -> Iterator[PlateHypothesis]:
    """Yield possible mistakes; a size, position or sensitivity has the value that fits best.

    Args:
        equations: Condensed equations of the wrench.
        plate: The plate as described in its file.
    """
    matrix = wrench_matrix(plate)
    if isinstance(plate, PlateDescription):
        yield from _sizes(equations, plate, matrix)
    for axes in ((0,), (1,), (2,), (0, 1), (0, 1, 2)):
        yield from _positions(equations, plate, matrix, axes)
    yield from _rotations(equations, plate)
    yield from _sensitivities(equations, matrix)
    yield from _signs(matrix)
    yield from _orders(equations, matrix)


def wrench_matrix(plate: PlatePlace, **changes: object) -> FloatArray:
    """Return the base wrench per reading, (6, c); `changes` replace fields of `plate`."""
    return base_wrench_matrix(plate.model_copy(update=changes))


def _sizes(
    equations: PlateEquations, plate: PlateDescription, matrix: FloatArray
) -> Iterator[PlateHypothesis]:
    for key in ("a_m", "b_m", "az0_m"):
        stated = float(getattr(plate, key))
        slope = wrench_matrix(plate, **{key: stated + 1.0}) - matrix
        right = stated + float(equations.best_parameters(matrix, slope[np.newaxis])[0])
        possible = right <= 0.0 if key == "az0_m" else right > 0.0
        if possible and abs(right - stated) >= max(LEAST_CHANGE * abs(stated), LEAST_SHIFT_M):
            words = f"`{key}` is {stated:.4g} m, but the recording shows {right:.4g} m"
            wrench = wrench_matrix(plate, **{key: right})
            yield PlateHypothesis(PlateKind.SIZE, key, (stated,), (right,), words, wrench, 1)
    a_m, b_m = plate.a_m, plate.b_m
    if a_m != b_m:
        wrench = wrench_matrix(plate, a_m=b_m, b_m=a_m)
        values, words = ((a_m, b_m), (b_m, a_m)), "`a_m` and `b_m` are swapped"
        yield PlateHypothesis(PlateKind.SIZE, "a_m", *values, words, wrench)


def _positions(
    equations: PlateEquations, plate: PlatePlace, matrix: FloatArray, axes: tuple[int, ...]
) -> Iterator[PlateHypothesis]:
    stated = np.array(plate.position_m)
    units = [np.eye(3)[axis] for axis in axes]
    slopes = [wrench_matrix(plate, position_m=tuple(stated + unit)) - matrix for unit in units]
    theta = equations.best_parameters(matrix, np.array(slopes))
    right = stated + sum(shift * unit for shift, unit in zip(theta, units, strict=True))
    if np.max(np.abs(right - stated)) >= LEAST_SHIFT_M:
        before, after = (", ".join(f"{x:.3g}" for x in place) for place in (stated, right))
        words = f"the plate's position is [{before}] m, but the recording shows [{after}] m"
        values = (tuple(stated.tolist()), tuple(right.tolist()))
        wrench = wrench_matrix(plate, position_m=values[1])
        yield PlateHypothesis(PlateKind.POSITION, "position_m", *values, words, wrench, len(axes))


def _rotations(equations: PlateEquations, plate: PlatePlace) -> Iterator[PlateHypothesis]:
    """Yield rotations by multiples of 90°, and the best yaw of an upright or inverted plate."""
    stated = rotation_of(plate)

    def turn_plate(turn: FloatArray, free: int) -> PlateHypothesis:
        right = angles_of(stated @ turn)
        angle = math.degrees(math.acos(max(-1.0, min(1.0, 0.5 * (float(np.trace(turn)) - 1.0)))))
        shown = ", ".join(f"{each:.4g}" for each in right)
        words = f"the plate is turned by {angle:.0f}°: the recording shows rotation_rad [{shown}]"
        values = (tuple(plate.rotation_rad), right)
        wrench = wrench_matrix(plate, rotation_rad=right)
        return PlateHypothesis(PlateKind.ROTATION, "rotation_rad", *values, words, wrench, free)

    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        turn = np.diag(signs)[list(order)]
        if np.linalg.det(turn) > 0.0 and not np.array_equal(turn, np.eye(3)):
            yield turn_plate(turn, 0)
    for side in (np.eye(3), np.diag([1.0, -1.0, -1.0])):

        def cost(degrees: float, side: FloatArray = side) -> float:
            right = angles_of(stated @ side @ _yaw(degrees))
            return float(np.sum(np.log(equations.shares(wrench_matrix(plate, rotation_rad=right)))))

        coarse = min(range(-180, 180, YAW_STEP_DEG), key=cost)
        fine = min(range(coarse - YAW_STEP_DEG, coarse + YAW_STEP_DEG + 1), key=cost)
        if abs(math.remainder(fine, 360.0)) >= LEAST_YAW_DEG and fine % 90:
            yield turn_plate(side @ _yaw(fine), 1)


def _sensitivities(equations: PlateEquations, matrix: FloatArray) -> Iterator[PlateHypothesis]:
    """Yield wrong sensitivities of each channel, of each of `GROUPS`, and of each two channels."""
    count = matrix.shape[1]
    groups = GROUPS if count == CHANNELS else WRENCH_GROUPS
    for channels in (*((each,) for each in range(count)), *groups):
        slope = np.zeros((1, 6, count))
        slope[0][:, list(channels)] = matrix[:, list(channels)]
        factor = 1.0 + float(equations.best_parameters(matrix, slope)[0])
        if abs(factor - 1.0) >= LEAST_CHANGE:
            yield _multiplied_readings(matrix, channels, (factor,) * len(channels), 1)
    for pair in combinations(range(count), 2):
        slopes = np.zeros((2, 6, count))
        for k, channel in enumerate(pair):
            slopes[k, :, channel] = matrix[:, channel]
        first, second = (1.0 + equations.best_parameters(matrix, slopes)).tolist()
        if min(abs(first - 1.0), abs(second - 1.0)) >= LEAST_CHANGE:
            yield _multiplied_readings(matrix, pair, (first, second), 2)


def _signs(matrix: FloatArray) -> Iterator[PlateHypothesis]:
    """Yield reversed readings of every set of channels, except of all channels together."""
    count = matrix.shape[1]
    for size in range(1, count):
        for channels in combinations(range(count), size):
            yield _multiplied_readings(matrix, channels, (-1.0,) * size, 0)


def _multiplied_readings(
    matrix: FloatArray, channels: tuple[int, ...], factors: tuple[float, ...], free: int
) -> PlateHypothesis:
    scale = np.ones(matrix.shape[1])
    scale[list(channels)] = factors
    of_readings = reading_names(matrix)
    names = ", ".join(of_readings[channel] for channel in channels)
    shown = " and ".join(f"{each:.3g}" for each in dict.fromkeys(factors))
    words = (
        f"the readings of {names} have the wrong sign"
        if set(factors) == {-1.0}
        else f"the readings of {names} must be multiplied by {shown}"
    )
    key, stated, kind = SENSITIVITY_KEY, (1.0,) * len(channels), PlateKind.SENSITIVITY
    return PlateHypothesis(kind, key, stated, factors, words, scale * matrix, free)


def _orders(equations: PlateEquations, matrix: FloatArray) -> Iterator[PlateHypothesis]:
    """Yield every order with two exchanged channels, and the best one of many other orders.

    This best order is improved by exchanges of two channels until no exchange reduces the
    residuals.
    """
    identity = tuple(range(matrix.shape[1]))
    swaps = [_swap(identity, *pair) for pair in combinations(identity, 2)]
    for order in swaps:
        yield _reorder(matrix, order)

    def cost(order: Sequence[int]) -> float:
        return float(np.sum(np.log(equations.shares(matrix[:, list(order)]))))

    orders = [identity[start:] + identity[:start] for start in identity[1:]]
    orders += [each[::-1] for each in (identity, *orders)]
    parts = HORIZONTAL if len(identity) == CHANNELS else 3  # forces and moments
    for first in permutations(identity[:parts]):
        orders += [first + each for each in permutations(identity[parts:])]
    best = min((each for each in orders if each != identity), key=cost)
    lowest = cost(best)
    while True:
        near = min((_swap(best, *pair) for pair in combinations(identity, 2)), key=cost)
        if cost(near) >= lowest:
            break
        best, lowest = near, cost(near)
    if best != identity and best not in swaps:
        yield _reorder(matrix, best)


def _swap(order: tuple[int, ...], first: int, second: int) -> tuple[int, ...]:
    own = list(order)
    own[first], own[second] = own[second], own[first]
    return tuple(own)


def _reorder(matrix: FloatArray, order: tuple[int, ...]) -> PlateHypothesis:
    """Return the hypothesis that the reading of channel i is that of channel `order[i]`."""
    moved = [i for i, other in enumerate(order) if i != other]
    of_readings = reading_names(matrix)
    names = [of_readings[i] for i in moved]
    right = [of_readings[order[i]] for i in moved]
    words = (
        f"the channels {names[0]} and {names[1]} are swapped"
        if len(moved) == 2
        else f"the readings of {', '.join(names)} belong to {', '.join(right)}, in this order"
    )
    values = (tuple(float(i) for i in moved), tuple(float(order[i]) for i in moved))
    return PlateHypothesis(PlateKind.ORDER, ORDER_KEY, *values, words, matrix[:, list(order)])


def _yaw(degrees: float) -> FloatArray:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def reading_names(matrix: FloatArray) -> tuple[str, ...]:
    """Return the names of the readings of a wrench matrix (6, c)."""
    return CHANNEL_NAMES if matrix.shape[1] == CHANNELS else WRENCH_NAMES


def rotation_of(plate: PlatePlace) -> FloatArray:
    """Return the plate's axes in the base's frame, as columns (3, 3)."""
    place = PlatePlace(position_m=(0.0, 0.0, 0.0), rotation_rad=plate.rotation_rad)
    return np.asarray(-wrench_matrix(place)[:3, :3])


def angles_of(rotation: FloatArray) -> tuple[float, float, float]:
    """Return roll, pitch and yaw of a rotation Rz(yaw) Ry(pitch) Rx(roll)."""
    pitch = math.asin(max(-1.0, min(1.0, -float(rotation[2, 0]))))
    if abs(rotation[2, 0]) > 1.0 - 1e-9:  # roll and yaw have the same axis: yaw is set to zero
        roll = math.copysign(1.0, pitch) * math.atan2(rotation[0, 1], rotation[1, 1])
        yaw = 0.0
    else:
        roll = math.atan2(rotation[2, 1], rotation[2, 2])
        yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    return round(roll, 6) + 0.0, round(pitch, 6) + 0.0, round(yaw, 6) + 0.0
