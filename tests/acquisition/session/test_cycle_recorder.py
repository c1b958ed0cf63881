"""Main function of the recorder process, called in the test's own process."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from acquisition.journal.cycles import read_journal
from acquisition.journal.header import JournalHeader
from acquisition.session.cycle_recorder import run_recorder
from acquisition.task.control_block import ControlBlock
from acquisition.task.ring import Ring
from acquisition.task.states import RecorderState, TaskState
from config.process.termination import TERMINATION

HEADER = JournalHeader(joint_names=("a", "b"), sample_period_s=0.008)
ROWS = 300


@pytest.fixture(autouse=True)
def signals_restored() -> Iterator[None]:
    before = {number: signal.getsignal(number) for number in TERMINATION}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture
def ring() -> Ring:
    ring = Ring.create(2, 512)
    for cycle in range(ROWS):
        values = (cycle * 0.008, 0.0, 0.0, *range(10), 1, 2, cycle, -1, *(0,) * 4, 1, 1, 3)
        assert ring.write(values)
    return ring


def test_the_recorder_empties_the_ring_after_the_task_has_finished(
    ring: Ring, tmp_path: Path
) -> None:
    control = ControlBlock.create()
    control.task.state = TaskState.FINISHED
    run_recorder(ring, control, tmp_path / "r.mcap", HEADER, os.getppid())
    assert control.recorder.state is RecorderState.FINISHED
    journal = read_journal(tmp_path / "r.mcap")
    assert journal.rows["cycle"].tolist() == list(range(ROWS))
    assert journal.damage.notes == ()


def test_the_recorder_finishes_when_the_program_declares_the_task_gone(
    ring: Ring, tmp_path: Path
) -> None:
    control = ControlBlock.create()
    control.program.declare_task_gone()
    run_recorder(ring, control, tmp_path / "r.mcap", HEADER, os.getppid())
    assert read_journal(tmp_path / "r.mcap").damage.finished


def test_an_orphaned_recorder_finishes_if_the_task_shows_no_sign_of_life(
    ring: Ring, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    control = ControlBlock.create()
    slept: list[float] = []
    monkeypatch.setattr("acquisition.session.cycle_recorder.time.sleep", slept.append)
    monkeypatch.setattr(
        "acquisition.session.cycle_recorder.time.monotonic", lambda: 0.5 * len(slept)
    )
    run_recorder(ring, control, tmp_path / "r.mcap", HEADER, parent=-1)
    assert control.recorder.state is RecorderState.FINISHED
    assert len(read_journal(tmp_path / "r.mcap").rows) == ROWS


def test_a_write_error_is_reported(ring: Ring, tmp_path: Path) -> None:
    control = ControlBlock.create()
    run_recorder(ring, control, tmp_path / "none" / "r.mcap", HEADER, os.getppid())
    assert control.recorder.state is RecorderState.FAILED
    assert control.recorder.error is not None
    assert control.recorder.error.refusal == "RID-FILE-WRITE"


def test_the_recorder_ignores_the_signals_that_stop_the_program(ring: Ring, tmp_path: Path) -> None:
    control = ControlBlock.create()
    control.task.state = TaskState.FINISHED
    run_recorder(ring, control, tmp_path / "r.mcap", HEADER, os.getppid())
    assert {signal.getsignal(number) for number in TERMINATION} == {signal.SIG_IGN}
