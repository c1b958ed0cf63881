"""The bundled six-axis cell in lock-step with all its processes: motion, temperature, payload.

The plant uses Pinocchio in motor coordinates; the estimators use our model in joint coordinates.
Without the coupling matrix of the wrist, the identified friction is wrong.
"""

from __future__ import annotations

import json
import multiprocessing
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.journal.cycles import read_journal
from acquisition.journal.monitor import (
    MONITOR,
    MonitorStream,
    read_monitor,
    read_run_temperatures,
    with_temperature_compensation,
)
from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.motion.samples import Phase
from acquisition.processing.periods import average_periods
from acquisition.recording.recording import Recording
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from acquisition.session.outcome import RecordOutcome
from acquisition.session.record import record_motion
from acquisition.task.states import TaskProgress
from config.cell.cell import CellConfig
from config.errors import ConfigError, TransportError
from config.load import LoadedCell, load_cell, to_yaml
from config.robot.robot import RobotDescription
from config.simulation.faults import FaultScript, RegisterFault
from dynamics.model.robot_model import RobotModel
from dynamics.model.true_parameters import true_parameters
from identification.estimation.fitted_periods import fit_periodic
from mock_hw.cell import SimulatedCell
from mock_hw.simulation import CellSimulation
from rid_daq.app import run
from rid_daq.runs.run_data import RunData
from tests.builders.raised_codes import raises_code

pytestmark = pytest.mark.slow

HARMONICS: dict[str, tuple[float, list[float], list[float]]] = {
    "axis1": (
        0.0,
        [0.44502, -0.27863, 0.03039, -0.03095, -0.01974],
        [-0.04701, -0.22023, -0.01686, -0.04716, 0.14491],
    ),
    "axis2": (
        0.3,
        [0.07973, -0.06226, -0.03311, -0.05897, -0.07452],
        [-0.138, 0.08509, -0.02808, 0.08455, -0.01411],
    ),
    "axis3": (
        -0.4,
        [0.00447, 0.14236, 0.03347, -0.02326, -0.00674],
        [0.09956, 0.17821, -0.01655, -0.01122, 0.03692],
    ),
    "axis4": (
        0.2,
        [-0.32814, -0.05399, 0.1089, 0.05371, 0.00678],
        [0.24805, -0.52345, 0.12602, -0.08881, -0.12353],
    ),
    "axis5": (
        0.4,
        [0.16148, 0.2046, -0.0866, -0.15719, 0.00305],
        [-0.03081, 0.41052, 0.14553, 0.0283, 0.12987],
    ),
    "axis6": (
        0.0,
        [-0.15832, -0.35663, 0.14998, 0.11219, -0.0331],
        [0.59, 0.31, -0.21, 0.05, 0.07],
    ),
}


def motion(periods: int, amplitude_ratio: float = 1.0, period_s: float = 9.6) -> FourierMotion:
    joints = [
        FourierJoint(
            joint=name,
            offset=offset,
            sine=tuple(amplitude_ratio * value for value in sine),
            cosine=tuple(amplitude_ratio * value for value in cosine),
        )
        for name, (offset, sine, cosine) in HARMONICS.items()
    ]
    return FourierMotion(
        kind="fourier",
        robot="kr15",
        period_s=period_s,
        periods=periods,
        transient_periods=1 if periods > 1 else 0,
        joints=tuple(joints),
    )


def record(
    loaded: LoadedCell,
    cell: CellConfig,
    requested: FourierMotion,
    path: Path,
    watch: Callable[[TaskProgress], None] | None = None,
) -> tuple[RecordOutcome, RunFolder]:
    samples = requested.plan(loaded.robot, cell.cycle_time_s)
    folder = RunFolder.create(path, "test", software={})
    folder.write("robot.yaml", loaded.files["robot.yaml"])
    outcome = record_motion(cell, loaded.robot, samples, folder, on_progress=watch)
    folder.finish(RunStatus.COMPLETE)
    return outcome, folder


def faster_cell(loaded: LoadedCell, cycle_time_ms: int, **changes: Any) -> CellConfig:
    """Return the cell with a shorter cycle and a drive monitor that reads more often."""
    assert loaded.config.monitor is not None
    monitor = loaded.config.monitor.model_copy(update={"period_s": 0.5, **changes})
    return loaded.config.model_copy(update={"cycle_time_ms": cycle_time_ms, "monitor": monitor})


@pytest.fixture(scope="module")
def loaded() -> LoadedCell:
    return load_cell("kr15")


@pytest.fixture(scope="module")
def wrist(loaded: LoadedCell) -> RobotDescription:
    """Return the robot with a wrist coupling of 0.2 and more."""
    coupling = np.eye(6)
    coupling[4, 3], coupling[5, 3], coupling[5, 4] = 0.25, -0.20, -0.35
    rows = tuple(tuple(row) for row in coupling.tolist())
    return loaded.robot.model_copy(update={"coupling": rows})


@pytest.fixture(scope="module")
def excited(
    loaded: LoadedCell,
    wrist: RobotDescription,
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[RecordOutcome, Recording, MonitorStream]:
    """Return four periods of an excitation on a robot without unmodelled effects."""
    assert loaded.plant is not None
    with SimulatedCell(
        CellSimulation(loaded.config, wrist, loaded.plant, realtime=False, seed=4, unmodelled=False)
    ) as simulated:
        path = tmp_path_factory.mktemp("runs")
        outcome, folder = record(replace(loaded, robot=wrist), simulated.cell, motion(4), path)
    recording = read_journal(outcome.path).recording()
    stream, notes = read_run_temperatures(recording, folder.path)
    assert stream is not None
    assert notes == ()
    recording = replace(recording, temperature_k=stream.temperatures_at(recording.time_s))
    return outcome, recording, stream


class TestACoupledRobot:
    def test_it_follows_its_motion(
        self, excited: tuple[RecordOutcome, Recording, MonitorStream]
    ) -> None:
        outcome, recording, _ = excited
        assert outcome.stop is None
        assert outcome.statistics.to_dict()["overruns"] == 0
        assert recording.target_position is not None
        error = np.abs(recording.position - recording.target_position)
        assert error[recording.phase == Phase.MAIN].max() < 0.02

    def test_its_parameters_are_identified(
        self,
        loaded: LoadedCell,
        wrist: RobotDescription,
        excited: tuple[RecordOutcome, Recording, MonitorStream],
    ) -> None:
        assert loaded.plant is not None
        _, recording, _ = excited
        estimate = fit_periodic(wrist, [average_periods(recording)]).estimate()
        model = RobotModel.from_description(wrist)
        truth = true_parameters(model, wrist, loaded.plant)
        deviation = (estimate.values - estimate.base.from_standard(truth)) / estimate.sigma
        assert np.mean(np.abs(deviation) < 2.0) >= 0.85
        assert np.abs(deviation).max() < 5.0
        friction = [name.startswith(("fc_", "fv_")) for name in estimate.base.names]
        assert sum(friction) == 12
        expected = estimate.base.from_standard(truth)[friction]
        np.testing.assert_allclose(estimate.values[friction], expected, rtol=0.05)

    def test_identification_without_its_coupling_matrix_differs(
        self,
        loaded: LoadedCell,
        wrist: RobotDescription,
        excited: tuple[RecordOutcome, Recording, MonitorStream],
    ) -> None:
        """The friction of at least one joint is then wrong by more than 50 %."""
        assert loaded.plant is not None
        _, recording, _ = excited
        blind = wrist.model_copy(update={"coupling": None})
        estimate = fit_periodic(blind, [average_periods(recording)]).estimate()
        model = RobotModel.from_description(blind)
        truth = estimate.base.from_standard(true_parameters(model, blind, loaded.plant))
        friction = [name.startswith(("fc_", "fv_")) for name in estimate.base.names]
        assert np.abs(estimate.values[friction] / truth[friction] - 1.0).max() > 0.5


class TestTheMonitor:
    def test_its_stream_covers_the_recording(
        self,
        loaded: LoadedCell,
        excited: tuple[RecordOutcome, Recording, MonitorStream],
    ) -> None:
        _, recording, stream = excited
        assert loaded.config.monitor is not None
        period_s = loaded.config.monitor.period_s
        np.testing.assert_allclose(np.diff(stream.time_s), period_s, atol=0.013)
        assert stream.time_s[0] == recording.time_s[0]
        assert recording.time_s[-1] - stream.time_s[-1] <= period_s + 0.013
        assert stream.valid.all()
        # the drives' clocks also run on simulated time
        clock_errors_s = np.diff(stream.operating_time_s, axis=0) - np.diff(stream.time_s)[:, None]
        assert np.abs(clock_errors_s).max() < 0.02

    def test_motors_stay_cold_without_unmodelled_effects(
        self, excited: tuple[RecordOutcome, Recording, MonitorStream]
    ) -> None:
        _, recording, _ = excited
        assert recording.temperature_k is not None
        np.testing.assert_allclose(recording.temperature_k, 298.15, atol=0.06)


def fast_cell(loaded: LoadedCell) -> SimulatedCell:
    assert loaded.plant is not None
    return SimulatedCell(
        CellSimulation(
            faster_cell(loaded, 4),
            loaded.robot,
            loaded.plant,
            realtime=False,
            seed=9,
            faults=FaultScript(registers=(RegisterFault(kind="silent", at_request=4),)),
        )
    )


@pytest.fixture(scope="module")
def session(
    loaded: LoadedCell, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[SimulatedCell, list[tuple[RecordOutcome, RunFolder]]]]:
    """Yield runs without and with a payload; in the first, the monitor misses an answer."""
    path = tmp_path_factory.mktemp("runs")
    with fast_cell(loaded) as simulated:
        runs = [record(loaded, simulated.cell, motion(1, 0.1, 2.0), path)]
        simulated.attach("medium")
        runs.append(record(loaded, simulated.cell, motion(1, 0.1, 2.0), path))
        yield simulated, runs


class TestWarmUpAndPayload:
    def test_motors_are_warmer_in_the_second_run(
        self, session: tuple[SimulatedCell, list[tuple[RecordOutcome, RunFolder]]]
    ) -> None:
        simulated, runs = session
        first, second = (RunData.load(folder).recording for _, folder in runs)
        assert first.temperature_k is not None
        assert second.temperature_k is not None
        assert first.temperature_k[0].max() < 299.0
        assert np.all(second.temperature_k[-1] > first.temperature_k[-1])
        np.testing.assert_allclose(
            second.temperature_k[-1], simulated.axes().temperature_k, atol=0.5
        )

    def test_the_payload_changes_the_mean_torques(
        self, session: tuple[SimulatedCell, list[tuple[RecordOutcome, RunFolder]]]
    ) -> None:
        _, runs = session
        means = [
            recording.torque_nm[recording.phase == Phase.MAIN].mean(axis=0)
            for recording in (RunData.load(folder).recording for _, folder in runs)
        ]
        change = means[1] - means[0]
        assert abs(change[1]) > 60.0
        assert abs(change[2]) > 40.0

    def test_torques_are_computed_with_torque_constants_at_motor_temperature(
        self, loaded: LoadedCell, session: tuple[SimulatedCell, list[Any]]
    ) -> None:
        _, runs = session
        outcome, folder = runs[1]
        raw = read_journal(outcome.path).recording()
        read = RunData.load(folder).recording
        assert read.temperature_k is not None
        np.testing.assert_allclose(
            read.torque_nm, raw.torque_nm * (1.0 - 0.001 * (read.temperature_k - 298.15))
        )
        assert with_temperature_compensation(raw, None, loaded.robot) is raw

    def test_equal_seeds_give_equal_recordings(
        self,
        loaded: LoadedCell,
        session: tuple[SimulatedCell, list[tuple[RecordOutcome, RunFolder]]],
        tmp_path: Path,
    ) -> None:
        _, runs = session
        with fast_cell(loaded) as again:
            outcome, folder = record(loaded, again.cell, motion(1, 0.1, 2.0), tmp_path)
        np.testing.assert_array_equal(
            read_journal(outcome.path).rows["torque_raw"],
            read_journal(runs[0][0].path).rows["torque_raw"],
        )
        ours, first = (read_monitor(each.file(MONITOR)) for each in (folder, runs[0][1]))
        np.testing.assert_array_equal(ours.time_s, first.time_s)
        np.testing.assert_array_equal(ours.temperature_k, first.temperature_k)

    def test_an_unknown_payload_is_refused(
        self, session: tuple[SimulatedCell, list[tuple[RecordOutcome, RunFolder]]]
    ) -> None:
        simulated, _ = session
        with raises_code(ConfigError, "RID-PLANT-UNFIT", "'huge'"):
            simulated.attach("huge")
        with raises_code(TransportError, "RID-API-ARGUMENT"):
            SimulatedCell.attach(
                SimulatedCell(simulated.simulation),
                "small",
            )


class TestMissingTemperatures:
    def test_one_missing_answer_marks_one_temperature(
        self, session: tuple[SimulatedCell, list[tuple[RecordOutcome, RunFolder]]]
    ) -> None:
        _, runs = session
        (first, folder), (second, _) = runs
        assert first.complete
        assert any("temperatures: 1; last problem" in note for note in first.notes)
        assert second.notes == ()
        stream = read_monitor(folder.file(MONITOR))
        assert not stream.valid[0, 4]
        assert stream.valid.sum() == stream.valid.size - 1

    def test_an_unreachable_or_killed_monitor_does_not_stop_the_motion(
        self, loaded: LoadedCell, tmp_path: Path
    ) -> None:
        killed: list[int] = []

        def kill_monitor(progress: TaskProgress) -> None:
            for child in multiprocessing.active_children():
                if progress.temperature_k and "monitor" in child.name and not killed:
                    killed.append(child.pid or 0)
                    child.kill()

        with fast_cell(loaded) as simulated:
            cell = simulated.cell
            assert cell.monitor is not None
            link = cell.monitor.link.model_copy(update={"port": 1})
            nobody = cell.model_copy(
                update={"monitor": cell.monitor.model_copy(update={"link": link})}
            )
            requested = motion(1, 0.1, 2.0)
            without, folder = record(loaded, nobody, requested, tmp_path)
            dead, _ = record(loaded, cell, requested, tmp_path, kill_monitor)
        assert without.complete
        assert any("cannot be opened" in note for note in without.notes)
        assert not folder.file(MONITOR).exists()
        assert RunData.load(folder).recording.temperature_k is None
        assert dead.complete
        assert killed
        assert any(
            "the process that reads the drives' temperatures has died" in note
            for note in dead.notes
        )


def test_check_reads_the_temperature_of_every_motor(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", "kr15", "--seconds", "0.2", "--json"]) == 0
    lines = json.loads(capsys.readouterr().out)["lines"]
    temperatures = [line for line in lines if line["what"] == "motor temperature [°C]"]
    assert [line["found"] for line in temperatures] == ["25.0"] * 6
    constants = [line for line in lines if line["what"].startswith("torque constant")]
    assert [line["verdict"] for line in constants] == ["ok"] * 6


def test_record_mounts_a_payload(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "motion.yaml"
    path.write_text(to_yaml(motion(1, 0.1, 2.4)))
    runs = ["--runs", str(tmp_path / "runs")]
    assert run(["record", "kr15", str(path), "--payload", "huge", *runs]) == 2
    assert "RID-PLANT-UNFIT" in capsys.readouterr().err
    assert run(["record", "kr15", str(path), "--payload", "small", "--json", *runs]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (Path(document["folder"]) / MONITOR).exists()
    assert (Path(document["folder"]) / "drives.yaml").exists()
    assert (
        run(["record", "kr15", str(path), "--payload", "small", "--mounted", "small", *runs]) == 2
    )
    assert "RID-OPTION-EXCLUSIVE" in capsys.readouterr().err
