"""Motions that are refused before any device is opened, each by a different guard."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.motion.samples import MotionSamples
from acquisition.runs.folder import RunFolder
from acquisition.session.record import record_motion
from config.cell.cell import CellConfig
from config.errors import ConfigError, PreflightError, RecordingError
from config.load import load_cell
from config.robot.bodies import Plane, Workspace
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain, link_transforms
from tests.builders.raised_codes import raises_code

LOADED = load_cell("ir361")
ROBOT = LOADED.robot
T = LOADED.config.cycle_time_s

Try = Callable[..., None]


@pytest.fixture(scope="module")
def samples() -> MotionSamples:
    joints = tuple(
        FourierJoint(joint=name, offset=0.1, sine=(0.1,), cosine=(0.0,))
        for name in ROBOT.joint_names
    )
    motion = FourierMotion(
        kind="fourier", robot="ir361", period_s=2.0, periods=3, ramp_s=1.0, joints=joints
    )
    return motion.plan(ROBOT, T)


@pytest.fixture
def try_to_record(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Try:
    """Return a function that tries to record a motion; the test fails if a process is started."""

    def begun(*_: object) -> None:
        pytest.fail("the motion was not refused")

    monkeypatch.setattr("acquisition.session.record.start_all", begun)
    folder = RunFolder.create(tmp_path, "refused")

    def call(
        samples: MotionSamples,
        cell: CellConfig = LOADED.config,
        robot: RobotDescription = ROBOT,
    ) -> None:
        record_motion(cell, robot, samples, folder)

    return call


def test_a_motion_of_another_cycle_time_is_refused(
    try_to_record: Try, samples: MotionSamples
) -> None:
    with raises_code(ConfigError, "RID-MOTION-CYCLE"):
        try_to_record(replace(samples, sample_period_s=0.5 * T))


def test_a_motion_beyond_the_limits_is_refused(try_to_record: Try, samples: MotionSamples) -> None:
    far = replace(
        samples,
        position=20.0 * samples.position,
        velocity=20.0 * samples.velocity,
        acceleration=20.0 * samples.acceleration,
    )
    with raises_code(PreflightError, "RID-MOTION-LIMIT"):
        try_to_record(far)


def test_a_motion_whose_stop_would_end_beyond_a_limit_is_refused(
    try_to_record: Try, samples: MotionSamples
) -> None:
    safety = {"quick_stop_deceleration_rad_s2": 0.02}
    slow = LOADED.config.drive_safety.model_copy(update=safety)
    with raises_code(PreflightError, "RID-MOTION-STOP", "axis"):
        try_to_record(samples, LOADED.config.model_copy(update={"drive_safety": slow}))


def test_a_motion_too_fast_for_a_motor_of_a_coupled_wrist_is_refused(
    try_to_record: Try, samples: MotionSamples
) -> None:
    """Each joint is within its limits, but the motor speed alpha3' = q3' + 50 q2' is not."""
    coupling = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -50.0, 1.0))
    with raises_code(PreflightError, "RID-MOTION-LIMIT", "motor", "axis3"):
        try_to_record(samples, robot=ROBOT.model_copy(update={"coupling": coupling}))


def test_a_feedforward_beyond_the_speed_limit_is_refused(
    try_to_record: Try, samples: MotionSamples
) -> None:
    fastest = max(joint.limits.velocity for joint in ROBOT.joints)
    with raises_code(PreflightError, "RID-MOTION-LIMIT"):
        try_to_record(replace(samples, feedforward=np.full_like(samples.velocity, 1.01 * fastest)))


def test_a_feedforward_that_begins_with_a_step_is_refused(
    try_to_record: Try, samples: MotionSamples
) -> None:
    """All its speeds are within the limits."""
    ahead = samples.velocity.copy()
    ahead[0] = 0.3 * np.array([joint.limits.velocity for joint in ROBOT.joints])
    with raises_code(PreflightError, "RID-MOTION-COMMAND"):
        try_to_record(replace(samples, feedforward=ahead))


def test_a_motion_that_comes_too_close_to_a_wall_is_refused(
    try_to_record: Try, samples: MotionSamples
) -> None:
    """The wall is halfway between the start and the most distant point of the path, along x."""
    chain = Chain.from_description(ROBOT)
    links = link_transforms(chain, samples.position)[:, -1]
    x = links[:, 0, :3] @ chain.tool_m + links[:, 0, 3]
    side = 1.0 if x[0] - x.min() > x.max() - x[0] else -1.0
    place = 0.5 * (x[0] + (x.min() if side > 0.0 else x.max()))
    wall = Plane(name="the wall", normal=(side, 0.0, 0.0), offset_m=side * float(place))
    workspace = Workspace(planes=(wall,), clearance_m=0.001)
    cell = LOADED.config.model_copy(update={"workspace": workspace})
    with raises_code(PreflightError, "RID-MOTION-COLLISION"):
        try_to_record(samples, cell)


def test_a_disk_with_too_little_room_is_refused(
    try_to_record: Try, samples: MotionSamples, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("acquisition.session.record.FREE_BYTES", 1 << 60)
    with raises_code(RecordingError, "RID-SYSTEM-DISK-FULL"):
        try_to_record(samples)
