"""The program supervises the cyclic task and the recorder; the processes are simulated."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from typing import cast

import pytest

from acquisition.session.helper_process import HelperProcess
from acquisition.session.record import _watch_processes
from acquisition.supervision.stop_reason import StopCode
from acquisition.task.control_block import ControlBlock
from acquisition.task.joint_values import JointWatch
from acquisition.task.states import TaskState

LOOKS = 3


class Process:
    """A simulated process that ends after a number of reads of `is_alive`; a kill is only noted."""

    def __init__(self, looks: int) -> None:
        self.sentinel, self._other_end = os.pipe()  # never written to
        self.killed = False
        self._looks = looks

    @property
    def is_alive(self) -> bool:
        self._looks -= 1
        return self._looks >= 0

    def kill_hung(self, silent_s: float) -> None:
        self.killed, self.silent_s = True, silent_s

    def close(self) -> None:
        os.close(self.sentinel)
        os.close(self._other_end)


Make = Callable[[int], Process]


@pytest.fixture
def make(monkeypatch: pytest.MonkeyPatch) -> Iterator[Make]:
    monkeypatch.setattr("acquisition.session.record.WATCH_S", 0.0)
    made: list[Process] = []

    def one(looks: int) -> Process:
        made.append(Process(looks))
        return made[-1]

    yield one
    for each in made:
        each.close()


def watch(task: Process, recorder: Process, control: ControlBlock) -> None:
    processes = (cast(HelperProcess, task), cast(HelperProcess, recorder))
    _watch_processes(*processes, None, control, cast(JointWatch, None), None, None, None)


@pytest.mark.parametrize("state", [TaskState.BRING_UP, TaskState.MOVING, TaskState.STOPPING])
def test_a_task_without_a_sign_of_life_is_killed(
    make: Make, monkeypatch: pytest.MonkeyPatch, state: TaskState
) -> None:
    """The kill ends the task's heartbeat, so that each drive stops its axis."""
    patience = "START" if state is TaskState.BRING_UP else "BEAT"
    monkeypatch.setattr(f"acquisition.session.record.{patience}_PATIENCE_S", -1.0)
    control = ControlBlock.create()
    control.task.state = state
    task = make(LOOKS)
    watch(task, make(9), control)
    assert task.killed


def test_a_task_with_signs_of_life_is_not_killed(make: Make) -> None:
    control = ControlBlock.create()
    task = make(LOOKS)
    watch(task, make(9), control)
    assert not task.killed
    assert not control.program.stop_code


def test_a_recorder_that_died_stops_the_motion(make: Make) -> None:
    control = ControlBlock.create()
    watch(make(LOOKS), make(0), control)
    assert control.program.stop_code == StopCode.RECORDER
