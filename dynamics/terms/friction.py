"""`Friction`: the term of all actuators' friction, linear in the friction coefficients."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.friction_terms import FrictionTerm
from config.robot.robot import Joint, RobotDescription
from dynamics.terms.complex_step import Values, slopes
from dynamics.terms.friction_functions import FrictionFunction, traits, unknown_function
from dynamics.terms.memory import Presliding
from dynamics.terms.motion import TermMotion
from dynamics.terms.term_parameter import NonlinearParameter

SLOWEST_STRIBECK: Final = 0.02
FASTEST_STRIBECK: Final = 0.5
SHORTEST_PRESLIDING: Final = 1e-5
LONGEST_PRESLIDING: Final = 0.05
LEAST_FRACTION: Final = 0.02
LARGEST_FRACTION: Final = 0.98

_FUNCTIONS: Final[dict[FrictionTerm, tuple[FrictionFunction, ...]]] = {
    "coulomb": ("coulomb",),
    "viscous": ("viscous",),
    "offset": ("offset",),
    "asymmetric": ("forward", "backward"),
    "cubic": ("cubic",),
    "cube_root": ("cube_root",),
    "stribeck": ("stribeck",),
    "shear_thinning": ("shear_thinning",),
    "temperature": ("coulomb_by_temperature", "viscous_by_temperature"),
    "load": (),  # a gear loss: see `Transmission`
    "presliding": (),  # replaces sign(v) in the other terms: see `Memory`
}


@dataclass(frozen=True)
class FrictionColumn:
    """One friction coefficient: joint (from 0), friction function, name and unit.

    `shear_thinning_speed` is v_T of the function `shear_thinning` [rad/s or m/s].
    """

    joint: int
    function: FrictionFunction
    parameter_name: str
    unit: str
    reference_temperature_k: float
    shear_thinning_speed: float


@dataclass(frozen=True)
class StribeckSpeed:
    """Speed at which the Stribeck friction of a joint (from 0) has decreased to 1/e (2.10)."""

    joint: int
    parameter: NonlinearParameter


@dataclass(frozen=True)
class Friction:
    """Friction of the actuators, link side, with the terms of each joint (2.8-2.14).

    With `sign_smoothing_rad_s` > 0, sign(v) is replaced by tanh(v / sign_smoothing_rad_s).
    Asymmetric friction has the magnitudes f+ for forward motion and f- for backward motion, which
    are positive if friction brakes. It is a Coulomb friction (f+ + f-) / 2 plus an offset (f+ - f-)
    / 2, which is not smoothed. At v = 0, the offset is 0 if sign(v) is discontinuous. All functions
    are analytic for v > 0 and for v < 0, so that the complex step can be used.

    If a joint has presliding and `Conditions.memory` is given, the hysteretic direction replaces
    sign(v). It depends on the joint's path and not on v.
    """

    columns: tuple[FrictionColumn, ...]
    sign_smoothing_rad_s: float = 0.0
    stribeck: tuple[StribeckSpeed, ...] = ()
    presliding: tuple[Presliding, ...] = ()

    through_gears = False
    inertial = False
    name = "friction"

    def __post_init__(self) -> None:
        if not 0.0 <= self.sign_smoothing_rad_s < np.inf:
            raise EstimationError(
                f"sign_smoothing_rad_s is {self.sign_smoothing_rad_s}: it must be 0 (sign(v) is"
                " discontinuous) or a small positive speed",
                code="RID-OPTION-RANGE",
            )

    @classmethod
    def from_description(
        cls, robot: RobotDescription, *, sign_smoothing_rad_s: float = 0.0
    ) -> Friction:
        """Return the friction terms of the robot's joints, joint by joint."""
        columns = tuple(
            _column(j, joint, function)
            for j, joint in enumerate(robot.joints)
            for term in joint.friction
            for function in _FUNCTIONS[term]
        )
        stribeck = tuple(
            StribeckSpeed(
                j,
                NonlinearParameter(
                    f"vs_{joint.name}",
                    "m/s" if joint.type == "prismatic" else "rad/s",
                    joint.stribeck_velocity,
                    min(SLOWEST_STRIBECK, joint.stribeck_velocity),
                    max(FASTEST_STRIBECK, joint.stribeck_velocity),
                ),
            )
            for j, joint in enumerate(robot.joints)
            if "stribeck" in joint.friction
        )
        return cls(columns, sign_smoothing_rad_s, stribeck, _presliding(robot))

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters, one per friction coefficient."""
        return tuple(column.parameter_name for column in self.columns)

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """Units of the parameters, in the order of `parameter_names`."""
        return tuple(column.unit for column in self.columns)

    @property
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """The nonlinear parameters: Stribeck velocities, presliding distances and fractions."""
        speeds = tuple(speed.parameter for speed in self.stribeck)
        distances = tuple(own.distance for own in self.presliding)
        return (*speeds, *distances, *(own.fraction for own in self.presliding if own.fraction))

    def with_nonlinear(self, values: FloatArray) -> Friction:
        """Return a copy with other values of the nonlinear parameters."""
        pairs = zip(self.nonlinear, values, strict=True)
        moved = {own.name: replace(own, value=float(value)) for own, value in pairs}
        return replace(
            self,
            stribeck=tuple(
                replace(own, parameter=moved[own.parameter.name]) for own in self.stribeck
            ),
            presliding=tuple(
                replace(
                    own,
                    distance=moved[own.distance.name],
                    fraction=own.fraction and moved[own.fraction.name],
                )
                for own in self.presliding
            ),
        )

    @property
    def changing(self) -> tuple[bool, ...]:
        """For each column, True if it depends on the nonlinear parameters."""
        with_memory = {own.joint for own in self.presliding}
        return tuple(
            column.function == "stribeck"
            or (traits(column.function).by_direction and column.joint in with_memory)
            for column in self.columns
        )

    def with_changing_only(self) -> Friction:
        """Return a copy with only those columns that depend on the nonlinear parameters."""
        pairs = zip(self.columns, self.changing, strict=True)
        return replace(self, columns=tuple(column for column, own in pairs if own))

    def nonlinear_slopes(self, motion: TermMotion, coefficients: FloatArray) -> FloatArray:
        """Return the slopes of the torque over the nonlinear parameters (`NonlinearTerm`)."""
        slopes = np.zeros((*motion.joint.shape[1:], len(self.nonlinear)))
        # `changing` refuses columns of an unknown function.
        changing = zip(self.columns, self.changing, coefficients, strict=True)
        sizes = {c.joint: float(size) for c, _, size in changing if c.function == "stribeck"}
        for k, stribeck in enumerate(self.stribeck):
            j, speed = stribeck.joint, stribeck.parameter.value
            size = sizes[j]
            v = motion.actuator[1, :, j]
            shape = self._sign(motion, j, v) * np.exp(-np.abs(v) / speed)
            slopes[:, j, k] = size * shape * np.abs(v) / speed**2
        memory = motion.conditions.memory
        if memory is not None:
            by_direction = self._memory_slopes(motion, coefficients)
            places = {own.name: k for k, own in enumerate(self.nonlinear)}
            for own in self.presliding:
                for parameter, steepness in memory.slopes(own):
                    place = places[parameter.name]
                    slopes[:, own.joint, place] = by_direction[:, own.joint] * steepness
        return slopes

    def _memory_slopes(self, motion: TermMotion, coefficients: FloatArray) -> FloatArray:
        """Return the torque's derivative with respect to the hysteretic direction, (samples, n)."""
        slopes = np.zeros(motion.joint.shape[1:])
        for column, size in zip(self.columns, coefficients, strict=True):
            j, v = column.joint, motion.actuator[1, :, column.joint]
            if not traits(column.function).by_direction:
                continue
            match column.function:
                case "coulomb":
                    slopes[:, j] += size
                case "forward" | "backward":
                    slopes[:, j] += 0.5 * size
                case "stribeck":
                    slopes[:, j] += size * np.exp(-np.abs(v) / self._stribeck_speed(j))
                case "coulomb_by_temperature":
                    slopes[:, j] += size * _temperature_rise(column, motion)
                case _:
                    raise unknown_function(column.function, "dynamics/terms/friction.py")
        return slopes

    def fill_torque(self, motion: TermMotion, out: FloatArray) -> None:
        """Compute the torque columns into `out`, (samples, n, coefficients).

        Raises:
            EstimationError: Friction depends on temperature, but `Conditions.temperature_k` is
                None.
        """
        for c, column in enumerate(self.columns):
            speed = motion.actuator[1, :, column.joint]
            out[:, column.joint, c] = self._values(column, motion, speed)

    def fill_base_wrench(self, motion: TermMotion, out: FloatArray) -> None:
        """Leave `out` zero: friction acts between two links and not on the base."""

    def torque_gradient(self, motion: TermMotion, weights: FloatArray) -> FloatArray:
        """Return the gradient of weighted sums of torque columns by the motion; see `Term`.

        The jump of a discontinuous sign(v) is not differentiated.
        """
        out = np.zeros((len(weights), *motion.actuator.shape))
        for c, column in enumerate(self.columns):
            speed = motion.actuator[1, :, column.joint]
            values = partial(self._values, column, motion)
            out[:, 1, :, column.joint] += weights[:, :, column.joint, c] * slopes(values, speed)
        return motion.by_joints(out)

    def _values(self, column: FrictionColumn, motion: TermMotion, v: Values) -> Values:
        match column.function:
            case "coulomb":
                return self._sign(motion, column.joint, v)
            case "viscous":
                return v
            case "offset":
                return np.ones_like(v)
            case "forward":
                return 0.5 * (self._sign(motion, column.joint, v) + self._motion(motion, column, v))
            case "backward":
                return 0.5 * (self._sign(motion, column.joint, v) - self._motion(motion, column, v))
            case "cubic":
                return v**3
            case "cube_root":
                direction = np.sign(v.real)
                return direction * (direction * v) ** (1.0 / 3.0)
            case "stribeck":
                speed = self._stribeck_speed(column.joint)
                falling = np.exp(-np.sign(v.real) * v / speed)
                return self._sign(motion, column.joint, v) * falling
            case "shear_thinning":
                speed = column.shear_thinning_speed
                return speed * np.arcsinh(v / speed)
            case "coulomb_by_temperature":
                return self._sign(motion, column.joint, v) * _temperature_rise(column, motion)
            case "viscous_by_temperature":
                return v * _temperature_rise(column, motion)
            case _:
                raise unknown_function(column.function, "dynamics/terms/friction.py")

    def _stribeck_speed(self, joint: int) -> float:
        return next(s.parameter.value for s in self.stribeck if s.joint == joint)

    def _sign(self, motion: TermMotion, joint: int, v: Values) -> Values:
        direction_of_memory = _hysteretic_direction(motion, joint)
        if direction_of_memory is not None:
            return direction_of_memory
        smoothing = self.sign_smoothing_rad_s
        return np.tanh(v / smoothing) if smoothing else np.sign(v.real)

    def _motion(self, motion: TermMotion, column: FrictionColumn, v: Values) -> Values:
        """Return 1; return 0 at rest if sign(v) is discontinuous (not smoothed, no hysteresis)."""
        if self.sign_smoothing_rad_s or _hysteretic_direction(motion, column.joint) is not None:
            return 1.0
        return np.abs(np.sign(v.real))


def _column(j: int, joint: Joint, function: FrictionFunction) -> FrictionColumn:
    own = traits(function)
    revolute, prismatic = own.units
    return FrictionColumn(
        joint=j,
        function=function,
        parameter_name=f"{own.symbol}_{joint.name}",
        unit=prismatic if joint.type == "prismatic" else revolute,
        reference_temperature_k=joint.reference_temperature_k,
        shear_thinning_speed=joint.shear_thinning_velocity,
    )


def _presliding(robot: RobotDescription) -> tuple[Presliding, ...]:
    """Return presliding distances and fractions, with their initial values for an estimate."""
    return tuple(
        Presliding(
            j,
            NonlinearParameter(
                f"dp_{joint.name}",
                "m" if joint.type == "prismatic" else "rad",
                joint.presliding_distance,
                min(SHORTEST_PRESLIDING, joint.presliding_distance),
                max(LONGEST_PRESLIDING, joint.presliding_distance),
            ),
            _fraction(joint),
        )
        for j, joint in enumerate(robot.joints)
        if "presliding" in joint.friction
    )


def _fraction(joint: Joint) -> NonlinearParameter | None:
    """Return a joint's presliding fraction as a parameter; None if all friction has hysteresis."""
    fraction = joint.presliding_share
    if fraction == 1.0:
        return None
    low, high = min(LEAST_FRACTION, fraction), max(LARGEST_FRACTION, fraction)
    return NonlinearParameter(f"sp_{joint.name}", "1", fraction, low, high)


def _hysteretic_direction(motion: TermMotion, joint: int) -> FloatArray | None:
    memory = motion.conditions.memory
    return None if memory is None else memory.of(joint)


def _temperature_rise(column: FrictionColumn, motion: TermMotion) -> FloatArray:
    """Return a drive's temperature minus its reference temperature, (samples,) [K]."""
    temperature = motion.conditions.temperature_k
    if temperature is None:
        raise EstimationError(
            f"{column.parameter_name} depends on the drive's temperature, which is missing:"
            " record or import it, give the joints' temperature if the command has --temperature,"
            " or leave out the friction term `temperature`",
            code="RID-MODEL-TEMPERATURE",
        )
    shape = motion.actuator.shape[1:]
    return np.broadcast_to(temperature, shape)[:, column.joint] - column.reference_temperature_k
