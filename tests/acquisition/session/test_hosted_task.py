"""The cyclic task in the process of a lock-step cell.

It records the same bytes as in a process of its own; interrupts and failures stop the motion.
"""

from __future__ import annotations

import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from acquisition.journal.cycle_reader import CycleReader
from acquisition.journal.cycles import read_journal
from acquisition.journal.plate import PLATE_RECORDING, read_plate_journal
from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.motion.samples import Phase
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RECORDING
from acquisition.session.outcome import RecordOutcome
from acquisition.session.record import (
    SIMULATION_ENDED,
    DeviceProfiles,
    MotionContext,
    record_motion,
)
from acquisition.supervision.stop_reason import StopCode
from acquisition.task.states import TaskProgress
from config.errors import TransportError
from config.load import LoadedCell, load_cell
from config.simulation.faults import FaultScript, ProcessKill
from mock_hw.cell import SimulatedCell
from mock_hw.simulation import CellSimulation
from tests.builders.raised_codes import raises_code

pytestmark = pytest.mark.slow

PATIENCE_S = 120.0


@pytest.fixture(scope="module")
def loaded() -> LoadedCell:
    return load_cell("ir361")


def simulation(loaded: LoadedCell, log: Path | None = None) -> CellSimulation:
    assert loaded.plant is not None
    return CellSimulation(
        loaded.config, loaded.robot, loaded.plant, realtime=False, seed=1, log=log
    )


def motion(loaded: LoadedCell, periods: int) -> FourierMotion:
    joints = tuple(
        FourierJoint(joint=name, offset=offset, sine=(0.2,), cosine=(0.1,))
        for name, offset in zip(loaded.robot.joint_names, (0.1, -0.15, 0.2), strict=True)
    )
    return FourierMotion(
        kind="fourier", robot="ir361", period_s=2.0, periods=periods, ramp_s=1.0, joints=joints
    )


def record(
    simulated: SimulatedCell,
    loaded: LoadedCell,
    folder: RunFolder,
    *,
    hosted: bool,
    periods: int = 2,
    on_progress: Callable[[TaskProgress], None] | None = None,
    plate: bool = False,
) -> RecordOutcome:
    return record_motion(
        simulated.cell,
        loaded.robot,
        motion(loaded, periods).plan(loaded.robot, simulated.cell.cycle_time_s),
        folder,
        on_progress=on_progress,
        profiles=DeviceProfiles(loaded.amplifier_profile if plate else None),
        context=MotionContext(task=simulated.create_master if hosted else None),
    )


@pytest.mark.parametrize("plate", [False, True])
def test_recordings_and_bus_are_equal_byte_for_byte_to_those_of_the_processes(
    loaded: LoadedCell, tmp_path: Path, plate: bool
) -> None:
    folder = RunFolder.create(tmp_path / "hosted", "test")
    same = tmp_path / "processes" / folder.path.name
    shutil.copytree(folder.path, same)
    folders = {True: folder, False: RunFolder.open(same)}
    for hosted, each in folders.items():
        log = tmp_path / f"{hosted}.log"
        with SimulatedCell(simulation(loaded, log)) as simulated:
            outcome = record(simulated, loaded, each, hosted=hosted, plate=plate)
        assert outcome.complete
        assert outcome.notes == ()
    # after the motion, simulated time follows real time: the last heartbeats are not compared
    logs = [(tmp_path / f"{hosted}.log").read_text().splitlines() for hosted in (True, False)]
    compared = min(map(len, logs))
    assert compared > 5000
    assert logs[0][:compared] == logs[1][:compared]
    assert recorded_rows(folder) == recorded_rows(folders[False])
    if plate:
        plates = [read_plate_journal(each.file(PLATE_RECORDING)).rows for each in folders.values()]
        compared = min(map(len, plates))
        assert compared > 1000
        assert plates[0][:compared].tobytes() == plates[1][:compared].tobytes()


def recorded_rows(folder: RunFolder) -> bytes:
    """Return the rows of a recording; its blocks depend on the computer's clock."""
    with CycleReader(folder.file(RECORDING)) as reader:
        return b"".join(rows.tobytes() for rows in reader.rows())


@pytest.fixture
def simulated(loaded: LoadedCell) -> Iterator[SimulatedCell]:
    with SimulatedCell(simulation(loaded)) as cell:
        yield cell


@pytest.fixture
def folder(tmp_path: Path) -> RunFolder:
    return RunFolder.create(tmp_path / "runs", "test")


def assert_at_rest(simulated: SimulatedCell) -> None:
    axes = simulated.axes()
    assert not axes.enabled.any()
    np.testing.assert_allclose(axes.velocity, 0.0, atol=1e-6)


def test_an_interrupt_stops_the_motion_and_the_next_motion_runs_in_the_same_process(
    simulated: SimulatedCell, loaded: LoadedCell, folder: RunFolder, tmp_path: Path
) -> None:
    def interrupt(progress: TaskProgress) -> None:
        if progress.phase == Phase.MAIN:
            os.kill(os.getpid(), signal.SIGINT)

    outcome = record(simulated, loaded, folder, hosted=True, periods=500, on_progress=interrupt)
    assert outcome.stop is not None
    assert outcome.stop.code is StopCode.INTERRUPTED
    assert_at_rest(simulated)
    following = RunFolder.create(tmp_path / "runs", "next")
    assert record(simulated, loaded, following, hosted=True).complete
    assert_at_rest(simulated)


def test_an_error_in_the_task_is_reported_and_the_process_continues(
    simulated: SimulatedCell, loaded: LoadedCell, folder: RunFolder
) -> None:
    failing = simulated.create_master(time.sleep, (-1.0,))
    failing.start()
    failing.join(PATIENCE_S)
    assert failing.exitcode == 1
    assert record(simulated, loaded, folder, hosted=True).complete


def test_a_killed_process_ends_the_motion(
    simulated: SimulatedCell, loaded: LoadedCell, folder: RunFolder
) -> None:
    def kill(progress: TaskProgress) -> None:
        if progress.phase == Phase.MAIN:
            simulated.create_master(time.sleep, ()).kill()

    outcome = record(simulated, loaded, folder, hosted=True, periods=500, on_progress=kill)
    assert outcome.stop is not None
    assert outcome.stop.code is StopCode.TASK_DIED
    assert read_journal(outcome.path).damage.finished


def test_a_hung_process_is_killed_and_reported(
    simulated: SimulatedCell,
    loaded: LoadedCell,
    folder: RunFolder,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("acquisition.session.record.BEAT_PATIENCE_S", 2.0)

    (host,) = multiprocessing.active_children()

    def suspend(progress: TaskProgress) -> None:
        if progress.phase == Phase.MAIN and host.pid is not None and host.is_alive():
            os.kill(host.pid, signal.SIGSTOP)

    outcome = record(simulated, loaded, folder, hosted=True, periods=500, on_progress=suspend)
    assert outcome.stop is not None
    assert outcome.stop.code is StopCode.TASK_DIED
    assert "2 s" in outcome.stop.text
    assert outcome.stop.text.endswith(SIMULATION_ENDED)
    assert read_journal(outcome.path).damage.finished
    following = RunFolder.create(tmp_path / "runs", "next")
    with raises_code(TransportError, "RID-SYSTEM-PROCESS-DIED"):
        record(simulated, loaded, following, hosted=True)


PROGRAM = """
import json, sys
from pathlib import Path
from acquisition.motion.samples import Phase
from acquisition.runs.folder import RunFolder
from config.load import load_cell
from mock_hw.cell import SimulatedCell
from tests.acquisition.session.test_hosted_task import record, simulation

def say(progress):
    if progress.phase == Phase.MAIN:
        print("moving", flush=True)

if __name__ == "__main__":
    loaded = load_cell("ir361")
    with SimulatedCell(simulation(loaded)) as simulated:
        folder = RunFolder.open(Path(sys.argv[1]))
        record(simulated, loaded, folder, hosted=True, periods=500, on_progress=say)
"""


def test_the_motion_of_a_killed_program_stops(folder: RunFolder, tmp_path: Path) -> None:
    script = tmp_path / "program.py"
    script.write_text(PROGRAM)
    command = [sys.executable, str(script), str(folder.path)]
    environment = os.environ | {"PYTHONPATH": str(Path(__file__).parents[3])}
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment, text=True) as program:
        assert program.stdout is not None
        assert program.stdout.readline() == "moving\n"
        program.kill()
        program.stdout.read()  # ends with the last process that the program started
    journal = read_journal(folder.file(RECORDING))
    assert journal.damage.finished
    rows = journal.recording()
    assert np.abs(np.diff(rows.position[-3:], axis=0)).max() < 1e-5
    assert len(rows.time_s) < 125_000


def test_real_time_and_faults_of_the_program_keep_the_processes(loaded: LoadedCell) -> None:
    fault = ProcessKill(kind="kill", process="task", at_s=1.0)
    plain = simulation(loaded)
    for changed in ({"realtime": True}, {"faults": FaultScript(program=(fault,))}):
        values = {**plain.__dict__, **changed}
        with SimulatedCell(CellSimulation(**values)) as simulated:
            assert not simulated.runs_masters
            with raises_code(TransportError, "RID-API-ARGUMENT"):
                simulated.create_master(time.sleep, ())
