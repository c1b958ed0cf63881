"""The live page's picture of a motion that has ended."""

from __future__ import annotations

import json

import pytest

from acquisition.task.control_block import ControlBlock
from acquisition.task.ring import Ring
from acquisition.task.states import TaskState
from config.load import load_cell
from rid_daq.live.picture import MotionPicture, ShownMotion


@pytest.mark.parametrize(
    ("state", "power_off", "drives_off"),
    [
        (TaskState.MOVING, False, False),  # the task died
        (TaskState.FINISHED, False, False),
        (TaskState.FINISHED, True, True),
    ],
)
def test_drives_are_off_only_if_the_task_confirmed_it(
    state: TaskState, power_off: bool, drives_off: bool
) -> None:
    loaded, control = load_cell("ir361"), ControlBlock.create()
    motion = ShownMotion("way", 100, 50, loaded.config, loaded.robot)
    control.task.power_off = power_off
    control.task.state = state
    control.program.declare_task_gone()
    shown = json.loads(MotionPicture(motion, Ring.create(3, 64), control).document())
    assert shown["over"]
    assert shown["drives_off"] is drives_off
