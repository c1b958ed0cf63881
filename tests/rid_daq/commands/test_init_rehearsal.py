"""`rid-daq init --urdf` tests its cell by a rehearsal."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.load import load_robot
from rid_daq.app import run
from tests.builders.json_output import document

pytestmark = pytest.mark.slow

ARM = """
<robot name="arm"><link name="base"/>
<link name="upper"><inertial><origin xyz="0.3 0 0"/><mass value="8"/>
  <inertia ixx="0.02" iyy="0.2" izz="0.2" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="wrist"><inertial><origin xyz="0 0.01 0"/><mass value="0.1"/>
  <inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="lift" type="revolute"><parent link="base"/><child link="upper"/>
  <origin rpy="1.5707963267948966 0 0"/><axis xyz="0 0 1"/>
  <limit lower="-2" upper="2" effort="{effort}" velocity="2.5"/></joint>
<joint name="roll" type="revolute"><parent link="upper"/><child link="wrist"/>
  <origin xyz="0.6 0 0"/><axis xyz="1 0 0"/>
  <limit lower="-3" upper="3" effort="2" velocity="4"/></joint></robot>"""


def test_init_raises_a_too_low_torque_limit_and_the_rehearsal_succeeds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "arm.urdf").write_text(ARM.format(effort=15))
    folder = tmp_path / "cell"
    assert run(["init", str(folder), "--urdf", str(tmp_path / "arm.urdf"), "--json"]) == 0
    result = document(capsys)
    assert result["rehearsed"]
    assert result["obstacle"] == ""
    assert any("gravity needs up to" in note and "'lift'" in note for note in result["notes"])
    assert load_robot(str(folder / "robot.yaml")).joints[0].limits.torque > 15.0
    names = sorted(path.name for path in folder.iterdir())
    assert names == ["cell.yaml", "plant.yaml", "robot.png", "robot.yaml", "validation.yaml"]
