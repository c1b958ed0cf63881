"""Measured poses of arms that Pinocchio simulates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from acquisition.tracker.pose_file import MeasuredPoses
from benchmarks.measured_arm import MeasuredArm
from config.arrays import FloatArray
from config.load import load_robot
from identification.kinematics.calibration import Calibration, calibrate, probe_positions
from identification.kinematics.gravity import Gravity

NOISE_M = 2e-5


@dataclass(frozen=True, eq=False)
class Experiment:
    """A simulated arm, its nominal tool point, and its gravity as computed by rid-daq."""

    arm: MeasuredArm
    point_m: FloatArray
    gravity: Gravity

    def measured(self, position: FloatArray, load_kg: FloatArray) -> MeasuredPoses:
        """Return the poses as the tracker measures them, with noise."""
        noise = NOISE_M * np.random.default_rng(5).normal(size=(len(position), 3))
        rows = np.arange(2, 2 + len(position))
        points = self.arm.points(position, load_kg) + noise
        return MeasuredPoses("poses.csv", rows, position, points, load_kg)

    def calibration(self, count: int, load_kg: float = 0.0) -> Calibration:
        """Return the calibration from random poses; the arm is loaded in every second pose."""
        loads = np.where(np.arange(count) % 2, load_kg, 0.0)
        poses = self.measured(probe_positions(self.arm.robot, count), loads)
        return calibrate(self.arm.robot, poses, self.gravity, self.point_m)


def _experiment(name: str, point: tuple[float, ...], stiffness: tuple[float, ...]) -> Experiment:
    nominal = np.array(point)
    arm = MeasuredArm.of(load_robot(name), nominal, stiffness, seed=1)
    return Experiment(arm, nominal, Gravity.of_cad(arm.robot, nominal))


@pytest.fixture(scope="session")
def three_axes() -> Experiment:
    """Experiment with ir361."""
    return _experiment("ir361", (0.765, 0.0, 0.0), (5e4, 6e4, 2e4))


@pytest.fixture(scope="session")
def six_axes() -> Experiment:
    """Experiment with kr15, whose wrist is coupled."""
    return _experiment("kr15", (0.12, 0.05, -0.1), (4e5, 5e5, 2e5, 4e4, 3e4, 1.5e4))


@pytest.fixture(scope="session")
def calibrated(three_axes: Experiment, six_axes: Experiment) -> Callable[[str], Calibration]:
    """Return a function that gives a robot's calibration by the robot's name.

    Each calibration has 50 poses, every second one with a load.
    """
    found = {"ir361": three_axes.calibration(50, 8.0), "kr15": six_axes.calibration(50, 13.6)}
    return found.__getitem__
