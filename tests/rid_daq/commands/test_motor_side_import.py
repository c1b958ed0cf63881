"""Import and identification of a motor-side recording of a coupled robot on the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.runs.folder import RunFolder
from config.load import load_robot, to_yaml
from dynamics.model.robot_model import RobotModel, torque
from identification.estimation.file import read_estimate
from rid_daq.app import run
from rid_daq.runs.run_data import RunData

COUPLING = ((1.0, 0.0, 0.0), (0.1, 1.0, 0.0), (-0.2, -0.4, 1.0))
MAP = """\
name: wrist
robot: robot.yaml
columns: 7
time: {column: 0}
side: motor
torques: motor_torque
joints:
  - {joint: axis1, position: 1, torque: 4}
  - {joint: axis2, position: 2, torque: 5}
  - {joint: axis3, position: 3, torque: 6}
plausible: {position: 10.0, speed: 10.0, torque: 10000.0}
"""


def test_a_motor_side_recording_is_read_and_identified_in_joint_coordinates(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    robot = load_robot("ir361").model_copy(update={"name": "wrist", "coupling": COUPLING})
    model = RobotModel.from_description(robot)
    random = np.random.default_rng(0)
    motion = FourierMotion(
        kind="fourier",
        robot="wrist",
        period_s=10.0,
        joints=tuple(
            FourierJoint(joint=name, sine=tuple(random.uniform(-0.1, 0.1, 5)), cosine=(0.0,) * 5)
            for name in robot.joint_names
        ),
    )
    trajectory = motion.trajectory(robot, 0.01)
    t = 0.01 * np.arange(2000, dtype=np.float64)
    q, v, a = (f(t) for f in (trajectory.position, trajectory.velocity, trajectory.acceleration))
    theta = np.where(np.char.startswith(model.parameter_names, "f"), 20.0, 0.5)
    theta[model.parameter_groups["rotors"]] = 1e-3
    tau = torque(model, q, v, a, theta) + 0.5 * random.standard_normal(q.shape)
    gears = np.array([joint.gear_ratio for joint in robot.joints])
    motors = np.linalg.solve(np.array(COUPLING), q.T).T * gears
    np.savetxt(tmp_path / "rec.csv", np.column_stack([t, motors, tau / gears]), delimiter=",")
    (tmp_path / "robot.yaml").write_text(to_yaml(robot))
    (tmp_path / "map.yaml").write_text(MAP)

    runs = str(tmp_path / "runs")
    command = ["import", str(tmp_path / "rec.csv"), "--map", str(tmp_path / "map.yaml")]
    assert run([*command, "--runs", runs, "--json"]) == 0
    folder = json.loads(capsys.readouterr().out)["folder"]
    recording = RunData.load(RunFolder.open(Path(folder))).recording
    np.testing.assert_allclose(recording.position, q, atol=1e-9)
    np.testing.assert_allclose(recording.torque_nm, tau, atol=1e-9)

    model_file = tmp_path / "model.json"
    assert run(["identify", folder, "-o", str(model_file), "--json"]) == 0
    estimate = read_estimate(model_file)
    friction = [name.startswith("f") for name in estimate.base.names]
    np.testing.assert_allclose(estimate.values[friction], 20.0, rtol=0.15)
    assert np.all(estimate.residual_nm < 1.0)
