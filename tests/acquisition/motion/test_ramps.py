"""Run-in and run-out join the periodic motion smoothly and stay on its path.

Point-to-point moves stay within the limits.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.motion.fourier import FourierTrajectory
from acquisition.motion.ramps import rest_to_rest, rest_to_rest_duration, run_in, run_out
from acquisition.motion.samples import join, standstill

T = 0.01
TRAJECTORY = FourierTrajectory(
    joint_names=("a", "b"),
    sample_period_s=T,
    samples_per_period=400,
    offset=np.array([0.1, -0.3]),
    sine=np.array([[0.3, 0.1], [0.0, 0.2], [0.1, 0.0]]),
    cosine=np.array([[0.1, 0.0], [0.2, -0.1], [0.0, 0.05]]),
)


def central_difference(x: np.ndarray) -> np.ndarray:
    return (x[2:] - x[:-2]) / (2 * T)


class TestRunIn:
    def test_the_run_in_starts_at_rest(self) -> None:
        path = run_in(TRAJECTORY, 300)
        np.testing.assert_array_equal(path.velocity[0], 0.0)
        np.testing.assert_array_equal(path.acceleration[0], 0.0)

    def test_the_run_in_joins_the_period_with_continuous_derivatives(self) -> None:
        t = TRAJECTORY.sample_times_s[:50]
        ramp = run_in(TRAJECTORY, 300)
        position = np.concatenate([ramp.position, TRAJECTORY.position(t)])
        velocity = np.concatenate([ramp.velocity, TRAJECTORY.velocity(t)])
        acceleration = np.concatenate([ramp.acceleration, TRAJECTORY.acceleration(t)])
        np.testing.assert_allclose(central_difference(position), velocity[1:-1], atol=3e-3)
        np.testing.assert_allclose(central_difference(velocity), acceleration[1:-1], atol=2e-2)
        jerk = central_difference(acceleration)
        # Class C3: the jerk changes little from row to row, also where ramp and period join.
        assert np.abs(np.diff(jerk, axis=0)).max() < 0.1 * np.abs(jerk).max()

    def test_the_run_in_stays_on_the_path_and_below_the_speed_of_the_period(self) -> None:
        t = np.linspace(0.0, TRAJECTORY.period_s, 4001)
        ramp = run_in(TRAJECTORY, 700)
        assert (ramp.position <= TRAJECTORY.position(t).max(axis=0) + 1e-6).all()
        assert (ramp.position >= TRAJECTORY.position(t).min(axis=0) - 1e-6).all()
        assert (np.abs(ramp.velocity) <= np.abs(TRAJECTORY.velocity(t)).max(axis=0) + 1e-6).all()


class TestRunOut:
    def test_the_run_out_starts_at_the_end_of_the_period_and_comes_to_rest(self) -> None:
        path = run_out(TRAJECTORY, 300)
        zero = np.zeros(1)
        np.testing.assert_allclose(path.position[:1], TRAJECTORY.position(zero))
        np.testing.assert_allclose(path.velocity[:1], TRAJECTORY.velocity(zero))
        np.testing.assert_allclose(path.acceleration[:1], TRAJECTORY.acceleration(zero))
        np.testing.assert_array_equal(path.velocity[-1], 0.0)
        np.testing.assert_array_equal(path.acceleration[-1], 0.0)
        np.testing.assert_allclose(
            central_difference(path.position), path.velocity[1:-1], atol=3e-3
        )
        np.testing.assert_allclose(
            central_difference(path.velocity), path.acceleration[1:-1], atol=2e-2
        )


class TestRestToRest:
    def test_a_point_to_point_move_connects_two_poses(self) -> None:
        start, end = np.array([0.0, 1.0]), np.array([1.0, -0.5])
        path = join([rest_to_rest(start, end, 200, T), standstill(end, 3)])
        assert path.position.shape == (203, 2)
        np.testing.assert_array_equal(path.position[[0, -1]], [start, end])
        np.testing.assert_allclose(
            central_difference(path.position), path.velocity[1:-1], atol=1e-3
        )
        np.testing.assert_allclose(
            central_difference(path.velocity), path.acceleration[1:-1], atol=5e-2
        )

    def test_a_move_without_travel_takes_no_time(self) -> None:
        one = np.ones(2)
        assert rest_to_rest_duration(np.zeros(2), one, one) == 0.0

    @settings(max_examples=50)
    @given(
        travel=st.floats(-3.0, 3.0).filter(lambda x: abs(x) > 1e-3),
        velocity=st.floats(0.1, 5.0),
        acceleration=st.floats(0.1, 20.0),
    )
    def test_a_move_takes_the_shortest_time_within_the_limits(
        self, travel: float, velocity: float, acceleration: float
    ) -> None:
        duration_s = rest_to_rest_duration(
            np.array([travel]), np.array([velocity]), np.array([acceleration])
        )
        path = rest_to_rest(np.zeros(1), np.array([travel]), 2000, duration_s / 2000)
        use = max(
            np.abs(path.velocity).max() / velocity, np.abs(path.acceleration).max() / acceleration
        )
        assert use == pytest.approx(1.0, abs=1e-5)
