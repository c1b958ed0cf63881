"""From a simulated robot on its plate to the combined model, with servo loops, stiction and charge
signals.

Pinocchio simulates the plant. The plate has eight charge channels with crosstalk, drift, a jump of
the zero, noise, a low-pass and a separate clock. Both are independent of the estimators.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.journal.mcap_reader import JournalDamage
from acquisition.journal.plate import EVENT_DTYPE, ROW_DTYPE, PlateHeader, PlateRows
from acquisition.motion.kinds.multipoint import MultipointMotion
from acquisition.motion.samples import MotionSamples
from acquisition.processing.periods import average_periods
from acquisition.processing.plate_alignment import with_plate
from acquisition.recording.recording import Recording
from acquisition.signals.clocks import DeviceClock
from benchmarks.closed_loop import plant_at
from config.cell.amplifier_profile import AmplifierProfile
from config.load import LoadedCell, load_bundled_or_path
from dynamics.model.true_parameters import true_parameters
from identification.accuracy.plate_benefit import improvement
from identification.calibration.torque_scale import torque_consistency
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_periods import FittedPeriods, fit_periodic
from identification.estimation.options import EstimationOptions
from identification.model.options import ModelOptions
from identification.validation.base_wrench_validation import validate_base_wrench
from mock_hw.amplifier.analog import AmplifierSettings, ChargeAmplifier
from mock_hw.amplifier.sensors import PlateSensors

pytestmark = pytest.mark.slow

CYCLE_S = 0.008
SETTLE = 250
START_S = 50.0
PROFILE = load_bundled_or_path("kistler_style", "profiles", AmplifierProfile)


@dataclass
class RobotOnPlate:
    """Simulation of the arm on its plate, one cycle after another."""

    cell: LoadedCell
    unmodelled: bool = False

    def run(self, samples: MotionSamples, seed: int, torque_scale: Any = 1.0) -> Recording:
        """Return the measurements of drives and plate along a motion."""
        plan, cell = self.cell.plant, self.cell.config
        assert plan is not None
        assert plan.plate is not None
        assert cell.plate is not None
        truth = plan if self.unmodelled else plan.without_unmodelled()
        plant = plant_at(self.cell, truth, samples.position[0], seed)
        plant.watch_base(True)
        sensors = PlateSensors(cell.plate, plan.plate)
        amplifier = ChargeAmplifier(plan.plate, seed)
        setup = cell.plate.amplifier
        amplifier.apply(
            AmplifierSettings(
                range_n=setup.range_n,
                sensitivity_pc_n=setup.sensitivity_pc_n,
                low_pass_hz=setup.low_pass_hz,
                low_pass_order=setup.low_pass_order,
                rate_hz=setup.rate_hz,
                bits=setup.bits,
            )
        )
        amplifier.operate(sensors.charges_pc(plant.base_wrench[np.newaxis])[0])
        amplifier.start()
        counts_per_rad = np.array(
            [
                axis.encoder_increments_per_motor_rev * joint.gear_ratio / (2.0 * np.pi)
                for axis, joint in zip(truth.axes, self.cell.robot.joints, strict=True)
            ]
        )
        n = len(self.cell.robot.joints)
        on, off = np.ones(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_)
        old, new = np.zeros(n), np.zeros(n)
        position, tau = np.zeros(samples.position.shape), np.zeros(samples.position.shape)
        wrenches: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []
        for row in range(-SETTLE, len(samples) + 50):
            at = min(max(row, 0), len(samples) - 1)
            measured = plant.position_counts() / counts_per_rad
            if 0 <= row < len(samples):
                position[row], tau[row] = measured, plant.measured_torque()
            forward = samples.velocity[at] if at == row else np.zeros(n)
            wanted = samples.position[at]
            old, new = new, cell.position_gain_per_s * (wanted - measured) + forward
            plant.advance(CYCLE_S, old, new, on, off)
            wrenches.append(plant.take_base_wrenches())
        ends = np.concatenate([end for end, _ in wrenches])
        charges = sensors.charges_pc(np.vstack([wrench for _, wrench in wrenches]))
        made = amplifier.convert(float(ends[-1]), ends, charges)
        random = np.random.default_rng(seed)
        rows = np.zeros(len(made.time_s), dtype=ROW_DTYPE)
        late = 28 * 10 / setup.baud_rate + random.uniform(0.0, 0.005, len(rows))
        rows["arrival_s"] = START_S + np.maximum.accumulate(made.time_s + late)
        rows["device_s"], rows["counts"] = np.round(made.device_s, 6), made.counts
        rows["sequence"] = np.arange(len(rows))
        rows["status"] = made.overload.astype(np.uint16) | 1 << PROFILE.status_bits.operate
        plain = Recording(
            joint_names=samples.joint_names,
            time_s=START_S + (SETTLE + np.arange(len(samples), dtype=np.float64)) * CYCLE_S,
            position=position,
            torque_nm=tau * torque_scale,
            valid=np.ones(len(samples), dtype=np.bool_),
            phase=samples.phase,
            sample_index=np.arange(len(samples)),
            source="cell",
            sample_period_s=CYCLE_S,
            samples_per_period=samples.samples_per_period,
            torque_filter=cell.torque_filter,
        )
        header = PlateHeader(plate=cell.plate, profile=PROFILE)
        events = np.zeros(0, dtype=EVENT_DTYPE)
        return with_plate(plain, PlateRows(header, rows, events, JournalDamage(True, (), 0)))


def combined(robot: RobotOnPlate, recording: Recording) -> FittedPeriods:
    return fit_periodic(
        robot.cell.robot,
        [average_periods(recording)],
        EstimationOptions(model=ModelOptions(kind="combined")),
    )


@pytest.fixture(scope="module")
def robot(cell: LoadedCell) -> RobotOnPlate:
    return RobotOnPlate(cell)


@pytest.fixture(scope="module")
def samples(cell: LoadedCell) -> MotionSamples:
    motion = design_two_harmonic(
        cell.robot,
        TwoHarmonicOptions(5.0, highest_harmonic=6, tries=50, seed=3, periods=16),
        CYCLE_S,
    )
    return motion.plan(cell.robot, CYCLE_S).whole()


@pytest.fixture(scope="module")
def fits(robot: RobotOnPlate, samples: MotionSamples) -> list[FittedPeriods]:
    return [combined(robot, robot.run(samples, seed)) for seed in range(3)]


def truth_of(estimate: Estimate, cell: LoadedCell) -> NDArray[np.float64]:
    assert cell.plant is not None
    standard = true_parameters(estimate.model, cell.robot, cell.plant)
    return estimate.base.from_standard(standard)


def test_the_truth_is_within_two_sigma(cell: LoadedCell, fits: list[FittedPeriods]) -> None:
    inside = []
    for fit in fits:
        estimate = fit.estimate()
        assert sum(estimate.base.rigid_body) == 20
        inside.append(np.abs(estimate.values - truth_of(estimate, cell)) < 2.0 * estimate.sigma)
    assert np.mean(inside) >= 0.9


def test_the_plate_fits_within_its_noise(fits: list[FittedPeriods]) -> None:
    for fit in fits:
        plate = fit.estimate().plate
        assert plate is not None
        assert (plate.residual < 1.3 * plate.noise).all()
        assert np.abs(plate.delay_s).max() < 100e-6
        # The plant's drifts in newtons: -0.306 pC/s over -7.5 pC/N and so on.
        assert plate.drift_n_s[0, 0] == pytest.approx(0.0408, abs=0.002)
        assert plate.drift_n_s[0, 4] == pytest.approx(-0.0497, abs=0.002)


def test_the_plate_clock_is_estimated(robot: RobotOnPlate, samples: MotionSamples) -> None:
    """The clock is 100 ppm fast and 3 ms ahead.

    The time of every row of the run is right within 50 us.
    """
    clock = fits_clock(robot.run(samples, 5))
    device = np.linspace(3.0, 90.0, 30)
    true = START_S + (device - 0.003) / (1.0 + 1e-4)
    assert np.abs(clock.to_sync(device) - true).max() < 50e-6


def fits_clock(recording: Recording) -> DeviceClock:
    assert recording.reaction is not None
    assert recording.reaction.clock is not None
    return recording.reaction.clock


def test_every_parameter_is_more_certain_and_the_determinant_much_smaller(
    fits: list[FittedPeriods],
) -> None:
    found = improvement(fits[0])
    assert found.determinant_ratio >= 3.0
    for parameter in found.parameters:
        for alone in (parameter.sigma_internal, parameter.sigma_external):
            assert alone is None or parameter.sigma_combined <= alone * (1.0 + 1e-9)


def test_torque_constants_agree_unless_one_is_5_percent_wrong(
    robot: RobotOnPlate, samples: MotionSamples, fits: list[FittedPeriods]
) -> None:
    for fit in fits:
        assert not any(axis.wrong for axis in torque_consistency(fit).axes)
    wrong = combined(robot, robot.run(samples, 1, torque_scale=np.array([1.0, 0.95, 1.0])))
    axes = torque_consistency(wrong).axes
    assert [axis.wrong for axis in axes] == [False, True, False]
    assert axes[1].ratio == pytest.approx(0.95, abs=0.005)


def test_unmodelled_effects_blame_no_torque_constant(
    cell: LoadedCell, samples: MotionSamples
) -> None:
    """Load-dependent friction of 1 % resembles a torque scale, but is too small to be reported."""
    real = RobotOnPlate(cell, unmodelled=True)
    scale = np.array([1.0, 1.0, 1.05])
    for factor, wrong in ((np.ones(3), []), (scale, ["axis3"])):
        axes = torque_consistency(combined(real, real.run(samples, 0, factor))).axes
        assert [axis.joint for axis in axes if axis.wrong] == wrong


def test_the_reaction_of_another_motion_is_predicted_within_the_noise_floor(
    cell: LoadedCell, robot: RobotOnPlate, fits: list[FittedPeriods]
) -> None:
    motion = MultipointMotion(kind="multipoint", robot="ir361", points=8, seed=3)
    recording = robot.run(motion.plan(cell.robot, CYCLE_S), 99)
    estimate = fits[0].estimate()
    found = validate_base_wrench(estimate, recording)
    floor = validate_base_wrench(replace(estimate, values=truth_of(estimate, cell)), recording)
    assert (found.rms <= 1.3 * floor.rms).all()
    assert found.noise is not None
    assert (found.rms <= 1.3 * found.noise).all()


def test_the_external_model_identifies_the_robot_too(
    cell: LoadedCell, robot: RobotOnPlate, samples: MotionSamples
) -> None:
    average = average_periods(robot.run(samples, 0))
    estimate = fit_periodic(
        cell.robot, [average], EstimationOptions(model=ModelOptions(kind="external"))
    ).estimate()
    inside = np.abs(estimate.values - truth_of(estimate, cell)) < 2.0 * estimate.sigma
    assert inside.mean() >= 0.9
