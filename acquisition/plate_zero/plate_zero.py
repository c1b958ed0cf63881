"""`PlateOffset`: offsets of a force plate, separated from the moment of gravity by turning axis 1.

The plate cannot be measured without load, because the robot stays on it. At rest, horizontal forces
and the moment about the vertical are zero, the weight is constant, and the moment of gravity turns
with axis 1 (thesis, 4.4). In poses A and B, axis 1 is at -d/2 and +d/2 from the middle. With the
offset o, the quarter turn J about axis 1, and gravity's moment mu in the middle, the readings are

    r_A = o + cos(d/2) mu - sin(d/2) J mu        r_B = o + cos(d/2) mu + sin(d/2) J mu

so that o = (r_A + r_B) / 2 + cot(d/2) / 2 * J (r_B - r_A): for half a turn (d = pi), half the sum.
A third reading, in pose A again, separates a linear drift.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from acquisition.motion.approach import approach
from acquisition.motion.samples import JointTrajectory, MotionSamples, Phase, join, standstill
from acquisition.recording.plate_geometry import PlateGeometry
from config.arrays import BoolArray, FloatArray, IntArray, freeze
from config.cell.plate import CHANNEL_NAMES, CHANNELS
from config.errors import ConfigError, DataQualityError
from config.robot.robot import RobotDescription

HALF_TURN_RAD = math.pi
SMALLEST_TURN_RAD = math.pi / 3.0
LIMIT_MARGIN_RAD = 0.02
VERTICAL_RAD = 0.01
BLOCK_S = 0.25
FEWEST_BLOCKS = 4
READINGS = 3


@dataclass(frozen=True, eq=False)
class ZeroTurn:
    """Turn of axis 1.

    Attributes:
        first, second: Shape (joints,). The two poses [rad or m]; they differ in axis 1 only.
        turn_rad: Angle from the first to the second pose [rad].
        axis: Shape (3,). Axis 1 in the base frame, in the direction of positive angles.
    """

    first: FloatArray
    second: FloatArray
    turn_rad: float
    axis: FloatArray

    def __post_init__(self) -> None:
        freeze(self, ConfigError, (None,), "first", what="pose ")
        freeze(self, ConfigError, self.first.shape, "second", what="pose ")
        freeze(self, ConfigError, (3,), "axis")

    @property
    def is_half(self) -> bool:
        """True for half a turn; the offset is then the mean of the two readings."""
        return math.isclose(self.turn_rad, HALF_TURN_RAD)


@dataclass(frozen=True, eq=False)
class PlateOffset:
    """Result of the turn; the standard deviations come from the noise of the readings.

    Attributes:
        offset_n, offset_sigma_n: Shape (8,). Reading of each channel without the robot's moment, at
            the end of the last reading [N].
        drift_n_s, drift_sigma_n_s: Shape (8,). Linear drift of each channel [N/s].
        rest_n: Shape (8,). Reading in the first pose minus the offset [N].
        gravity, gravity_sigma: Shape (6,). `rest_n` as a wrench on the robot's base [N, N m]. Its
            horizontal moments are those of gravity; its forces and its moment about axis 1 should
            be zero.
        seconds: Time from the first reading to the end of the last [s].
    """

    offset_n: FloatArray
    offset_sigma_n: FloatArray
    drift_n_s: FloatArray
    drift_sigma_n_s: FloatArray
    rest_n: FloatArray
    gravity: FloatArray
    gravity_sigma: FloatArray
    seconds: float

    def __post_init__(self) -> None:
        of_channels = ("offset_n", "offset_sigma_n", "drift_n_s", "drift_sigma_n_s", "rest_n")
        freeze(self, DataQualityError, (CHANNELS,), *of_channels)
        freeze(self, DataQualityError, (6,), "gravity", "gravity_sigma")


def plan_turn(robot: RobotDescription, reference: FloatArray | None = None) -> ZeroTurn:
    """Return the largest turn of axis 1 about a reference pose, at most half a turn.

    Args:
        robot: Joints and limits.
        reference: Shape (joints,). Pose in the middle of the turn [rad or m] (default: the middle
            of every range).

    Raises:
        ConfigError: The pose is outside the limits, axis 1 is not vertical, or its turn is too
            small to separate offset and gravity.
    """
    lowest = np.array([joint.limits.position_min for joint in robot.joints])
    highest = np.array([joint.limits.position_max for joint in robot.joints])
    middle = 0.5 * (lowest + highest) if reference is None else np.asarray(reference, float)
    if middle.shape != lowest.shape or not np.isfinite(middle).all():
        raise ConfigError(
            f"the reference pose has {middle.size} values for {len(lowest)} joints: give one value"
            " per joint",
            code="RID-MOTION-JOINTS",
        )
    for joint, value in zip(robot.joints, middle.tolist(), strict=True):
        low, high = joint.limits.position_min, joint.limits.position_max
        if not low <= value <= high:
            raise ConfigError(
                f"the reference pose has {joint.name} at {value:g} {joint.unit}, outside its limits"
                f" {low:g} to {high:g} {joint.unit}: choose another pose (--pose)",
                code="RID-POSE-OUTSIDE",
            )
    axis = _vertical_axis(robot)
    room = float(min(middle[0] - lowest[0], highest[0] - middle[0])) - LIMIT_MARGIN_RAD
    turn_rad = min(2.0 * room, HALF_TURN_RAD)
    if turn_rad < SMALLEST_TURN_RAD:
        raise ConfigError(
            f"{robot.joints[0].name} can turn by {math.degrees(max(turn_rad, 0.0)):.0f} degrees,"
            f" centred on {math.degrees(middle[0]):.0f} degrees, but at least"
            f" {math.degrees(SMALLEST_TURN_RAD):.0f} degrees are needed to separate offset and"
            " gravity: choose a reference pose (--pose) nearer to the middle of its range",
            code="RID-PLATE-ZERO-POSE",
        )
    first, second = middle.copy(), middle.copy()
    first[0] -= 0.5 * turn_rad
    second[0] += 0.5 * turn_rad
    return ZeroTurn(first, second, turn_rad, axis)


def rest_samples(
    robot: RobotDescription, pose: FloatArray, seconds: float, sample_period_s: float
) -> MotionSamples:
    """Return a motion that rests in a pose, (joints,), which the cyclic task approaches first."""
    rows = max(2, math.ceil(seconds / sample_period_s))
    return MotionSamples(
        robot.joint_names, sample_period_s, *standstill(pose, rows), np.full(rows, Phase.HOLD)
    )


def turn_samples(
    robot: RobotDescription,
    turn: ZeroTurn,
    settle_s: float,
    read_s: float,
    sample_period_s: float,
) -> tuple[MotionSamples, tuple[range, ...]]:
    """Return the motion to the first pose, the second pose and back, and the rows of each reading.

    Args:
        robot: Joints and limits.
        turn: The poses.
        settle_s, read_s: Rest before each reading, and duration of each reading [s].
        sample_period_s: Cycle time of the cell [s].

    Raises:
        ConfigError: A pose is outside the limits.
    """
    settle = max(1, math.ceil(settle_s / sample_period_s))
    read = max(2, math.ceil(read_s / sample_period_s))
    poses = (turn.first, turn.second, turn.first)
    paths: list[JointTrajectory] = []
    readings: list[range] = []
    rows = 0
    for number, pose in enumerate(poses):
        if number:
            way = approach(poses[number - 1], pose, robot, sample_period_s)
            paths.append(JointTrajectory(way.position, way.velocity, way.acceleration))
            rows += len(way)
        paths.append(standstill(pose, settle + read))
        readings.append(range(rows + settle, rows + settle + read))
        rows += settle + read
    samples = MotionSamples(
        robot.joint_names, sample_period_s, *join(paths), np.full(rows, Phase.HOLD)
    )
    return samples, tuple(readings)


def find_offset(
    geometry: PlateGeometry,
    turn: ZeroTurn,
    time_s: FloatArray,
    reading: IntArray,
    channels_n: FloatArray,
    valid: BoolArray,
) -> PlateOffset:
    """Separate each channel's offset from gravity and drift.

    Each block of a quarter of a second counts as one reading. The noise is the scatter of the
    blocks about two levels and one slope.

    Args:
        geometry: Geometry of the plate.
        turn: Turn of axis 1.
        time_s: Shape (samples,). Times of the samples [s].
        reading: Shape (samples,). 0 in the first pose, 1 in the second, 2 in the first pose again;
            rows with other values are not used.
        channels_n: Shape (samples, 8). Channel values [N].
        valid: Shape (samples, 8). False if a channel was overloaded or is missing.

    Raises:
        DataQualityError: More than 2 % of the values of a reading are invalid, or it is too short.
    """
    times, levels, numbers = _blocks(time_s, reading, channels_n, valid)
    end_s = float(time_s[np.isin(reading, range(READINGS))].max())
    design = np.column_stack([numbers != 1, numbers == 1, times - end_s]).astype(float)
    spread = np.linalg.inv(design.T @ design)
    found = spread @ design.T @ levels
    residual = levels - design @ found
    variance = np.square(residual).sum(axis=0) / (len(levels) - design.shape[1])
    of_first, of_second = _offset_maps(geometry, turn)
    offset = of_first @ found[0] + of_second @ found[1]
    rest = found[0] - offset
    to_wrench = geometry.base_wrench_matrix
    eye = np.eye(CHANNELS)
    return PlateOffset(
        offset_n=offset,
        offset_sigma_n=_sigma(of_first, of_second, spread, variance),
        drift_n_s=found[2],
        drift_sigma_n_s=np.sqrt(variance * spread[2, 2]),
        rest_n=rest,
        gravity=to_wrench @ rest,
        gravity_sigma=_sigma(
            to_wrench @ (eye - of_first), -to_wrench @ of_second, spread, variance
        ),
        seconds=end_s - float(time_s[reading == 0].min()),
    )


def _vertical_axis(robot: RobotDescription) -> FloatArray:
    """Return axis 1 in the base frame, (3,); raise an error if it is not vertical."""
    first = robot.joints[0]
    row = robot.kinematics.modified_rows()[0]
    ca, sa, cb, sb = (f(x) for x in (row.alpha_rad, row.beta_rad) for f in (math.cos, math.sin))
    axis = np.array([sb, -sa * cb, ca * cb])
    gravity = np.array(robot.gravity_m_s2)
    off = math.atan2(float(np.linalg.norm(np.cross(axis, gravity))), abs(float(axis @ gravity)))
    if first.type != "revolute" or not np.any(gravity) or off > VERTICAL_RAD:
        raise ConfigError(
            f"{first.name} does not turn about the vertical, so the plate's offset cannot be"
            " separated from gravity: correct gravity_m_s2 or this joint in the robot file, or"
            " enter `plate.zero` in the cell file by hand",
            code="RID-PLATE-ZERO-AXIS",
        )
    return axis


def _offset_maps(geometry: PlateGeometry, turn: ZeroTurn) -> tuple[FloatArray, FloatArray]:
    """Return the (8, 8) matrices of offset = first @ reading in A + second @ reading in B."""
    half = 0.5 * np.eye(CHANNELS)
    if turn.is_half:
        return half, half
    x, y, z = turn.axis
    quarter_turn = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    moments, back = geometry.base_wrench_matrix[3:], geometry.channel_matrix[:, 3:]
    bent = 0.5 / math.tan(0.5 * turn.turn_rad) * back @ quarter_turn @ moments
    return half - bent, half + bent


def _sigma(
    first: FloatArray, second: FloatArray, spread: FloatArray, variance: FloatArray
) -> FloatArray:
    """Return the standard deviation of first @ (level in pose A) + second @ (level in pose B)."""
    share = np.square(first) * spread[0, 0] + np.square(second) * spread[1, 1]
    share += 2.0 * first * second * spread[0, 1]
    return np.asarray(np.sqrt(np.maximum(share @ variance, 0.0)))


def _blocks(
    time_s: FloatArray, reading: IntArray, channels_n: FloatArray, valid: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return mean time, mean channel values and reading number of each block of `BLOCK_S`."""
    times, levels, numbers = [], [], []
    for number in range(READINGS):
        rows = np.flatnonzero(reading == number)
        spoilt = ~valid[rows]
        bad = [CHANNEL_NAMES[k] for k in np.flatnonzero(spoilt.any(axis=0))]
        if len(bad) and spoilt.mean() > 0.02:
            raise DataQualityError(
                f"reading {number + 1} of {READINGS}: {', '.join(bad)} of the force plate was"
                " overloaded or sent no values: choose a larger plate.amplifier.range_n, or check"
                " the line",
                code="RID-PLATE-CHANNEL",
            )
        rows = rows[valid[rows].all(axis=1)]
        place = np.floor((time_s[rows] - time_s[rows[:1]].sum()) / BLOCK_S).astype(np.int64)
        kept = [rows[place == k] for k in range(int(place.max(initial=-1)) + 1)]
        kept = [block for block in kept if len(block) and 2 * len(block) > len(kept[0])]
        if len(kept) < FEWEST_BLOCKS:
            raise DataQualityError(
                f"reading {number + 1} of {READINGS} of the force plate has less than"
                f" {FEWEST_BLOCKS * BLOCK_S:g} s of valid rows: read longer (--read)",
                code="RID-RECORDING-SHORT",
            )
        times += [time_s[block].mean() for block in kept]
        levels += [channels_n[block].mean(axis=0) for block in kept]
        numbers += [number] * len(kept)
    return np.array(times), np.array(levels), np.array(numbers)
