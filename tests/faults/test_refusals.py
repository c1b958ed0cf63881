"""Motion files beyond a limit: `record` ends with exit code 3 (docs/faults.md, row 16)."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.motion.kinds.fourier import FourierMotion
from config.load import LoadedCell, to_yaml
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel
from dynamics.model.true_parameters import true_parameters
from identification.estimation.estimate import Estimate
from identification.estimation.file import write_estimate
from identification.model.base_parameters import base_parameters
from identification.model.options import ModelOptions
from mock_hw.cell import SimulatedCell
from mock_hw.simulation import CellSimulation
from rid_daq.app import run

Measured = Callable[[str], None]


def true_estimate(loaded: LoadedCell, robot: RobotDescription) -> Estimate:
    """Return an estimate with the plant's true parameters and no uncertainty."""
    assert loaded.plant is not None
    model = RobotModel.from_description(robot)
    base, n = base_parameters(model), len(robot.joints)
    none = np.zeros((len(base), len(base)))
    return Estimate(
        robot=robot,
        options=ModelOptions(),
        base=base,
        values=base.combination @ true_parameters(model, robot, loaded.plant),
        covariance_noise=None,
        covariance_residual=none,
        covariance_jackknife=none,
        condition_number=1.0,
        equations=1,
        residual_nm=np.zeros(n),
        noise_nm=None,
        left_out_fraction=np.zeros(n),
        method="periodic",
        band_hz=20.0,
        standstill_rad_s=0.01,
    )


def weak_robot(robot: RobotDescription) -> RobotDescription:
    """Return a robot whose second joint has a torque limit of 20 N m."""
    first, second, third = robot.joints
    limits = second.limits.model_copy(update={"torque": 20.0})
    return robot.model_copy(
        update={"joints": (first, second.model_copy(update={"limits": limits}), third)}
    )


def far_table(plan: FourierMotion) -> str:
    """Return a CSV table of joint positions [rad] that leaves the first joint's range."""
    names = [joint.joint for joint in plan.joints]
    turns = np.linspace(0.0, 1.0, 200)
    rows = [f"{4.0 * s:.4f},{6.0 * (1.0 - np.cos(2.0 * np.pi * s)):.6f},0,0" for s in turns]
    return "\n".join(["time_s," + ",".join(names), *rows]) + "\n"


@pytest.mark.fault(16)
@pytest.mark.slow
def test_a_motion_file_beyond_a_limit_is_refused_before_any_frame(
    loaded: LoadedCell,
    motion_of: Callable[[str, int], FourierMotion],
    tmp_path: Path,
    capsys: Any,
    measured: Measured,
) -> None:
    assert loaded.plant is not None
    plan, log = motion_of("ir361", 2), tmp_path / "bus.log"
    fast = plan.model_copy(
        update={"joints": tuple(j.model_copy(update={"sine": (0.9,)}) for j in plan.joints)}
    )
    (tmp_path / "far.csv").write_text(far_table(plan))
    texts = {
        "position": "kind: joint_table\nrobot: ir361\nfile: far.csv\n",
        "velocity": to_yaml(fast),
        "torque": to_yaml(plan),
    }
    weak = weak_robot(loaded.robot)
    write_estimate(tmp_path / "model.json", true_estimate(loaded, weak))
    (tmp_path / "weak.yaml").write_text(to_yaml(weak))
    config = loaded.config.model_copy(update={"plate": None})
    messages = {}
    with SimulatedCell(
        CellSimulation(config, loaded.robot, loaded.plant, realtime=False, seed=3, log=log)
    ) as simulated:
        cell = simulated.cell.model_dump(mode="json") | {"simulated": False, "plant": None}
        (tmp_path / "cell.json").write_text(json.dumps(cell | {"robot": "weak.yaml"}))
        for what, text in texts.items():
            (tmp_path / f"{what}.yaml").write_text(text)
            words = ["record", str(tmp_path / "cell.json"), str(tmp_path / f"{what}.yaml")]
            words += ["--model", str(tmp_path / "model.json"), "--i-have-cleared-the-cell"]
            assert run([*words, "--runs", str(tmp_path / "runs")]) == 3
            messages[what] = capsys.readouterr().err
    assert {"'axis1'", "2.811"} <= {*messages["position"].split()}
    assert "velocity" in messages["velocity"]
    assert "'axis2'" in messages["torque"]
    assert re.search(r"\b20\b", messages["torque"])
    ours = [line for line in log.read_text().splitlines() if not line.split()[2].startswith("70")]
    assert ours == []
    assert not (tmp_path / "runs").exists()
    measured("position, velocity or predicted torque beyond its limit: exit 3, 0 frames, no run")
