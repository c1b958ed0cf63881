"""`RecordedRun`: a motion that was recorded and evaluated, with its report and messages."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from pydantic import JsonValue

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from acquisition.session.outcome import RecordOutcome
from acquisition.supervision.stop_reason import StopCode
from config.errors import DataQualityError, RecordingError
from rid_daq.blocks.block import AnyBlock, Text, Verdict
from rid_daq.report.result import Result
from rid_daq.report.result_file import REPORT
from rid_daq.report.sections.timing import loop_sentence
from rid_daq.report.sections.verdict import VerdictSection
from rid_daq.runs.run_data import RunData
from rid_daq.runs.run_quality import RunQuality
from rid_daq.terminal.exit_codes import ExitCode, exit_code_of_stop
from rid_daq.terminal.motion_progress import describe_end_position

_AGAIN = "Start again when you are ready"
_BY_ITSELF = "; the robot moves to the start pose by itself"
_WHAT_TO_DO = {
    StopCode.INTERRUPTED: _AGAIN,
    StopCode.STOP_COMMAND: _AGAIN,
    StopCode.STOP_BUTTON: _AGAIN,
    StopCode.CLIENT_LOST: "Connect the page or program again and take the cell, then start again.",
    StopCode.SERVICE_LOST: "Find out why the service did not respond, then check the cell and"
    " start again.",
    StopCode.RECORDER: "Check the disk (free space, speed), and other programs that use the run"
    " folder, then start again.",
    StopCode.BUS: "Then run `rid-daq check`.",
    StopCode.MISSED_FRAMES: "Check cable and bus load, then run `rid-daq check`.",
    StopCode.SECOND_ANSWERS: "Remove the other sender from the bus, then run `rid-daq check`.",
    StopCode.PLATE_LINE: "Check the amplifier's cable and adapter, then run `rid-daq check`.",
    StopCode.PLATE_OVERLOAD: "Choose a larger plate.amplifier.range_n, and zero the plate again.",
    StopCode.POINTS_LOST: "Make sure that the program sends its points fast enough, then start"
    " it again.",
    StopCode.POINTS_REFUSED: "Correct the path that the program sends, then start again.",
    StopCode.LOAD_SIGNAL: "Check if the robot carries the part before you start again.",
    StopCode.LATE_CYCLE: "Reduce the load of this computer, or allow real-time scheduling; then"
    " start again.",
}
_CHECK = "Find the cause at the robot before you start again; `rid-daq check` reads the drives."
_NOT_GOOD = "Recorded, but the data are not good enough for the next step"


@dataclass
class RecordedRun:
    """A recorded motion with its report.

    Attributes:
        folder: Run folder.
        outcome: Outcome of the motion.
        data: The recording; None if no row could be read.
        quality: Completeness of the recording; None if the motion was stopped or no row was
            recorded.
        result: Result of the run; callers can add to it until it is written.
        facts: Facts for the manifest; callers can add to them until they are written.
        held: True if the robot moved only while a person held a key.
    """

    folder: RunFolder
    outcome: RecordOutcome
    data: RunData | None
    quality: RunQuality | None
    result: Result
    facts: dict[str, JsonValue] = field(default_factory=dict)
    held: bool = False

    @property
    def measured(self) -> RunData:
        """The recording.

        Raises:
            DataQualityError: No row was recorded.
        """
        if self.data is None:
            raise DataQualityError(
                f"{self.folder.path}: no row was recorded in this run", code="RID-RECORDING-EMPTY"
            )
        return self.data

    @property
    def report(self) -> Path:
        """Path of the report."""
        return self.folder.file(REPORT)

    @property
    def status(self) -> RunStatus:
        """Status of the run: complete or stopped."""
        return RunStatus.COMPLETE if self.outcome.complete else RunStatus.STOPPED

    @property
    def exit_code(self) -> ExitCode:
        """Exit code of a command that recorded only this run."""
        stop = self.outcome.stop
        if stop is not None:
            return exit_code_of_stop(stop.code, self.outcome.interrupted_by)
        good = self.quality is None or self.quality.good
        return ExitCode.DONE if good else ExitCode.DATA_QUALITY

    @property
    def stop_sentence(self) -> str:
        """Stop reason, position in the motion, and remedy; empty for a complete run."""
        stop = self.outcome.stop
        if stop is None:
            return ""
        place = "" if self.data is None else f" {describe_end_position(self.data.tally)}"
        what_to_do = _WHAT_TO_DO.get(stop.code, _CHECK)
        if what_to_do == _AGAIN:
            what_to_do = f"{_AGAIN}{'' if self.held else _BY_ITSELF}."
        return f"{stop_words(self.outcome)}{place} {what_to_do}"

    @property
    def timing_sentence(self) -> str:
        """Sentence on the timing of the cyclic task."""
        return loop_sentence(self.outcome.statistics)

    def as_step(self) -> RecordedRun:
        """Return this run as a step of a sequence of motions.

        A stop request that arrived after the end of this motion is then treated as a stop of this
        motion, so that the sequence ends.
        """
        late = self.outcome.late_stop
        return self if late is None else replace(self, outcome=replace(self.outcome, stop=late))

    def verdict(self, goals: Sequence[str]) -> VerdictSection:
        """Return the verdict: the motion's outcome, the states of goals, and lost data."""
        if self.outcome.stop is not None:
            return VerdictSection.failed(
                "The motion was stopped before its end", self.stop_sentence
            )
        sentences = [". ".join(goals or [self.timing_sentence])]
        good = self.quality is None or self.quality.good
        if self.quality is not None:
            lost = list(self.quality.sentences())
            trouble = [] if good else [self.quality.trouble]
            sentences = [*trouble, *sentences, *lost]
        sentence = " ".join(f"{line.removesuffix('.')}." for line in sentences)
        if not good:
            return VerdictSection.failed(_NOT_GOOD, sentence)
        return VerdictSection.of([], "Recorded completely", sentence)

    def document(self) -> dict[str, object]:
        """Return the JSON document of the run."""
        return {
            "run": self.folder.run_id,
            "folder": str(self.folder.path),
            "report": str(self.report),
            "status": self.status.value,
            "rows": self.outcome.rows,
            **stop_document(self.outcome),
            "quality": None if self.quality is None else self.quality.to_dict(),
            "statistics": self.outcome.statistics.to_dict(),
        }

    @property
    def trouble(self) -> str:
        """Reason why the run cannot be used; empty if it can be used."""
        if self.quality is None or self.quality.good:
            return self.stop_sentence
        return f"{_NOT_GOOD}: {self.quality.trouble}"

    @property
    def is_usable(self) -> bool:
        """True if the motion was complete and enough rows were recorded."""
        return not self.trouble

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield lost data, the motion's outcome, and the paths of run folder and report."""
        for sentence in [] if self.quality is None else self.quality.sentences():
            yield Text(text=sentence)
        if self.trouble:
            yield Verdict(passed=False, text=self.trouble)
            yield Text(text=f"{self.outcome.rows} rows are kept.")
        else:
            yield Verdict(passed=True, text="Recorded")
        yield Text(text=f"Run: {self.folder.path}", is_for_terminal=True)
        yield Text(text=f"Report: {self.report}", is_for_terminal=True)


def stop_words(outcome: RecordOutcome) -> str:
    """Return the stop reason as a sentence; empty if the motion was not stopped."""
    if outcome.stop is None:
        return ""
    text = f"{outcome.stop.text.removesuffix('.')}."
    return f"S{text[1:]}" if text.startswith("stopped ") else f"Stopped: {text}"


def stop_facts(outcome: RecordOutcome) -> dict[str, JsonValue]:
    """Return code and reason of a stop as facts for the manifest; empty for a complete motion."""
    stop = outcome.stop
    return {} if stop is None else {"stop": stop.code.name, "why": stop.text}


def stop_document(outcome: RecordOutcome) -> dict[str, object]:
    """Return the JSON entries on a motion's end: `stop` (None if it was complete), and `notes`."""
    stop = outcome.stop
    return {
        "stop": None if stop is None else {"code": stop.code.name, "text": stop.text},
        "notes": list(outcome.notes),
    }


@contextlib.contextmanager
def prefix_errors_with_outcome(outcome: RecordOutcome, epilogue: str = "") -> Iterator[None]:
    """Prefix storage errors with the motion's outcome.

    Raises:
        RecordingError: The storage error; its text begins with the motion's outcome and
            `epilogue`.
    """
    try:
        yield
    except RecordingError as error:
        ended = stop_words(outcome) or "The motion ended as planned."
        raise RecordingError(
            " ".join(filter(None, (ended, epilogue, str(error)))), code=error.refusal
        ) from error
