"""Periodic excitation (2.30): exact derivatives and a whole number of samples per period."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from acquisition.motion.fourier import samples_of_period
from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from config.errors import ConfigError
from config.load import load_robot
from tests.builders.raised_codes import raises_code

ROBOT = load_robot("ir361")


def motion(**changes: object) -> FourierMotion:
    joints = (
        FourierJoint(joint="axis1", offset=0.1, sine=(0.2, 0.0, 0.05), cosine=(0.0, 0.1, -0.02)),
        FourierJoint(joint="axis2", offset=-0.2, sine=(0.1,), cosine=(0.05,)),
        FourierJoint(joint="axis3", offset=0.5, sine=(0.0, 0.2), cosine=(0.3, 0.0)),
    )
    values: dict[str, object] = {
        "kind": "fourier",
        "robot": "ir361",
        "period_s": 10.0,
        "joints": joints,
    }
    return FourierMotion.model_validate(values | changes)


class TestTrajectory:
    def test_the_trajectory_is_the_sum_of_2_30(self) -> None:
        trajectory = motion().trajectory(ROBOT, 0.008)
        t = np.array([0.0, 1.234, 9.9])
        w = 2.0 * np.pi / 10.0
        axis1 = (
            0.1
            + 0.2 * np.sin(w * t)
            + 0.05 * np.sin(3 * w * t)
            + 0.1 * np.cos(2 * w * t)
            - 0.02 * np.cos(3 * w * t)
        )
        speed2 = 0.1 * w * np.cos(w * t) - 0.05 * w * np.sin(w * t)
        acceleration3 = -0.2 * (2 * w) ** 2 * np.sin(2 * w * t) - 0.3 * w**2 * np.cos(w * t)
        np.testing.assert_allclose(trajectory.position(t)[:, 0], axis1, atol=1e-14)
        np.testing.assert_allclose(trajectory.velocity(t)[:, 1], speed2, atol=1e-14)
        np.testing.assert_allclose(trajectory.acceleration(t)[:, 2], acceleration3, atol=1e-14)

    def test_the_trajectory_repeats_after_its_period(self) -> None:
        trajectory = motion().trajectory(ROBOT, 0.008)
        assert trajectory.samples_per_period == 1250
        assert trajectory.harmonics == 3
        t = trajectory.sample_times_s
        np.testing.assert_allclose(
            trajectory.position(t + trajectory.period_s), trajectory.position(t), atol=1e-12
        )

    def test_the_trajectory_is_in_the_robots_joint_order(self) -> None:
        given_order = motion()
        shuffled = motion(joints=given_order.joints[::-1])
        a = given_order.trajectory(ROBOT, 0.008)
        b = shuffled.trajectory(ROBOT, 0.008)
        np.testing.assert_array_equal(a.offset, b.offset)
        np.testing.assert_array_equal(a.sine, b.sine)

    def test_a_trajectory_is_immutable(self) -> None:
        trajectory = motion().trajectory(ROBOT, 0.008)
        assert not trajectory.sine.flags.writeable

    def test_a_missing_joint_is_refused_with_its_name(self) -> None:
        with raises_code(ConfigError, "RID-MOTION-JOINTS", "axis1", "axis2", "'ir361'", "axis3"):
            motion(joints=motion().joints[:2]).trajectory(ROBOT, 0.008)

    def test_harmonics_beyond_half_the_sampling_rate_are_refused(self) -> None:
        with raises_code(ConfigError, "RID-MOTION-BAND"):
            motion(period_s=0.6).trajectory(ROBOT, 0.1)


class TestSamplesOfPeriod:
    def test_the_nearest_valid_periods_are_suggested(self) -> None:
        with raises_code(ConfigError, "RID-MOTION-PERIOD", "1250.375", "10", "10.008"):
            samples_of_period(10.003, 0.008)

    def test_a_period_of_a_few_cycles_is_refused(self) -> None:
        with raises_code(ConfigError, "RID-MOTION-PERIOD"):
            samples_of_period(0.024, 0.008)

    @given(
        samples=st.integers(4, 1_000_000),
        cycle_ms=st.integers(1, 100),
    )
    def test_every_whole_number_of_cycles_is_accepted(self, samples: int, cycle_ms: int) -> None:
        sample_period_s = cycle_ms / 1000.0
        period_s = float(
            f"{samples * sample_period_s:.9g}"
        )  # rounded to nine digits, as a user enters a period
        assert samples_of_period(period_s, sample_period_s) == samples
