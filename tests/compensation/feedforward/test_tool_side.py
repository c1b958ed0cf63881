"""Path errors at the tool, from a tracker with its own clock and frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from acquisition.motion.kinds.multipoint import MultipointMotion
from acquisition.motion.samples import Phase
from acquisition.recording.recording import Recording
from acquisition.tracker.tracker_file import TrackedPoint
from compensation.feedforward.tool_side import tool_side_error
from config.arrays import FloatArray
from config.errors import DataQualityError
from config.load import load_robot
from dynamics.geometry.kinematics import Chain, forward
from tests.builders.raised_codes import raises_code

ROBOT = load_robot("ir361")
CHAIN = Chain.from_description(ROBOT)
TURN = Rotation.from_rotvec([0.02, -0.03, 0.9]).as_matrix()
ORIGIN_M = np.array([2.1, -0.7, 0.4])
NOISE_M = 2e-5


def _wave(target: FloatArray, size: float) -> FloatArray:
    """Return errors of the joints (rad), of up to `size`, that change along the motion."""
    rows = np.linspace(0.0, 40.0, len(target))[:, np.newaxis]
    return size * np.sin(rows * [1.0, 1.3, 1.7])


@pytest.fixture(scope="module")
def recording() -> Recording:
    motion = MultipointMotion(kind="multipoint", robot="ir361", points=6, seed=3)
    target = motion.plan(ROBOT, 0.004).whole().position
    rows = len(target)
    return Recording(
        joint_names=ROBOT.joint_names,
        time_s=0.004 * np.arange(rows, dtype=np.float64),
        position=target - _wave(target, 1e-4),
        torque_nm=np.zeros_like(target),
        valid=np.ones(rows, dtype=np.bool_),
        phase=np.full(rows, Phase.MAIN, dtype=np.uint8),
        sample_index=np.arange(rows),
        target_position=target,
        source="cell",
    )


def tracked(recording: Recording, bent: float, rate_hz: float = 250.0) -> TrackedPoint:
    """Return the path of the tool if the joints deviate by up to `bent` rad from their encoders."""
    links = recording.position - _wave(recording.position, bent)
    path = CubicSpline(recording.time_s, forward(CHAIN, links))
    times = np.arange(0.0, recording.time_s[-1], 1.0 / rate_hz)
    noise = NOISE_M * np.random.default_rng(2).normal(size=(len(times), 3))
    points = path(times) @ TURN.T + ORIGIN_M + noise
    return TrackedPoint(times * (1.0 + 5e-5) + 1234.5, points)


@pytest.mark.parametrize("rate_hz", [1000.0, 100.0])
def test_the_error_at_the_tool_is_that_of_motors_and_gears(
    recording: Recording, rate_hz: float
) -> None:
    bent = 1e-3
    found = tool_side_error(CHAIN, recording, tracked(recording, bent, rate_hz))
    links = recording.position - _wave(recording.position, bent)
    assert recording.target_position is not None
    true = np.linalg.norm(forward(CHAIN, links) - forward(CHAIN, recording.target_position), axis=1)
    assert found.mean_m == pytest.approx(true.mean(), rel=0.1)
    assert found.max_m == pytest.approx(true.max(), rel=0.15)
    assert found.alignment.rate == pytest.approx(5e-5, abs=5e-5)
    assert found.alignment.offset_s == pytest.approx(1234.5, abs=2e-3)


def test_without_deflection_the_error_is_that_of_the_motors(recording: Recording) -> None:
    found = tool_side_error(CHAIN, recording, tracked(recording, 0.0))
    assert recording.target_position is not None
    motors = np.linalg.norm(
        forward(CHAIN, recording.position) - forward(CHAIN, recording.target_position), axis=1
    )
    assert found.mean_m == pytest.approx(np.hypot(motors.mean(), NOISE_M), rel=0.1)
    assert found.alignment.residual_m == pytest.approx(np.sqrt(3.0) * NOISE_M, rel=0.1)


def test_the_measured_point_may_be_another_than_the_tool(recording: Recording) -> None:
    wrong = replace(CHAIN, tool_m=CHAIN.tool_m + np.array([0.0, 0.0, 0.02]))
    seen = tracked(recording, 0.0)
    assert tool_side_error(wrong, recording, seen).mean_m > 1e-3


def test_a_foreign_run_is_refused(recording: Recording) -> None:
    foreign = replace(recording, target_position=None)
    with raises_code(DataQualityError, "RID-RUN-FOREIGN"):
        tool_side_error(CHAIN, foreign, tracked(recording, 0.0))


@pytest.fixture(scope="module")
def corrected(recording: Recording) -> tuple[Recording, FloatArray]:
    """Return a run whose motors are ahead of the path by the deflection, and this lead (rad)."""
    path = recording.target_position
    assert path is not None
    lead = np.column_stack(
        [0.0 * path[:, 0], 2e-3 * np.cos(path[:, 1]), 1e-3 * np.sin(path[:, 1] + path[:, 2])]
    )
    return replace(recording, position=path + lead, target_position=path + lead), lead


def on_path(recording: Recording, lead: FloatArray) -> TrackedPoint:
    """Return the measured path of a tool that is exactly on its path."""
    points = forward(CHAIN, recording.position - lead) @ TURN.T + ORIGIN_M
    return TrackedPoint(recording.time_s + 5.0, points)


def test_a_run_that_corrects_the_deflection_is_judged_by_the_path_of_the_links(
    corrected: tuple[Recording, FloatArray],
) -> None:
    run, lead = corrected
    found = tool_side_error(CHAIN, run, on_path(run, lead), lead)
    assert found.max_m < 1e-6
    assert found.share > 0.999
    assert tool_side_error(CHAIN, run, on_path(run, lead)).mean_m > 1e-3


@pytest.mark.parametrize("rows", [60, 125, 400])
def test_measured_rows_in_a_gap_of_the_run_are_left_out(
    corrected: tuple[Recording, FloatArray], rows: int
) -> None:
    run, lead = corrected
    valid = run.valid.copy()
    first = len(valid) // 2 - 300
    valid[first : first + rows] = False
    found = tool_side_error(CHAIN, replace(run, valid=valid), on_path(run, lead), lead)
    assert len(found.time_s) == pytest.approx(len(valid) - rows, abs=2)
    assert found.max_m < 1e-6


@pytest.mark.parametrize("part", [0.3, 0.7])
def test_a_part_of_the_motion_is_not_judged_as_the_whole(
    corrected: tuple[Recording, FloatArray], part: float
) -> None:
    run, lead = corrected
    whole = on_path(run, lead)
    rows = int(part * len(whole.time_s))
    seen = TrackedPoint(whole.time_s[:rows], whole.point_m[:rows])
    if part < 0.5:
        with raises_code(DataQualityError, "RID-TRACKER-ALIGNMENT", "30 %"):
            tool_side_error(CHAIN, run, seen, lead)
    else:
        assert tool_side_error(CHAIN, run, seen, lead).share == pytest.approx(part, abs=0.01)
