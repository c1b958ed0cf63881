"""`RunSession`: record motions of a cell: run folder, motion, reading, evaluation, report."""

from __future__ import annotations

import contextlib
import secrets
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

from pydantic import JsonValue

from acquisition.journal.cycle_reader import read_tail
from acquisition.motion.known_pose import KnownPose
from acquisition.motion.samples import MotionSamples
from acquisition.runs.folder import RunFolder
from acquisition.session.early_stop import NewPeriods
from acquisition.session.frame_recorder import FrameRecorder
from acquisition.session.outcome import RecordOutcome
from acquisition.session.record import DeviceProfiles, MotionContext, record_motion
from acquisition.task.service_beat import ServiceBeat
from acquisition.task.set_points import SetPointSource
from config.cell.cell import CellConfig
from config.errors import RecordingError, RidDaqError, TransportError
from config.load import LoadedCell
from rid_daq.live.live_page import LivePage, live_page
from rid_daq.preflight.axis_test import AxisTestRule, require_axis_test
from rid_daq.preflight.last_pose import known_pose, store_pose
from rid_daq.recording.recorded_run import RecordedRun, prefix_errors_with_outcome, stop_facts
from rid_daq.recording.run_request import RunRequest
from rid_daq.report.result import Result
from rid_daq.report.sections.average import AverageSection
from rid_daq.report.sections.runs import CellSection, RunSection
from rid_daq.report.sections.stop import StopCurve
from rid_daq.report.sections.timing import LoopTiming, Timing
from rid_daq.report_page.write import write_result
from rid_daq.requests.cell_options import Live, Simulation
from rid_daq.runs.flange import write_flange_state
from rid_daq.runs.origins import write_cell_origin
from rid_daq.runs.run_data import RunData
from rid_daq.runs.run_quality import run_quality
from rid_daq.session.cells import hold_reachable_cell
from rid_daq.session.scenario import Scenario
from rid_daq.session.session import mark_unfinished
from rid_daq.session.versions import software_versions
from rid_daq.terminal.clearance import require_cleared
from rid_daq.terminal.context import Context, Display
from rid_daq.terminal.job_events import MotionEvent
from rid_daq.terminal.motion_progress import motion_total, progress_callback

if TYPE_CHECKING:
    from mock_hw.cell import SimulatedCell

FRAMES: Final = "frames.blf"
STOP_TAIL_S: Final = 10.0
"""Length of the end of a stopped recording that the report draws [s].

It is long enough to include the last second before the stop and the deceleration to rest.
"""


@dataclass(frozen=True)
class RunSession:
    """Session on one cell that records motions, each into its own run folder.

    Attributes:
        loaded: The cell and its files.
        cell: The cell with a bus that this program can open.
        runs: Folder of the run folders.
        display: Output for progress and messages.
        simulated: Simulated devices of this program; their payload is noted in the run.
        page: Live page that also shows the motions; None without one.
        axis_test: Result of the axis test of a real cell; empty for a simulated one.
        service: Heartbeat of the service that started the session; None without a service.
        operator: Person or program that started the session; empty if unknown.
        session_id: Id of the session, under which lists of runs show its runs together; empty
            without one.
    """

    loaded: LoadedCell
    cell: CellConfig
    runs: Path
    display: Display
    simulated: SimulatedCell | None = None
    page: LivePage | None = None
    axis_test: str = ""
    service: ServiceBeat | None = None
    operator: str = ""
    session_id: str = ""

    def record(self, request: RunRequest) -> RecordedRun:
        """Record a motion, evaluate it and write its report, also if the motion was stopped.

        Raises:
            RidDaqError: Any error of `recording`.
        """
        with self.recording(request) as run:
            return run

    @contextlib.contextmanager
    def recording(self, request: RunRequest) -> Iterator[RecordedRun]:
        """Record a motion and evaluate it; write its report when the `with` block ends.

        Results and facts that the `with` block adds to the run are written too. If an error leaves
        the block, the run is marked as stopped, with the reason.

        Raises:
            PreflightError, DriverError, RecordingError: Nothing moved, or nothing was recorded
                (`record_motion`).
            ConfigError: The label is invalid.
            RecordingError: The run folder cannot be read or written; the message includes the
                motion's outcome.
        """
        folder = RunFolder.create(
            self.runs, request.label, software=software_versions(), facts=self._facts
        )
        with mark_unfinished(folder):
            facts: dict[str, JsonValue] = {}
            for name, content in self.loaded.files.items():
                folder.write(name, content)
            write_cell_origin(folder, self.loaded)
            if self.simulated is not None:
                facts |= write_flange_state(folder, self.loaded, self.simulated.attached)
            _write_files(folder, request.files)
            created_utc = folder.manifest().created_utc
            started_s = time.monotonic()
            with (
                _stored_after_error(folder, request),
                self._recorded_frames(folder, request.frames),
            ):
                if request.drive is not None:
                    outcome = request.drive(partial(self._drive, folder, request))
                else:
                    assert request.samples is not None
                    outcome = self._drive(folder, request, request.samples)
            elapsed_s = time.monotonic() - started_s
            with prefix_errors_with_outcome(outcome, request.epilogue):
                _write_files(folder, request.observed())
                self._store_pose(folder, outcome)
                run = self._evaluate(folder, request, outcome)
                run.facts.update(facts, rows=outcome.rows, **stop_facts(outcome))
                run.result = run.result.with_sections(
                    timing=Timing(
                        elapsed_s=elapsed_s,
                        created_utc=created_utc,
                        loops=(LoopTiming.of(request.role, outcome.statistics),),
                    )
                )
                yield run
                folder.finish(run.status, run.facts)  # the report names the recording's SHA-256
                write_result(folder, run.result)

    @property
    def _facts(self) -> dict[str, JsonValue]:
        """Facts of every run of the session."""
        facts: dict[str, JsonValue] = {
            "robot": self.loaded.robot.name,
            "cell": self.cell.name,
            "session": self.session_id,
            "operator": self.operator,
            "axis_test": self.axis_test,
        }
        return {name: fact for name, fact in facts.items() if fact}

    def _known_pose(self, request: RunRequest) -> KnownPose | None:
        """Return the last known pose of the robot; None for this program's simulated devices."""
        if self.simulated is not None:
            return None
        return known_pose(self.loaded, binding=not (self.cell.simulated or request.held))

    def _store_pose(self, folder: RunFolder, outcome: RecordOutcome) -> None:
        """Store the robot's pose after a motion, if it is known and devices are not simulated here.

        The pose of a real robot that was displaced before the motion is not stored either: a held
        key may move such a robot, but the next run must report the displacement again.
        """
        if self.simulated is not None or outcome.pose is None:
            return
        if self.cell.simulated or not outcome.displaced:
            store_pose(self.loaded, outcome.pose, f"run {folder.run_id}")

    def _drive(
        self, folder: RunFolder, request: RunRequest, motion: MotionSamples | SetPointSource
    ) -> RecordOutcome:
        robot, samples, watch = self.loaded.robot, request.samples, request.watch
        pose, simulated, task = self._known_pose(request), self.simulated, None
        if simulated and simulated.runs_masters and isinstance(motion, MotionSamples):
            task = simulated.create_master  # other sources wait for a person or a program
        marker = simulated.motion_marker if simulated else None
        observer, rows, per_period = None, 0, None
        if samples is not None:
            rows, per_period = len(samples), samples.samples_per_period
            if self.page is not None:
                observer = self.page.observer(request.sentence, samples, self.cell, robot)
        is_enough = False

        def enough(new: NewPeriods) -> bool:
            nonlocal is_enough
            assert watch is not None
            is_enough = is_enough or watch.add_periods(new)
            return is_enough

        self.display.announce_motion(
            MotionEvent(
                at_s=time.time(),
                run=folder.run_id,
                title=request.sentence,
                rows=rows,
                rows_per_period=per_period,
                tested_joint=request.tested_joint,
            )
        )
        with self.display.progress(
            request.role, *motion_total(samples, held=request.held)
        ) as shown:
            outcome = record_motion(
                self.cell,
                robot,
                motion,
                folder,
                on_progress=progress_callback(
                    samples,
                    robot.joint_names,
                    shown.update,
                    (lambda: "") if watch is None else watch.line,
                    lambda: is_enough,
                ),
                enough=None if watch is None else enough,
                profiles=DeviceProfiles(self.loaded.amplifier_profile, self.loaded.drive_profile),
                context=MotionContext(observer, self.service, pose, task, marker),
            )
        for note in outcome.notes:
            self.display.say(f"note: {note}")
        return outcome

    def _evaluate(
        self, folder: RunFolder, request: RunRequest, outcome: RecordOutcome
    ) -> RecordedRun:
        """Read the recording once, and evaluate it."""
        robot = self.loaded.robot
        data = RunData.load(folder, unfinished=True, changing_load=True) if outcome.rows else None
        quality = section = average = None
        if data is not None:
            stop = None if outcome.stop is None else outcome.stop.text
            section = RunSection.of(request.role, request.sentence, data.tally, robot, stop)
            section = section.with_traces(data.parts(), robot)
            if outcome.stop is not None:
                tail = read_tail(outcome.path, STOP_TAIL_S)
                curve = StopCurve.of(tail, outcome.stop, self.cell, robot)
                section = section.model_copy(update={"stop_curve": curve})
            quality = run_quality(data.tally, lambda: data.average) if outcome.complete else None
        if quality is not None and quality.average is not None:
            average = AverageSection.of(quality.average, robot)
        result = Result.new(f"Recording on {self.cell.name}", robot.name).with_sections(
            cell=CellSection.of(self.cell),
            runs=None if section is None else (section,),
            average=average,
        )
        run = RecordedRun(folder, outcome, data, quality, result, held=request.held)
        goals = [] if request.watch is None else request.watch.sentences()
        run.result = result.with_sections(verdict=run.verdict(goals))
        return run

    @contextlib.contextmanager
    def _recorded_frames(self, folder: RunFolder, wanted: bool) -> Iterator[None]:
        """Record the frames of the bus into a run until the `with` block ends.

        An error of this recording is reported and does not stop the motion.
        """
        if not wanted:
            yield
            return
        with FrameRecorder(self.cell.can, folder.file(FRAMES)) as recorder:
            yield
            try:
                self.display.say(f"{FRAMES}: {recorder.finish()} frames")
            except (RecordingError, TransportError) as error:
                self.display.say(f"note: {FRAMES} is incomplete: {error}")


def _write_files(folder: RunFolder, files: Mapping[str, bytes]) -> None:
    for name, content in files.items():
        folder.write(name, content)


@contextlib.contextmanager
def _stored_after_error(folder: RunFolder, request: RunRequest) -> Iterator[None]:
    """Write the files with observations also if an error or a signal ends the `with` block."""
    try:
        yield
    except BaseException:
        with contextlib.suppress(RidDaqError):
            _write_files(folder, request.observed())
        raise


def require_runs_folder(runs: Path) -> None:
    """Refuse a path in which no run folder can be made.

    Raises:
        RecordingError: The path exists and is not a folder.
    """
    if runs.exists() and not runs.is_dir():
        raise RecordingError(
            f"{runs}: this is a file, so no run folder can be made in it; give a folder with"
            " --runs",
            code="RID-FILE-NOT-FOLDER",
        )


@dataclass(frozen=True)
class Clearance:
    """Data for the question, before a motion, whether the cell is clear.

    Attributes:
        cleared: True if a person has just confirmed that the cell is clear.
        practise: True to ask on a simulated cell too.
        files: Files of the motion, in addition to the cell's files; the question shows their
            hashes. They have been read already, and the run stores the same bytes.
    """

    cleared: bool
    practise: bool
    files: Mapping[str, bytes] = field(default_factory=dict)


@contextlib.contextmanager
def open_session(
    loaded: LoadedCell,
    runs: Path,
    context: Context,
    clearance: Clearance | None,
    axis_test: AxisTestRule,
    *,
    simulation: Simulation | None = None,
    scenario: Scenario | None = None,
    live: Live | None = None,
) -> Iterator[RunSession]:
    """Yield a session on a cell; the cell is locked until the `with` block ends.

    Args:
        runs: Folder of the run folders.
        context: Output for the person; asks whether a real cell is clear, after all other checks
            have passed.
        clearance: Data for this question; None if each step of the session asks it itself.
        simulation: Options of a simulated cell that this program starts.
        scenario: Faults and instruments of such a cell.
        live: Options of the live page.

    Raises:
        RidDaqError: Any error of `require_runs_folder`, `require_axis_test`, `require_cleared`,
            `live_page` and `hold_reachable_cell`.
    """
    require_runs_folder(runs)
    tested = require_axis_test(loaded, axis_test)
    if clearance is not None:
        files = {**loaded.files, **clearance.files}
        practise = clearance.practise
        require_cleared(loaded.config, clearance.cleared, context, practise=practise, files=files)
    if axis_test is AxisTestRule.WAIVED and tested:
        context.say(f"note: axis test: {tested}")
    with (
        live_page(live or Live()) as page,
        hold_reachable_cell(loaded, simulation, scenario) as (cell, simulated),
    ):
        yield RunSession(
            loaded,
            cell,
            runs,
            context,
            simulated,
            page,
            tested,
            context.service,
            context.operator,
            secrets.token_hex(8),
        )
