from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.processing.periods import PeriodAverage, average_periods
from acquisition.recording.recording import Recording
from config.cell.torque_filter import ButterworthFilter
from config.errors import EstimationError
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import Joint, JointLimits, RobotDescription
from dynamics.model.robot_model import RobotModel
from identification.equations.bins import BinEquations, bin_equations
from identification.model.base_parameters import base_parameters
from tests.builders.raised_codes import raises_code

PERIOD_S, SAMPLES = 2.0, 250


def one_joint_average(
    position: NDArray[np.float64], torque_filter: ButterworthFilter | None = None
) -> PeriodAverage:
    zero = np.zeros((SAMPLES // 2 + 1, 1))
    return PeriodAverage(
        joint_names=("j",),
        sample_period_s=PERIOD_S / SAMPLES,
        position=position[:, np.newaxis],
        torque_nm=np.zeros((SAMPLES, 1)),
        position_variance=np.zeros(1),
        torque_variance=np.zeros(1),
        position_bin_variance=zero,
        torque_bin_variance=zero + 1e-4,
        periods_kept=4,
        torque_filter=torque_filter,
    )


@pytest.fixture(scope="module")
def pendulum() -> RobotModel:
    limits = JointLimits(
        position_min=-3.0, position_max=3.0, velocity=9.0, acceleration=99.0, torque=9.0
    )
    robot = RobotDescription(
        name="pendulum",
        kinematics=Kinematics(convention="modified_dh", rows=(KinematicRow(),)),
        joints=(Joint(name="j", limits=limits),),
    )
    return RobotModel.from_description(robot)


def test_a_slow_joint_counts_as_moving_below_the_usual_standstill_speed(
    pendulum: RobotModel,
) -> None:
    lift = replace(pendulum, speed_limits=(0.013,))
    slow = one_joint_average(0.004 * sine(0.4))  # at most 0.0126 rad/s
    assert equations_of(pendulum, slow, 0.02).left_out_fraction == pytest.approx([1.0])
    assert equations_of(lift, slow, 0.02).left_out_fraction[0] < 0.1
    still = one_joint_average(0.0002 * sine(0.4))
    assert equations_of(lift, still, 0.02).left_out_fraction == pytest.approx([1.0])


def equations_of(
    model: RobotModel, average: PeriodAverage, standstill_rad_s: float = 0.0
) -> BinEquations:
    return bin_equations(
        model, base_parameters(model), average, band_hz=10.0, standstill_rad_s=standstill_rad_s
    )


def sine(phase: float) -> NDArray[np.float64]:
    """Return one period of a sine whose first sample has this phase (rad)."""
    return np.sin(2.0 * np.pi * np.arange(SAMPLES) / SAMPLES + phase)


@pytest.mark.parametrize("phase", [0.0, 0.4, 1.2345])
def test_coulomb_friction_has_the_harmonics_of_a_square_wave_at_any_phase(
    pendulum: RobotModel, phase: float
) -> None:
    equations = equations_of(pendulum, one_joint_average(sine(phase)))
    coulomb = equations.matrix[0][:, base_parameters(pendulum).names.index("fc_j")]
    k = np.arange(1, equations.harmonics + 1)
    # sign(cos(x)) = 4 / pi (cos x - cos 3x / 3 + cos 5x / 5 ...), x = wt + phase.
    amplitude = np.where(k % 2 == 1, 4.0 / (np.pi * k) * np.sin(np.pi * k / 2.0), 0.0)
    root = np.sqrt(2.0)
    expected = np.concatenate(
        [
            [0.0],
            root * amplitude / 2.0 * np.cos(k * phase),
            root * amplitude / 2.0 * np.sin(k * phase),
        ]
    )
    np.testing.assert_allclose(coulomb, expected, atol=2e-3)


def test_rows_preserve_the_mean_square_over_time(pendulum: RobotModel) -> None:
    equations = equations_of(pendulum, one_joint_average(sine(0.3)))
    viscous = equations.matrix[0][:, base_parameters(pendulum).names.index("fv_j")]
    omega = 2.0 * np.pi / PERIOD_S
    assert np.sum(viscous**2) == pytest.approx(omega**2 / 2.0)
    rows = np.zeros((1, 2 * equations.harmonics + 1))
    rows[0] = viscous
    np.testing.assert_allclose(
        equations.to_time(rows, SAMPLES)[:, 0],
        omega * np.cos(2.0 * np.pi * np.arange(SAMPLES) / SAMPLES + 0.3),
        atol=1e-9,
    )


def test_the_band_ends_below_nyquist_and_the_filter_cut_off(pendulum: RobotModel) -> None:
    plain, filtered = (
        one_joint_average(sine(0.0), torque_filter)
        for torque_filter in (None, ButterworthFilter(order=2, cutoff_hz=7.0))
    )
    base = base_parameters(pendulum)

    def harmonics(average: PeriodAverage, band_hz: float) -> int:
        return bin_equations(
            pendulum, base, average, band_hz=band_hz, standstill_rad_s=0.0
        ).harmonics

    assert harmonics(plain, 10.0) == 20
    assert harmonics(filtered, 10.0) == 14
    assert harmonics(plain, 1000.0) == 100  # 0.8 of half the 125 Hz sampling rate
    with raises_code(EstimationError, "RID-MOTION-BAND"):
        harmonics(plain, 0.1)


def test_torque_near_standstill_is_free_and_the_time_counted(pendulum: RobotModel) -> None:
    average = one_joint_average(sine(0.7))
    assert equations_of(pendulum, average).free[0].shape[1] == 0
    # |v| = pi |cos| is under 0.1 rad/s for 2 asin(0.1 / pi) / pi of the time.
    equations = equations_of(pendulum, average, standstill_rad_s=0.1)
    share = 2.0 * np.arcsin(0.1 / np.pi) / np.pi
    assert equations.left_out_fraction[0] == pytest.approx(share, abs=0.003)
    assert (
        equations.free[0].shape[1] >= 4
    )  # two passages through standstill, at least two free parts each
    # The constant column sums up to the free time.
    assert equations.free[0][0].sum() == pytest.approx(share, abs=0.003)


def test_a_joint_at_rest_is_excluded(pendulum: RobotModel) -> None:
    equations = equations_of(
        pendulum, one_joint_average(np.full(SAMPLES, 0.3)), standstill_rad_s=0.02
    )
    assert equations.left_out_fraction[0] == 1.0
    assert np.linalg.matrix_rank(equations.free[0]) == 2 * equations.harmonics + 1


def test_another_robot_s_recording_is_refused(
    pendulum: RobotModel, measure: Callable[..., Recording]
) -> None:
    with raises_code(EstimationError, "RID-ROBOT-OTHER", "axis1", "axis2", "axis3"):
        equations_of(pendulum, average_periods(measure()))
