"""The simulated tracker measures the true point, in its own frame and on its own clock."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from config.errors import ConfigError
from config.load import load_bundled_or_path, load_robot
from config.simulation.plant import PlantConfig
from mock_hw.plant.tracker import Tracker
from tests.builders.raised_codes import raises_code

ROBOT = load_robot("ir361")


@pytest.fixture(scope="module")
def plant() -> PlantConfig:
    return load_bundled_or_path("ir361_elastic", "plants", PlantConfig)


def nominal(plant: PlantConfig, **changes: object) -> PlantConfig:
    """Return the plant with a changed tracker and without unmodelled effects."""
    assert plant.tracker is not None
    tracker = plant.tracker.model_copy(update=changes)
    return plant.model_copy(update={"unmodelled": None, "tracker": tracker})


def test_the_point_is_that_of_the_stretched_arm(plant: PlantConfig) -> None:
    turn, place = (0.1, -0.2, 2.4), (2.5, 0.8, -0.4)
    changed = nominal(
        plant, point_m=(0.765, 0.0, 0.0), rotation_rad=turn, position_m=place, noise_m=0.0
    )
    found = Tracker(ROBOT, changed, 0).point_m(np.zeros(3))
    # In its zero pose, the arm of 0.48 m and 0.765 m is bent by a right angle.
    in_base = Rotation.from_rotvec(turn).apply(found) + place
    assert np.linalg.norm(in_base[:2]) == pytest.approx(0.765, abs=1e-6)
    assert in_base[2] == pytest.approx(-1.02 - 0.48, abs=1e-6)


def test_rate_clock_and_noise_are_those_of_the_plant(plant: PlantConfig) -> None:
    tracker = Tracker(ROBOT, nominal(plant, clock_ppm=1000.0, noise_m=1e-4), 3)
    still = np.array([0.3, 0.2, 0.1]), np.zeros(3)
    tracker.begin(2.0, *still)
    rows = np.array(
        [row for step in range(1, 2501) for row in tracker.observe(2.0 + step * 0.004, *still)]
    )
    assert len(rows) == 2503  # 10 s on a clock that is 0.1 % fast
    assert np.diff(rows[:, 0]) == pytest.approx(0.004)
    assert rows[0, 0] == pytest.approx(4711.3)
    assert rows[:, 1:].std(axis=0) == pytest.approx(1e-4, rel=0.1)
    assert rows[:, 1:].mean(axis=0) == pytest.approx(tracker.point_m(still[0]), abs=1e-5)


def test_the_motion_between_two_states_is_smooth(plant: PlantConfig) -> None:
    tracker = Tracker(ROBOT, nominal(plant, rate_hz=1000.0, noise_m=0.0, clock_ppm=0.0), 0)

    def state(at_s: float) -> tuple[np.ndarray, np.ndarray]:
        return np.sin(5.0 * at_s) * np.ones(3), 5.0 * np.cos(5.0 * at_s) * np.ones(3)

    tracker.begin(0.0, *state(0.0))
    rows = np.array(
        [row for n in range(1, 101) for row in tracker.observe(0.01 * n, *state(0.01 * n))]
    )
    true = np.array([tracker.point_m(state(0.001 * n)[0]) for n in range(len(rows))])
    assert np.abs(rows[:, 1:] - true).max() < 1e-7


def test_a_plant_without_tracker_is_refused(plant: PlantConfig) -> None:
    with raises_code(ConfigError, "RID-PLANT-UNFIT"):
        Tracker(ROBOT, plant.model_copy(update={"tracker": None}), 0)
