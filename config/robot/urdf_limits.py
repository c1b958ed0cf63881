"""Joint limits: what a URDF states; if it states none, what is given, else by the robot's size.

Many exporters write 0 for what they do not know, and infinity or 1e16 for no limit. What no joint
has is refused, never replaced by something wider. A default is marked wherever it is shown, with
how it came about: motions are held to it, and a person must confirm it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from config.errors import ConfigError
from config.formats.urdf import UrdfJoint
from config.plausible import Plausible
from config.robot.joint_size import JointSize
from config.robot.robot import (
    JointAcceleration,
    JointLimits,
    JointPosition,
    JointTorque,
    JointVelocity,
)

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
NO_LIMIT: Final = 1e6
"""From this size on a limit says that there is none, as infinity does."""
LIMIT_CODE: Final = "RID-URDF-LIMIT"


@dataclass(frozen=True)
class LimitDefaults:
    """What to take where a URDF states no limit: one value for all joints, or one a joint.

    Empty where the robot's size decides.

    Attributes:
        position: Joints go from minus to plus this [rad or m].
        velocity, acceleration: [rad/s or m/s], and the same per second.
        torque: At the link side [N m or N].
    """

    position: tuple[float, ...] = ()
    velocity: tuple[float, ...] = ()
    acceleration: tuple[float, ...] = ()
    torque: tuple[float, ...] = ()

    def refuse_unfit(self, names: Sequence[str]) -> None:
        """Refuse a number of values that is neither one nor one a joint.

        Raises:
            ConfigError: Some is.
        """
        options = ("--range", "--velocity", "--acceleration", "--effort")
        values = (self.position, self.velocity, self.acceleration, self.torque)
        for option, given in zip(options, values, strict=True):
            if len(given) not in (0, 1, len(names)):
                raise ConfigError(
                    f"{option} has {len(given)} values: give one, or one for each of the"
                    f" {len(names)} joints {', '.join(names)}",
                    code="RID-OPTION-COUNT",
                )


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


def limits_of_urdf(
    joints: Sequence[UrdfJoint],
    sizes: Sequence[JointSize],
    given: LimitDefaults,
) -> list[FoundLimits]:
    """Return every joint's limits.

    Raises:
        ConfigError: What is given does not fit the joints, or the URDF states limits that no joint
            has, all of them at once.
    """
    given.refuse_unfit([joint.name for joint in joints])
    found: list[FoundLimits] = []
    problems: list[str] = []
    heaviest = max(size.weight for size in sizes)
    for i, joint in enumerate(joints):
        one = _OneJoint(joint, sizes[i], LEAST_SHARE * heaviest)
        try:
            low, high = one.range(_of(given.position, i))
            velocity = one.velocity(_of(given.velocity, i))
            torque = one.torque(_of(given.torque, i))
            acceleration = one.acceleration(_of(given.acceleration, i), velocity)
        except ConfigError as error:
            problems.append(str(error))
            continue
        limits = JointLimits(
            position_min=low,
            position_max=high,
            velocity=velocity,
            acceleration=round(acceleration, 9),
            torque=torque,
        )
        found.append(FoundLimits(limits, tuple(one.taken)))
    if problems:
        raise ConfigError("\n".join(problems), code=LIMIT_CODE)
    return found


class _OneJoint:
    """Reads one joint's limits; keeps what of them is not as the URDF states it, or refuses it."""

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
        """Return the least and the largest position [rad or m].

        Raises:
            ConfigError: No range of this joint can be meant.
        """
        limits = self._joint.limits
        stated = f"the URDF states {_told(limits.get('lower'))} to {_told(limits.get('upper'))}"
        if self._states_no_range(given):
            if self._joint.kind == "continuous":
                return self._centred(given, ENDLESS_RAD, "the joint has no end: narrow it")
            return self._centred(given, self._usual_half(), f"{stated}: narrow it")
        low, high = limits.get("lower", 0.0), limits.get("upper", 0.0)
        if {"lower", "upper"} - limits.keys():
            self.take("position", f"{low:g} to {high:g}", f"{stated}: what is missing is 0")
        if low == high:
            raise self._refused(
                f"lower = upper = {low:g}: the joint is locked. State its range (zeros: or give"
                ' --range), or make it type="fixed" at that position'
            )
        if low > high:
            raise self._refused(f"lower {low:g} is above upper {high:g}: correct them")
        low, high = self._in_units(low, high, stated)
        half = given if given is not None else self._usual_half()
        low, high = (
            end if abs(end) < NO_LIMIT else self._open_end(sign * half, stated, given)
            for sign, end in ((-1.0, low), (1.0, high))
        )
        low, high = self._soft(low, high)
        if low >= high:
            raise self._refused(f"{stated}: no range is left of it ({low:g} to {high:g})")
        if self._joint.kind == "continuous":
            self.take("position", f"{low:g} to {high:g}", f"{stated}, of a continuous joint")
        return low, high

    def _states_no_range(self, given: float | None) -> bool:
        """Return True if lower and upper are missing, or zeros that stand for nothing.

        Zeros beside a speed and a torque lock the joint, unless a range is given for it.
        """
        limits = self._joint.limits
        if limits.get("lower", 0.0) or limits.get("upper", 0.0):
            return False
        stated = {"lower", "upper"} & limits.keys()
        moves = limits.get("velocity", 0.0) and limits.get("effort", 0.0)
        endless = self._joint.kind == "continuous"
        return not (stated and moves) or given is not None or endless

    def _in_units(self, low: float, high: float, stated: str) -> tuple[float, float]:
        """Return the range in rad or m, if it is in degrees or millimetres."""
        size = max((abs(end) for end in (low, high) if abs(end) < NO_LIMIT), default=0.0)
        found = _plausible(JointPosition, self._slides)
        if found.holds(size):
            return low, high
        unit, scale = ("mm", _MM) if self._slides else ("degrees", _DEGREE)
        if size > (found.high / _MM if self._slides else _LARGEST_DEGREES):
            raise self._refused(f"{stated}: no joint has that range")
        self._scale = scale
        low, high = round(scale * low, 9), round(scale * high, 9)
        self.take("position", f"{low:g} to {high:g}", f"repaired: {stated}, read as {unit}")
        return low, high

    def _open_end(self, usual: float, stated: str, given: float | None) -> float:
        """Return the end of a range that the URDF states as endless."""
        how = "--range" if given is not None else "default"
        self.take("position", f"{usual:g} at the open end", f"{how}: {stated}: narrow it")
        return usual

    def _soft(self, low: float, high: float) -> tuple[float, float]:
        """Return the range within the limits of <safety_controller>, which are narrower."""
        limits = self._joint.limits
        soft_low, soft_high = (limits.get(f"soft_{end}", 0.0) for end in ("lower", "upper"))
        if soft_low == soft_high == 0.0:
            return low, high
        narrow = max(low, self._scale * soft_low), min(high, self._scale * soft_high)
        if narrow != (low, high):
            self.take("position", f"{narrow[0]:g} to {narrow[1]:g}", "within <safety_controller>")
        return narrow

    def _usual_half(self) -> float:
        by_size = _two_digits(SLIDE_SHARE * self._size.reach_m) or SLIDE_SHARE
        return by_size if self._slides else TURN_RAD

    def _centred(self, given: float | None, usual: float, why: str) -> tuple[float, float]:
        half = usual if given is None else given
        self.take(
            "position", f"±{half:g}", f"{'--range' if given is not None else 'default'}: {why}"
        )
        return -half, half

    def velocity(self, given: float | None) -> float:
        """Return the largest speed [rad/s or m/s].

        Raises:
            ConfigError: The URDF states one that no joint has.
        """
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

    def acceleration(self, given: float | None, velocity: float) -> float:
        """Return the largest acceleration [rad/s² or m/s²].

        Raises:
            ConfigError: The URDF states one that no joint has.
        """
        keys = ("acceleration", "deceleration")
        stated = [self._stated(key, JointAcceleration) for key in keys]
        known = [value for value in stated if value is not None]
        if known:
            return min(known)
        if given is not None:
            return given
        value = ACCELERATION_PER_VELOCITY * velocity
        self.take("acceleration", value, "default: five times the velocity, per second")
        return value

    def torque(self, given: float | None) -> float:
        """Return the largest torque [N m or N].

        Raises:
            ConfigError: The URDF states one that no joint has.
        """
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
        """Return what the URDF states; None if it states nothing, 0 or no limit.

        A joint whose range is in degrees has its other limits in degrees too.
        """
        value = self._joint.limits.get(key, 0.0)
        found = _plausible(kind, self._slides)
        if value == 0.0 or value >= NO_LIMIT:
            return None
        scaled = value if key == "effort" else round(value * self._scale, 9)
        if value < 0.0 or not found.holds(scaled):
            unlikely = f"expected is {found.low:g} to {found.high:g} {found.unit}"
            raise self._refused(f"{key} {value:g}: {unlikely}{found.likely_unit(scaled)}")
        if scaled != value:
            self.take(key, scaled, f"repaired: {self._why(key)}, read as the positions are")
        return scaled

    def _refused(self, why: str) -> ConfigError:
        words = f"{self._joint.where}: <limit> of joint {self._joint.name!r}: {why}"
        return ConfigError(words, code=LIMIT_CODE)

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
