"""`PlantConfig`: true parameters of a simulated robot, for the mock hardware and the demo's check.

Effects that a model with rigid gears, Coulomb and viscous friction lacks are in `unmodelled`, so
that they can be switched off. For some of these effects, the robot file has a friction term.
"""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from config.cell.plate import Eight, EightSensitivities, SquareMatrix
from config.errors import ConfigError
from config.model import ConfigModel
from config.plausible import Derived, PhysicalFile, Plausible, radius_of_gyration
from config.quantities import InertiaElements, Mass, NonNegative, Place, Positive, Temperature
from config.robot.kinematic_table import Kinematics
from config.simulation.tracker import SimulatedTracker


class LinkInertia(Derived):
    """A rigid link.

    Masses and transverse inertias of rotors are part of the link that carries them; their polar
    inertias are not.

    Attributes:
        mass_kg: Mass.
        centre_m: Centre of gravity in the link frame.
        inertia_kg_m2: Ixx, Iyy, Izz, Ixy, Ixz, Iyz about the centre of gravity, in the axes of the
            link frame.
    """

    mass_kg: Mass
    centre_m: Place
    inertia_kg_m2: InertiaElements

    def derived(self) -> dict[str, tuple[float, Plausible]]:
        """Return the radius of gyration."""
        return radius_of_gyration(self.mass_kg, self.inertia_kg_m2[:3])


class MountedBody(LinkInertia):
    """A body that can be mounted on the flange.

    Attributes:
        mass_kg: Mass.
        centre_m: Centre of gravity in the frame of the last link.
        inertia_kg_m2: Ixx, Iyy, Izz, Ixy, Ixz, Iyz about the centre of gravity, in the axes of that
            frame.
    """

    @model_validator(mode="after")
    def _check_inertia(self) -> Self:
        xx, yy, zz, xy, xz, yz = self.inertia_kg_m2
        moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if moments[0] < 0.0 or moments[0] + moments[1] < moments[2]:
            raise ValueError(
                f"inertia_kg_m2 has the principal moments {', '.join(f'{m:.4g}' for m in moments)}:"
                " none may be negative or larger than the sum of the other two; correct them"
            )
        return self


class SimulatedThermal(ConfigModel):
    """Warming of a motor and its effects.

    Attributes:
        initial_k: Temperature of the motor at the start.
        ambient_k: Temperature of the surroundings.
        time_constant_s: Time constant of the motor's warming and cooling.
        rise_k_per_w: Rise above the surroundings per watt of heat.
        loss_at_rated_w: Copper loss at rated torque; it grows with the torque's square.
        friction_share: Fraction of the friction's power that also heats the motor.
        friction_per_k: Relative change of the friction per kelvin above the joint's reference
            temperature (robot file); the friction is at least a fifth of its value there.
        torque_constant_per_k: Relative change of the torque constant per kelvin above the joint's
            reference temperature.
    """

    initial_k: Temperature = 298.15
    ambient_k: Temperature = 298.15
    time_constant_s: Annotated[Positive, Plausible(0.1, 1e5, "s")]
    rise_k_per_w: Positive
    loss_at_rated_w: NonNegative
    friction_share: Annotated[float, Field(ge=0.0, le=1.0)] = 0.5
    friction_per_k: float = 0.0
    torque_constant_per_k: float = 0.0


class SimulatedAxis(ConfigModel):
    """One simulated axis: motor, friction, servo loop and the drive's reports.

    Friction and torques are the motor's, at the link side of its gear. The velocity loop is tau =
    K_p (1 + 1/(T_i s)) of the velocity error, followed by the current loop as a first-order lag.

    Attributes:
        rotor_inertia_kg_m2: Inertia of the rotor at the motor side; with a `gear_ratio` of 1 this
            is also its inertia at the link side.
        coulomb_nm: Coulomb friction.
        viscous_nm_s: Viscous friction.
        velocity_gain_nm_s: Gain K_p of the velocity loop.
        velocity_integral_time_s: Integral time T_i of the velocity loop.
        current_loop_bandwidth_hz: Corner frequency of the current loop's lag.
        rated_motor_torque_nm: Rated torque of the motor, at the motor side.
        peak_motor_torque_nm: Largest torque of the motor, at the motor side.
        encoder_increments_per_motor_rev: Resolution of the encoder.
        torque_noise_nm: Standard deviation of the noise of each torque sample.
        brake_torque_nm: Holding torque of the brake.
        initial_position: Position at switch-on [rad or m].
        referenced: False for an axis that has not been homed, if its drive can report that.
    """

    rotor_inertia_kg_m2: Annotated[NonNegative, Plausible(1e-9, 1e4, "kg m² or kg")]
    coulomb_nm: Annotated[NonNegative, Plausible(0.0, 1e4, "N m")]
    viscous_nm_s: Annotated[NonNegative, Plausible(0.0, 1e5, "N m s/rad")]
    velocity_gain_nm_s: Annotated[Positive, Plausible(1e-4, 1e7, "N m s/rad")]
    velocity_integral_time_s: Annotated[Positive, Plausible(1e-4, 100.0, "s")]
    current_loop_bandwidth_hz: Annotated[Positive, Plausible(1.0, 2e4, "Hz")] = 300.0
    rated_motor_torque_nm: Annotated[Positive, Plausible(1e-6, 2e5, "N m or N")]
    peak_motor_torque_nm: Annotated[Positive, Plausible(1e-6, 5e5, "N m or N")]
    encoder_increments_per_motor_rev: Annotated[int, Field(ge=16, le=2**24)]
    torque_noise_nm: Annotated[NonNegative, Plausible(0.0, 1e4, "N m")] = 0.0
    brake_torque_nm: Annotated[Positive, Plausible(1e-4, 1e6, "N m")]
    initial_position: Annotated[float, Plausible(0.0, 50.0, "rad or m")] = 0.0
    referenced: bool = True

    @model_validator(mode="after")
    def _check_torques(self) -> Self:
        if self.peak_motor_torque_nm < self.rated_motor_torque_nm:
            raise ValueError(
                f"peak_motor_torque_nm {self.peak_motor_torque_nm:g} N m is below"
                f" rated_motor_torque_nm, {self.rated_motor_torque_nm:g} N m; correct one of them"
            )
        return self


class SimulatedSpring(ConfigModel):
    """The gravity spring (3.36); its geometry is in the robot file.

    Attributes:
        stiffness_n_per_m: Stiffness.
        free_length_m: Length without force.
    """

    stiffness_n_per_m: Annotated[Positive, Plausible(1.0, 1e8, "N/m")]
    free_length_m: Annotated[Positive, Plausible(1e-3, 5.0, "m")]


class SimulatedPlate(ConfigModel):
    """True parameters of a simulated force plate, of its charge amplifier and of its serial line.

    The sensors' positions and the amplifier's settings are in the cell file.

    Attributes:
        sensitivity_pc_n: True sensitivities of the sensors.
        crosstalk: Charge of a channel = `sensitivity_pc_n` times (matrix times sensor forces).
        zero_jump_pc: Charge that the switch to Operate adds to each channel.
        drift_pc_s: Drift of each channel after the switch to Operate.
        noise_v: Noise of each sample at the output, whose full scale is 10 V.
        clock_offset_s: Time that the amplifier's clock shows when it is switched on, together with
            the cell.
        clock_ppm: Error of the clock; positive if it runs fast.
        line_jitter_s: Longest delay of a byte on its way to the computer.
    """

    sensitivity_pc_n: EightSensitivities
    crosstalk: SquareMatrix | None = None
    zero_jump_pc: Eight = (0.0,) * 8
    drift_pc_s: Eight = (0.0,) * 8
    noise_v: Annotated[NonNegative, Plausible(0.0, 10.0, "V")] = 0.0
    clock_offset_s: float = 0.0
    clock_ppm: Annotated[float, Field(ge=-10_000.0, le=10_000.0)] = 0.0
    line_jitter_s: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0


class UnmodelledAxis(ConfigModel):
    """Effects of one axis that a model with a rigid gear, Coulomb and viscous friction lacks.

    Attributes:
        stribeck_nm: Friction at standstill in addition to Coulomb friction (Stribeck friction).
        stribeck_velocity_rad_s: Speed over which the Stribeck friction falls.
        load_friction: Friction per transmitted torque.
        cogging_nm: Amplitude of the cogging torque.
        cogging_periods_per_motor_rev: Periods of the cogging torque per turn of the motor.
        tachometer_ripple: Relative ripple of the measured velocity.
        friction_drift_per_s: Relative change of friction per second.
        thermal: Warming of the motor.
        presliding_rad: Presliding displacement of the motor, at the link side. At smaller
            displacements friction is a spring with hysteresis.
        joint_stiffness_nm_rad: Stiffness of the spring between motor and link; without it, the gear
            is rigid.
        joint_damping_nm_s: Damping parallel to the spring.
        play_rad: Play of the gear, within which neither spring nor damper acts.
    """

    stribeck_nm: Annotated[NonNegative, Plausible(0.0, 1e4, "N m")] = 0.0
    stribeck_velocity_rad_s: Annotated[Positive, Plausible(1e-5, 10.0, "rad/s or m/s")] = 0.05
    load_friction: NonNegative = 0.0
    cogging_nm: Annotated[NonNegative, Plausible(0.0, 1e4, "N m")] = 0.0
    cogging_periods_per_motor_rev: Annotated[int, Field(ge=1)] = 12
    tachometer_ripple: NonNegative = 0.0
    friction_drift_per_s: float = 0.0
    thermal: SimulatedThermal | None = None
    presliding_rad: Annotated[NonNegative, Plausible(0.0, 0.1, "rad or m")] = 0.0
    joint_stiffness_nm_rad: Annotated[Positive, Plausible(10.0, 1e9, "N m/rad or N/m")] | None = (
        None
    )
    joint_damping_nm_s: Annotated[NonNegative, Plausible(0.0, 1e6, "N m s/rad")] = 0.0
    play_rad: Annotated[NonNegative, Plausible(0.0, 0.1, "rad or m")] = 0.0

    @model_validator(mode="after")
    def _check_gear(self) -> Self:
        if self.joint_stiffness_nm_rad is None and (self.joint_damping_nm_s or self.play_rad):
            raise ValueError(
                "joint_damping_nm_s and play_rad need an elastic gear; add joint_stiffness_nm_rad"
            )
        return self


class UnmodelledEffects(ConfigModel):
    """Effects that a model with rigid gears, Coulomb and viscous friction lacks.

    Attributes:
        axes: Effects of each axis.
        kinematics: True kinematics, if they differ from the nominal ones of the robot file.
    """

    axes: tuple[UnmodelledAxis, ...]
    kinematics: Kinematics | None = None


class PlantConfig(PhysicalFile):
    """A simulated robot; lists have one entry per joint of the robot file, base to flange.

    Attributes:
        name: Name of the plant.
        links: Masses and inertias.
        axes: Motors, friction and servo loops.
        spring: The gravity spring, if the robot file has one.
        plate: The force plate, if the cell has one.
        unmodelled: Effects that a model with rigid gears, Coulomb and viscous friction lacks.
        payloads: Bodies for the flange, by name.
        attached: The payload that is mounted when the robot is switched on.
        tracker: A laser tracker that measures a point on the last link.
    """

    name: str = Field(pattern=r"^[A-Za-z0-9][\w.-]{0,63}$")
    links: tuple[LinkInertia, ...] = Field(min_length=1)
    axes: tuple[SimulatedAxis, ...] = Field(min_length=1)
    spring: SimulatedSpring | None = None
    plate: SimulatedPlate | None = None
    unmodelled: UnmodelledEffects | None = None
    payloads: dict[str, MountedBody] = Field(default_factory=dict)
    attached: str | None = None
    tracker: SimulatedTracker | None = None

    @field_validator("payloads")
    @classmethod
    def _check_names(cls, payloads: dict[str, MountedBody]) -> dict[str, MountedBody]:
        for name in payloads:
            if not name.isidentifier():
                raise ValueError(f"invalid payload name {name!r}; use letters, digits and _")
        return payloads

    @model_validator(mode="after")
    def _check_attached(self) -> Self:
        if self.attached is not None:
            self._require_payload(self.attached)
        return self

    def _require_payload(self, name: str) -> None:
        if name not in self.payloads:
            known = ", ".join(self.payloads) or "none"
            raise ValueError(f"unknown payload {name!r}; use one of: {known}")

    def with_payload(self, name: str | None) -> PlantConfig:
        """Return the plant with a payload of `payloads` on its flange, or without a payload.

        Raises:
            ConfigError: No payload has that name.
        """
        if name is not None:
            try:
                self._require_payload(name)
            except ValueError as error:
                raise ConfigError(f"plant {self.name!r}: {error}", code="RID-PLANT-UNFIT") from None
        return self.model_copy(update={"attached": name})

    @property
    def extras(self) -> tuple[UnmodelledAxis, ...]:
        """The unmodelled effects of every axis; default values if they are switched off."""
        return (
            (UnmodelledAxis(),) * len(self.axes)
            if self.unmodelled is None
            else self.unmodelled.axes
        )

    def without_unmodelled(self) -> PlantConfig:
        """Return the plant without the effects under `unmodelled`."""
        return self.model_copy(update={"unmodelled": None})
