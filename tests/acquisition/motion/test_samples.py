"""Planned motions are at rest at both ends and within the limits also between samples.

Other motions are refused.
"""

from __future__ import annotations

from typing import Literal, TypedDict

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.motion.approach import approach
from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.motion.kinds.multipoint import MultipointMotion
from acquisition.motion.limits import verify_limits
from acquisition.motion.samples import MotionSamples, Phase
from config.arrays import FloatArray, PhaseArray
from config.errors import ConfigError
from config.load import load_robot
from tests.builders.raised_codes import raises_code

ROBOT = load_robot("ir361")
T = 0.008


def fourier(amplitude: float = 0.2, harmonics: int = 5, **changes: object) -> FourierMotion:
    rng = np.random.default_rng(5)
    joints = tuple(
        FourierJoint(
            joint=joint.name,
            offset=(joint.limits.position_min + joint.limits.position_max) / 2.0,
            sine=tuple(amplitude * rng.uniform(-1, 1, harmonics) / np.arange(1, harmonics + 1)),
            cosine=tuple(amplitude * rng.uniform(-1, 1, harmonics) / np.arange(1, harmonics + 1)),
        )
        for joint in ROBOT.joints
    )
    values: dict[str, object] = {
        "kind": "fourier",
        "robot": "ir361",
        "period_s": 10.0,
        "joints": joints,
    }
    return FourierMotion.model_validate(values | changes)


def multipoint(**changes: object) -> MultipointMotion:
    return MultipointMotion.model_validate(
        {"kind": "multipoint", "robot": "ir361", "seed": 1} | changes
    )


def largest_mismatch(samples: MotionSamples) -> tuple[float, float]:
    """Return the largest errors of velocity and acceleration against finite differences."""
    by_position = np.diff(samples.position, axis=0) / T
    by_velocity = np.diff(samples.velocity, axis=0) / T
    mean_velocity = (samples.velocity[1:] + samples.velocity[:-1]) / 2.0
    mean_acceleration = (samples.acceleration[1:] + samples.acceleration[:-1]) / 2.0
    return (
        float(np.abs(by_position - mean_velocity).max()),
        float(np.abs(by_velocity - mean_acceleration).max()),
    )


class TestFourierPlan:
    samples = fourier(periods=3, transient_periods=2).plan(ROBOT, T).whole()

    def test_a_fourier_plan_starts_and_ends_at_rest(self) -> None:
        for values in (self.samples.velocity, self.samples.acceleration):
            np.testing.assert_array_equal(values[[0, -1]], 0.0)

    def test_a_fourier_plan_has_run_in_transient_main_and_run_out(self) -> None:
        phase = self.samples.phase
        changes = phase[np.flatnonzero(np.diff(phase, prepend=99))]
        assert changes.tolist() == [Phase.RUN_IN, Phase.TRANSIENT, Phase.MAIN, Phase.RUN_OUT]
        assert np.count_nonzero(phase == Phase.TRANSIENT) == 2 * 1250
        assert np.count_nonzero(phase == Phase.MAIN) == 3 * 1250
        assert np.count_nonzero(phase == Phase.RUN_IN) == 500  # 4 s
        assert self.samples.samples_per_period == 1250
        assert self.samples.periods == 3

    def test_main_periods_are_equal_bit_for_bit(self) -> None:
        main = self.samples.position[self.samples.phase == Phase.MAIN].reshape(3, 1250, -1)
        np.testing.assert_array_equal(main[0], main[2])

    def test_a_fourier_plan_stores_its_main_period_once(self) -> None:
        planned = fourier(periods=3, transient_periods=2).plan(ROBOT, T)
        assert len(planned) == len(self.samples)
        assert planned.period_ends == self.samples.period_ends
        assert len(planned.position) == len(self.samples) - 2 * 1250
        rows = [planned.place(row) for row in range(len(planned))]
        for name in ("position", "velocity", "acceleration", "phase"):
            np.testing.assert_array_equal(getattr(planned, name)[rows], getattr(self.samples, name))

    def test_a_fourier_plan_stores_as_many_rows_for_an_hour_as_for_a_minute(self) -> None:
        hour, minute = (fourier(periods=count).plan(ROBOT, T) for count in (360, 6))
        assert len(hour.position) == len(minute.position)
        assert len(hour) - len(minute) == 354 * 1250
        shorter = hour.whole(most_periods=6)
        np.testing.assert_array_equal(shorter.position, minute.whole().position)

    def test_velocity_and_acceleration_are_the_derivatives_throughout(self) -> None:
        velocity, acceleration = largest_mismatch(self.samples)
        assert velocity < 1e-3
        assert acceleration < 1e-2

    def test_the_ramp_is_lengthened_until_the_limits_are_kept(self) -> None:
        samples = fourier(amplitude=0.5, periods=1, ramp_s=0.05).plan(ROBOT, T)
        ramp_s = np.count_nonzero(samples.phase == Phase.RUN_IN) * T
        assert 0.1 < ramp_s < 4.0
        verify_limits(samples, ROBOT)

    def test_a_period_beyond_a_limit_is_refused_with_joint_value_and_limit(self) -> None:
        names = ("position of joint", "'axis2'", "1.59753 rad", "is 1 rad;")
        with raises_code(ConfigError, "RID-MOTION-LIMIT", *names):
            fourier(amplitude=2.0).plan(ROBOT, T)

    @settings(max_examples=15)
    @given(
        amplitude=st.floats(0.0, 0.6),
        harmonics=st.integers(1, 8),
        ramp_s=st.floats(0.01, 5.0),
        transient=st.integers(0, 2),
    )
    def test_a_fourier_plan_is_within_limits_or_refused(
        self, amplitude: float, harmonics: int, ramp_s: float, transient: int
    ) -> None:
        motion = fourier(
            amplitude, harmonics, ramp_s=ramp_s, transient_periods=transient, periods=1
        )
        try:
            samples = motion.plan(ROBOT, T)
        except ConfigError:
            return
        for column, joint in enumerate(ROBOT.joints):
            limits = joint.limits
            assert samples.position[:, column].max() <= limits.position_max + 1e-6
            assert samples.position[:, column].min() >= limits.position_min - 1e-6
            assert np.abs(samples.velocity[:, column]).max() <= limits.velocity + 1e-6
            assert np.abs(samples.acceleration[:, column]).max() <= limits.acceleration + 1e-6


class TestMultipointPlan:
    def test_a_multipoint_plan_is_at_rest_at_every_pose(self) -> None:
        motion = multipoint(points=20)
        samples = motion.plan(ROBOT, T)
        for pose in motion.draw_poses(ROBOT):
            at_pose = (samples.position == pose).all(axis=1)
            assert at_pose.any()
            np.testing.assert_array_equal(samples.velocity[at_pose], 0.0)
        assert (samples.phase == Phase.MAIN).all()
        assert samples.samples_per_period is None
        assert 20.0 < samples.duration_s < 60.0

    def test_a_multipoint_plan_depends_on_the_seed_alone(self) -> None:
        one, same, other = (multipoint(seed=s).plan(ROBOT, T) for s in (4, 4, 5))
        np.testing.assert_array_equal(one.position, same.position)
        assert len(other) != len(one) or (other.position != one.position).any()

    def test_a_multipoint_plan_uses_its_fraction_of_range_and_speed(self) -> None:
        samples = multipoint(range_fraction=0.5, speed_fraction=0.4).plan(ROBOT, T)
        for column, joint in enumerate(ROBOT.joints):
            limits = joint.limits
            middle = (limits.position_min + limits.position_max) / 2.0
            half = (limits.position_max - limits.position_min) / 2.0
            assert np.abs(samples.position[:, column] - middle).max() <= 0.5 * half
            assert np.abs(samples.velocity[:, column]).max() <= 0.4 * limits.velocity
            assert np.abs(samples.acceleration[:, column]).max() <= 0.4 * limits.acceleration

    def test_a_multipoint_plan_is_smooth(self) -> None:
        velocity, acceleration = largest_mismatch(multipoint().plan(ROBOT, T))
        assert velocity < 0.02
        assert acceleration < 0.6  # quintic: the acceleration has corners at the poses


class TestApproach:
    def test_the_approach_is_slow(self) -> None:
        start, end = np.array([0.0, 0.5, -1.0]), np.array([1.0, -1.0, 2.0])
        samples = approach(start, end, ROBOT, T)
        np.testing.assert_array_equal(samples.position[[0, -1]], [start, end])
        np.testing.assert_array_equal(samples.velocity[[0, -1]], 0.0)
        assert (samples.phase == Phase.APPROACH).all()
        speed_use = np.abs(samples.velocity).max(axis=0) / [j.limits.velocity for j in ROBOT.joints]
        assert speed_use.max() <= 0.3

    def test_an_approach_to_the_present_pose_has_two_rows(self) -> None:
        samples = approach(np.zeros(3), np.zeros(3), ROBOT, T)
        assert len(samples) == 2
        np.testing.assert_array_equal(samples.velocity, 0.0)

    def test_an_approach_from_outside_the_limits_is_refused(self) -> None:
        with raises_code(ConfigError, "RID-MOTION-LIMIT", "'axis2'", "1.2"):
            approach(np.array([0.0, 1.2, 0.0]), np.zeros(3), ROBOT, T)


class Rows(TypedDict):
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    phase: PhaseArray


class TestVerifyLimits:
    @staticmethod
    def at_rest(rows: int = 10) -> Rows:
        return {
            "position": np.zeros((rows, 3)),
            "velocity": np.zeros((rows, 3)),
            "acceleration": np.zeros((rows, 3)),
            "phase": np.zeros(rows, dtype=np.uint8),
        }

    def test_a_peak_between_the_samples_is_found(self) -> None:
        rows = self.at_rest()
        rows["position"][:, 1] = 0.9999
        rows["velocity"][4, 1] = 0.4  # overshoots 1.0 between row 4 and row 5
        samples = MotionSamples(ROBOT.joint_names, 0.01, **rows)
        assert samples.position.max() < 1.0
        with raises_code(ConfigError, "RID-MOTION-LIMIT", "'axis2'", "1.00"):
            verify_limits(samples, ROBOT)

    def test_a_position_step_is_treated_as_a_speed(self) -> None:
        rows = self.at_rest()
        rows["position"][5:, 0] = 0.1
        with raises_code(ConfigError, "RID-MOTION-LIMIT", "'axis1'"):
            verify_limits(MotionSamples(ROBOT.joint_names, T, **rows), ROBOT)

    def test_every_row_of_a_long_motion_is_checked(self) -> None:
        rows = self.at_rest(25_000)
        rows["velocity"][[10_000, 24_998], [2, 2]] = [3.1, -3.3]
        upper = ("velocity of joint", "'axis3'", "3.1 rad/s", "80 s", "is 3 rad/s;")
        lower = ("-3.3 rad/s", "200 s", "is -3 rad/s")
        with raises_code(ConfigError, "RID-MOTION-LIMIT", *upper, *lower):
            verify_limits(MotionSamples(ROBOT.joint_names, T, **rows), ROBOT)

    def test_a_motion_of_another_robot_is_refused(self) -> None:
        samples = MotionSamples(("x", "y", "z"), T, **self.at_rest())
        with raises_code(ConfigError, "RID-MOTION-JOINTS"):
            verify_limits(samples, ROBOT)


class TestMotionSamples:
    def test_motion_samples_are_immutable(self) -> None:
        samples = MotionSamples(ROBOT.joint_names, T, **TestVerifyLimits.at_rest())
        assert not samples.position.flags.writeable

    @pytest.mark.parametrize("name", ["position", "velocity", "acceleration"])
    def test_samples_that_are_not_finite_are_refused(
        self, name: Literal["position", "velocity", "acceleration"]
    ) -> None:
        rows = TestVerifyLimits.at_rest()
        rows[name][3, 1] = np.nan
        with raises_code(ConfigError, "RID-API-ARGUMENT", f"motion {name} ", "(3, 1)"):
            MotionSamples(ROBOT.joint_names, T, **rows)

    def test_samples_of_inconsistent_shapes_are_refused(self) -> None:
        rows = TestVerifyLimits.at_rest()
        rows["velocity"] = rows["velocity"][1:]
        with raises_code(ConfigError, "RID-API-ARGUMENT", "velocity", "(10, 3)", "(9, 3)"):
            MotionSamples(ROBOT.joint_names, T, **rows)

    def test_a_wrong_number_of_periods_is_refused(self) -> None:
        rows = TestVerifyLimits.at_rest()
        rows["phase"][:] = Phase.MAIN
        with raises_code(ConfigError, "RID-API-ARGUMENT", "10"):
            MotionSamples(ROBOT.joint_names, T, **rows, samples_per_period=4, periods=2)


@pytest.mark.parametrize(
    "motion", [fourier(period_s=1e9), fourier(periods=10_000), fourier(ramp_s=1e9)]
)
def test_a_periodic_motion_that_is_too_long_is_refused_before_it_fills_the_memory(
    motion: FourierMotion,
) -> None:
    with raises_code(ConfigError, "RID-MOTION-LONG", "14400"):
        motion.plan(load_robot("ir361"), 0.008)


def test_a_multipoint_motion_that_is_too_long_is_refused() -> None:
    with raises_code(ConfigError, "RID-MOTION-LONG", "14400"):
        multipoint(speed_fraction=1e-9).plan(ROBOT, T)
