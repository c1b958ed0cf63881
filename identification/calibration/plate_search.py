"""`find_plate_mistake`: what may be wrong in the description of a force plate.

A plate's wrench must be that of some robot, whatever its motors measure: its six components share
the links' parameters. A wrong size, place, direction or sensitivity contradicts that. The wrench is
linear in sizes, in the position and in each channel's sensitivity, which are solved for together
with the parameters; turned plates and swapped channels are tried one after the other.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations, product
from typing import Final

import numpy as np

from acquisition.processing.periods import PeriodAverage
from acquisition.recording.plate_geometry import PlateGeometry
from acquisition.signals.bins import filter_response, to_bins
from config.arrays import FloatArray
from config.cell.plate import CHANNEL_NAMES, CHANNELS, PlateConfig
from identification.calibration.plate_mistake import PlateKind, PlateMistake
from identification.equations.base_wrench import in_time, real_rows
from identification.equations.bins import BinEquations
from identification.equations.plate_fit import SMALL_COMPONENT

RIDGE: Final = 1e-10
SUSPECT_SHARE: Final = 0.03
LEAST_GAIN: Final = 1.5
FAR_BETTER_TIMES: Final = 3.0
ONE_MORE_FREE: Final = 0.1
LEAST_CHANGE: Final = 0.03
LEAST_SHIFT_M: Final = 5e-3
YAW_STEP_DEG: Final = 15
LEAST_YAW_DEG: Final = 3.0


@dataclass(frozen=True, eq=False)
class _Plate:
    """Equations of the wrench on the bins, without its constant part.

    Attributes
    ----------
    columns : ndarray, shape (6, rows, b)
        Of the base parameters.
    channels : ndarray, shape (8, rows)
        Of the channels' readings [N].
    """

    columns: FloatArray
    channels: FloatArray

    @classmethod
    def of(
        cls,
        averages: Sequence[PeriodAverage],
        equations: Sequence[BinEquations],
        delays_s: Sequence[float],
    ) -> _Plate | None:
        """Take them out of the runs' equations; None if a channel was left out."""
        columns, channels = [], []
        for each, average, delay_s in zip(equations, averages, delays_s, strict=True):
            own, wrench = average.reaction, each.reaction
            if own is None or wrench is None or len(wrench.components) < 6:
                return None
            response = np.ones(wrench.harmonics + 1, dtype=complex)
            if own.low_pass is not None:
                frequencies = np.arange(wrench.harmonics + 1) / wrench.period_s
                response = filter_response(own.low_pass, frequencies)
            bins = to_bins(own.channels_n, wrench.harmonics) / response[:, np.newaxis]
            rows = in_time(real_rows(bins).T, wrench.period_s, delay_s)
            channels.append(rows[:, 1:])
            columns.append(wrench.matrix[:, 1:])
        if len({each.shape[0] for each in channels} | {CHANNELS}) > 1:
            return None
        return cls(np.concatenate(columns, axis=1), np.concatenate(channels, axis=1))

    def shares(self, matrix: FloatArray) -> FloatArray:
        """Return the residual of each component over its size, by a wrench matrix (6, 8)."""
        wrench, size = self._sized(matrix)
        values = self._solve(self.columns, wrench, size)
        rest = wrench - self.columns @ values
        return np.asarray(_rms(rest) / size)

    def free(self, matrix: FloatArray, slopes: FloatArray) -> FloatArray:
        """Return the best theta (k,) of a wrench matrix plus theta times slopes (k, 6, 8)."""
        wrench, size = self._sized(matrix)
        more = -np.einsum("kwc,cr->wrk", slopes, self.channels)
        values = self._solve(np.concatenate([self.columns, more], axis=2), wrench, size)
        return values[self.columns.shape[2] :]

    def _sized(self, matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the wrench, (6, rows), and the sizes of its components, (6,)."""
        wrench = matrix @ self.channels
        size = _rms(wrench)
        for part in (slice(0, 3), slice(3, 6)):
            size[part] = np.maximum(size[part], SMALL_COMPONENT * size[part].max())
        return wrench, np.maximum(size, 1e-12)

    @staticmethod
    def _solve(columns: FloatArray, wrench: FloatArray, size: FloatArray) -> FloatArray:
        flat = (columns / size[:, np.newaxis, np.newaxis]).reshape(-1, columns.shape[2])
        rhs = (wrench / size[:, np.newaxis]).reshape(-1)
        scale = np.maximum(np.linalg.norm(flat, axis=0), 1e-300)
        flat = flat / scale
        gram = flat.T @ flat + RIDGE * np.eye(len(scale))
        return np.asarray(np.linalg.solve(gram, flat.T @ rhs) / scale)


@dataclass(frozen=True, eq=False)
class _Hypothesis:
    """A mistake, the wrench matrix without it, and how many numbers were fitted for it."""

    mistake: PlateMistake
    matrix: FloatArray
    free: int


def find_plate_mistake(
    averages: Sequence[PeriodAverage],
    equations: Sequence[BinEquations],
    delays_s: Sequence[float],
    plate: PlateConfig,
) -> PlateMistake | None:
    """Return the mistake in a plate's description that explains its wrench far better, if any.

    Parameters
    ----------
    averages : sequence of PeriodAverage
        The runs' mean periods.
    equations : sequence of BinEquations
        Their equations, of the external or the combined model.
    delays_s : sequence of float
        By how much the plate's signals were late in each run [s].
    plate : PlateConfig
        The plate as its cell file describes it.
    """
    found = _Plate.of(averages, equations, delays_s)
    return None if found is None else _best(found, plate)


def _best(equations: _Plate, plate: PlateConfig) -> PlateMistake | None:
    matrix = PlateGeometry.from_config(plate).base_wrench_matrix
    before = equations.shares(matrix)
    suspect = before > SUSPECT_SHARE
    if not suspect.any():
        return None
    tried: list[tuple[float, float, PlateMistake]] = []
    for each in _hypotheses(equations, plate, matrix):
        after = equations.shares(each.matrix)
        times = float(np.max(before / np.maximum(after, 1e-12)))
        gain = float(np.sum(np.log(before / np.maximum(after, 1e-12))))
        halved = bool(np.any(suspect & (before >= FAR_BETTER_TIMES * after)))
        if halved and gain >= LEAST_GAIN and np.all(after[suspect] <= before[suspect]):
            tried.append((gain - ONE_MORE_FREE * each.free, times, each.mistake))
    if not tried:
        return None
    _, times, mistake = max(tried, key=lambda each: each[0])
    own = (mistake.kind, mistake.key, mistake.stated, mistake.right, mistake.words)
    return PlateMistake(*own, times_better=times)


def _hypotheses(equations: _Plate, plate: PlateConfig, matrix: FloatArray) -> Iterator[_Hypothesis]:
    for key in ("a_m", "b_m", "az0_m"):
        yield from _of_size(equations, plate, matrix, key)
    for axes in ((0,), (1,), (2,), (0, 1), (0, 1, 2)):
        yield from _of_position(equations, plate, matrix, axes)
    yield from _of_rotation(equations, plate)
    for channel in range(CHANNELS):
        slope = np.zeros((1, 6, CHANNELS))
        slope[0, :, channel] = matrix[:, channel]
        factor = 1.0 + float(equations.free(matrix, slope)[0])
        if abs(factor - 1.0) < LEAST_CHANGE:
            continue
        name = CHANNEL_NAMES[channel]
        words = f"the readings of channel {name} must be {factor:.3g} times what they are"
        key = "amplifier.sensitivity_pc_n"
        mistake = PlateMistake(PlateKind.SENSITIVITY, key, (1.0,), (factor,), words, 1.0)
        yield _Hypothesis(mistake, matrix + (factor - 1.0) * slope[0], 1)
    for first, second in combinations(range(CHANNELS), 2):
        order = list(range(CHANNELS))
        order[first], order[second] = second, first
        words = f"the channels {CHANNEL_NAMES[first]} and {CHANNEL_NAMES[second]} are swapped"
        key, numbers = "amplifier", (float(first), float(second))
        mistake = PlateMistake(PlateKind.ORDER, key, numbers, numbers[::-1], words, 1.0)
        yield _Hypothesis(mistake, matrix[:, order], 0)


def _of_size(
    equations: _Plate, plate: PlateConfig, matrix: FloatArray, key: str
) -> Iterator[_Hypothesis]:
    stated = float(getattr(plate, key))
    slope = _matrix_of(plate, **{key: stated + 1.0}) - matrix
    right = stated + float(equations.free(matrix, slope[np.newaxis])[0])
    possible = right <= 0.0 if key == "az0_m" else right > 0.0
    if possible and abs(right - stated) >= max(LEAST_CHANGE * abs(stated), LEAST_SHIFT_M):
        words = f"`{key}` is {stated:.4g} m, the recording shows {right:.4g} m"
        mistake = PlateMistake(PlateKind.SIZE, key, (stated,), (right,), words, 1.0)
        yield _Hypothesis(mistake, _matrix_of(plate, **{key: right}), 1)


def _of_position(
    equations: _Plate, plate: PlateConfig, matrix: FloatArray, axes: tuple[int, ...]
) -> Iterator[_Hypothesis]:
    stated = np.array(plate.position_m)
    units = [np.eye(3)[axis] for axis in axes]
    slopes = [_matrix_of(plate, position_m=tuple(stated + unit)) - matrix for unit in units]
    theta = equations.free(matrix, np.array(slopes))
    right = stated + sum(shift * unit for shift, unit in zip(theta, units, strict=True))
    if np.max(np.abs(right - stated)) >= LEAST_SHIFT_M:
        before, after = (", ".join(f"{x:.3g}" for x in place) for place in (stated, right))
        words = f"its position is [{before}] m, the recording shows [{after}] m"
        values = (tuple(stated.tolist()), tuple(right.tolist()))
        mistake = PlateMistake(PlateKind.POSITION, "position_m", *values, words, 1.0)
        yield _Hypothesis(mistake, _matrix_of(plate, position_m=values[1]), len(axes))


def _of_rotation(equations: _Plate, plate: PlateConfig) -> Iterator[_Hypothesis]:
    """Yield the plate in every way that a cube can lie, and turned about its own axis."""
    stated = _rotation(plate)

    def turned(turn: FloatArray, free: int) -> _Hypothesis:
        right = _angles(stated @ turn)
        angle = math.degrees(math.acos(max(-1.0, min(1.0, 0.5 * (float(np.trace(turn)) - 1.0)))))
        told = ", ".join(f"{each:.4g}" for each in right)
        words = f"it is turned by {angle:.0f}°: the recording shows rotation_rad [{told}]"
        own = (tuple(plate.rotation_rad), right, words, 1.0)
        mistake = PlateMistake(PlateKind.ROTATION, "rotation_rad", *own)
        return _Hypothesis(mistake, _matrix_of(plate, rotation_rad=right), free)

    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        turn = np.diag(signs)[list(order)]
        if np.linalg.det(turn) > 0.0 and not np.array_equal(turn, np.eye(3)):
            yield turned(turn, 0)

    def cost(degrees: float) -> float:
        matrix = _matrix_of(plate, rotation_rad=_angles(stated @ _yaw(degrees)))
        return float(np.sum(np.log(np.maximum(equations.shares(matrix), 1e-12))))

    coarse = min(range(-180, 180, YAW_STEP_DEG), key=cost)
    fine = min(range(coarse - YAW_STEP_DEG, coarse + YAW_STEP_DEG + 1), key=cost)
    if abs(math.remainder(fine, 360.0)) >= LEAST_YAW_DEG and fine % 90:
        yield turned(_yaw(fine), 1)


def _yaw(degrees: float) -> FloatArray:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _rotation(plate: PlateConfig) -> FloatArray:
    """Return the plate's axes in the base's frame, as columns (3, 3)."""
    turned = plate.model_copy(update={"sensitivity": None, "position_m": (0.0, 0.0, 0.0)})
    straight = turned.model_copy(update={"rotation_rad": (0.0, 0.0, 0.0)})
    forces, back = (PlateGeometry.from_config(each) for each in (turned, straight))
    return np.asarray(forces.base_wrench_matrix[:3] @ np.linalg.pinv(back.base_wrench_matrix[:3]))


def _angles(rotation: FloatArray) -> tuple[float, float, float]:
    """Return roll, pitch and yaw of a rotation Rz(yaw) Ry(pitch) Rx(roll)."""
    pitch = math.asin(max(-1.0, min(1.0, -float(rotation[2, 0]))))
    if abs(rotation[2, 0]) > 1.0 - 1e-9:  # roll and yaw turn about one axis: roll takes it all
        roll = math.copysign(1.0, pitch) * math.atan2(rotation[0, 1], rotation[1, 1])
        yaw = 0.0
    else:
        roll = math.atan2(rotation[2, 1], rotation[2, 2])
        yaw = math.atan2(rotation[1, 0], rotation[0, 0])
    return round(roll, 6) + 0.0, round(pitch, 6) + 0.0, round(yaw, 6) + 0.0


def _matrix_of(plate: PlateConfig, **changes: object) -> FloatArray:
    return PlateGeometry.from_config(plate.model_copy(update=changes)).base_wrench_matrix


def _rms(values: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(np.square(values), axis=1)))
