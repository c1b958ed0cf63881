"""Tables with the parameters of a plant's axes and spring, for the kernel of the servo loops."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.errors import ConfigError
from config.robot.robot import RobotDescription
from config.simulation.plant import PlantConfig
from mock_hw.plant import servo_loops as rows
from mock_hw.plant.rigid_bodies import output_columns

Vector = NDArray[np.float64]
TACHOMETER_PERIODS_PER_MOTOR_REV = 11


def axis_rows(robot: RobotDescription, plant: PlantConfig) -> Vector:
    """Return the kernel's table of axis parameters, (AXES_ROWS, n).

    Raises:
        ConfigError: An axis has presliding but no Coulomb friction.
    """
    table = np.zeros((rows.AXES_ROWS, len(plant.axes)))
    outputs = output_columns(plant)
    for i, (axis, extra) in enumerate(zip(plant.axes, plant.extras, strict=True)):
        ratio = abs(robot.joints[i].gear_ratio)
        table[rows.COULOMB, i] = axis.coulomb_nm
        table[rows.VISCOUS, i] = axis.viscous_nm_s
        table[rows.GAIN, i] = axis.velocity_gain_nm_s
        table[rows.INTEGRAL_TIME, i] = axis.velocity_integral_time_s
        table[rows.CURRENT_BANDWIDTH, i] = 2.0 * math.pi * axis.current_loop_bandwidth_hz
        table[rows.BRAKE, i] = axis.brake_torque_nm
        table[rows.STRIBECK, i] = extra.stribeck_nm
        table[rows.STRIBECK_VELOCITY, i] = extra.stribeck_velocity_rad_s
        table[rows.LOAD_FRICTION, i] = extra.load_friction
        table[rows.COGGING, i] = extra.cogging_nm
        table[rows.COGGING_WAVES, i] = extra.cogging_periods_per_motor_rev * ratio
        table[rows.RIPPLE, i] = extra.tachometer_ripple
        table[rows.RIPPLE_WAVES, i] = TACHOMETER_PERIODS_PER_MOTOR_REV * ratio
        table[rows.FRICTION_DRIFT, i] = extra.friction_drift_per_s
        table[rows.OUTPUT, i] = outputs[i]
        table[rows.GEAR_STIFFNESS, i] = extra.joint_stiffness_nm_rad or 0.0
        table[rows.GEAR_DAMPING, i] = extra.joint_damping_nm_s
        table[rows.PLAY, i] = extra.play_rad
        if extra.presliding_rad > 0.0:
            if axis.coulomb_nm == 0.0:
                raise ConfigError(
                    f"plant {plant.name!r}: unmodelled.axes[{i}].presliding_rad needs Coulomb"
                    f" friction: set axes[{i}].coulomb_nm, or set presliding_rad to 0",
                    code="RID-PLANT-UNFIT",
                )
            table[rows.BRISTLE_STIFFNESS, i] = axis.coulomb_nm / extra.presliding_rad
    return table


def spring_entries(robot: RobotDescription, plant: PlantConfig) -> Vector:
    """Return the kernel's spring: column (-1: no spring), stiffness k, free length, l, r.

    Raises:
        ConfigError: The spring's data are incomplete, or the spring cannot be simulated.
    """
    if robot.spring is None or plant.spring is None:
        return np.array([-1.0, 0.0, 0.0, 1.0, 0.5])
    joint = robot.joint_names.index(robot.spring.joint)
    if robot.coupling is not None and robot.coupling[joint] != tuple(
        float(j == joint) for j in range(len(robot.joints))
    ):
        raise ConfigError(
            f"robot {robot.name!r}: several motors move joint {robot.spring.joint!r}; the"
            " simulation supports a spring only on a joint with its own motor",
            code="RID-PLANT-UNFIT",
        )
    l_m, r_m = robot.spring.l_m, robot.spring.r_m
    if l_m is None or r_m is None:
        raise ConfigError(
            f"robot {robot.name!r}: the simulation of the spring needs its distances: set"
            " spring.l_m and spring.r_m",
            code="RID-PLANT-UNFIT",
        )
    if plant.spring.free_length_m > l_m + r_m:
        raise ConfigError(
            f"plant {plant.name!r}: spring.free_length_m {plant.spring.free_length_m} m is longer"
            f" than the largest length of the spring, {l_m + r_m} m",
            code="RID-PLANT-UNFIT",
        )
    return np.array(
        [
            output_columns(plant)[joint],
            plant.spring.stiffness_n_per_m,
            plant.spring.free_length_m,
            l_m,
            r_m,
        ]
    )
