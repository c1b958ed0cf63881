"""`record`: perform a motion on a cell and record it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from rid_daq.blocks.block import AnyBlock, Next, Text, Verdict
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.cell_options import (
    BEFORE,
    SIMULATED,
    AxisTest,
    Cleared,
    Live,
    OfFile,
    Practise,
    Simulation,
)
from rid_daq.requests.option import (
    DEFAULT_RUNS,
    FILES,
    CellName,
    DespiteMisfitOfModel,
    LoadChangeFile,
    Option,
    RunsFolder,
)
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from rid_daq.operations.experiment.recorded_motion import RecordedMotion
    from rid_daq.recording.accuracy_watch import AccuracyWatch

SINGLE_PERIODS: Final = (
    "The running estimate uses the rows of single periods, with their noise and reversals. Its"
    " residual therefore differs from that of the identification, which uses the mean of the"
    " periods, and does not use the torque near reversals."
)


class RecordRequest(Request):
    """Perform a motion on a cell and record it into a new run folder.

    The motion is checked against the limits before anything moves, against those of torque only
    with --model. STOP stops the robot (quick stop, then power off) and keeps the recorded rows; it
    is not an emergency stop. The recording is not good enough if more than 2 % of a drive's answers
    were lost, or if more than 5 periods of a periodic motion are bad or fewer than 2 are good.

    In a terminal: Ctrl-C is STOP. Exit code 3 if the motion is refused, 1 if a goal of --until is
    not reached by the last period, 6 if the recording is not good enough.
    """

    cell: CellName
    motion: Annotated[
        Path,
        Field(description="Motion file."),
        Option(positional=True, metavar="MOTION", file="input"),
    ]
    until: Annotated[
        tuple[str, ...],
        Field(
            description="End early when these standard deviations are reached, such as"
            " sx3<0.01kgm, fv_axis1<5% or torque<1.5Nm."
        ),
        Option(metavar="GOAL"),
    ] = ()
    feedforward: Annotated[
        Path | None,
        Field(description="Feedforward file of this motion, written by `compensate`."),
        Option(metavar="FEEDFORWARD", file="input"),
    ] = None
    model: Annotated[
        Path | None,
        Field(
            description="Model file, written by `identify`; the motion is refused if the model"
            " predicts more torque than a joint's limit."
        ),
        Option(metavar="MODEL", file="input"),
    ] = None
    despite_misfit: DespiteMisfitOfModel = False
    payload: Annotated[
        str | None,
        Field(
            description="What the robot carries. With --model as in `validate`: a payload file; a"
            " YAML file with known `bodies`; a run or session with a payload; `model`; or `none`."
            " Without --model the name of a payload in the plant file, which a simulated robot then"
            " carries."
        ),
        Option(metavar="PAYLOAD", file="input"),
    ] = None
    load_changes: LoadChangeFile = None
    frames: Annotated[
        bool,
        Field(description="Save all frames on the bus to frames.blf of the run."),
    ] = False
    simulation: Simulation = Simulation()
    faults: Annotated[
        Path | None,
        Field(description="Fault script: faults of a simulated cell and their times."),
        Option(group=SIMULATED, metavar="FILE", file="input"),
    ] = None
    tracker: Annotated[
        Path | None,
        Field(
            description="File to write what the simulated laser tracker measures (key `tracker` of"
            " the plant file), in the format that `stiffness` and `tracking` read."
        ),
        Option(group=SIMULATED, metavar="FILE", file="output", endings=(".csv",)),
    ] = None
    rehearse: Annotated[
        bool,
        Field(
            description="Before the recording, perform the motion once at a quarter of its"
            " speed, into a separate run."
        ),
        Option(group=BEFORE),
    ] = False
    cleared: Cleared = False
    axis_test: AxisTest = "required"
    practise: Practise = False
    live: Annotated[Live, Option(owned=True)] = Live()
    label: Annotated[OfFile, Option(group=FILES)] = None
    runs: RunsFolder = DEFAULT_RUNS


@dataclass(frozen=True)
class RecordResult:
    """A motion that was performed and recorded.

    Attributes:
        recorded: The run, and the estimate that was updated during it.
    """

    recorded: RecordedMotion

    @property
    def exit_code(self) -> int:
        """Exit code of the run; 1 if an accuracy goal was not reached."""
        return self.recorded.exit_code

    def document(self) -> dict[str, object]:
        """Return the JSON document of the run; for a stopped rehearsal, its folder and the stop."""
        from rid_daq.recording.recorded_run import stop_document

        run, accuracy = self.recorded.run, self.recorded.accuracy
        if self.recorded.rehearsal_only:
            return {"rehearsal": str(run.folder.path), **stop_document(run.outcome)}
        found = None if accuracy is None else _accuracy_document(accuracy)
        return run.document() | {"accuracy": found}

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield timing, accuracy, the motion's outcome, and the next command."""
        from rid_daq.operations.experiment.recorded_motion import REHEARSAL_ALONE

        run, accuracy = self.recorded.run, self.recorded.accuracy
        if self.recorded.rehearsal_only:
            yield Verdict(passed=False, text=f"{run.stop_sentence} {REHEARSAL_ALONE}")
            return
        yield Text(text=run.timing_sentence)
        if accuracy is not None and accuracy.running is not None:
            yield Text(text=f"Running estimate: {accuracy.running_sentence()}")
            yield Text(text=SINGLE_PERIODS)
        for sentence in [] if accuracy is None else accuracy.sentences():
            yield Text(text=sentence)
        yield from run.blocks()
        if run.is_usable:
            words = self.recorded.motion.next_command(run.folder.path)
            yield Next(words=tuple(map(str, words)))


def _accuracy_document(accuracy: AccuracyWatch) -> dict[str, object]:
    running = accuracy.running
    return {
        "relative_percent": None if running is None else running.relative_percent.tolist(),
        "relative_percent_of": "single periods",
        "reached": accuracy.reached if accuracy.goals else None,
        "periods": accuracy.periods,
        "goals": accuracy.sentences(),
    }


def run(request: RecordRequest, context: Context) -> RecordResult:
    """Record a motion."""
    from rid_daq.operations.experiment.recorded_motion import record_motion_file

    return RecordResult(record_motion_file(request, context))


OPERATION: Final = Operation(
    name="record",
    label="Record",
    request=RecordRequest,
    run=run,
    examples=(
        "record ir361 motion.yaml --label monday --until torque<1.5Nm",
        "record cell.yaml path.yaml --feedforward ahead.json --rehearse --live",
    ),
    opens_cell=True,
    moves=True,
    module="rid_daq.operations.experiment.recorded_motion",
)
