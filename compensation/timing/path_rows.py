"""`PathRows`: all limits along a path, as inequalities in squared speed and acceleration."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np

from compensation.timing.joint_curve import JointCurve
from compensation.timing.limits import TimingLimits
from compensation.timing.reach_kernels import FrictionArrays, along_path, friction_at_rest
from config.arrays import BoolArray, FloatArray, IntArray
from config.errors import LimitError
from config.robot.robot import RobotDescription
from dynamics.model.one_sample import EFFICIENCY, FRICTION, JOINT, KIND, VALUE, SampleTorque

WRENCH: Final = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
# fraction of an actuator's largest path derivative; smaller values are rounding errors
STANDS: Final = 1e-7
FASTEST: Final = 1e12
MOST_OF_ROOM: Final = 0.8
SMALLEST: Final = 1e-12


@dataclass(frozen=True, eq=False)
class PathDynamics:
    """A model evaluated along a path; its friction is stored separately.

    Attributes:
        curve: The path.
        robot: Robot of the joints.
        length: Shape (points,). Grid of the path length.
        position, slope, bend: Shape (points, n). Joint positions and their derivatives
            with respect to the length.
        parts: Shape (points, 2 n + 6, 3). Result of `along_path`.
        friction, losses: Shape (terms, 8). Rows of `SampleTorque`'s table for friction and gear
            losses.
        smoothing: Smoothing of the sign of friction [rad/s].
        motor_slope: Shape (points, n). Speeds of the actuators at the path speed 1.
    """

    curve: JointCurve
    robot: RobotDescription
    length: FloatArray
    position: FloatArray
    slope: FloatArray
    bend: FloatArray
    parts: FloatArray
    friction: FloatArray
    losses: FloatArray
    smoothing: float
    motor_slope: FloatArray

    @classmethod
    def of(
        cls, curve: JointCurve, robot: RobotDescription, torque: SampleTorque, intervals: int
    ) -> PathDynamics:
        """Evaluate a model along a path, at the ends of equal intervals."""
        length = np.linspace(*curve.ends, intervals + 1)
        position, slope, bend = curve.at(length)
        table = torque.arrays[4]
        kinds = table[:, KIND]
        rigid = np.ascontiguousarray(table[(kinds != FRICTION) & (kinds < EFFICIENCY)])
        bodies, memory = torque.arrays[3], torque.arrays[6]
        without = (*torque.arrays[:4], rigid, torque.arrays[5], memory)
        parts = np.empty((len(length), 2 * position.shape[1] + 6, 3))
        along_path(without, position, slope, bend, parts)
        return cls(
            curve=curve,
            robot=robot,
            length=length,
            position=position,
            slope=slope,
            bend=bend,
            parts=parts,
            friction=np.ascontiguousarray(table[kinds == FRICTION]),
            losses=table[kinds >= EFFICIENCY],
            smoothing=float(bodies[len(bodies) - 2, 3]),
            motor_slope=np.ascontiguousarray(slope @ torque.arrays[5][1].T),
        )


@dataclass(frozen=True, eq=False)
class PathRows:
    """Limits along a path: rows and bounds divided by their limits, and the largest speed.

    Each row is a quantity that is limited, as a function of acceleration u and squared speed x.

    Attributes:
        dynamics: Model along the path.
        labels: Name of each row, for messages.
        rows: Shape (points, rows, 3). Coefficients of u and x, and the value at rest.
        bounds: Shape (points, rows, 3). Lower and upper bound, and factor of the joint's friction
            in the row.
        size: Shape (rows,). Limit by which a row and its bounds are divided.
        joints: Shape (rows,). Joint whose friction is in the row, or -1 for none.
        both: Shape (points - 1, n). True if an actuator reverses or rests, so that its friction has
            either sign.
        fastest: Shape (points,). Largest x that the speed limits allow.
    """

    dynamics: PathDynamics
    labels: tuple[str, ...]
    rows: FloatArray
    bounds: FloatArray
    size: FloatArray
    joints: IntArray
    both: BoolArray
    fastest: FloatArray
    friction: FrictionArrays = field(init=False)

    def __post_init__(self) -> None:
        own = self.dynamics
        arrays = (self.joints, own.friction, own.smoothing, own.motor_slope, self.both)
        object.__setattr__(self, "friction", arrays)

    @classmethod
    def of(cls, dynamics: PathDynamics, limits: TimingLimits) -> PathRows:
        """Apply limits to a model along a path."""
        names = [joint.name for joint in dynamics.robot.joints]
        n = len(names)
        both = _either_sign(dynamics.motor_slope)
        build = _Builder(len(dynamics.length))
        lossy = {int(row[JOINT]): row for row in dynamics.losses}
        load, free = dynamics.parts[:, :n], dynamics.parts[:, n : 2 * n]
        for j, name in enumerate(names):
            label, limit = f"torque of {name}", limits.torque[j]
            if j not in lossy:
                build.add(label, load[:, j] + free[:, j], limit, j)
                continue
            # A lossy gear's torque is the larger of two lines forwards, and the smaller one
            # backwards.
            ahead, behind = _factors(lossy[j])
            turns = np.append(both[:, j], False) | np.append(False, both[:, j])
            forth = dynamics.motor_slope[:, j] > 0.0
            least = np.where(forth & ~turns, -np.inf, -1.0)
            most = np.where(~forth & ~turns, np.inf, 1.0)
            build.add(label, ahead * load[:, j] + free[:, j], limit, j, (least, most))
            build.add(label, behind * load[:, j] + free[:, j], limit, j)
        for j, name in enumerate(names):
            own = np.stack([dynamics.slope[:, j], dynamics.bend[:, j], 0.0 * dynamics.length], 1)
            build.add(f"acceleration of {name}", own, limits.acceleration[j])
        if limits.base is not None:
            for c, name in enumerate(WRENCH):
                if np.isfinite(limits.base[c]):
                    build.add(f"{name} of the base", dynamics.parts[:, 2 * n + c], limits.base[c])
        speed = np.maximum(
            np.abs(dynamics.slope) / limits.speed, np.abs(dynamics.motor_slope) / limits.speed
        ).max(axis=1)
        return cls(
            dynamics=dynamics,
            labels=tuple(build.labels),
            rows=np.ascontiguousarray(np.stack(build.rows, axis=1)),
            bounds=np.ascontiguousarray(np.stack(build.bounds, axis=1)),
            size=np.array(build.sizes),
            joints=np.array(build.joints, dtype=np.int64),
            both=both,
            fastest=1.0 / np.maximum(speed, FASTEST**-0.5) ** 2,
        )

    def tighten(self, free: FloatArray) -> FloatArray:
        """Return bounds that keep a further fraction `free` (points, rows) of each limit free.

        The fraction is smaller at points at which even slow motion needs more of the limit.
        """
        least, most = self.at_rest()
        room = np.minimum(self.bounds[:, :, 1] - most, least - self.bounds[:, :, 0])
        room = np.maximum(room, SMALLEST)
        most_of = MOST_OF_ROOM * room  # a larger reserve approaches `room`, but never reaches it
        beyond = np.maximum(free - most_of, 0.0) / (room - most_of)
        keep = np.where(free < most_of, free, room - (room - most_of) * np.exp(-beyond))
        bounds = self.bounds.copy()
        bounds[:, :, 0] += keep
        bounds[:, :, 1] -= keep
        return bounds

    def at_rest(self) -> tuple[FloatArray, FloatArray]:
        """Return the smallest and largest value of each row (points, rows) near standstill."""
        friction = np.empty((len(self.rows), 2, self.both.shape[1]))
        friction_at_rest(self.friction, friction)
        share = self.bounds[:, :, 2]
        of_joint = np.maximum(self.joints, 0)
        least = self.rows[:, :, 2] + share * friction[:, 0][:, of_joint]
        most = self.rows[:, :, 2] + share * friction[:, 1][:, of_joint]
        return least, most

    def refuse_standing(self, free: FloatArray | float = 0.0) -> None:
        """Refuse a path on which gravity and slow friction alone exceed a limit.

        Args:
            free: Shape (points, rows), or float. Fraction of each limit to hold in reserve.

        Raises:
            LimitError: Gravity and the friction of a slow motion exceed a limit; the message names
                joint and pose.
        """
        least, most = self.at_rest()
        low, high = self.bounds[:, :, 0] + free, self.bounds[:, :, 1] - free
        over = np.maximum(low - least, most - high)
        point, row = np.unravel_index(int(over.argmax()), over.shape)
        if over[point, row] <= 0.0:
            return
        own, size = self.dynamics, self.size[row]
        upwards = most[point, row] - high[point, row] >= low[point, row] - least[point, row]
        takes = (most if upwards else least)[point, row] * size
        allowed = abs((high if upwards else low)[point, row]) * size
        pose = ", ".join(f"{value:.4g}" for value in own.position[point])
        raise LimitError(
            f"the path exceeds its limits at any speed: {self.labels[row]} is {takes:.4g} at the"
            f" pose ({pose}) from gravity and slow friction alone"
            f" ({self.rows[point, row, 2] * size:.4g} without friction); the limit is"
            f" {max(allowed, 0.0):.4g}. Move the path, reduce the payload, or raise the limit",
            code="RID-TIMING-NOT-FEASIBLE",
        )


class _Builder:
    def __init__(self, points: int) -> None:
        self.points = points
        self.labels: list[str] = []
        self.rows: list[FloatArray] = []
        self.bounds: list[FloatArray] = []
        self.sizes: list[float] = []
        self.joints: list[int] = []

    def add(
        self,
        label: str,
        row: FloatArray,
        limit: float,
        joint: int = -1,
        ends: tuple[FloatArray, FloatArray] | None = None,
    ) -> None:
        bounds = np.empty((self.points, 3))
        bounds[:, 0], bounds[:, 1] = (-1.0, 1.0) if ends is None else ends
        bounds[:, 2] = 1.0 / limit if joint >= 0 else 0.0
        self.labels.append(label)
        self.rows.append(row / limit)
        self.bounds.append(bounds)
        self.sizes.append(float(limit))
        self.joints.append(joint)


def _factors(loss: FloatArray) -> tuple[float, float]:
    """Return the factors by which a lossy gear multiplies positive and negative load torques.

    They hold for a joint that moves forwards. For a joint that moves backwards they are exchanged.
    """
    value = float(loss[VALUE])
    if loss[KIND] == EFFICIENCY:
        return 1.0 / value, value
    return 1.0 + value, 1.0 - value


def _either_sign(speed: FloatArray) -> BoolArray:
    """Return the intervals in which each actuator reverses or rests."""
    stands = np.abs(speed) <= STANDS * np.abs(speed).max()
    begin, end = speed[:-1], speed[1:]
    return np.ascontiguousarray((begin * end <= 0.0) | stands[:-1] | stands[1:])
