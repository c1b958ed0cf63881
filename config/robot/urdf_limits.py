"""Joint limits from a URDF, from the user's options, or from the robot's size, in this order.

Many exporters write 0 for unknown values, and infinity or 1e16 for no limit. A limit that no real
joint has is refused, never replaced by a wider one. A default is marked with its origin wherever it
is shown, because motions are checked against it and a person must confirm it.
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
from config.robot.joint_size import JointSize
from config.robot.robot import (
    JointAcceleration,
    JointLimits,
    JointPosition,
    JointTorque,
    JointVelocity,
)
from config.robot.urdf_mimic import box_inside

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
"""From this value on, a limit means "no limit", as infinity does."""
NEGLIGIBLE: Final = 1e-5
LIMIT_CODE: Final = "RID-URDF-LIMIT"


@dataclass(frozen=True)
class LimitDefaults:
    """Limits to use if a URDF states none: one value for all joints, or one per joint.

    If a field is empty, the limit follows from the robot's size.

    Attributes:
        position: Joints go from minus to plus this value [rad or m].
        velocity, acceleration: Largest speed [rad/s or m/s], and largest acceleration [rad/s² or
            m/s²].
        torque: Largest torque at the link side [N m or N].
    """

    position: tuple[float, ...] = ()
    velocity: tuple[float, ...] = ()
    acceleration: tuple[float, ...] = ()
    torque: tuple[float, ...] = ()

    def refuse_unfit(self, names: Sequence[str]) -> None:
        """Check that each field has no value, one value, or one per joint.

        Raises:
            ConfigError: A field has another number of values.
        """
        options = ("--range", "--velocity", "--acceleration", "--effort")
        values = (self.position, self.velocity, self.acceleration, self.torque)
        for option, given in zip(options, values, strict=True):
            if len(given) not in (0, 1, len(names)):
                raise ConfigError(
                    f"{option} has {len(given)} values; give one, or one for each of the"
                    f" {len(names)} joints {', '.join(names)}",
                    code="RID-OPTION-COUNT",
                )


@dataclass(frozen=True)
class ReplacedValue:
    """A value that differs from the URDF: its key, the value used, and the reason."""

    key: str
    value: str
    how: str

    def __str__(self) -> str:
        return f"{self.key}: {self.value} ({self.how})"


@dataclass(frozen=True)
class FoundLimits:
    """The limits of a joint, and the values that differ from the URDF."""

    limits: JointLimits
    replaced: tuple[ReplacedValue, ...]


def limits_of_urdf(
    joints: Sequence[UrdfJoint],
    sizes: Sequence[JointSize],
    given: LimitDefaults,
) -> list[FoundLimits]:
    """Return every joint's limits.

    Raises:
        ConfigError: The options do not fit the joints, or the URDF states limits that no joint has;
            the text lists all such limits.
    """
    given.refuse_unfit([joint.name for joint in joints])
    found: list[FoundLimits] = []
    problems: list[str] = []
    heaviest = max(size.weight for size in sizes)
    for i, joint in enumerate(joints):
        one = _LimitReader(joint, sizes[i], LEAST_SHARE * heaviest)
        try:
            low, high = one.range(_joint_value(given.position, i))
            velocity = one.velocity(_joint_value(given.velocity, i))
            torque = one.torque(_joint_value(given.torque, i))
            acceleration = one.acceleration(_joint_value(given.acceleration, i), velocity)
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
        found.append(FoundLimits(limits, tuple(one.replaced)))
    if problems:
        raise ConfigError("\n".join(problems), code=LIMIT_CODE)
    return found


def limits_within(found: Sequence[FoundLimits], joints_by_urdf: FloatArray) -> list[FoundLimits]:
    """Return limits of coupled joints that keep the URDF's limits in every pose.

    Args:
        found: The limits of the URDF's driven joints.
        joints_by_urdf: Shape (n, n). The joints' positions by those of the URDF's driven joints.
    """
    low, high = (
        np.array([getattr(each.limits, f"position_{end}") for each in found])
        for end in ("min", "max")
    )
    lowest, highest = box_inside(joints_by_urdf, low, high)
    within = []
    for number, each in enumerate(found):
        start, stop = float(f"{lowest[number]:.6g}"), float(f"{highest[number]:.6g}")
        if abs(start - low[number]) + abs(stop - high[number]) < NEGLIGIBLE:
            within.append(each)
            continue
        how = (
            f"coupled: the URDF's {low[number]:g} to {high[number]:g} applies to the motor; within"
            " the replaced limits no motor of the coupled joints exceeds its range"
        )
        limits = each.limits.model_copy(update={"position_min": start, "position_max": stop})
        replaced = (*each.replaced, ReplacedValue("position", f"{start:g} to {stop:g}", how))
        within.append(FoundLimits(limits, replaced))
    return within


class _LimitReader:
    """Reader of one joint's limits; it collects values that differ from the URDF."""

    def __init__(self, joint: UrdfJoint, size: JointSize, least_weight: float) -> None:
        self._joint = joint
        self._size = size
        self._weight = max(size.weight, least_weight)
        self._slides = joint.kind == "prismatic"
        self._scale = 1.0  # to rad or m; not 1 if the URDF has degrees or millimetres
        self.replaced: list[ReplacedValue] = []

    def replace(self, key: str, value: float | str, how: str) -> None:
        """Add a value that differs from the URDF."""
        shown = value if isinstance(value, str) else f"{value:g}"
        self.replaced.append(ReplacedValue(key, shown, how))

    def range(self, given: float | None) -> tuple[float, float]:
        """Return the lowest and highest position [rad or m].

        Raises:
            ConfigError: The URDF states a range that no joint has.
        """
        limits = self._joint.limits
        low_text, high_text = (_stated_text(limits.get(key)) for key in ("lower", "upper"))
        stated = f"the URDF states {low_text} to {high_text}"
        if self._states_no_range(given):
            if self._joint.kind == "continuous":
                return self._centred_range(
                    given, ENDLESS_RAD, "the joint has no end; narrow this range"
                )
            return self._centred_range(
                given, self._default_half_range(), f"{stated}; narrow this range"
            )
        low, high = limits.get("lower", 0.0), limits.get("upper", 0.0)
        if {"lower", "upper"} - limits.keys():
            self.replace("position", f"{low:g} to {high:g}", f"{stated}; a missing end is 0")
        if low == high:
            raise self._error(
                f"lower = upper = {low:g}: the joint is locked. State its range (or give --range if"
                ' both are 0), or use type="fixed" at that position'
            )
        if low > high:
            raise self._error(f"lower {low:g} is above upper {high:g}; correct them")
        low, high = self._convert_units(low, high, stated)
        half = given if given is not None else self._default_half_range()
        low, high = (
            end if abs(end) < NO_LIMIT else self._replace_open_end(sign * half, stated, given)
            for sign, end in ((-1.0, low), (1.0, high))
        )
        low, high = self._narrow_to_soft(low, high)
        if low >= high:
            raise self._error(
                f"{stated}; the soft limits leave no range ({low:g} to {high:g}); correct them"
            )
        if self._joint.kind == "continuous":
            self.replace("position", f"{low:g} to {high:g}", f"{stated}, for a continuous joint")
        return low, high

    def _states_no_range(self, given: float | None) -> bool:
        """Return True if lower and upper are missing, or are zeros that mean "unknown".

        Zeros mean "locked" if velocity and effort are stated, unless the user gives a range or the
        joint is continuous.
        """
        limits = self._joint.limits
        if limits.get("lower", 0.0) or limits.get("upper", 0.0):
            return False
        stated = {"lower", "upper"} & limits.keys()
        moves = limits.get("velocity", 0.0) and limits.get("effort", 0.0)
        endless = self._joint.kind == "continuous"
        return not (stated and moves) or given is not None or endless

    def _convert_units(self, low: float, high: float, stated: str) -> tuple[float, float]:
        """Return the range in rad or m, converted if it is in degrees or millimetres."""
        size = max((abs(end) for end in (low, high) if abs(end) < NO_LIMIT), default=0.0)
        found = _plausible(JointPosition, self._slides)
        if found.holds(size):
            return low, high
        unit, scale = ("mm", _MM) if self._slides else ("degrees", _DEGREE)
        if size > (found.high / _MM if self._slides else _LARGEST_DEGREES):
            raise self._error(f"{stated}: no joint has such a range; correct it")
        self._scale = scale
        low, high = round(scale * low, 9), round(scale * high, 9)
        self.replace("position", f"{low:g} to {high:g}", f"repaired: {stated}, read as {unit}")
        return low, high

    def _replace_open_end(self, usual: float, stated: str, given: float | None) -> float:
        """Return the value to use for an end of the range that the URDF states as unlimited."""
        how = "--range" if given is not None else "default"
        self.replace(
            "position", f"{usual:g} at the unlimited end", f"{how}: {stated}; narrow this range"
        )
        return usual

    def _narrow_to_soft(self, low: float, high: float) -> tuple[float, float]:
        """Return the range narrowed to the soft limits of <safety_controller>."""
        limits = self._joint.limits
        soft_low, soft_high = (limits.get(f"soft_{end}", 0.0) for end in ("lower", "upper"))
        if soft_low == soft_high == 0.0:
            return low, high
        narrow = max(low, self._scale * soft_low), min(high, self._scale * soft_high)
        if narrow != (low, high):
            self.replace(
                "position", f"{narrow[0]:g} to {narrow[1]:g}", "within <safety_controller>"
            )
        return narrow

    def _default_half_range(self) -> float:
        by_size = _two_digits(SLIDE_SHARE * self._size.reach_m) or SLIDE_SHARE
        return by_size if self._slides else TURN_RAD

    def _centred_range(self, given: float | None, usual: float, why: str) -> tuple[float, float]:
        half = usual if given is None else given
        self.replace(
            "position", f"±{half:g}", f"{'--range' if given is not None else 'default'}: {why}"
        )
        return -half, half

    def velocity(self, given: float | None) -> float:
        """Return the largest speed [rad/s or m/s].

        Raises:
            ConfigError: The URDF states a speed that no joint has.
        """
        stated = self._stated("velocity", JointVelocity)
        if stated is not None:
            return stated
        if given is not None:
            return self._checked_option("velocity", "velocity", given)
        low, high = SPEEDS_RAD_S
        if self._slides:
            value, why = SLIDE_SPEED_M_S, "usual"
        else:
            speed = TIP_SPEED_M_S / max(self._size.reach_m, 1e-3)
            value = _two_digits(float(np.clip(speed, low, high)))
            why = f"{TIP_SPEED_M_S:g} m/s at full reach, {low:g} to {high:g} rad/s"
        self.replace("velocity", value, f"default: {self._reason('velocity')}; {why}")
        return value

    def acceleration(self, given: float | None, velocity: float) -> float:
        """Return the largest acceleration [rad/s² or m/s²].

        Raises:
            ConfigError: The URDF states an acceleration that no joint has.
        """
        keys = ("acceleration", "deceleration")
        stated = [self._stated(key, JointAcceleration) for key in keys]
        known = [value for value in stated if value is not None]
        if known:
            return min(known)
        if given is not None:
            return given
        value = ACCELERATION_PER_VELOCITY * velocity
        self.replace("acceleration", value, "default: five times the velocity, per second")
        return value

    def torque(self, given: float | None) -> float:
        """Return the largest torque [N m or N].

        Raises:
            ConfigError: The URDF states a torque that no joint has.
        """
        stated = self._stated("effort", JointTorque)
        if stated is not None:
            return stated
        if given is not None:
            return self._checked_option("torque", "effort", given)
        lowest = _plausible(JointTorque, self._slides).low
        value = max(_two_digits(WEIGHT_MARGIN * self._weight), 10.0 * lowest)
        self.replace(
            "torque", value, f"default: {self._reason('effort')}; twice the weight at full reach"
        )
        return value

    def _stated(self, key: str, kind: Any) -> float | None:
        """Return the stated value; None if the URDF states nothing, 0 or no limit.

        If a joint's range is in degrees or mm, so are its velocity and acceleration.
        """
        value = self._joint.limits.get(key, 0.0)
        found = _plausible(kind, self._slides)
        if value == 0.0 or value >= NO_LIMIT:
            return None
        scaled = value if key == "effort" else round(value * self._scale, 9)
        if value < 0.0 or not found.holds(scaled):
            unlikely = f"expected is {found.low:g} to {found.high:g} {found.unit}"
            raise self._error(f"{key} {value:g}: {unlikely}{found.likely_unit(scaled)}")
        if scaled != value:
            self.replace(
                key, scaled, f"repaired: {self._reason(key)}, in the unit of the positions"
            )
        return scaled

    def _error(self, why: str) -> ConfigError:
        words = f"{self._joint.where}: <limit> of joint {self._joint.name!r}: {why}"
        return ConfigError(words, code=LIMIT_CODE)

    def _reason(self, key: str) -> str:
        return f"the URDF states {_stated_text(self._joint.limits.get(key))}"

    def _checked_option(self, key: str, option: str, value: float) -> float:
        self.replace(key, value, f"--{option}: {self._reason(option)}")
        return value


def _stated_text(value: float | None) -> str:
    return "none" if value is None else f"{value:g}"


def _joint_value(values: tuple[float, ...], joint: int) -> float | None:
    """Return a joint's value; None if no values are given."""
    return values[joint if len(values) > 1 else 0] if values else None


def _plausible(kind: Any, slides: bool) -> Plausible:
    """Return the plausible range of an annotated type."""
    found = next(item for item in kind.__metadata__ if isinstance(item, Plausible))
    return found.prismatic if slides and found.prismatic is not None else found


def _two_digits(value: float) -> float:
    return float(f"{value:.2g}")
