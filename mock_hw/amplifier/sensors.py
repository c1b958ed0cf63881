"""Sensors of a simulated force plate: from the base wrench to the charges of eight channels.

The plate is rigid and rests on four equal three-component sensors at (±a, ±b). A load on the plate
is distributed over the sensors as over four equal springs. Kistler's formulas allow many
distributions; this is the one with the least elastic energy.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from config.cell.plate import PlateConfig
from config.simulation.plant import SimulatedPlate

Matrix = NDArray[np.float64]


class PlateSensors:
    """A plate with its sensors; forces and charges are linear functions of the base wrench.

    Args:
        plate: Geometry of the plate, and its position in the robot's base frame.
        truth: True sensitivity (pC/N) and crosstalk of the sensors. The `sensitivity` in the cell
            file is a calibration result and is not used here.
    """

    def __init__(self, plate: PlateConfig, truth: SimulatedPlate) -> None:
        crosstalk = np.eye(8) if truth.crosstalk is None else np.array(truth.crosstalk)
        on_plate = -_to_plate_frame(plate)  # the load on the plate is minus the base wrench
        self._forces = _sensor_matrix(plate.a_m, plate.b_m, plate.az0_m) @ on_plate
        self._charges = np.diag(truth.sensitivity_pc_n) @ crosstalk @ self._forces

    def forces_n(self, base_wrench: ArrayLike) -> Matrix:
        """Return the sensors' forces for base wrenches, (m, 8) [N], in the order of the channels.

        Args:
            base_wrench: Shape (m, 6). Wrench of the base on the robot, about the origin and in the
                axes of the base frame [N, N m].
        """
        return np.asarray(base_wrench) @ self._forces.T

    def charges_pc(self, base_wrench: ArrayLike) -> Matrix:
        """Return the channels' charges, (m, 8) [pC], with the signs of the sensitivities."""
        return np.asarray(base_wrench) @ self._charges.T


def _to_plate_frame(plate: PlateConfig) -> Matrix:
    """Return the matrix (6, 6) that transforms wrenches from the base frame to the plate frame."""
    roll, pitch, yaw = plate.rotation_rad
    turned = _rotation(2, yaw) @ _rotation(1, pitch) @ _rotation(0, roll)
    x, y, z = plate.position_m
    lever = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix = np.zeros((6, 6))
    matrix[:3, :3] = matrix[3:, 3:] = turned.T
    matrix[3:, :3] = -turned.T @ lever
    return matrix


def _rotation(axis: int, angle: float) -> Matrix:
    one, two = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[one, one] = matrix[two, two] = math.cos(angle)
    matrix[two, one], matrix[one, two] = math.sin(angle), -math.sin(angle)
    return matrix


def _sensor_matrix(a_m: float, b_m: float, az0_m: float) -> Matrix:
    """Return the matrix (8, 6) from a wrench about the centre of the plate's surface to forces."""
    turning = 0.5 / (a_m * a_m + b_m * b_m)
    about_x, about_y = 0.25 / b_m, 0.25 / a_m
    # Moments about the sensors' plane z = -az0: Mx = Mx' - Fy az0, My = My' + Fx az0.
    to_sensor_plane = np.eye(6)
    to_sensor_plane[3, 1] = -az0_m
    to_sensor_plane[4, 0] = az0_m
    return (
        np.array(
            [
                [0.5, 0.0, 0.0, 0.0, 0.0, -b_m * turning],
                [0.5, 0.0, 0.0, 0.0, 0.0, b_m * turning],
                [0.0, 0.5, 0.0, 0.0, 0.0, a_m * turning],
                [0.0, 0.5, 0.0, 0.0, 0.0, -a_m * turning],
                [0.0, 0.0, 0.25, about_x, -about_y, 0.0],
                [0.0, 0.0, 0.25, about_x, about_y, 0.0],
                [0.0, 0.0, 0.25, -about_x, about_y, 0.0],
                [0.0, 0.0, 0.25, -about_x, -about_y, 0.0],
            ]
        )
        @ to_sensor_plane
    )
