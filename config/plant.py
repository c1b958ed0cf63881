"""`PlantConfig`: the truth of a simulated robot, for the mock hardware and the demo's judge.

What the identification models do not have stands in `unmodelled`, so that it can be switched off.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from config.model import ConfigModel
from config.plate import Eight, SquareMatrix
from config.robot import Kinematics, NonNegative, Positive, Vector3


class LinkInertia(ConfigModel):
    """A rigid link: mass, centre of gravity in the link frame, inertia about it in its axes.

    `inertia_kg_m2` is Ixx, Iyy, Izz, Ixy, Ixz, Iyz. The rotors' masses and transverse inertias are
    part of the links that carry them; their polar inertias are not.
    """

    mass_kg: Positive
    centre_m: Vector3
    inertia_kg_m2: tuple[float, float, float, float, float, float]


class SimulatedAxis(ConfigModel):
    """One simulated axis: motor, friction, servo loop and what its drive reports.

    Friction and torques are at the link side. The velocity loop is tau = K_p (1 + 1/(T_i s)) of
    the velocity error, with the current loop a first-order lag behind it.
    """

    rotor_inertia_kg_m2: NonNegative
    coulomb_nm: NonNegative
    viscous_nm_s: NonNegative
    velocity_gain_nm_s: Positive
    velocity_integral_time_s: Positive
    current_loop_bandwidth_hz: Positive = 300.0
    rated_motor_torque_nm: Positive
    peak_motor_torque_nm: Positive
    encoder_increments_per_motor_rev: Annotated[int, Field(ge=16, le=2**24)]
    torque_noise_nm: NonNegative = 0.0
    brake_torque_nm: Positive
    initial_position: float = 0.0


class SimulatedSpring(ConfigModel):
    """The gravity spring's stiffness and free length (3.36); its geometry is the robot file's."""

    stiffness_n_per_m: Positive
    free_length_m: Positive


class SimulatedPlate(ConfigModel):
    """The truth of a simulated force plate, of its charge amplifier and of its serial line.

    Where the sensors sit and what the amplifier is set to is the cell file's. `crosstalk`: charge
    of a channel = `sensitivity_pc_n` times (matrix times sensor forces). Operate adds the charge
    `zero_jump_pc` and lets `drift_pc_s` flow; `noise_v` is of each sample at the output, whose full
    scale is 10 V. The amplifier's clock shows `clock_offset_s` when it is switched on, with the
    cell, and runs `clock_ppm` fast. Bytes reach the computer up to `line_jitter_s` after they have
    been sent.
    """

    sensitivity_pc_n: Eight
    crosstalk: SquareMatrix | None = None
    zero_jump_pc: Eight = (0.0,) * 8
    drift_pc_s: Eight = (0.0,) * 8
    noise_v: NonNegative = 0.0
    clock_offset_s: float = 0.0
    clock_ppm: Annotated[float, Field(ge=-10_000.0, le=10_000.0)] = 0.0
    line_jitter_s: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0


class UnmodelledAxis(ConfigModel):
    """Effects of one axis that no model of the estimators has."""

    stribeck_nm: NonNegative = 0.0
    stribeck_velocity_rad_s: Positive = 0.05
    load_friction: NonNegative = 0.0
    cogging_nm: NonNegative = 0.0
    cogging_periods_per_motor_rev: Annotated[int, Field(ge=1)] = 12
    tachometer_ripple: NonNegative = 0.0
    friction_drift_per_s: float = 0.0


class Unmodelled(ConfigModel):
    """All effects that the models do not have: per axis, and true kinematics off the nominal."""

    axes: tuple[UnmodelledAxis, ...]
    kinematics: Kinematics | None = None


class PlantConfig(ConfigModel):
    """A simulated robot; lists run base to flange, one entry a joint of the robot file."""

    name: str = Field(pattern=r"^[A-Za-z0-9][\w.-]{0,63}$")
    links: tuple[LinkInertia, ...] = Field(min_length=1)
    axes: tuple[SimulatedAxis, ...] = Field(min_length=1)
    spring: SimulatedSpring | None = None
    plate: SimulatedPlate | None = None
    unmodelled: Unmodelled | None = None

    def without_unmodelled(self) -> PlantConfig:
        """Return the same plant with every effect switched off that the models do not have."""
        return self.model_copy(update={"unmodelled": None})
