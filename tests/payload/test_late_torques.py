"""Payload identification with a model that contains the delay and filter of the torques."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from acquisition.processing.torque_channel import TorqueChannel
from acquisition.recording.recording import Recording
from acquisition.runs.folder import RunFolder
from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from identification.estimation.estimate import Estimate
from identification.estimation.options import EstimationOptions
from identification.model.options import ModelOptions
from identification.payload.procedures import PayloadOptions, identify_payload
from rid_daq.operations.estimation.run_estimation import EstimationJob, estimate_runs
from rid_daq.operations.payload.payload_estimate import PayloadRequest, payload_runs
from rid_daq.runs.run_data import RunData

LATE_S = np.array([0.004, 0.006, 0.005, 0.004, -0.003, 0.0])
LATE = TorqueChannel.of_delays(LATE_S, np.full(6, 1e-4))
NARROW = replace(TorqueChannel.none(6), width_s=np.full(6, 0.1))
OPTIONS = ModelOptions(rotors=False)


def delay_torques(torque_nm: FloatArray, step_s: float) -> FloatArray:
    """Return periodic torques delayed by fractions of a sample."""
    turn = np.exp(-2j * np.pi * np.outer(np.fft.rfftfreq(len(torque_nm), step_s), LATE_S))
    return np.fft.irfft(np.fft.rfft(torque_nm, axis=0) * turn, axis=0)


def low_pass_torques(torque_nm: FloatArray, step_s: float) -> FloatArray:
    return NARROW.through(torque_nm, step_s)


@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize(
    ("through", "channel"), [(delay_torques, LATE), (low_pass_torques, NARROW)]
)
def test_the_torque_channel_of_a_model_is_applied_to_the_payload(
    lab: SimpleNamespace,
    tmp_path: Path,
    through: Callable[[FloatArray, float], FloatArray],
    channel: TorqueChannel,
    periodic: bool,
) -> None:
    robot: RobotDescription = lab.six_axes()
    motion = lab.motion_of(robot)

    def run(recording: Recording) -> RunData:
        if not periodic:
            recording = replace(recording, samples_per_period=None)
        return RunData.of(RunFolder(tmp_path, "run"), recording, robot, None)

    how = EstimationJob(EstimationOptions(model=OPTIONS))
    model = estimate_runs([run(lab.measured(robot, motion, None, seed=1))], how).estimate
    true = lab.measured(robot, motion, lab.medium, seed=2)
    changed = replace(true, torque_nm=through(true.torque_nm, true.sample_period_s))

    def sigmas_off(recording: Recording, by: Estimate) -> FloatArray:
        request = PayloadRequest(PayloadOptions("model", OPTIONS, by))
        runs = payload_runs([run(recording)], [True], request)
        found = identify_payload(robot, runs, request.how)
        return np.asarray((found.reported - lab.medium.reported) / found.sigma)

    known = sigmas_off(changed, replace(model, channel=channel))
    unknown = sigmas_off(changed, model)
    assert np.abs(known).max() < 3.0
    assert np.abs(unknown - sigmas_off(true, model)).max() > 1.0, (
        "a model without the channel must be less accurate"
    )
