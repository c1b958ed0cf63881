"""Motions recorded from a simulated cell through all real processes, in lock-step.

Each test judges the motion of the simulated axes and not the calls that were made.
"""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np
import pytest

from acquisition.journal.cycle_row import row_struct
from acquisition.journal.cycles import Journal, read_journal
from acquisition.journal.mcap_writer import is_being_written
from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.motion.samples import MotionSamples, Phase
from acquisition.runs.folder import RunFolder
from acquisition.session.outcome import RecordOutcome
from acquisition.session.record import record_motion
from acquisition.session.repair import repair_journal
from acquisition.supervision.stop_reason import StopCode
from acquisition.task.control_block import ControlBlock
from acquisition.task.states import TaskProgress, TaskState
from config.errors import ConfigError, PreflightError, RecordingError
from config.load import LoadedCell, load_cell
from mock_hw.cell import SimulatedCell
from mock_hw.simulation import CellSimulation
from tests.builders.raised_codes import raises_code
from tests.builders.recording_program import RECORD

pytestmark = pytest.mark.slow

PATIENCE_S = 120.0
RAMP_S = 0.25


@pytest.fixture(scope="module")
def loaded() -> LoadedCell:
    return load_cell("ir361")


@pytest.fixture(scope="module")
def simulated(loaded: LoadedCell) -> Iterator[SimulatedCell]:
    assert loaded.plant is not None
    with SimulatedCell(
        CellSimulation(loaded.config, loaded.robot, loaded.plant, realtime=False, seed=1)
    ) as cell:
        yield cell


@pytest.fixture
def folder(tmp_path: Path) -> RunFolder:
    return RunFolder.create(tmp_path / "runs", "test")


def fourier(loaded: LoadedCell, periods: int) -> FourierMotion:
    """Return periods of 2 s in which every axis oscillates with an amplitude of 13 degrees."""
    centre = (0.1, -0.15, 0.2)
    joints = tuple(
        FourierJoint(joint=name, offset=offset, sine=(0.2,), cosine=(0.1,))
        for name, offset in zip(loaded.robot.joint_names, centre, strict=True)
    )
    return FourierMotion(
        kind="fourier", robot="ir361", period_s=2.0, periods=periods, ramp_s=1.0, joints=joints
    )


@pytest.fixture
def short(loaded: LoadedCell) -> MotionSamples:
    return fourier(loaded, 2).plan(loaded.robot, loaded.config.cycle_time_s)


@pytest.fixture
def long(loaded: LoadedCell) -> MotionSamples:
    return fourier(loaded, 500).plan(loaded.robot, loaded.config.cycle_time_s)


Record = Callable[..., RecordOutcome]


@pytest.fixture
def record(simulated: SimulatedCell, loaded: LoadedCell, folder: RunFolder) -> Record:
    def call(
        samples: MotionSamples, on_progress: Callable[[TaskProgress], None] | None = None
    ) -> RecordOutcome:
        return record_motion(simulated.cell, loaded.robot, samples, folder, on_progress=on_progress)

    return call


def in_mid_motion(act: Callable[[], None]) -> Callable[[TaskProgress], None]:
    """Return a function that calls `act` at each progress report from the main phase on."""

    def on_progress(progress: TaskProgress) -> None:
        if progress.phase >= Phase.MAIN:
            act()

    return on_progress


def kill(name: str) -> None:
    for process in multiprocessing.active_children():
        if name in process.name and process.pid is not None:
            os.kill(process.pid, signal.SIGKILL)


def assert_at_rest(simulated: SimulatedCell) -> None:
    axes = simulated.axes()
    assert not axes.enabled.any()
    np.testing.assert_allclose(axes.velocity, 0.0, atol=1e-6)


def wait_for(condition: Callable[[], bool]) -> None:
    until_s = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < until_s, "the condition was not met in time"
        os.sched_yield()


def at_rest(simulated: SimulatedCell) -> bool:
    axes = simulated.axes()
    return not axes.enabled.any() and float(np.abs(axes.velocity).max()) < 1e-6


def test_a_complete_motion_is_recorded(
    record: Record, short: MotionSamples, simulated: SimulatedCell, folder: RunFolder
) -> None:
    reports: list[TaskProgress] = []
    outcome = record(short, reports.append)
    assert outcome.complete
    assert outcome.notes == ()
    assert outcome.statistics.overruns == 0
    assert outcome.statistics.missed_frames == (0, 0, 0)
    journal = read_journal(outcome.path)
    assert journal.damage.notes == ()
    assert journal.header.run_id == folder.run_id
    recording = journal.recording()
    streamed = recording.sample_index >= 0
    assert recording.sample_index[streamed].tolist() == list(range(len(short)))
    assert recording.valid.all()
    assert recording.target_position is not None
    assert np.abs(recording.target_position - recording.position).max() < 0.02
    assert {progress.state for progress in reports} >= {TaskState.MOVING, TaskState.FINISHED}
    assert_at_rest(simulated)


def test_the_outcome_states_if_power_off_was_confirmed(
    record: Record, short: MotionSamples
) -> None:
    def look(progress: TaskProgress) -> None:
        off[progress.state] = next(ControlBlock.all_of_process(os.getpid())).task.power_off

    off: dict[TaskState, bool] = {}
    record(short, look)
    assert (off[TaskState.MOVING], off[TaskState.FINISHED]) == (False, True)


@pytest.mark.fault(19)
@pytest.mark.fault(20)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_five_interrupts_stop_the_motion_once_and_the_file_is_closed(
    record: Record,
    long: MotionSamples,
    simulated: SimulatedCell,
    number: signal.Signals,
    measured: Callable[[str], None],
) -> None:
    sent: list[int] = []

    def interrupt() -> None:
        if len(sent) < 5:
            sent.append(time.time_ns())
            os.kill(os.getpid(), number)

    outcome = record(long, in_mid_motion(interrupt))
    assert sent
    closed_s = 1e-9 * (outcome.path.stat().st_mtime_ns - sent[0])
    assert -0.02 < closed_s < PATIENCE_S  # a file's time has the resolution of the kernel's tick
    assert outcome.interrupted_by is number
    assert outcome.stop is not None
    assert outcome.stop.code is StopCode.INTERRUPTED
    assert read_journal(outcome.path).damage.notes == ()
    assert_at_rest(simulated)
    measured(f"{number.name} 5 times: at rest, file closed {1e3 * closed_s:.0f} ms after the first")


@pytest.mark.fault(21)
def test_a_killed_recorder_stops_the_motion_and_its_file_stays_readable(
    record: Record, long: MotionSamples, simulated: SimulatedCell, measured: Callable[[str], None]
) -> None:
    outcome = record(long, in_mid_motion(lambda: kill("recorder")))
    assert outcome.stop is not None
    assert outcome.stop.code is StopCode.RECORDER
    assert outcome.rows > 100
    assert any("not closed" in note for note in outcome.notes)
    assert_at_rest(simulated)
    measured("quick stop, axes at rest, file readable")


@pytest.fixture
def small_disk(new_python_processes: None) -> Iterator[None]:
    """Limit the size of the child processes' files to 1 MB."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000, hard))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.fault(24)
@pytest.mark.usefixtures("small_disk")
def test_a_full_disk_stops_the_motion_and_the_written_rows_stay_readable(
    record: Record, long: MotionSamples, simulated: SimulatedCell, measured: Callable[[str], None]
) -> None:
    outcome = record(long)
    assert outcome.stop is not None
    assert outcome.stop.code is StopCode.RECORDER
    assert "cannot be written" in outcome.stop.text
    assert outcome.rows > 0.95 * 1_000_000 / (row_struct(3).size + 35 + 16)  # one write is lost
    assert_at_rest(simulated)
    measured(f"quick stop, axes at rest, {outcome.rows} rows readable")


@pytest.mark.fault(18)
def test_a_killed_task_is_reported_and_the_drives_stop_by_themselves(
    record: Record, long: MotionSamples, simulated: SimulatedCell, measured: Callable[[str], None]
) -> None:
    outcome = record(long, in_mid_motion(lambda: kill("cyclic task")))
    assert outcome.stop is not None
    assert outcome.stop.code is StopCode.TASK_DIED
    assert read_journal(outcome.path).damage.finished
    wait_for(lambda: at_rest(simulated))
    measured("the drives stop by themselves, file closed")


def test_an_error_in_the_program_stops_the_motion_at_once(
    record: Record, long: MotionSamples, simulated: SimulatedCell, folder: RunFolder
) -> None:
    def fail(progress: TaskProgress) -> None:
        if progress.phase == Phase.MAIN:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        record(long, fail)
    assert_at_rest(simulated)
    assert read_journal(folder.file("recording.mcap")).damage.finished


class Start(Protocol):
    """Start a separate program; its robot moves when the `with` block begins."""

    def __call__(
        self, *, alone: bool = False
    ) -> contextlib.AbstractContextManager[subprocess.Popen[str]]: ...


@pytest.fixture
def start(simulated: SimulatedCell, loaded: LoadedCell, folder: RunFolder) -> Start:
    texts = (
        simulated.cell.model_dump_json(),
        loaded.robot.model_dump_json(),
        fourier(loaded, 500).model_dump_json(),
        str(folder.path),
    )

    @contextlib.contextmanager
    def begin(*, alone: bool = False) -> Iterator[subprocess.Popen[str]]:
        with subprocess.Popen(
            [sys.executable, "-c", RECORD, json.dumps(texts)],
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=alone,
        ) as program:
            assert program.stdout is not None
            assert program.stdout.readline() == "moving\n"
            yield program

    return begin


@pytest.mark.fault(19)
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_terminated_program_closes_its_file_before_it_ends(
    start: Start,
    simulated: SimulatedCell,
    folder: RunFolder,
    number: signal.Signals,
    measured: Callable[[str], None],
) -> None:
    with start() as program:
        sent_ns = time.time_ns()
        program.send_signal(number)
        assert program.wait(PATIENCE_S) == 0
    path = folder.file("recording.mcap")
    closed_s = 1e-9 * (path.stat().st_mtime_ns - sent_ns)
    assert -0.02 < closed_s < PATIENCE_S
    journal = read_journal(path)
    assert journal.damage.notes == ()
    moving = np.flatnonzero(np.abs(journal.rows["velocity_command"]).max(axis=1) > 0.0)
    stop = journal.rows[int(moving[-1]) + 1 :]
    assert stop["time_s"][-1] - stop["time_s"][0] < RAMP_S + 0.1
    assert_at_rest(simulated)
    measured(
        f"a separate program, {number.name}: at rest, file closed {1e3 * closed_s:.0f} ms later"
        " (lock-step: the ramp takes no time)"
    )


@pytest.fixture
def killed(start: Start) -> Iterator[int]:
    """Return the process id of a program that was killed with SIGKILL during its motion."""
    with start() as program:
        program.kill()
        yield program.pid


def test_a_killed_program_leaves_the_axes_at_rest_and_a_complete_recording(
    killed: int, simulated: SimulatedCell, folder: RunFolder
) -> None:
    wait_for(lambda: at_rest(simulated))

    def closed() -> bool:
        return read_journal(folder.file("recording.mcap")).damage.finished

    wait_for(closed)
    journal: Journal = read_journal(folder.file("recording.mcap"))
    assert journal.damage.notes == ()
    moving = np.abs(journal.rows["velocity_command"]).max(axis=1) > 0.0
    last_command = int(np.flatnonzero(moving)[-1])
    stop = journal.rows[last_command + 1 :]
    assert stop["time_s"][-1] - stop["time_s"][0] < RAMP_S + 0.1
    assert not list(Path("/dev/shm").glob(f"pym-{killed}-*"))


@pytest.mark.fault(18)
def test_killing_all_processes_leaves_the_axes_at_rest_and_a_recoverable_recording(
    start: Start,
    simulated: SimulatedCell,
    folder: RunFolder,
    tmp_path: Path,
    measured: Callable[[str], None],
) -> None:
    with start(alone=True) as program:
        started = Path(f"/proc/{program.pid}/task/{program.pid}/children").read_text().split()
        for pid in [*map(int, started), program.pid]:  # task, recorder and program
            os.kill(pid, signal.SIGKILL)
        program.wait()
        wait_for(lambda: at_rest(simulated))
        wait_for(lambda: not is_being_written(folder.file("recording.mcap")))
    timeout_ms = simulated.cell.drive_safety.master_heartbeat_timeout_ms
    assert timeout_ms <= 100
    repair = repair_journal(folder.file("recording.mcap"), tmp_path / "new.mcap")
    assert repair.kept_rows > 100
    assert repair.lost_rows == 0
    measured(f"axes at rest by the drives' heartbeat timeout ({timeout_ms} ms) and ramp")


def test_a_motion_of_another_cycle_time_or_beyond_the_limits_moves_nothing(
    record: Record, loaded: LoadedCell, short: MotionSamples, folder: RunFolder
) -> None:
    faster = replace(short, sample_period_s=0.004)
    with raises_code(ConfigError, "RID-MOTION-CYCLE"):
        record(faster)
    wider = MotionSamples(
        short.joint_names, 0.008, short.position * 20.0, short.velocity * 20.0,
        short.acceleration * 20.0, short.phase,
    )  # fmt: skip
    with raises_code(PreflightError, "RID-MOTION-LIMIT"):
        record(wider)
    assert not folder.file("recording.mcap").exists()


def test_nothing_moves_if_nothing_can_be_recorded(
    record: Record, short: MotionSamples, simulated: SimulatedCell, folder: RunFolder
) -> None:
    before = simulated.axes().position
    folder.file("recording.mcap").write_bytes(b"here already")
    with raises_code(RecordingError, "RID-OUTPUT-EXISTS", "recording.mcap"):
        record(short)
    np.testing.assert_allclose(simulated.axes().position, before, atol=1e-6)


def test_nothing_moves_on_a_full_disk(
    record: Record, short: MotionSamples, monkeypatch: pytest.MonkeyPatch, folder: RunFolder
) -> None:
    monkeypatch.setattr("acquisition.session.record.FREE_BYTES", 1 << 60)
    with raises_code(RecordingError, "RID-SYSTEM-DISK-FULL", f"{1 << 40} MB"):
        record(short)
