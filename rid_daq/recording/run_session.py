"""`RunSession`: every recording of the program: folder, motion, reading, judgement, report."""

from __future__ import annotations

import contextlib
import time
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

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
from config.errors import RecordingError, TransportError
from config.load import LoadedCell
from config.simulation.faults import NO_SCRIPT, FaultScript
from rid_daq.live.live_page import LivePage, live_page
from rid_daq.preflight.axis_test import AxisTestRule, require_axis_test
from rid_daq.preflight.last_pose import keep_pose, known_pose
from rid_daq.recording.recorded_run import RecordedRun, ending_said
from rid_daq.report.result import Result
from rid_daq.report.sections.average import AverageSection
from rid_daq.report.sections.runs import CellSection, RunSection
from rid_daq.report.sections.stop import StopCurve
from rid_daq.report.sections.timing import LoopTiming, Timing
from rid_daq.report_page.write import write_result
from rid_daq.requests.cell_options import Live, Simulation
from rid_daq.runs.flange import note_flange
from rid_daq.runs.origins import note_cell
from rid_daq.runs.run_data import RunData
from rid_daq.runs.run_quality import run_quality
from rid_daq.session.cells import mountable_cell
from rid_daq.session.session import unfinished
from rid_daq.session.versions import software_versions
from rid_daq.terminal.clearance import require_cleared
from rid_daq.terminal.context import Context, Display
from rid_daq.terminal.motion_progress import motion_total, progress_callback

if TYPE_CHECKING:
    from mock_hw.cell import SimulatedCell

FRAMES: Final = "frames.blf"
STOP_TAIL_S: Final = 10.0  # a second before the stop, and coming to rest

Record = Callable[[MotionSamples | SetPointSource], RecordOutcome]
"""Runs planned rows, or a source of set-points, into the run folder of a request."""


class Watch(Protocol):
    """Looks at the periods so far, and says whether they are enough."""

    @abstractmethod
    def enough(self, new: NewPeriods) -> bool:
        """Return whether the motion may end after the period under way."""

    @abstractmethod
    def line(self) -> str:
        """Say in a few words how far it is; empty where there is nothing to say."""

    @abstractmethod
    def sentences(self) -> Sequence[str]:
        """Say for the report how far it came."""


@dataclass(frozen=True)
class RunRequest:
    """What is recorded into one run folder.

    Attributes:
        label: What people call the run.
        sentence: What is driven.
        samples: The planned rows; None where points come from elsewhere.
        drive: Makes the set-points while the run folder is open, and hands them to the `Record`
            that it is called with; the planned rows are driven where it is left out.
        role: What the motion is for: names it on the terminal and in the report.
        files: Name to content of what is written into the folder beside the cell's own files.
        watch: Follows the periods, and may end the motion.
        frames: Whether every frame on the bus is recorded too.
        epilogue: Said after how the motion ended where its run is all that was driven of a longer
            job.
        held: Whether the robot moves only while a person holds a key.
    """

    label: str
    sentence: str
    samples: MotionSamples | None
    drive: Callable[[Record], RecordOutcome] | None = None
    role: str = "recording"
    files: Mapping[str, bytes] = field(default_factory=dict)
    watch: Watch | None = None
    frames: bool = False
    epilogue: str = ""
    held: bool = False


@dataclass(frozen=True)
class RunSession:
    """Records motions on one cell, each into a run folder of its own.

    Attributes:
        loaded: The cell and its files.
        cell: The cell as it is reachable.
        runs: The folder of the run folders.
        display: Where progress is shown.
        simulated: The mock hardware, where it was started here: what it carries is noted.
        page: Where motions are shown too.
        axis_test: What is known of the axis test of a real cell; empty for a simulated one.
        service: Signs of life of the service that has ordered the session, if one has.
    """

    loaded: LoadedCell
    cell: CellConfig
    runs: Path
    display: Display
    simulated: SimulatedCell | None = None
    page: LivePage | None = None
    axis_test: str = ""
    service: ServiceBeat | None = None

    def record(self, request: RunRequest) -> RecordedRun:
        """Record a motion, judge it and write its report; also where the motion was stopped.

        Raises:
            RidDaqError: As `recording`.
        """
        with self.recording(request) as run:
            return run

    @contextlib.contextmanager
    def recording(self, request: RunRequest) -> Iterator[RecordedRun]:
        """Record a motion and judge it; write its report when the `with` is left.

        What the body of the `with` adds to the run's result and facts is written too. A run that
        is left by an error is marked as stopped, with the reason.

        Raises:
            PreflightError, DriverError, RecordingError: Nothing was moved, or nothing was recorded
                (`record_motion`).
            RecordingError: The run folder cannot be read or written; the message says how the
                motion ended.
        """
        folder = RunFolder.create(self.runs, request.label, software=software_versions())
        with unfinished(folder):
            facts: dict[str, JsonValue] = {"robot": self.loaded.robot.name}
            if self.axis_test:
                facts["axis_test"] = self.axis_test
            for name, content in self.loaded.files.items():
                folder.write(name, content)
            note_cell(folder, self.loaded)
            if self.simulated is not None:
                facts |= note_flange(folder, self.loaded, self.simulated.attached)
            for name, content in request.files.items():
                folder.write(name, content)
            created_utc = folder.manifest().created_utc
            started_s = time.monotonic()
            with self._frames(folder, request.frames):
                if request.drive is not None:
                    outcome = request.drive(partial(self._driven, folder, request))
                else:
                    assert request.samples is not None
                    outcome = self._driven(folder, request, request.samples)
            elapsed_s = time.monotonic() - started_s
            with ending_said(outcome, request.epilogue):
                self._keep_pose(folder, outcome)
                run = self._judged(folder, request, outcome)
                run.facts.update(facts, rows=outcome.rows)
                run.result = run.result.updated(
                    timing=Timing(
                        elapsed_s=elapsed_s,
                        created_utc=created_utc,
                        loops=(LoopTiming.of(request.role, outcome.statistics),),
                    )
                )
                yield run
                write_result(folder, run.result)
                folder.finish(run.status, run.facts)

    def _known_pose(self, request: RunRequest) -> KnownPose | None:
        """Return where the robot was seen last; None for mock hardware that was started here."""
        if self.simulated is not None:
            return None
        return known_pose(self.loaded, binding=not (self.cell.simulated or request.held))

    def _keep_pose(self, folder: RunFolder, outcome: RecordOutcome) -> None:
        """Keep where the robot stands; a key moves a displaced one, and settles nothing."""
        if self.simulated is not None or outcome.pose is None:
            return
        if self.cell.simulated or not outcome.displaced:
            keep_pose(self.loaded, outcome.pose, f"run {folder.run_id}")

    def _driven(
        self, folder: RunFolder, request: RunRequest, motion: MotionSamples | SetPointSource
    ) -> RecordOutcome:
        """Drive what was asked for, and say what a person should know of it."""
        robot, samples, watch = self.loaded.robot, request.samples, request.watch
        pose = self._known_pose(request)
        observer = None
        rows, per_period = 0, None
        if samples is not None:
            rows, per_period = len(samples), samples.samples_per_period
            if self.page is not None:
                observer = self.page.observer(request.sentence, samples, self.cell, robot)
        seen = False

        def enough(new: NewPeriods) -> bool:
            nonlocal seen
            assert watch is not None
            seen = seen or watch.enough(new)
            return seen

        self.display.announce_motion(folder.run_id, request.sentence, rows, per_period)
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
                    lambda: seen,
                ),
                enough=None if watch is None else enough,
                profiles=DeviceProfiles(self.loaded.amplifier_profile, self.loaded.drive_profile),
                context=MotionContext(observer, self.service, pose),
            )
        for note in outcome.notes:
            self.display.say(f"note: {note}")
        return outcome

    def _judged(
        self, folder: RunFolder, request: RunRequest, outcome: RecordOutcome
    ) -> RecordedRun:
        """Read what was recorded, once, and judge it."""
        robot = self.loaded.robot
        data = RunData.load(folder, unfinished=True) if outcome.rows else None
        quality = section = average = None
        if data is not None:
            stop = None if outcome.stop is None else outcome.stop.text
            section = RunSection.of(request.role, request.sentence, data.tally, robot, stop)
            if outcome.stop is not None:
                tail = read_tail(outcome.path, STOP_TAIL_S)
                curve = StopCurve.of(tail, outcome.stop, self.cell, robot)
                section = section.model_copy(update={"stop_curve": curve})
            quality = run_quality(data.tally, lambda: data.average) if outcome.complete else None
        if quality is not None and quality.average is not None:
            average = AverageSection.of(quality.average, robot)
        result = Result.new(f"Recording on {self.cell.name}", robot.name).updated(
            cell=CellSection.of(self.cell),
            runs=None if section is None else (section,),
            average=average,
        )
        run = RecordedRun(folder, outcome, data, quality, result, held=request.held)
        goals = [] if request.watch is None else request.watch.sentences()
        run.result = result.updated(verdict=run.verdict(goals))
        return run

    @contextlib.contextmanager
    def _frames(self, folder: RunFolder, wanted: bool) -> Iterator[None]:
        """Record the bus's frames into a run for as long as the `with` lasts.

        What goes wrong with them on the way is told and costs nothing else.
        """
        if not wanted:
            yield
            return
        with FrameRecorder(self.cell.can, folder.file(FRAMES)) as recorder:
            yield
            try:
                self.display.say(f"{FRAMES}: {recorder.finish()} frames")
            except (RecordingError, TransportError) as error:
                self.display.say(f"note: {FRAMES} is not whole: {error}")


def refuse_runs(runs: Path) -> None:
    """Refuse what no run folder can be made in.

    Raises:
        RecordingError: It is there, and no folder.
    """
    if runs.exists() and not runs.is_dir():
        raise RecordingError(
            f"{runs}: no run folder can be made: it is a file; give --runs the folder of the runs",
            code="RID-FILE-NOT-FOLDER",
        )


@dataclass(frozen=True)
class Clearance:
    """What is known, before a motion, of whether the cell is clear.

    Attributes:
        cleared: True if a person has just said that it is.
        practise: True to ask on a simulated cell too.
        files: What is driven, beside the cell's own files; shown by hashes beside the question.
            The run keeps them: all of them have been read, and nothing is read again.
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
    faults: FaultScript = NO_SCRIPT,
    live: Live | None = None,
) -> Iterator[RunSession]:
    """Yield a session on a cell that is reachable, and held alone, as long as the `with` lasts.

    Args:
        runs: The folder of the run folders.
        context: Where a person is asked whether a real cell is clear, once nothing else is a
            reason to refuse.
        clearance: What is known of that; None if the session's steps ask.
        simulation, faults: How mock hardware that is started here is, and what goes wrong in it.
        live: The live page.

    Raises:
        RidDaqError: As `refuse_runs`, `require_axis_test`, `require_cleared`, `live_page` and
            `mountable_cell`.
    """
    refuse_runs(runs)
    tested = require_axis_test(loaded, axis_test)
    if clearance is not None:
        files = {**loaded.files, **clearance.files}
        practise = clearance.practise
        require_cleared(loaded.config, clearance.cleared, context, practise=practise, files=files)
    if axis_test is AxisTestRule.WAIVED and tested:
        context.say(f"note: axis test {tested}")
    with (
        live_page(live or Live()) as page,
        mountable_cell(loaded, simulation, faults) as (cell, simulated),
    ):
        yield RunSession(loaded, cell, runs, context, simulated, page, tested, context.service)
