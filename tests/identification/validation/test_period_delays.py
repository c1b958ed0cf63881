"""True torque delays of a periodic recording are found on a plant with different friction.

Pinocchio simulates the plant in closed loop. Its joints stick at reversals, or have a presliding
law that differs from the model's.
"""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.motion.samples import Phase
from acquisition.processing.periods import average_periods
from acquisition.processing.torque_channel import TorqueChannel
from acquisition.recording.recording import Recording
from benchmarks.closed_loop import closed_loop
from config.load import LoadedCell
from config.robot.friction_terms import FrictionTerm
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel, torque
from identification.equations.bins import with_free_reversals
from identification.equations.bus_delay import split_implausible_channel
from identification.estimation.fitted_periods import fit_periodic
from identification.validation.period_delays import choose_period_delays
from identification.validation.robot_terms import with_presliding
from tests.builders.late_torque import FOUND_M, MOTION, late, robot_of
from tests.identification.conftest import CYCLE_S


@pytest.fixture(scope="module")
def sticking(cell: LoadedCell) -> Recording:
    """Simulate joints that stick at reversals, and otherwise obey the model."""
    assert cell.plant is not None
    samples = MOTION.plan(cell.robot, CYCLE_S)
    return closed_loop(cell, cell.plant.without_unmodelled(), samples, 200)


@pytest.fixture(scope="module")
def unmodelled(cell: LoadedCell) -> Recording:
    """Simulate joints with presliding, more friction at low speed, cogging and warming."""
    assert cell.plant is not None
    return closed_loop(cell, cell.plant, MOTION.plan(cell.robot, CYCLE_S), 200)


@pytest.mark.parametrize(
    "delay_ms", [(4.0, 2.0, -3.0), (0.5, 4.0, 2.0), (-3.0, 0.5, 4.0), (2.0, -3.0, 0.5)]
)
def test_delays_of_a_fraction_of_a_sample_are_recovered(
    cell: LoadedCell, sticking: Recording, delay_ms: tuple[float, ...]
) -> None:
    channel = choose_period_delays(robot_of(cell), [average_periods(late(sticking, delay_ms))])
    error_ms = 1e3 * channel.delay_s - delay_ms
    assert np.all(channel.delay_s != 0.0)
    assert np.all(np.abs(error_ms) < 2e3 * channel.delay_sigma_s)
    assert np.all(channel.delay_sigma_s < 0.00015)
    assert not channel.filters


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_an_undelayed_recording_has_no_delay(cell: LoadedCell, seed: int) -> None:
    assert cell.plant is not None
    samples = MOTION.plan(cell.robot, CYCLE_S)
    recording = closed_loop(cell, cell.plant.without_unmodelled(), samples, seed)
    assert not choose_period_delays(robot_of(cell), [average_periods(recording)]).changes


@pytest.mark.parametrize("distances", [(None,) * 3, FOUND_M])
def test_delays_are_recovered_with_a_wrong_friction_law(
    cell: LoadedCell, unmodelled: Recording, distances: tuple[float | None, ...]
) -> None:
    robot, true_ms = with_presliding(robot_of(cell), distances), (4.0, 2.0, -3.0)
    channel = choose_period_delays(robot, [average_periods(late(unmodelled, true_ms))])
    error_ms = 1e3 * channel.delay_s - true_ms
    assert np.all(channel.delay_s != 0.0)
    assert np.all(np.abs(error_ms) < 2e3 * channel.delay_sigma_s)
    assert np.all(channel.delay_sigma_s < 0.0007)
    assert not choose_period_delays(robot, [average_periods(unmodelled)]).changes


@pytest.mark.parametrize("terms", [(), ("coulomb",), ("viscous",)])
def test_the_residual_of_wrong_friction_is_not_a_delay(
    cell: LoadedCell, unmodelled: Recording, terms: tuple[FrictionTerm, ...]
) -> None:
    assert not choose_period_delays(robot_of(cell, terms), [average_periods(unmodelled)]).changes


def test_a_delay_beyond_a_quarter_of_the_shortest_period_is_a_bound(
    cell: LoadedCell, sticking: Recording
) -> None:
    """The band ends at 10 Hz; 96 and -40 ms exceed a quarter of that period of 100 ms."""
    average = average_periods(late(sticking, (96.0, -40.0, 4.0)))
    channel = choose_period_delays(robot_of(cell), [average])
    assert np.all(channel.delay_sigma_s[:2] == np.abs(channel.delay_s[:2]))
    _, refused = split_implausible_channel(channel, CYCLE_S)
    assert any(refused.is_bound[:2])


def oscillating_axis(robot: RobotDescription, delay_s: float) -> Recording:
    """Return periods of one axis that oscillates at one frequency; its torque is `delay_s` late."""
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
def test_no_delay_is_found_if_the_motion_cannot_distinguish_it_from_friction(
    cell: LoadedCell, delay_s: float
) -> None:
    """At one frequency, the delayed torque of an inertia equals that of viscous friction."""
    robot = robot_of(cell)
    kinematics = robot.kinematics.model_copy(update={"rows": robot.kinematics.rows[:1]})
    one = {"joints": robot.joints[:1], "spring": None, "kinematics": kinematics}
    robot = robot.model_copy(update=one)
    average = average_periods(oscillating_axis(robot, delay_s))
    assert not choose_period_delays(robot, [average]).changes


def test_the_corrected_period_gives_the_estimate_of_the_undelayed_one(
    cell: LoadedCell, sticking: Recording
) -> None:
    by_ms = (4.0, 0.0, -3.0)
    channel = TorqueChannel.of_delays(1e-3 * np.array(by_ms), np.zeros(3))
    delayed = average_periods(late(sticking, by_ms))
    in_time = channel.undelayed_period(delayed)
    whole = average_periods(sticking)
    np.testing.assert_allclose(in_time.torque_nm, whole.torque_nm, atol=0.5)
    right = fit_periodic(robot_of(cell), [whole]).estimate()
    made, wrong = (fit_periodic(robot_of(cell), [a]).estimate() for a in (in_time, delayed))
    np.testing.assert_array_less(np.abs(made.values - right.values), 0.1 * right.sigma)
    assert np.any(np.abs(wrong.values - right.values) > 5.0 * right.sigma)


def test_torque_at_reversals_is_free_over_the_presliding_distance(
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
    # Time for twice the longest distance at the speed of a reversal
    assert np.all(shares[2] < 0.2)
