"""`PlateGeometry`: converts channels of a force plate to the wrench on the robot's base, and back.

A plate with four three-component sensors has eight channels fx12, fx34, fy14, fy23, fz1 to fz4:
forces on the plate in its own axes, z down. The manufacturer's formulas give the wrench (Kistler,
Force Plate Formulae, 1999; the same as C3D's FORCE_PLATFORM type 3). In `dynamics`, the base wrench
is the wrench of the base on the robot about the origin of the base frame: the opposite of the
wrench on the plate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from config.arrays import FloatArray, freeze
from config.cell.plate import CHANNELS, PlateDescription, PlatePlace
from config.errors import RecordingError

WRENCH_NAMES = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
WRENCH_UNITS = ("N", "N", "N", "N m", "N m", "N m")


@dataclass(frozen=True, eq=False)
class PlateGeometry:
    """Conversion between the channels of a plate and the base wrench of the robot on it.

    Attributes:
        base_wrench_matrix: Shape (6, 8). Base wrench (Fx, Fy, Fz [N], Mx, My, Mz [N m], exerted on
            the robot, about the base frame's origin and in its axes) per unit of each channel's
            reading.
        channel_matrix: Shape (8, 6). Readings per unit of base wrench for four equally stiff
            sensors: of all readings with this wrench, those with the smallest sum of squared sensor
            forces.
    """

    base_wrench_matrix: FloatArray
    channel_matrix: FloatArray

    def __post_init__(self) -> None:
        freeze(self, RecordingError, (6, CHANNELS), "base_wrench_matrix")
        freeze(self, RecordingError, (8, 6), "channel_matrix")

    @classmethod
    def from_config(cls, plate: PlateDescription) -> PlateGeometry:
        """Return the geometry of a plate as a file describes it."""
        of_plate = plate_wrench_matrix(plate.a_m, plate.b_m, plate.az0_m)
        crosstalk = np.eye(CHANNELS) if plate.sensitivity is None else np.array(plate.sensitivity)
        of_base = -_plate_to_base_matrix(plate) @ of_plate
        back = np.asarray(crosstalk @ np.linalg.pinv(of_base), dtype=np.float64)
        return cls(of_base @ np.linalg.inv(crosstalk), back)

    def base_wrench(self, channels_n: FloatArray) -> FloatArray:
        """Return the base wrench, (samples, 6), of readings (samples, 8) [N]."""
        return np.asarray(channels_n @ self.base_wrench_matrix.T)

    def channels(self, base_wrench: FloatArray) -> FloatArray:
        """Return readings, (samples, 8) [N], that correspond to a base wrench (samples, 6)."""
        return np.asarray(base_wrench @ self.channel_matrix.T)


def base_wrench_matrix(plate: PlatePlace) -> FloatArray:
    """Return the base wrench per unit of each reading of a plate, (6, c).

    The readings are the eight channels of a `PlateDescription`. A plate of which only the place is
    known reads six components: the wrench on the plate, about the origin of the plate's frame and
    in its axes.
    """
    if isinstance(plate, PlateDescription):
        return PlateGeometry.from_config(plate).base_wrench_matrix
    return -_plate_to_base_matrix(plate)


def plate_wrench_matrix(a_m: float, b_m: float, az0_m: float) -> FloatArray:
    """Return the wrench on the plate, about its surface's centre, per unit of channel, (6, 8).

    Args:
        a_m, b_m: Distances of the sensors from the centre along x and y [m].
        az0_m: z of the surface, measured from the sensors' plane; negative, as z points down [m].
    """
    a, b, h = a_m, b_m, az0_m
    return np.array(
        [
            [1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0],
            [0.0, 0.0, h, h, b, b, -b, -b],
            [-h, -h, 0.0, 0.0, -a, a, a, -a],
            [-b, b, a, -a, 0.0, 0.0, 0.0, 0.0],
        ]
    )


def _plate_to_base_matrix(plate: PlatePlace) -> FloatArray:
    """Return the matrix that transforms a wrench from the plate frame to the base frame, (6, 6)."""
    rotation = _rotation_matrix(*plate.rotation_rad)
    x, y, z = plate.position_m
    lever = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    shift = np.zeros((6, 6))
    shift[:3, :3] = shift[3:, 3:] = rotation
    shift[3:, :3] = lever @ rotation
    return shift


def _rotation_matrix(roll: float, pitch: float, yaw: float) -> FloatArray:
    """Return Rz(yaw) Ry(pitch) Rx(roll), (3, 3)."""
    cr, sr = np.cos(roll), np.sin(roll)
    cp, sp = np.cos(pitch), np.sin(pitch)
    cy, sy = np.cos(yaw), np.sin(yaw)
    about_z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    return np.asarray(about_z @ about_y @ about_x)
