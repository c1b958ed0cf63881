"""Joint limits: what a URDF states where that can be meant, else what is given, else by size.

Many exporters write 0 for what they do not know. A default is marked wherever it is shown, with
how it came about: motions are held to it, and a person must confirm it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from config.arrays import FloatArray
from config.errors import ConfigError
from config.formats.urdf import UrdfJoint
from config.plausible import Plausible
from config.robot.robot import JointLimits, JointPosition, JointTorque, JointVelocity

GRAVITY_M_S2: Final = 9.81
ACCELERATION_PER_VELOCITY: Final = 5.0
WEIGHT_MARGIN: Final = 2.0
LEAST_SHARE: Final = 0.02
TIP_SPEED_M_S: Final = 3.0
SPEEDS_RAD_S: Final = (1.0, 3.0)
SLIDE_SPEED_M_S: Final = 0.5
SLIDE_SHARE: Final = 0.25
TURN_RAD: Final = 3.14
ENDLESS_RAD: Final = 6.28
_DEGREE: Final = float(np.pi / 180.0)
_MM: Final = 1e-3
_LARGEST_DEGREES: Final = 1000.0


@dataclass(frozen=True)
class LimitDefaults:
    """What to take where a URDF states no limit: one value for all joints, or one a joint.

    Empty where the robot's size decides.

    Attributes
    ----------
    position : tuple of float
        Joints go from minus to plus this [rad or m].
    velocity, acceleration : tuple of float
        [rad/s or m/s], and the same per second.
    torque : tuple of float
        At the link side [N m or N].
    """

    position: tuple[float, ...] = ()
    velocity: tuple[float, ...] = ()
    acceleration: tuple[float, ...] = ()
    torque: tuple[float, ...] = ()

    def refuse_unfit(self, names: Sequence[str]) -> None:
        """Refuse a number of values that is neither one nor one a joint.

        Raises
        ------
        ConfigError
            Some is.
        """
        options = ("--range", "--velocity", "--acceleration", "--effort")
        values = (self.position, self.velocity, self.acceleration, self.torque)
        for option, given in zip(options, values, strict=True):
            if len(given) not in (0, 1, len(names)):
                raise ConfigError(
                    f"{option} has {len(given)} values: give one, or one for each of the"
                    f" {len(names)} joints {', '.join(names)}"
                )


@dataclass(frozen=True)
class JointSize:
    """How far an arm reaches beyond a joint [m], and its weight's torque there [N m or N]."""

    reach_m: float
    weight: float


@dataclass(frozen=True)
class Taken:
    """A value that is not as the URDF states it: of which key, which, and how it came about."""

    key: str
    value: str
    how: str

    def __str__(self) -> str:
        return f"{self.key}: {self.value} ({self.how})"


@dataclass(frozen=True)
class FoundLimits:
    """The limits of a joint, and what of them is not as the URDF states it."""

    limits: JointLimits
    taken: tuple[Taken, ...]


def joint_sizes(
    joints: Sequence[UrdfJoint],
    origins_m: FloatArray,
    tip_m: FloatArray,
    centres_m: FloatArray,
    masses_kg: FloatArray,
) -> list[JointSize]:
    """Return the size of every joint's load, along the chain as if it were stretched out.

    Parameters
    ----------
    joints : sequence of UrdfJoint
        The joints.
    origins_m : (n, 3) array
        Their places at zero.
    tip_m : (3,) array
        The tool point.
    centres_m : (n, 3) array
        The links' centres of gravity.
    masses_kg : (n,) array
        Their masses.
    """
    n = len(origins_m)
    steps = np.linalg.norm(np.diff(np.vstack([origins_m, tip_m]), axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    beyond = np.linalg.norm(centres_m - origins_m, axis=1)
    sizes = []
    for i, joint in enumerate(joints):
        arms = along[i:n] - along[i] + beyond[i:]
        reach = max(float(along[-1] - along[i]), float(arms.max()))
        lever = np.ones(n - i) if joint.kind == "prismatic" else arms
        sizes.append(JointSize(reach, float(GRAVITY_M_S2 * masses_kg[i:] @ lever)))
    return sizes


def limits_of_urdf(
    joints: Sequence[UrdfJoint],
    sizes: Sequence[JointSize],
    given: LimitDefaults,
) -> list[FoundLimits]:
    """Return every joint's limits.

    Raises
    ------
    ConfigError
        What is given does not fit the joints.
    """
    given.refuse_unfit([joint.name for joint in joints])
    found = []
    heaviest = max(size.weight for size in sizes)
    for i, joint in enumerate(joints):
        one = _OneJoint(joint, sizes[i], LEAST_SHARE * heaviest)
        low, high = one.range(_of(given.position, i))
        velocity = one.velocity(_of(given.velocity, i))
        torque = one.torque(_of(given.torque, i))
        acceleration = _of(given.acceleration, i)
        if acceleration is None:
            acceleration = ACCELERATION_PER_VELOCITY * velocity
            one.take("acceleration", acceleration, "default: five times the velocity, per second")
        limits = JointLimits(
            position_min=low,
            position_max=high,
            velocity=velocity,
            acceleration=round(acceleration, 9),
            torque=torque,
        )
        found.append(FoundLimits(limits, tuple(one.taken)))
    return found


class _OneJoint:
    """Reads one joint's limits, and keeps what of them is not as the URDF states it."""

    def __init__(self, joint: UrdfJoint, size: JointSize, least_weight: float) -> None:
        self._joint = joint
        self._size = size
        self._weight = max(size.weight, least_weight)
        self._slides = joint.kind == "prismatic"
        self._scale = 1.0  # of positions and velocities: degrees or millimetres
        self.taken: list[Taken] = []

    def take(self, key: str, value: float | str, how: str) -> None:
        """Keep what was taken."""
        shown = value if isinstance(value, str) else f"{value:g}"
        self.taken.append(Taken(key, shown, how))

    def range(self, given: float | None) -> tuple[float, float]:
        """Return the least and the largest position [rad or m]."""
        low, high = (self._joint.limits.get(key) for key in ("lower", "upper"))
        if self._joint.kind == "continuous":
            return self._centred(given, ENDLESS_RAD, "the joint has no end: narrow it")
        stated = f"the URDF states {_told(low)} to {_told(high)}"
        if low is None or high is None or low == high:
            return self._default_range(given, stated)
        if low > high:
            low, high = high, low
            self.take("position", f"{low:g} to {high:g}", f"repaired: {stated}")
        size = max(abs(low), abs(high))
        found = _plausible(JointPosition, self._slides)
        if found.holds(size):
            return low, high
        unit, scale = ("mm", _MM) if self._slides else ("degrees", _DEGREE)
        if size > (found.high / _MM if self._slides else _LARGEST_DEGREES):
            return self._default_range(given, stated)
        self._scale = scale
        low, high = round(scale * low, 9), round(scale * high, 9)
        self.take("position", f"{low:g} to {high:g}", f"repaired: {stated}, read as {unit}")
        return low, high

    def _default_range(self, given: float | None, why: str) -> tuple[float, float]:
        by_size = _two_digits(SLIDE_SHARE * self._size.reach_m) or SLIDE_SHARE
        return self._centred(given, by_size if self._slides else TURN_RAD, f"{why}: narrow it")

    def _centred(self, given: float | None, usual: float, why: str) -> tuple[float, float]:
        half = usual if given is None else given
        self.take(
            "position", f"±{half:g}", f"{'--range' if given is not None else 'default'}: {why}"
        )
        return -half, half

    def velocity(self, given: float | None) -> float:
        """Return the largest speed [rad/s or m/s]."""
        stated = self._stated("velocity", JointVelocity)
        if stated is not None:
            return stated
        if given is not None:
            return self._given("velocity", "velocity", given)
        low, high = SPEEDS_RAD_S
        if self._slides:
            value, why = SLIDE_SPEED_M_S, "usual"
        else:
            speed = TIP_SPEED_M_S / max(self._size.reach_m, 1e-3)
            value = _two_digits(float(np.clip(speed, low, high)))
            why = f"{TIP_SPEED_M_S:g} m/s at full reach, {low:g} to {high:g} rad/s"
        self.take("velocity", value, f"default: {self._why('velocity')}; {why}")
        return value

    def torque(self, given: float | None) -> float:
        """Return the largest torque [N m or N]."""
        stated = self._stated("effort", JointTorque)
        if stated is not None:
            return stated
        if given is not None:
            return self._given("torque", "effort", given)
        lowest = _plausible(JointTorque, self._slides).low
        value = max(_two_digits(WEIGHT_MARGIN * self._weight), 10.0 * lowest)
        self.take(
            "torque", value, f"default: {self._why('effort')}; twice the weight at full reach"
        )
        return value

    def _stated(self, key: str, kind: Any) -> float | None:
        """Return what the URDF states, where that can be meant."""
        value = self._joint.limits.get(key, 0.0)
        found = _plausible(kind, self._slides)
        if value > 0.0 and found.holds(value):
            return value
        scaled = round(value * self._scale, 9)
        if key == "velocity" and self._scale != 1.0 and scaled > 0.0 and found.holds(scaled):
            self.take(key, scaled, f"repaired: {self._why(key)}, read as the positions are")
            return scaled
        return None

    def _why(self, key: str) -> str:
        return f"the URDF states {_told(self._joint.limits.get(key))}"

    def _given(self, key: str, option: str, value: float) -> float:
        self.take(key, value, f"--{option}: {self._why(option)}")
        return value


def _told(value: float | None) -> str:
    return "none" if value is None else f"{value:g}"


def _of(values: tuple[float, ...], joint: int) -> float | None:
    """Return a joint's value of those given, None where none is."""
    return values[joint if len(values) > 1 else 0] if values else None


def _plausible(kind: Any, slides: bool) -> Plausible:
    """Return the plausible range of a kind of key."""
    found = next(item for item in kind.__metadata__ if isinstance(item, Plausible))
    return found.prismatic if slides and found.prismatic is not None else found


def _two_digits(value: float) -> float:
    return float(f"{value:.2g}")
