"""Jumps of the wall clock: wall time is only a label, and no duration depends on it
(docs/faults.md, row 26).
"""

from __future__ import annotations

import ast
import itertools
import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.journal.cycles import read_journal
from acquisition.journal.header import JournalHeader
from acquisition.motion.samples import MotionSamples, Phase
from acquisition.runs.catalogue import find_run
from acquisition.runs.folder import RunFolder
from acquisition.session.cycle_recorder import run_recorder
from acquisition.task.control_block import ControlBlock
from acquisition.task.cyclic_task import CyclicTask
from acquisition.task.ring import Ring
from acquisition.task.set_points import PlannedMotion
from acquisition.task.states import TaskState
from acquisition.task.stop_orders import StopOrders
from config.cell.cell import CellConfig
from config.process.termination import TERMINATION
from config.robot.robot import RobotDescription
from tests.builders.code_lines import ROOT
from tests.builders.syntax_trees import source_files, tree_of

FLOORS = ("acquisition", "compensation", "config", "drivers", "dynamics", "identification")
LABELS_ONLY = {"acquisition/runs/folder.py"}
TO_READ_STAMPS = {"drivers/ports/socketcan_port.py"}
WALL_CLOCK = {
    ("time", "time"), ("time", "time_ns"), ("time", "localtime"), ("time", "gmtime"),
    ("time", "strftime"), ("datetime", "now"), ("datetime", "utcnow"), ("datetime", "today"),
    ("date", "today"),
}  # fmt: skip
HOUR_NS = 3600 * 10**9
NOW_NS = 1_800_000_000 * 10**9


@pytest.fixture
def leaping_clock(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A wall clock that jumps by up to 2 h at every read, in the time zone of central Europe."""
    leaps = itertools.cycle((0, HOUR_NS, -HOUR_NS, 5 * 10**6))
    monkeypatch.setattr("time.time_ns", lambda: NOW_NS + next(leaps))
    monkeypatch.setattr("time.time", lambda: (NOW_NS + next(leaps)) / 1e9)
    monkeypatch.setenv("TZ", "CET-1CEST,M1.5.0,M10.5.0/3")
    time.tzset()
    before = {number: signal.getsignal(number) for number in TERMINATION}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)
    monkeypatch.undo()
    time.tzset()


@pytest.mark.fault(26)
@pytest.mark.usefixtures("leaping_clock")
def test_jumps_of_the_wall_clock_have_no_effect_on_a_recording(
    cell: CellConfig,
    robot: RobotDescription,
    axes: Any,
    clock: Any,
    motion: MotionSamples,
    tmp_path: Path,
    measured: Callable[[str], None],
) -> None:
    ring, control = Ring.create(3, 4096), ControlBlock.create()
    folder = RunFolder.create(tmp_path, "leaps")
    task = CyclicTask(
        axes,
        clock,
        cell,
        robot,
        ring,
        control,
        lockstep=True,
        orders=StopOrders(control, lambda: False),
    )
    assert task.run(PlannedMotion(motion)) is None
    control.task.state = TaskState.FINISHED
    header = JournalHeader(
        joint_names=robot.joint_names, sample_period_s=0.008, samples_per_period=100
    )
    run_recorder(ring, control, folder.file("recording.mcap"), header, os.getppid())
    recording = read_journal(folder.file("recording.mcap")).recording()
    steps_s = np.diff(recording.time_s)
    np.testing.assert_allclose(steps_s, 0.008, rtol=1e-9)
    periods = np.count_nonzero(recording.phase == Phase.MAIN) / 100
    assert periods == 2
    measured(f"{np.sum(steps_s <= 0)} steps back in time, {periods:.0f} of 2 periods recorded")


@pytest.mark.fault(26)
def test_runs_are_sorted_in_the_order_of_their_creation(
    tmp_path: Path, measured: Callable[[str], None]
) -> None:
    steps_ns = (0, HOUR_NS, -HOUR_NS, -HOUR_NS + 10**6, 0, 5 * 10**8)
    made = [RunFolder.create(tmp_path, "run", now_ns=NOW_NS + step) for step in steps_ns]
    assert sorted(folder.run_id for folder in made) == [folder.run_id for folder in made]
    assert find_run(tmp_path, "latest").run_id == made[-1].run_id
    assert (
        made[2].manifest().created_utc.startswith("2027-01-15T07:00:00")
    )  # one hour earlier: the label shows the wall clock
    measured("run ids in order although the clock went back by an hour")


def test_a_clock_that_was_once_far_ahead_does_not_fix_the_order_for_ever(tmp_path: Path) -> None:
    RunFolder.create(tmp_path, "wrong", now_ns=NOW_NS + 365 * 24 * HOUR_NS)
    first = RunFolder.create(tmp_path, "right", now_ns=NOW_NS)
    assert first.run_id < RunFolder.create(tmp_path, "wrong", now_ns=2 * NOW_NS).run_id


@pytest.mark.fault(26)
def test_no_computation_driver_or_task_reads_the_wall_clock(
    measured: Callable[[str], None],
) -> None:
    readers = set()
    files = source_files(*FLOORS)
    for path in files:
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                if (node.value.id, node.attr) in WALL_CLOCK:
                    readers.add(str(path.relative_to(ROOT)))
            elif isinstance(node, ast.ImportFrom) and node.module == "time":
                assert not {alias.name for alias in node.names} & {"time", "time_ns"}, path
    assert readers == LABELS_ONLY | TO_READ_STAMPS
    assert len(files) > 150
    measured("1 file reads the date for a label, 1 to convert kernel stamps to monotonic time")
