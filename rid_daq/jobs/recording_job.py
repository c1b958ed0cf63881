"""Recording one motion on one cell: the progress shown, and what the report says of it."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from acquisition.journal.cycles import read_journal
from acquisition.motion.samples import MotionSamples, Phase
from acquisition.recording.recording import Recording
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from acquisition.session.record import RecordOutcome, record_motion
from acquisition.supervision.stop_reason import StopCode
from acquisition.task.control_block import Progress, TaskState
from acquisition.task.joint_values import JointValues
from acquisition.task.set_points import SetPointSource
from config.cell.amplifier_profile import AmplifierProfile
from config.cell.cell import CellConfig
from config.cell.drive_profile import DriveProfile
from config.errors import ConfigError, RecordingError
from config.motion.motion import AnyMotion
from config.robot.robot import RobotDescription
from rid_daq.jobs.accuracy_watch import AccuracyWatch
from rid_daq.live.live_page import LivePage
from rid_daq.report.result import new_result, verdict
from rid_daq.report.sections import (
    average_section,
    cell_section,
    loop_section,
    loop_sentence,
    motion_sentence,
    run_section,
)
from rid_daq.runs.run_data import read_run
from rid_daq.runs.run_quality import RunQuality, run_quality
from rid_daq.terminal.console import Console
from rid_daq.terminal.motion_words import PHASES, motion_words

_AGAIN = "Start again when you are ready; the robot goes to the start by itself."
_WHAT_TO_DO = {
    StopCode.INTERRUPTED: _AGAIN,
    StopCode.STOP_COMMAND: _AGAIN,
    StopCode.STOP_BUTTON: _AGAIN,
    StopCode.RECORDER: "Check the disk (free space, speed) and who else works in the run folder,"
    " then start again.",
    StopCode.BUS: "Then run `rid-daq check`.",
    StopCode.MISSED_FRAMES: "Check cable and bus load, then run `rid-daq check`.",
    StopCode.SECOND_ANSWERS: "Take the other sender off the bus, then run `rid-daq check`.",
    StopCode.PLATE_LINE: "Check the amplifier's cable and adapter, then run `rid-daq check`.",
    StopCode.PLATE_OVERLOAD: "Choose a larger plate.amplifier.range_n, and zero the plate again.",
    StopCode.POINTS_LOST: "See that the program that sends points keeps up, then start it again.",
    StopCode.POINTS_REFUSED: "Correct the path that is sent, then start again.",
    StopCode.LATE_CYCLE: "Take load off this computer, or allow real-time scheduling; then start"
    " again.",
}
_CHECK = "Find the cause at the robot before you start again; `rid-daq check` reads the drives."


@dataclass(frozen=True)
class RecordedRun:
    """A recorded motion with its report.

    Attributes
    ----------
    outcome : RecordOutcome
        What became of it.
    recording : Recording or None
        What was measured; None where no row could be read.
    result : dict
        The result document.
    """

    outcome: RecordOutcome
    recording: Recording | None
    result: dict[str, Any]

    @property
    def status(self) -> RunStatus:
        """Complete, or stopped."""
        return RunStatus.COMPLETE if self.outcome.complete else RunStatus.STOPPED

    @property
    def is_periodic(self) -> bool:
        """Whether it holds whole periods."""
        return self.recording is not None and self.recording.samples_per_period is not None

    @property
    def stop_sentence(self) -> str:
        """What stopped, where in the motion, and what to do; empty for a complete run."""
        stop = self.outcome.stop
        if stop is None:
            return ""
        where = "" if self.recording is None else f" {_where(self.recording)}"
        return f"{stop_words(self.outcome)}{where} {_WHAT_TO_DO.get(stop.code, _CHECK)}"

    @property
    def ended(self) -> str:
        """How the motion ended, also where nothing stopped it."""
        return self.stop_sentence or ended_words(self.outcome)

    @property
    def timing_sentence(self) -> str:
        """How well the loop kept its time."""
        return loop_sentence(self.outcome.statistics)


def record_run(
    cell: CellConfig,
    robot: RobotDescription,
    motion: AnyMotion | str,
    samples: MotionSamples | None,
    folder: RunFolder,
    console: Console,
    *,
    source: SetPointSource | None = None,
    role: str = "recording",
    accuracy: AccuracyWatch | None = None,
    profile: AmplifierProfile | None = None,
    drive_profile: DriveProfile | None = None,
    page: LivePage | None = None,
) -> RecordedRun:
    """Record a motion into a run folder, showing how far it is.

    `motion` is what was planned, or a sentence that says it; `source` hands out its set-points
    where they are not the planned rows alone, and then nothing needs to be planned.
    With `accuracy` the progress tells the running estimate, and the motion ends after the period in
    which its goals, if it has any, are reached; with
    `profile`, what its amplifier speaks, the cell's force plate is recorded too. A live `page`
    shows it.

    Raises
    ------
    PreflightError, DriverError, RecordingError
        Nothing was moved, or nothing was recorded (`record_motion`).
    """
    driven = source or samples
    if driven is None:
        raise ConfigError("there is nothing to drive: give a motion or a source of set-points")
    total, unit = (None, "points") if samples is None else _total(samples)
    sentence = motion if isinstance(motion, str) else motion_sentence(motion)
    onlooker = None
    if page is not None and samples is not None:
        onlooker = page.onlooker(sentence, samples, cell, robot)
    created_utc = folder.manifest().created_utc
    started_s = time.monotonic()
    with console.progress(role, total, unit) as display:
        outcome = record_motion(
            cell,
            robot,
            driven,
            folder,
            on_progress=progress_shown(samples, display.update, accuracy, robot.joint_names),
            enough=None if accuracy is None else accuracy.enough,
            profile=profile,
            drive_profile=drive_profile,
            onlooker=onlooker,
        )
    elapsed_s = time.monotonic() - started_s
    tell_notes(console, outcome)
    with how_it_ended(ended_words(outcome, role)):
        recording = read_journal(outcome.path).recording() if outcome.rows else None
    result = new_result(f"Recording on {cell.name}", robot.name)
    result["cell"] = cell_section(cell)
    stop = None if outcome.stop is None else outcome.stop.text
    if recording is not None:
        result["runs"] = [run_section(role, sentence, recording, robot, stop)]
    result["timing"] = {
        "elapsed_s": elapsed_s,
        "created_utc": created_utc,
        "loops": [loop_section(role, outcome.statistics)],
    }
    run = RecordedRun(outcome, recording, result)
    if outcome.stop is not None:
        result["verdict"] = verdict([], "Stopped before its end", run.stop_sentence)
        result["verdict"]["passed"] = False
    else:
        goals = [] if accuracy is None else accuracy.sentences()
        sentences = goals or [run.timing_sentence]
        result["verdict"] = verdict([], "Recorded completely", ". ".join(sentences))
    return run


def stop_words(outcome: RecordOutcome) -> str:
    """Return what stopped a motion, as a sentence; empty where nothing did."""
    if outcome.stop is None:
        return ""
    text = f"{outcome.stop.text.removesuffix('.')}."
    return f"S{text[1:]}" if text.startswith("stopped ") else f"Stopped: {text}"


def stop_document(outcome: RecordOutcome) -> dict[str, Any]:
    """Return what programs are told of a motion's end: `stop`, None where it came, and `notes`."""
    stop = outcome.stop
    return {
        "stop": None if stop is None else {"code": stop.code.name, "text": stop.text},
        "notes": list(outcome.notes),
    }


def tell_notes(console: Console, outcome: RecordOutcome) -> None:
    """Say what else a person should know, such as drives that did not confirm being disabled."""
    for note in outcome.notes:
        console.say(f"note: {note}")


def ended_words(outcome: RecordOutcome, role: str = "motion") -> str:
    """Return how a motion ended, as a sentence, also where nothing stopped it."""
    return stop_words(outcome) or f"The {role} ended as planned."


@contextlib.contextmanager
def how_it_ended(ended: str) -> Iterator[None]:
    """Say how a motion `ended` also where its run folder cannot be read or written any more.

    Raises
    ------
    RecordingError
        What failed, after how the motion ended.
    """
    try:
        yield
    except RecordingError as error:
        raise RecordingError(f"{ended} {error}") from error


def judge(run: RecordedRun, folder: RunFolder) -> RunQuality | None:
    """Judge a run that was not stopped, and put that into its result; None for one that was."""
    if run.recording is None or run.outcome.stop is not None:
        return None
    data = read_run(folder, unfinished=True)
    quality = run_quality(data.recording)
    if quality.average is not None:
        run.result["average"] = average_section(quality.average, data.robot)
    words = [run.result["verdict"]["sentence"], *quality.sentences()]
    if not quality.good:
        run.result["verdict"]["headline"] = "Recorded, but not good enough to go on with"
        run.result["verdict"]["passed"] = False
        words.insert(0, quality.trouble)
    run.result["verdict"]["sentence"] = " ".join(f"{line.removesuffix('.')}." for line in words)
    return quality


def tell_verdict(
    console: Console, run: RecordedRun, quality: RunQuality | None, folder: RunFolder, report: Path
) -> bool:
    """Say what a run has lost, how it ended and where it is; return whether it can be used."""
    trouble = run.stop_sentence
    if quality is not None:
        for sentence in quality.sentences():
            console.say(sentence)
        if not quality.good:
            trouble = f"Recorded, but not good enough to go on with: {quality.trouble}"
    if trouble:
        console.verdict(False, trouble)
        console.say(f"Kept: {run.outcome.rows} rows in {folder.path}")
    else:
        console.verdict(True, f"Recorded: {folder.path}")
    console.say(f"Report: {report}")
    return not trouble


def progress_shown(
    samples: MotionSamples | None,
    show: Callable[[float, str], None],
    accuracy: AccuracyWatch | None = None,
    joint_names: Sequence[str] = (),
) -> Callable[[Progress], None]:
    """Return what turns the task's progress into periods done (seconds, if not periodic).

    Where no rows are planned, it counts the points.
    """
    done = 0.0
    names = joint_names if samples is None else samples.joint_names

    def update(progress: Progress) -> None:
        nonlocal done
        if progress.sample_index >= 0:
            row = progress.sample_index
            done = float(row) if samples is None else _done(samples, row)
        moving = progress.state is TaskState.MOVING
        line = motion_words(progress)
        if moving and progress.joints is not None:
            line += f"; {load_words(progress.joints, names)}"
        if moving and accuracy is not None and accuracy.line():
            line += f"; {accuracy.line()}"
        show(done, line)

    return update


def load_words(joints: JointValues, names: Sequence[str]) -> str:
    """Say how much of their limits torque and following error take, each of the worst joint."""
    torque, error = int(joints.torque_share.argmax()), int(joints.following_error_share.argmax())
    return (
        f"torque {joints.torque_share[torque]:.0%} ({names[torque]}), following error"
        f" {joints.following_error_share[error]:.0%} ({names[error]}) of the limit"
    )


def _where(recording: Recording) -> str:
    """Say how far into the motion the recording goes."""
    moved = recording.sample_index[recording.sample_index >= 0]
    if len(moved) == 0 or recording.sample_period_s is None:
        return "The motion had not begun."
    phase = Phase(int(recording.phase[recording.sample_index >= 0][-1]))
    into_s = float(moved[-1]) * recording.sample_period_s
    period = ""
    if recording.samples_per_period is not None and phase is Phase.MAIN:
        first = moved[recording.phase[recording.sample_index >= 0] == Phase.MAIN][0]
        period = f", period {int(moved[-1] - first) // recording.samples_per_period + 1}"
    return f"That was {into_s:.2f} s into the motion ({PHASES[phase]}{period})."


def _total(samples: MotionSamples) -> tuple[float, str]:
    if samples.samples_per_period is None:
        return samples.duration_s, "s"
    return len(samples) / samples.samples_per_period, "periods"


def _done(samples: MotionSamples, row: int) -> float:
    per_unit = samples.samples_per_period or 1.0 / samples.sample_period_s
    return row / per_unit
