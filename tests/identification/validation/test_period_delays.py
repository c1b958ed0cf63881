"""Delays of a periodic recording's torque: found where they are, on a plant with its own friction.

The plant is Pinocchio's, in closed loop; its joints stick at reversals, or give way before they
slide by another law than the model's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.motion.samples import Phase
from acquisition.processing.periods import PeriodAverage, average_periods
from acquisition.recording.recording import Recording
from benchmarks.closed_loop import closed_loop
from config.load import LoadedCell
from config.robot.friction_terms import FrictionTerm
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel, torque
from identification.equations.bins import with_free_reversals
from identification.equations.torque_channel import TorqueChannel
from identification.estimation.estimators import estimate_periodic
from identification.estimation.fitted_periods import fit_periodic
from identification.validation.friction_trials import with_friction
from identification.validation.period_delays import choose_period_delays
from identification.validation.presliding_choice import with_presliding
from tests.identification.conftest import CYCLE_S

CLASSICAL: tuple[FrictionTerm, ...] = ("coulomb", "viscous")
FOUND_M = (2.8e-4, 2.8e-4, 3.4e-4)
"""Presliding distances by which the model comes closest to what the plant's joints give way."""
MOTION = FourierMotion(
    kind="fourier",
    robot="ir361",
    period_s=10.0,
    periods=8,
    ramp_s=4.0,
    joints=(
        FourierJoint(
            joint="axis1",
            offset=0.5,
            sine=(-0.62, 0.65, 0.19, -0.22, 0.39),
            cosine=(0.56, 0.24, -0.41, -0.59, -0.07),
        ),
        FourierJoint(
            joint="axis2",
            offset=-0.2,
            sine=(-0.58, 0.17, 0.09, -0.32, -0.23),
            cosine=(-0.16, -0.28, 0.19, -0.03, 0.49),
        ),
        FourierJoint(
            joint="axis3",
            offset=0.54,
            sine=(-0.74, -0.04, 0.18, -0.5, -0.41),
            cosine=(-0.35, 0.07, -0.76, 0.28, -0.1),
        ),
    ),
)
"""Five harmonics, as `rid-daq design` finds them."""


def robot_of(cell: LoadedCell, terms: tuple[FrictionTerm, ...] = CLASSICAL) -> RobotDescription:
    return with_friction(cell.robot, [terms] * 3)


def late(recording: Recording, delay_ms: Sequence[float]) -> PeriodAverage:
    """Return the mean period of a recording whose torque came later than it was."""
    torque = [
        CubicSpline(recording.time_s, column)(recording.time_s - 1e-3 * by)
        for column, by in zip(recording.torque_nm.T, delay_ms, strict=True)
    ]
    return average_periods(replace(recording, torque_nm=np.transpose(torque)))


@pytest.fixture(scope="module")
def sticking(cell: LoadedCell) -> Recording:
    """Drive joints that stick at reversals, and otherwise obey the model."""
    assert cell.plant is not None
    samples = MOTION.plan(cell.robot, CYCLE_S)
    return closed_loop(cell, cell.plant.without_unmodelled(), samples, 200)


@pytest.fixture(scope="module")
def unmodelled(cell: LoadedCell) -> Recording:
    """Drive joints that give way, hold more at low speed, cog and warm up."""
    assert cell.plant is not None
    return closed_loop(cell, cell.plant, MOTION.plan(cell.robot, CYCLE_S), 200)


@pytest.mark.parametrize(
    "delay_ms", [(4.0, 2.0, -3.0), (0.5, 4.0, 2.0), (-3.0, 0.5, 4.0), (2.0, -3.0, 0.5)]
)
def test_delays_of_parts_of_a_sample_come_back(
    cell: LoadedCell, sticking: Recording, delay_ms: tuple[float, ...]
) -> None:
    channel = choose_period_delays(robot_of(cell), [late(sticking, delay_ms)])
    error_ms = 1e3 * channel.delay_s - delay_ms
    assert np.all(channel.delay_s != 0.0)
    assert np.all(np.abs(error_ms) < 2e3 * channel.delay_sigma_s)
    assert np.all(channel.delay_sigma_s < 0.00015)
    assert channel.bandwidth_hz is None


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_recording_in_time_has_none(cell: LoadedCell, seed: int) -> None:
    assert cell.plant is not None
    samples = MOTION.plan(cell.robot, CYCLE_S)
    recording = closed_loop(cell, cell.plant.without_unmodelled(), samples, seed)
    assert not choose_period_delays(robot_of(cell), [average_periods(recording)]).changes


@pytest.mark.parametrize("distances", [(None,) * 3, FOUND_M])
def test_delays_come_back_from_joints_with_another_law(
    cell: LoadedCell, unmodelled: Recording, distances: tuple[float | None, ...]
) -> None:
    robot, true_ms = with_presliding(robot_of(cell), distances), (4.0, 2.0, -3.0)
    channel = choose_period_delays(robot, [late(unmodelled, true_ms)])
    error_ms = 1e3 * channel.delay_s - true_ms
    assert np.all(channel.delay_s != 0.0)
    assert np.all(np.abs(error_ms) < 2e3 * channel.delay_sigma_s)
    assert np.all(channel.delay_sigma_s < 0.0007)
    assert not choose_period_delays(robot, [average_periods(unmodelled)]).changes


@pytest.mark.parametrize("terms", [(), ("coulomb",), ("viscous",)])
def test_what_wrong_friction_leaves_is_no_delay(
    cell: LoadedCell, unmodelled: Recording, terms: tuple[FrictionTerm, ...]
) -> None:
    assert not choose_period_delays(robot_of(cell, terms), [average_periods(unmodelled)]).changes


def test_longer_than_a_quarter_of_the_shortest_period_is_no_delay(
    cell: LoadedCell, sticking: Recording
) -> None:
    """The band ends at 10 Hz; 96 ms are a whole period of it."""
    channel = choose_period_delays(robot_of(cell), [late(sticking, (96.0, -40.0, 4.0))])
    assert np.all(channel.delay_s[:2] == 0.0)


def swinging(robot: RobotDescription, delay_s: float) -> Recording:
    """Return periods of one axis that swings at one frequency, friction and inertia known."""
    model = RobotModel.from_description(robot)
    true = {"Izz1": 8.0, "fc_axis1": 20.0, "fv_axis1": 25.0}
    values = np.array([true.get(name, 0.0) for name in model.parameter_names])
    rows, periods, omega = 500, 6, 2.0 * np.pi / (500 * CYCLE_S)
    phase = omega * CYCLE_S * np.arange(rows)[:, np.newaxis]
    then = phase - omega * delay_s
    q, v = 0.8 * np.sin(then), 0.8 * omega * np.cos(then)
    tau = np.tile(torque(model, q, v, -(omega**2) * q, values), (periods, 1))
    return Recording(
        joint_names=robot.joint_names,
        time_s=CYCLE_S * np.arange(len(tau), dtype=np.float64),
        position=np.round(np.tile(0.8 * np.sin(phase), (periods, 1)) / 3e-6) * 3e-6,
        torque_nm=tau + np.random.default_rng(0).normal(0.0, 1.0, tau.shape),
        valid=np.ones(len(tau), dtype=np.bool_),
        phase=np.full(len(tau), Phase.MAIN, dtype=np.uint8),
        sample_index=np.arange(len(tau)),
        source="cell",
        sample_period_s=CYCLE_S,
        samples_per_period=rows,
    )


@pytest.mark.parametrize("delay_s", [0.0, 0.004])
def test_a_motion_that_does_not_tell_delay_from_friction_shows_none(
    cell: LoadedCell, delay_s: float
) -> None:
    """At one frequency the torque of an inertia that is late is the torque of viscous friction."""
    robot = robot_of(cell)
    kinematics = robot.kinematics.model_copy(update={"rows": robot.kinematics.rows[:1]})
    one = {"joints": robot.joints[:1], "spring": None, "kinematics": kinematics}
    robot = robot.model_copy(update=one)
    average = average_periods(swinging(robot, delay_s))
    assert not choose_period_delays(robot, [average]).changes


def test_a_period_in_time_gives_the_estimate_of_one_that_never_was_late(
    cell: LoadedCell, sticking: Recording
) -> None:
    by_ms = (4.0, 0.0, -3.0)
    channel = TorqueChannel(1e-3 * np.array(by_ms), np.zeros(3))
    in_time = channel.undelayed_period(late(sticking, by_ms))
    whole = average_periods(sticking)
    np.testing.assert_allclose(in_time.torque_nm, whole.torque_nm, atol=0.5)
    right = estimate_periodic(robot_of(cell), [whole])
    made, wrong = (estimate_periodic(robot_of(cell), [a]) for a in (in_time, late(sticking, by_ms)))
    np.testing.assert_array_less(np.abs(made.values - right.values), 0.1 * right.sigma)
    assert np.any(np.abs(wrong.values - right.values) > 5.0 * right.sigma)


def test_reversals_are_free_until_nothing_of_them_is_left(
    cell: LoadedCell, sticking: Recording
) -> None:
    average = average_periods(sticking)
    shares = []
    for distance in (None, 1e-3, 1e-2):
        fitted = fit_periodic(with_presliding(robot_of(cell), [distance] * 3), [average])
        model = fitted.model
        if distance is not None:
            model = model.with_nonlinear(np.full(3, distance))
        free = with_free_reversals(fitted.equations[0], model, average, 0.02)
        shares.append(free.left_out_fraction)
        if distance is None:
            np.testing.assert_array_equal(shares[0], fitted.equations[0].left_out_fraction)
    assert np.all(np.diff(shares, axis=0) > 0.0)
    # The longest distance twice, at the speed with which joints turn round
    assert np.all(shares[2] < 0.2)
