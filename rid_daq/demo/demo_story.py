"""Workflow of the demo on one simulated robot: record, average, identify, validate, compensate."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.kinds.multipoint import MultipointMotion
from acquisition.motion.motion_file import AnyMotion
from acquisition.motion.samples import MotionSamples
from acquisition.processing.periods import PeriodAverage
from acquisition.runs.folder import RunFolder
from config.errors import ConfigError, SafetyStop
from config.load import LoadedCell, load_cell, to_yaml
from config.robot.robot import RobotDescription
from dynamics.model.true_parameters import true_parameters
from identification.equations.segments import period_signals
from identification.estimation.file import write_estimate
from identification.estimation.fitted_periods import fit_periodic
from identification.estimation.options import EstimationOptions
from identification.validation.period_comparison import compare_period
from identification.validation.presliding_choice import choose_presliding
from identification.validation.torque_prediction import validate_torques
from mock_hw.cell import SimulatedCell
from mock_hw.simulation import CellSimulation
from rid_daq.demo.demo_elastic import ElasticMotions, elastic_cell, run_elastic_chapter
from rid_daq.demo.demo_paths import PathMotions, run_path_chapter
from rid_daq.demo.demo_timing import TimingMotions, run_timing_chapter
from rid_daq.recording.recorded_run import RecordedRun
from rid_daq.recording.run_request import RunRequest
from rid_daq.recording.run_session import RunSession
from rid_daq.report.elastic_path_entry import ElasticPathSection
from rid_daq.report.sections.average import AverageSection
from rid_daq.report.sections.curves import CurvesSection, SpectrumCurves, TorqueCurves
from rid_daq.report.sections.estimate import EstimateSection
from rid_daq.report.sections.retiming import RetimingSection
from rid_daq.report.sections.runs import RunSection
from rid_daq.report.sections.timing import LoopTiming
from rid_daq.report.sections.tracking import TrackingSection
from rid_daq.report.sections.validation import ValidationSection
from rid_daq.runs.run_data import MOTION
from rid_daq.session.session import hold_cell
from rid_daq.terminal.console import Progress
from rid_daq.terminal.job_events import MotionEvent

DEMO_CELL = "ir361"

Show = Callable[[float, str], None]
"""Function that shows the progress: completed seconds of motion, and a word for the present step.
"""


@dataclass(frozen=True)
class Motions:
    """Motions of the demo: the excitation, the validation motion, and paths.

    The timed path comes last. It is executed only if there are paths. The robot without unmodelled
    effects is ready earlier; its process then moves the arm with elastic gears.
    """

    excitation: FourierMotion
    validation: MultipointMotion
    paths: PathMotions | None
    timed: TimingMotions | None
    elastic: ElasticMotions | None


@dataclass(frozen=True)
class Story:
    """Result sections of one simulated robot, and the ids of its runs."""

    runs: tuple[RunSection, ...]
    average: AverageSection
    estimate: EstimateSection
    validation: ValidationSection
    curves: CurvesSection
    tracking: TrackingSection | None
    retiming: RetimingSection | None
    elastic: ElasticPathSection | None
    elastic_runs: tuple[RunSection, ...]
    loops: tuple[LoopTiming, ...]
    run_ids: tuple[str, ...]


def run_story(
    folder: RunFolder, motions: Motions, seed: int, unmodelled: bool, show: Show
) -> Story:
    """Run the workflow on one simulated robot; return the sections of its result.

    Args:
        folder: Run folder of the demo; the runs become folders in it.
        motions: Motions of the demo.
        seed: Random seed of the simulation.
        unmodelled: True if the simulated robot has unmodelled effects.
        show: Function that is called with the progress.

    Raises:
        RidDaqError: A step failed; the message names it.
    """
    loaded = load_cell(DEMO_CELL)
    robot, cell, plant = loaded.robot, loaded.config, loaded.plant
    if plant is None:
        raise ConfigError(
            f"cell {cell.name}: has no key plant, so it cannot be simulated",
            code="RID-CELL-NOT-SIMULATED",
        )
    console = _ProgressConsole(show)
    runs = folder.path / _name(unmodelled)
    simulation = CellSimulation(
        cell,
        robot,
        plant,
        realtime=False,
        seed=seed,
        unmodelled=unmodelled,
        amplifier_profile=loaded.amplifier_profile,
    )
    with SimulatedCell(simulation) as simulated, hold_cell(simulated.cell):
        # without the force plate: only joint torques are used here
        bare = simulated.cell.model_copy(update={"plate": None})
        record = _Recorder(RunSession(loaded, bare, runs, console), console)
        excited = record("excitation", motions.excitation)
        validated = record("validation", motions.validation)
        show(console.done_s, "identifying")
        average = excited.measured.average
        with_presliding = _with_presliding(robot, average)
        estimate = fit_periodic(with_presliding, [average]).estimate(cell_name=cell.name)
        write_estimate(folder.path / f"model_{_name(unmodelled)}.json", estimate)
        chapter = timed = None
        if unmodelled and motions.paths is not None:
            chapter = run_path_chapter(record, motions.paths, robot, cell, estimate, folder)
    if chapter is not None and motions.timed is not None:
        fresh = _FreshCellRecorder(motions.timed.cell_with_robot(loaded), simulation, runs, console)
        timed = run_timing_chapter(fresh, motions.timed, robot, chapter.precompensation, folder)
    bent = None
    if not unmodelled and motions.elastic is not None:
        soft = elastic_cell()
        recorder = partial(_elastic_recorder, soft, seed, folder.path / "elastic", console)
        bent = run_elastic_chapter(recorder, motions.elastic, soft, folder)
    truth = estimate.base.from_standard(true_parameters(estimate.model, robot, plant))
    noise_nm = np.sqrt(average.torque_variance)
    validation = validate_torques(estimate, validated.measured.recording, noise_nm=noise_nm)
    floor = validate_torques(replace(estimate, values=truth), validated.measured.recording)
    period = compare_period(estimate, average)
    return Story(
        runs=(
            *(
                RunSection.of(role, motion.describe(), run.measured.tally, robot)
                for role, motion, run in (
                    ("Excitation", motions.excitation, excited),
                    ("Validation", motions.validation, validated),
                )
            ),
            *(() if chapter is None else chapter.runs),
            *(() if timed is None else timed.runs),
        ),
        average=AverageSection.of(average, robot),
        estimate=EstimateSection.of(estimate, truth),
        validation=ValidationSection.of(
            validation,
            robot,
            f"{motions.validation.points} random points, not used for the estimate.",
            floor.rms_nm,
        ),
        curves=CurvesSection(
            torque=TorqueCurves.of(validation, robot),
            spectrum=SpectrumCurves.of(robot, period, average.periods_kept),
        ),
        tracking=None if chapter is None else chapter.tracking,
        retiming=None if timed is None else timed.retiming,
        elastic=None if bent is None else bent.section,
        elastic_runs=() if bent is None else bent.runs,
        loops=tuple(
            LoopTiming.of(role, run.outcome.statistics)
            for role, run in (("Excitation", excited), ("Validation", validated))
        ),
        run_ids=(
            *(run.folder.run_id for run in (excited, validated)),
            *(() if chapter is None else chapter.run_ids),
            *(() if timed is None else timed.run_ids),
            *(() if bent is None else bent.run_ids),
        ),
    )


class _ProgressConsole:
    """Console that adds up the progress of all motions, in seconds of motion."""

    def __init__(self, show: Show) -> None:
        self._show = show
        self.done_s = 0.0
        self.motion_s = 0.0

    def say(self, text: str = "") -> None:
        """Do nothing: the demo shows only the progress of its motions."""

    def announce_motion(self, motion: MotionEvent) -> None:
        """Do nothing: the progress shows the motion."""

    @contextlib.contextmanager
    def progress(self, title: str, total: float | None, unit: str) -> Iterator[Progress]:
        """Show the completed part of a motion."""
        yield _MotionProgress(self._show, title, self.done_s, self.motion_s / (total or 1.0))
        self.done_s += self.motion_s


@dataclass(frozen=True)
class _MotionProgress:
    show: Show
    title: str
    before_s: float
    unit_s: float

    def update(self, done: float, line: str) -> None:
        """Show the progress of the whole workflow."""
        self.show(self.before_s + done * self.unit_s, self.title)


@dataclass(frozen=True)
class _Recorder:
    """Records the motions of the workflow in one session."""

    session: RunSession
    console: _ProgressConsole

    def __call__(
        self,
        role: str,
        motion: AnyMotion,
        planned: MotionSamples | None = None,
        files: Mapping[str, bytes] | None = None,
    ) -> RecordedRun:
        """Record a motion into its own run folder, with `planned` samples if given.

        Raises:
            SafetyStop: The motion was stopped.
        """
        session = self.session
        samples = planned or motion.plan(session.loaded.robot, session.cell.cycle_time_s)
        self.console.motion_s = samples.duration_s
        both = {MOTION: to_yaml(motion).encode(), **(files or {})}
        request = RunRequest(role, motion.describe(), samples, role=role, files=both)
        run = session.record(request).as_step()
        if run.outcome.stop is not None:
            why = "; ".join((run.outcome.stop.text, *run.outcome.notes))
            raise SafetyStop(f"the demo's {role} was stopped: {why}", code="RID-STOP-ORDERED")
        return run


@dataclass(frozen=True)
class _FreshCellRecorder:
    """Records each motion on a newly started simulated cell with its force plate.

    Between two runs of the same simulated cell, simulated time follows the wall clock for a while.
    The first row with data of the plate would therefore differ between two executions of the demo.
    """

    loaded: LoadedCell
    simulation: CellSimulation
    runs: Path
    console: _ProgressConsole

    def __call__(
        self,
        role: str,
        motion: AnyMotion,
        planned: MotionSamples | None = None,
        files: Mapping[str, bytes] | None = None,
    ) -> RecordedRun:
        """Record one motion; arguments and errors are those of `_Recorder`."""
        with SimulatedCell(self.simulation) as simulated, hold_cell(simulated.cell):
            session = RunSession(self.loaded, simulated.cell, self.runs, self.console)
            return _Recorder(session, self.console)(role, motion, planned, files)


@contextlib.contextmanager
def _elastic_recorder(
    loaded: LoadedCell, seed: int, runs: Path, console: _ProgressConsole, tracker_file: Path | None
) -> Iterator[_Recorder]:
    """Open the simulated cell with elastic gears, without its force plate."""
    assert loaded.plant is not None
    simulation = CellSimulation(
        loaded.config,
        loaded.robot,
        loaded.plant,
        realtime=False,
        seed=seed,
        amplifier_profile=loaded.amplifier_profile,
        tracker_file=tracker_file,
    )
    with SimulatedCell(simulation) as simulated, hold_cell(simulated.cell):
        bare = simulated.cell.model_copy(update={"plate": None})
        yield _Recorder(RunSession(loaded, bare, runs, console), console)


def _with_presliding(robot: RobotDescription, average: PeriodAverage) -> RobotDescription:
    """Return the robot with presliding on the joints for which the excitation identifies it."""
    options = EstimationOptions()
    signals = [period_signals(average, options.band_hz)]
    return choose_presliding(robot, signals, options).robot(robot)


def _name(unmodelled: bool) -> str:
    return "with_unmodelled" if unmodelled else "without_unmodelled"
