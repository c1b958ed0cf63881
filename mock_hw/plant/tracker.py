"""`Tracker`: a simulated laser tracker, which measures a point on the last link of the plant."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from numpy.typing import NDArray

from config.errors import ConfigError
from config.robot.robot import RobotDescription
from config.simulation.plant import PlantConfig
from mock_hw.plant.rigid_bodies import build_links

Vector = NDArray[np.float64]

HEADER = "time_s,x_m,y_m,z_m\n"


class Tracker:
    """Measures the point between two states of the joints at the tracker's own rate.

    Args:
        robot: Description of the robot, as in the robot file.
        plant: True parameters, with a tracker.
        seed: Random seed of the noise.

    Raises:
        ConfigError: The plant has no tracker.
    """

    def __init__(self, robot: RobotDescription, plant: PlantConfig, seed: int) -> None:
        if plant.tracker is None:
            raise ConfigError(
                f"plant {plant.name!r} has no tracker: add the key `tracker` to the plant file",
                code="RID-PLANT-UNFIT",
            )
        self._settings = plant.tracker
        self._model = build_links(robot, plant)
        self._data: Any = self._model.createData()
        self._frame = pin.SE3(
            pin.exp3(np.array(plant.tracker.rotation_rad)), np.array(plant.tracker.position_m)
        )
        self._random = np.random.default_rng([seed, 7])
        self._begin_s = self._before_s = 0.0
        self._before = np.zeros(len(robot.joints)), np.zeros(len(robot.joints))
        self._taken = 0

    def begin(self, now_s: float, position: Vector, velocity: Vector) -> None:
        """Start the measurement.

        Args:
            now_s: Time of the first state [s].
            position, velocity: Shape (n,). The joints at this time [rad or m, per second].
        """
        self._begin_s = self._before_s = now_s
        self._before, self._taken = (position, velocity), 0

    def observe(self, now_s: float, position: Vector, velocity: Vector) -> list[Vector]:
        """Return the measurements since the last state: rows of the tracker's time, x, y, z [s, m].

        The joints' motion between two states is the cubic that their velocities determine.

        Args:
            now_s: Time of the new state [s].
            position, velocity: Shape (n,). The joints at this time.
        """
        settings, rows = self._settings, []
        own_rate = settings.rate_hz * (1.0 + 1e-6 * settings.clock_ppm)
        (start, start_v), step_s = self._before, now_s - self._before_s
        for number in range(self._taken, math.floor((now_s - self._begin_s) * own_rate) + 1):
            at_s = self._begin_s + number / own_rate
            u = 1.0 if step_s <= 0.0 else min(1.0, max(0.0, (at_s - self._before_s) / step_s))
            q = (
                (1.0 + 2.0 * u) * (1.0 - u) ** 2 * start
                + u * (1.0 - u) ** 2 * step_s * start_v
                + u * u * (3.0 - 2.0 * u) * position
                - u * u * (1.0 - u) * step_s * velocity
            )
            noise = settings.noise_m * self._random.standard_normal(3)
            own_s = settings.clock_offset_s + number / settings.rate_hz
            rows.append(np.array([own_s, *(self.point_m(q) + noise)]))
            self._taken = number + 1
        self._before, self._before_s = (position, velocity), now_s
        return rows

    def point_m(self, q: Vector) -> Vector:
        """Return the true point in the tracker's frame, (3,) [m], for joint positions (n,)."""
        pin.forwardKinematics(self._model, self._data, q)
        point = self._data.oMi[self._model.njoints - 1].act(np.array(self._settings.point_m))
        return np.asarray(self._frame.actInv(point))
