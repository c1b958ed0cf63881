"""A motion recorded together with the force plate, on the simulated cell in lock-step."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from acquisition.journal.cycles import read_journal
from acquisition.journal.plate import PLATE_RECORDING, PlateRows, read_plate_journal
from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.motion.samples import Phase
from acquisition.runs.folder import RunFolder
from acquisition.session.outcome import RecordOutcome
from acquisition.session.plate_preparation import prepare_plate, read_zero_drift_n
from acquisition.session.record import DeviceProfiles, record_motion
from acquisition.supervision.stop_reason import StopCode
from acquisition.task.states import TaskProgress
from config.errors import PreflightError
from config.load import LoadedCell, load_cell
from config.simulation.faults import AmplifierFault, FaultScript
from drivers.amplifier.amplifier import open_amplifier
from mock_hw.cell import SimulatedCell
from mock_hw.simulation import CellSimulation
from tests.builders.raised_codes import raises_code

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def loaded() -> LoadedCell:
    return load_cell("ir361")


@contextmanager
def served(loaded: LoadedCell, *faults: AmplifierFault) -> Iterator[SimulatedCell]:
    assert loaded.plant is not None
    with SimulatedCell(
        CellSimulation(
            loaded.config,
            loaded.robot,
            loaded.plant,
            realtime=False,
            seed=4,
            amplifier_profile=loaded.amplifier_profile,
            faults=FaultScript(amplifier=faults),
        )
    ) as simulated:
        yield simulated


Record = Callable[..., tuple[RecordOutcome, PlateRows]]


@pytest.fixture
def record(loaded: LoadedCell, tmp_path: Path) -> Record:
    def call(
        simulated: SimulatedCell,
        periods: int = 2,
        on_progress: Callable[[TaskProgress], None] | None = None,
        simulated_flag: bool = True,
    ) -> tuple[RecordOutcome, PlateRows]:
        joints = tuple(
            FourierJoint(joint=name, offset=offset, sine=(0.2,), cosine=(0.1,))
            for name, offset in zip(loaded.robot.joint_names, (0.1, -0.15, 0.2), strict=True)
        )
        motion = FourierMotion(
            kind="fourier", robot="ir361", period_s=2.0, periods=periods, ramp_s=1.0, joints=joints
        )
        samples = motion.plan(loaded.robot, loaded.config.cycle_time_s)
        folder = RunFolder.create(tmp_path / "runs", "test")
        outcome = record_motion(
            simulated.cell.model_copy(update={"simulated": simulated_flag}),
            loaded.robot,
            samples,
            folder,
            profiles=DeviceProfiles(loaded.amplifier_profile),
            on_progress=on_progress,
        )
        return outcome, read_plate_journal(folder.file(PLATE_RECORDING))

    return call


def test_every_row_of_the_motion_is_recorded_at_the_time_of_sync(
    loaded: LoadedCell, record: Record
) -> None:
    with served(loaded) as simulated:
        outcome, rows = record(simulated)
    assert (outcome.stop, outcome.notes) == (None, ())
    sync_s = read_journal(outcome.path).rows["time_s"]
    assert rows.header.simulated_time
    assert (rows.rows_lost, rows.damage.notes) == (0, ())
    assert rows.arrival_s[0] <= sync_s[0]
    assert rows.arrival_s[-1] >= sync_s[-1] - 0.05
    late_s = rows.arrival_s - rows.device_s
    assert np.ptp(late_s - np.polyval(np.polyfit(rows.device_s, late_s, 1), rows.device_s)) < 0.05
    assert rows.operating.all()
    assert not rows.overload.any()
    assert np.ptp(rows.channels_n, axis=0).min() > 1.0


def test_a_lost_plate_line_stops_the_motion(loaded: LoadedCell, record: Record) -> None:
    with served(loaded, AmplifierFault(kind="unplug", row=7000, duration_s=1e5)) as simulated:
        outcome, rows = record(simulated, periods=500)
    assert outcome.stop is not None
    assert outcome.stop.code is StopCode.PLATE_LINE
    assert not simulated_moves(outcome)
    assert len(rows.rows) <= 7000


def simulated_moves(outcome: RecordOutcome) -> bool:
    position = read_journal(outcome.path).rows["position"]
    return bool(np.abs(np.diff(position[-3:], axis=0)).max() > 1e-4)


def test_a_killed_plate_recorder_stops_the_motion(loaded: LoadedCell, record: Record) -> None:
    def kill(progress: TaskProgress) -> None:
        if progress.phase >= Phase.MAIN:
            for process in multiprocessing.active_children():
                if "plate recorder" in process.name and process.pid is not None:
                    os.kill(process.pid, signal.SIGKILL)

    with served(loaded) as simulated:
        outcome, rows = record(simulated, periods=500, on_progress=kill)
    assert outcome.stop is not None
    assert outcome.stop.code is StopCode.PLATE_LINE
    assert any("plate recorder died" in note for note in outcome.notes)
    assert not rows.damage.finished


def test_overloads_in_more_than_three_periods_stop_the_motion_and_name_the_range(
    loaded: LoadedCell, record: Record
) -> None:
    fault = AmplifierFault(kind="overload", row=4000, duration_s=1e5, channel=4)
    with served(loaded, fault) as simulated:
        outcome, rows = record(simulated, periods=500)
    assert outcome.stop is not None
    assert outcome.stop.code is StopCode.PLATE_OVERLOAD
    assert any("fz1 was overloaded; its range is 5000 N" in note for note in outcome.notes)
    full = np.abs(rows.rows["counts"].astype(int)).max(axis=1) >= 32767
    assert np.all(rows.overload[full].any(axis=1))


def test_a_real_plate_in_reset_is_refused_before_any_motion(
    loaded: LoadedCell, record: Record
) -> None:
    with (
        served(loaded) as simulated,
        raises_code(PreflightError, "RID-PLATE-NOT-ZEROED"),
    ):
        record(simulated, simulated_flag=False)


def test_preparation_changes_only_the_settings_that_differ(loaded: LoadedCell) -> None:
    profile = loaded.amplifier_profile
    assert profile is not None
    with served(loaded) as simulated:
        plate = simulated.cell.plate
        assert plate is not None
        first = prepare_plate(plate, profile)
        assert not first.operating
        assert first.changed
        second = prepare_plate(plate, profile, operate=True)
        assert (second.changed, second.operating) == ((), True)
        assert {setting.verdict for setting in second.settings} == {"ok"}
        assert not any(second.overloads)
        third = prepare_plate(plate, profile)
        assert (third.changed, third.operating, third.charge_lost) == ((), True, False)
        assert read_zero_drift_n(plate, profile).shape == (8,)
        with open_amplifier(plate.amplifier, profile) as amplifier:
            assert amplifier.connect() == third.identity
