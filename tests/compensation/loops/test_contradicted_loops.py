"""Loops of recordings with a clipped torque, or with torques or commands in another unit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from acquisition.motion.kinds.multisine import MultisineMotion
from acquisition.recording.recording import Recording
from compensation.loops.loop_measurement import measure_loops
from compensation.loops.plausible_inertia import refuse_light_axes
from config.errors import EstimationError
from config.load import LoadedCell
from tests.builders.raised_codes import raises_code
from tests.compensation.loops.test_velocity_loop import limited, multisine

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def recorded(
    cell: LoadedCell, drive: Callable[..., Recording]
) -> tuple[MultisineMotion, Recording]:
    motion = multisine()
    return motion, drive(motion.plan(cell.robot, cell.config.cycle_time_s))


@pytest.mark.parametrize("noise", [0.0, 0.002])
def test_intervals_cover_the_error_of_a_slightly_clipped_torque(
    cell: LoadedCell, recorded: tuple[MultisineMotion, Recording], noise: float
) -> None:
    """The reading of the first two joints is clipped, with or without noise behind the limit."""
    assert cell.plant is not None
    motion, recording = recorded
    torque = recording.torque_nm.copy()
    random = np.random.default_rng(1).normal(size=torque.shape)
    largest = np.abs(torque).max(axis=0)
    torque[:, :2] = (limited(recording, 0.8).torque_nm + noise * largest * random)[:, :2]
    found = measure_loops(replace(recording, torque_nm=torque), motion, cell.robot, 15.0)
    for axis, loop, share in zip(cell.plant.axes, found.loops, found.unexplained, strict=True):
        off = abs(loop.gain - axis.velocity_gain_nm_s)
        assert off < 2.0 * loop.sigma["gain"]
        assert (share > 0.01) is (loop.joint_name != "axis3")


def test_commands_in_another_unit_are_refused(
    cell: LoadedCell, recorded: tuple[MultisineMotion, Recording]
) -> None:
    motion, recording = recorded
    assert recording.velocity_command is not None
    for factor in (0.01, 0.9, 1.2, 100.0):
        command = factor * recording.velocity_command
        with pytest.raises(EstimationError) as refused:
            measure_loops(replace(recording, velocity_command=command), motion, cell.robot, 15.0)
        assert refused.value.refusal in ("RID-LOOP-WEAK", "RID-LOOP-CONTRADICTED")


def test_a_torque_in_another_unit_is_refused(
    cell: LoadedCell, recorded: tuple[MultisineMotion, Recording]
) -> None:
    motion, recording = recorded
    pose = recording.position.mean(axis=0)
    refuse_light_axes(measure_loops(recording, motion, cell.robot, 15.0).cascades, cell.robot, pose)
    small = replace(recording, torque_nm=0.01 * recording.torque_nm)
    found = measure_loops(small, motion, cell.robot, 15.0)
    with raises_code(EstimationError, "RID-LOOP-INERTIA", "axis1"):
        refuse_light_axes(found.cascades, cell.robot, pose)
