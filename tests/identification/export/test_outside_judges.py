"""Exported files are read by the parsers and engines of others: urdfdom, MuJoCo, libsdformat.

urdfdom and libsdformat are used if they are installed, as `.ci/run` does: Debian's
liburdfdom-tools and libsdformat-dev, the latter with a C++ compiler.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import mujoco
import numpy as np
import pytest

from identification.export.description import sdf, urdf
from identification.export.model import ExportModel
from tests.identification.export.test_description import (
    motion_of,
    random_robot,
    with_bodies,
    without_friction,
)

pytestmark = pytest.mark.slow

LISTING = r"""
#include <iostream>
#include <sdf/sdf.hh>
int main(int, char **arguments) {
  sdf::Root root;
  auto errors = root.Load(arguments[1]);
  for (const auto &error : errors) std::cout << "error " << error.Message() << "\n";
  if (!root.Model()) return 1;
  const sdf::Model &model = *root.Model();
  for (uint64_t i = 0; i < model.JointCount(); ++i) {
    const sdf::Joint &joint = *model.JointByIndex(i);
    std::string parent, child;
    joint.ResolveParentLink(parent);
    joint.ResolveChildLink(child);
    std::cout << "joint " << joint.Name() << " " << parent << " " << child << "\n";
  }
  for (uint64_t i = 0; i < model.LinkCount(); ++i) {
    const sdf::Link &link = *model.LinkByIndex(i);
    std::cout << "link " << link.Name() << " " << link.Inertial().MassMatrix().Mass() << "\n";
  }
  return errors.empty() ? 0 : 1;
}
"""


@pytest.fixture(params=["RPR", "RRRRRR"])
def model(request: pytest.FixtureRequest) -> ExportModel:
    return with_bodies(random_robot(4, request.param), 4)


@pytest.mark.skipif(shutil.which("check_urdf") is None, reason="liburdfdom-tools is not installed")
def test_urdfdom_accepts_the_urdf(model: ExportModel, tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf"
    path.write_text(urdf(model))
    judged = subprocess.run(["check_urdf", path], capture_output=True, text=True, check=False)
    assert judged.returncode == 0, judged.stdout + judged.stderr
    assert "Successfully Parsed XML" in judged.stdout
    found = re.findall(r"child\(1\):\s+(\S+)", judged.stdout)
    assert [name for name in found if name != "tool"][-len(model.robot.joints) :] == [
        f"link{number}" for number in range(1, len(model.robot.joints) + 1)
    ]


def test_mujoco_computes_the_same_torques_from_the_urdf(model: ExportModel) -> None:
    built = mujoco.MjModel.from_xml_string(urdf(model))
    assert [built.joint(j).name for j in range(built.njnt)] == list(model.robot.joint_names)
    built.dof_damping[:] = built.dof_frictionloss[:] = 0.0  # links without friction
    built.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    built.opt.gravity[:] = model.robot.gravity_m_s2
    data = mujoco.MjData(built)
    motion = motion_of(len(model.robot.joints))
    torques = []
    for data.qpos[:], data.qvel[:], data.qacc[:] in zip(*motion, strict=True):
        mujoco.mj_inverse(built, data)
        torques.append(data.qfrc_inverse.copy())
    np.testing.assert_allclose(torques, without_friction(model, motion), atol=1e-8)


def has_libsdformat() -> bool:
    command = ["pkg-config", "--exists", "sdformat12"]
    tools = shutil.which("c++") and shutil.which("pkg-config")
    return bool(tools) and subprocess.run(command, check=False).returncode == 0


@pytest.mark.skipif(not has_libsdformat(), reason="libsdformat-dev is not installed")
def test_libsdformat_accepts_the_sdf(tmp_path: Path) -> None:
    model = with_bodies(random_robot(4, "RPR"), 4)
    (tmp_path / "listing.cc").write_text(LISTING)
    (tmp_path / "arm.sdf").write_text(sdf(model))
    command = ["pkg-config", "--cflags", "--libs", "sdformat12"]
    flags = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
    program = str(tmp_path / "listing")
    subprocess.run(
        ["c++", "-std=c++17", str(tmp_path / "listing.cc"), "-o", program, *flags], check=True
    )
    judged = subprocess.run(
        [program, str(tmp_path / "arm.sdf")], capture_output=True, text=True, check=False
    )
    assert judged.returncode == 0, judged.stdout + judged.stderr
    masses = dict(re.findall(r"^link (\S+) (\S+)$", judged.stdout, re.MULTILINE))
    for number in (1, 2, 3):
        mass = model.of(f"m{number}")
        assert float(masses[f"link{number}"]) == pytest.approx(mass, rel=1e-5)
    joints = re.findall(r"^joint (j\d) (\S+) (\S+)$", judged.stdout, re.MULTILINE)
    assert joints == [
        ("j1", "base", "link1"), ("j2", "link1", "link2"), ("j3", "link2", "link3")
    ]  # fmt: skip
