from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from config.arrays import FloatArray
from config.load import load_cell
from dynamics.model.robot_model import RobotModel, torque
from dynamics.model.true_parameters import true_parameters
from rid_daq.api import Model, Recording, Robot, identify
from tests.builders.identified_run import arm_in_motion, identified_run

STEP_S = 0.004


@dataclass(frozen=True)
class Arm:
    """The bundled three-axis arm with its true parameters, as arrays.

    Attributes:
        robot: Its description.
        model: Its equations.
        theta: Their true parameters.
    """

    robot: Robot
    model: RobotModel
    theta: FloatArray

    def torque_nm(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Return the true torques of a motion, shape (samples, 3)."""
        return torque(self.model, q, v, a, self.theta)

    def motion(self, seed: int, seconds: float) -> tuple[FloatArray, ...]:
        """Return times, positions, velocities and accelerations of a sum of sines.

        Returns:
            Times [s], shape (samples,); then arrays of shape (samples, 3) [rad, rad/s, rad/s2].
        """
        draws, time_s = np.random.default_rng(seed), np.arange(0.0, seconds, STEP_S)
        limits = [joint.limits for joint in self.robot.description.joints]
        middle = np.array([0.5 * (each.position_min + each.position_max) for each in limits])
        q, v, a = (np.zeros((len(time_s), len(limits))) for _ in range(3))
        for _ in range(4):
            omega, phase = draws.uniform(0.8, 4.0, len(limits)), draws.uniform(0, 6.28, len(limits))
            angle, size = np.outer(time_s, omega) + phase, draws.uniform(0.05, 0.15, len(limits))
            q += size * np.sin(angle)
            v += size * omega * np.cos(angle)
            a -= size * omega**2 * np.sin(angle)
        return time_s, middle + q, v, a

    def recording(self, seed: int, seconds: float = 20.0) -> Recording:
        """Return a recording of a motion; its torques have noise of 1 N m."""
        time_s, q, v, a = self.motion(seed, seconds)
        noise = np.random.default_rng(seed + 100).standard_normal(q.shape)
        measured = self.torque_nm(q, v, a) + noise
        return Recording.from_arrays(
            time_s, q, measured, torques="motor_torque", robot=self.robot, name=f"run {seed}"
        )


@pytest.fixture(scope="package")
def arm() -> Arm:
    cell = load_cell("ir361")
    model = RobotModel.from_description(cell.robot)
    assert cell.plant is not None
    return Arm(Robot(cell.robot), model, np.array(true_parameters(model, cell.robot, cell.plant)))


@pytest.fixture(scope="package")
def train(arm: Arm) -> Recording:
    return arm.recording(1)


@pytest.fixture(scope="package")
def model(train: Recording) -> Model:
    return identify(train, diagnose=False)


@pytest.fixture(scope="package")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a periodic run of the same arm, recorded by rid-daq."""
    runs = tmp_path_factory.mktemp("runs")
    identified_run(runs, arm_in_motion(), "excitation", 3)
    return next(each for each in runs.iterdir() if each.is_dir())
