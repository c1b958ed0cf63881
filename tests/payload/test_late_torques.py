"""A payload weighed by a model that says how late each joint's torque is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from acquisition.recording.recording import Recording
from acquisition.runs.folder import RunFolder
from config.robot.robot import RobotDescription
from identification.equations.torque_channel import TorqueChannel
from identification.estimation.estimate import Estimate
from identification.estimation.options import EstimationOptions
from identification.model.options import ModelOptions
from identification.payload.procedures import PayloadOptions, identify_payload
from rid_daq.jobs.identification_job import EstimationRequest, estimate_runs
from rid_daq.jobs.payload.payload_job import PayloadRequest, payload_runs
from rid_daq.runs.run_data import RunData

LATE_S = np.array([0.004, 0.006, 0.005, 0.004, -0.003, 0.0])
OPTIONS = ModelOptions(rotors=False)


def late(recording: Recording) -> Recording:
    """Return a periodic recording whose torques come late, to the last fraction of a sample."""
    step_s = recording.sample_period_s
    assert step_s is not None
    frequency_hz = np.fft.rfftfreq(len(recording.time_s), step_s)
    turn = np.exp(-2j * np.pi * np.outer(frequency_hz, LATE_S))
    torque = np.fft.irfft(np.fft.rfft(recording.torque_nm, axis=0) * turn, axis=0)
    return replace(recording, torque_nm=torque)


@pytest.mark.parametrize("periodic", [True, False])
def test_what_a_model_says_of_late_torques_holds_for_a_payload(
    lab: SimpleNamespace, tmp_path: Path, periodic: bool
) -> None:
    robot: RobotDescription = lab.six_axes()
    motion = lab.motion_of(robot)
    empty = lab.measured(robot, motion, None, seed=1)
    loaded = lab.measured(robot, motion, lab.medium, seed=2)
    if not periodic:
        empty, loaded = (replace(each, samples_per_period=None) for each in (empty, loaded))

    def run(recording: Recording) -> RunData:
        return RunData.of(RunFolder(tmp_path, "run"), recording, robot, None)

    how = EstimationRequest(EstimationOptions(model=OPTIONS))
    model = estimate_runs([run(empty)], how).estimate
    channel = TorqueChannel(LATE_S, np.full(6, 1e-4))

    def weighed(recording: Recording, by: Estimate) -> np.ndarray:
        request = PayloadRequest(PayloadOptions("model", OPTIONS, by))
        runs = payload_runs([run(recording)], [True], request)
        found = identify_payload(robot, runs, request.how)
        return np.asarray((found.reported - lab.medium.reported) / found.sigma)

    true = weighed(loaded, model)
    known = weighed(late(loaded), replace(model, channel=channel))
    unknown = weighed(late(loaded), model)
    np.testing.assert_allclose(known, true, atol=0.1)
    assert np.abs(known).max() < 3.0
    assert np.abs(unknown - true).max() > 1.0, "who does not know is off by more than noise"
