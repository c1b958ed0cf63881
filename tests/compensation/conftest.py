"""The bundled arm in closed loop: its plant, and the position loop one cycle behind."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.motion_samples import MotionSamples, plan_motion
from acquisition.periods import average_periods
from acquisition.recording import Recording
from compensation.frequency_response import frequency_responses
from compensation.velocity_loop import VelocityLoop, fit_velocity_loop
from config.load import LoadedCell, load_cell
from config.motion import MultisineMotion
from identification.estimate import Estimate
from identification.estimators import estimate_periodic
from identification.experiment_design import design_two_harmonic
from mock_hw.plant import Plant

Drive = Callable[..., Recording]
SETTLE_ROWS = 60


@pytest.fixture(scope="session")
def cell() -> LoadedCell:
    return load_cell("ir361")


@pytest.fixture(scope="session")
def drive(cell: LoadedCell) -> Drive:
    """Drive samples through plant and position loop; speeds sent act from the next SYNC on."""

    def through(
        samples: MotionSamples,
        seed: int = 0,
        *,
        feedforward: NDArray[np.float64] | None = None,
        unmodelled: bool = True,
    ) -> Recording:
        assert cell.plant is not None
        truth = cell.plant if unmodelled else cell.plant.without_unmodelled()
        start = samples.position[0]
        axes = tuple(
            axis.model_copy(update={"initial_position": float(at)})
            for axis, at in zip(truth.axes, start, strict=True)
        )
        truth = truth.model_copy(update={"axes": axes})
        plant = Plant(cell.robot, truth, cell.config.torque_filter, seed)
        counts_per_rad = np.array(
            [
                axis.encoder_increments_per_motor_rev * joint.gear_ratio / (2.0 * np.pi)
                for axis, joint in zip(truth.axes, cell.robot.joints, strict=True)
            ]
        )
        n = len(start)
        powered, free = np.ones(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_)
        ahead = samples.velocity if feedforward is None else feedforward
        position, torque, command = np.zeros((3, len(samples), n))
        before = now = sent = np.zeros(n)
        for row in range(-SETTLE_ROWS, len(samples)):
            measured = plant.position_counts() / counts_per_rad
            wanted = samples.position[max(row, 0)]
            speed = cell.config.position_gain_per_s * (wanted - measured)
            if row >= 0:
                position[row], torque[row] = measured, plant.measured_torque()
                speed = speed + ahead[row]
                command[row] = speed
            before, now, sent = now, sent, speed
            plant.advance(samples.sample_period_s, before, now, powered, free)
        return Recording(
            joint_names=samples.joint_names,
            time_s=np.arange(len(samples)) * samples.sample_period_s,
            position=position,
            torque_nm=torque,
            valid=np.ones(len(samples), dtype=np.bool_),
            phase=samples.phase,
            sample_index=np.arange(len(samples)),
            source="cell",
            target_position=samples.position,
            velocity_command=command,
            sample_period_s=samples.sample_period_s,
            samples_per_period=samples.samples_per_period,
            torque_filter=cell.config.torque_filter,
        )

    return through


@pytest.fixture(scope="session")
def loops(cell: LoadedCell, drive: Drive) -> list[VelocityLoop]:
    joints = tuple(
        {"joint": name, "velocity": 0.03, "slow_amplitude": 0.1} for name in cell.robot.joint_names
    )
    motion = MultisineMotion.model_validate(
        {
            "kind": "multisine",
            "robot": "ir361",
            "period_s": 4.0,
            "lowest_hz": 0.75,
            "highest_hz": 20.0,
            "realisations": 2,
            "joints": joints,
        }
    )
    samples = plan_motion(motion, cell.robot, cell.config.cycle_time_s)
    recording = drive(samples, 1)
    return [fit_velocity_loop(r) for r in frequency_responses(recording, motion, cell.robot)]


@pytest.fixture(scope="session")
def model(cell: LoadedCell, drive: Drive) -> Estimate:
    motion = design_two_harmonic(cell.robot, 10.0, cell.config.cycle_time_s, tries=100, periods=8)
    samples = plan_motion(motion, cell.robot, cell.config.cycle_time_s)
    return estimate_periodic(cell.robot, [average_periods(drive(samples, 2))])
