"""Motions from Python: design, points, retiming, compensation and plots."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from compensation.loops.loop_file import write_loops
from compensation.loops.velocity_loop import VelocityLoop
from config.errors import ConfigError, LimitError
from rid_daq.api import Model, Motion, Recording, compensate, design, plot, retime, validate
from tests.builders.raised_codes import raises_code
from tests.rid_daq.api.conftest import Arm

QUICK = {"excitation": {"method": "two-harmonic", "tries": 4}}
POSES = [[0.0, -0.3, 0.4], [0.4, 0.0, 0.2], [0.6, -0.2, 0.6]]


@pytest.fixture(scope="module")
def path() -> Motion:
    return Motion.through(POSES, cell="ir361", speed_fraction=0.3)


def test_an_excitation_of_a_robot_keeps_its_limits_and_is_saved(arm: Arm, tmp_path: Path) -> None:
    motion = design(arm.robot, period_s=4.0, periods=2, options=QUICK)
    limits = [joint.limits for joint in arm.robot.description.joints]
    assert motion.position.shape == motion.velocity.shape == (len(motion.time_s), 3)
    assert np.all(np.abs(motion.velocity).max(axis=0) <= [each.velocity for each in limits])
    shown = [line.split()[0] for line in str(motion).splitlines()[2:5]]
    assert shown == list(arm.robot.joint_names)
    motion.save(tmp_path / "motion.yaml")
    again = Motion.load(tmp_path / "motion.yaml", cell=arm.robot)
    np.testing.assert_array_equal(again.position, motion.position)
    with raises_code(ConfigError, "RID-OUTPUT-EXISTS"):
        motion.save(tmp_path / "motion.yaml")


def test_a_design_reports_its_starts() -> None:
    fractions: list[float] = []
    options = {"excitation": {"starts": 1, "harmonics": 2}}
    design(
        "ir361",
        period_s=4.0,
        options=options,
        progress=lambda _step, done, _total: fractions.append(done),
    )
    assert fractions[0] == 0.0
    assert fractions[-1] >= 1.0


def test_a_path_is_retimed_within_the_torque_limits(path: Motion, model: Model) -> None:
    faster = retime(path, model, margin=0.1)
    assert faster.duration_s < path.duration_s
    limits = [joint.limits.torque for joint in model.robot.description.joints]
    torque = model.inverse_dynamics(faster.position, faster.velocity, faster.acceleration)
    assert np.all(np.abs(torque).max(axis=0) <= limits)
    with raises_code(ConfigError, "RID-MOTION-KIND"):
        retime(design("ir361", period_s=4.0, options=QUICK), model)


def test_points_outside_the_limits_are_refused() -> None:
    with raises_code(LimitError, "RID-MOTION-LIMIT", "axis1"):
        Motion.through([[0.0, 0.0, 0.0], [99.0, 0.0, 0.0]], cell="ir361")
    with raises_code(ConfigError, "RID-API-ARGUMENT", "(poses, joints)"):
        Motion.through([0.0, 1.0], cell="ir361")


def test_a_feedforward_changes_the_speeds_and_is_saved(
    path: Motion, model: Model, tmp_path: Path
) -> None:
    loops = [
        VelocityLoop(name, 900.0, 0.08, 0.0, 0.002, ("gain",), np.eye(1), 1.0, ())
        for name in model.robot.joint_names
    ]
    write_loops(tmp_path / "loops.json", loops, "ir361", "a run")
    ahead = compensate(path, model, tmp_path / "loops.json")
    assert ahead.velocity.shape == path.velocity.shape
    assert np.abs(ahead.velocity - path.velocity).max() > 1e-4
    ahead.save(tmp_path / "feedforward.json")
    with raises_code(ConfigError, "RID-OUTPUT-EXISTS"):
        ahead.save(tmp_path / "feedforward.json")


def test_motion_model_recording_and_validation_are_plotted(
    path: Motion, model: Model, train: Recording, arm: Arm, tmp_path: Path
) -> None:
    validation = validate(model, arm.recording(2))
    figures = (plot(path), plot(model), plot(train), plot(validation))
    for number, figure in enumerate(figures):
        assert figure.axes
        assert figure._repr_png_().startswith(b"\x89PNG")  # type: ignore[attr-defined]
        figure.savefig(tmp_path / f"{number}.png", dpi=30)
