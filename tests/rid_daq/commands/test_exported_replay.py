"""Models of a real robot, exported and replayed along a recording by Pinocchio and MuJoCo."""

from __future__ import annotations

import contextlib
import io
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from acquisition.runs.catalogue import find_run
from config.arrays import BoolArray, FloatArray
from identification.equations.deconvolution import smoothed_recording
from identification.estimation.estimate import predict
from identification.estimation.file import read_estimate
from rid_daq.app import run
from rid_daq.runs.run_data import RunData

pytestmark = pytest.mark.slow

URDF = Path(__file__).parent / "ur10e.urdf"
TRAIN = ("ur-20_02_12-50sec_12harm.csv", "355-5090")
OTHER = ("ur-20_01_17-ptp_10_points.csv", "700-4200")
SLOWEST_RAD_S = 0.1
STEP = 5


@dataclass(frozen=True)
class Replay:
    """A motion of the robot that was not used to identify the model.

    Attributes:
        folder: Folder of the model, `model.json`.
        q, v, a: Shape (samples, 6). The recorded motion, low-pass filtered [rad, rad/s, rad/s2].
        predicted_nm, measured_nm: Shape (samples, 6). Torques of the model and of the recording.
    """

    folder: Path
    q: FloatArray
    v: FloatArray
    a: FloatArray
    predicted_nm: FloatArray
    measured_nm: FloatArray

    @property
    def moves(self) -> BoolArray:
        """True for speeds above `SLOWEST_RAD_S`, shape (samples, 6); slower joints may stick."""
        return np.asarray(np.abs(self.v) > SLOWEST_RAD_S)

    def rms(self, torques: FloatArray) -> FloatArray:
        """Return the RMS of each joint over the samples in which it moves, shape (6,)."""
        return np.sqrt(np.mean(torques**2, axis=0, where=self.moves))


@pytest.fixture(scope="module")
def replay(real_robot: Path, tmp_path_factory: pytest.TempPathFactory) -> Replay:
    folder = tmp_path_factory.mktemp("replay")
    runs = ["--runs", str(folder / "runs")]
    for label, (name, rows) in {"train": TRAIN, "other": OTHER}.items():
        words = ["import", str(real_robot / name), "--map", "ur10e_31", "--rows", rows]
        assert run([*words, "--label", label, *runs]) == 0
    model = folder / "model.json"
    assert run(["identify", "train", "--no-diagnose", "-o", str(model), *runs]) == 0
    estimate = read_estimate(model)
    data = RunData.load(find_run(folder / "runs", "other"))
    signals = smoothed_recording(data.recording, estimate.band_hz)
    q, v, a = (each[::STEP] for each in (signals.position, signals.velocity, signals.acceleration))
    return Replay(folder, q, v, a, predict(estimate, q, v, a), signals.torque_nm[::STEP])


def exported(replay: Replay, name: str, *words: str) -> dict[str, Any]:
    command = ["export", str(replay.folder / "model.json"), *words, "-o", str(replay.folder / name)]
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        assert run([*command, "--json"]) == 0
    result: dict[str, Any] = json.loads(output.getvalue())
    return result


def column(result: dict[str, Any], key: str) -> FloatArray:
    return np.array([each[key] for each in result["torques"]])


def test_the_updated_urdf_gives_the_validated_torques_in_pinocchio(replay: Replay) -> None:
    result = exported(replay, "arm.urdf", "--to", "urdf", "--urdf", str(URDF))
    robot, before = (
        pin.buildModelFromUrdf(str(path)) for path in (replay.folder / "arm.urdf", URDF)
    )
    robot.armature = column(result, "armature")
    torques = replayed_by_pinocchio(robot, replay)
    difference = replay.rms(torques - replay.predicted_nm)
    assert np.all(difference < column(result, "difference_rms"))
    error = replay.rms(replay.predicted_nm - replay.measured_nm)
    assert np.all(replay.rms(torques - replay.measured_nm) < 1.2 * error)
    for q in replay.q[::50]:
        np.testing.assert_allclose(frames(robot, q), frames(before, q), rtol=0.0, atol=1e-12)


def test_the_mjcf_gives_the_validated_torques_in_mujoco(replay: Replay) -> None:
    result = exported(replay, "arm.xml", "--to", "mjcf")
    built = mujoco.MjModel.from_xml_path(str(replay.folder / "arm.xml"))
    data, found = mujoco.MjData(built), []
    for data.qpos[:], data.qvel[:], data.qacc[:] in zip(replay.q, replay.v, replay.a, strict=True):
        mujoco.mj_inverse(built, data)
        found.append(data.qfrc_inverse.copy())
    torques = np.array(found)
    difference = replay.rms(torques - replay.predicted_nm)
    assert np.all(difference < column(result, "difference_rms"))
    error = replay.rms(replay.predicted_nm - replay.measured_nm)
    assert np.all(replay.rms(torques - replay.measured_nm) < 1.2 * error)


def replayed_by_pinocchio(robot: pin.Model, replay: Replay) -> FloatArray:
    data, samples = robot.createData(), zip(replay.q, replay.v, replay.a, strict=True)
    links = np.array([pin.rnea(robot, data, *sample) for sample in samples])
    friction = robot.friction * np.sign(replay.v) + robot.damping * replay.v
    return np.asarray(links + friction)


def frames(robot: pin.Model, q: FloatArray) -> FloatArray:
    data = robot.createData()
    pin.framesForwardKinematics(robot, data, q)
    return np.array([frame.homogeneous for frame in data.oMf])
