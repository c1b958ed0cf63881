"""`stream`: follow a path with online compensation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from compensation.online.patience import BUFFER_S, CLIENT_PATIENCE_S
from config.ranges import BufferS, PatienceS
from rid_daq.blocks.block import AnyBlock, Next, Text
from rid_daq.operations.operation import Context, Operation
from rid_daq.operations.path.shared import LoopsFile, ModelFile, Temperature
from rid_daq.requests.cell_options import AxisTest, Cleared, OfFile, Practise, Simulation
from rid_daq.requests.option import (
    DEFAULT_RUNS,
    FILES,
    CarriedPayload,
    CellName,
    DespiteMisfit,
    LoadChangeFile,
    Option,
    RunsFolder,
)
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from rid_daq.recording.recorded_run import RecordedRun


class StreamOptions(Request):
    """Options of a streamed path."""

    compensated: Annotated[
        bool,
        Field(
            description="False: the feedforward is only the velocity of the path, without"
            " compensation by the model."
        ),
        Option(flag="plain", value=False),
    ] = True
    buffer_s: Annotated[
        BufferS,
        Field(description="Shortest time by which the path is read ahead of the robot."),
        Option(flag="buffer", unit="s", metavar="SECONDS"),
    ] = BUFFER_S
    patience_s: Annotated[
        PatienceS,
        Field(description="Longest wait for the first points of another program."),
        Option(flag="wait", unit="s", metavar="SECONDS"),
    ] = CLIENT_PATIENCE_S


class StreamRequest(Request):
    """Follow a path with online compensation: the feedforward is computed while the robot moves.

    The path comes from a motion file, or point by point from another program over a local socket.
    Every point is checked before it is driven. If points stop arriving, or a point is invalid, the
    robot slows down along the points that it already has until it rests.

    In a terminal: exit code 4 or 5 after such an end.
    """

    cell: CellName
    motion: Annotated[
        Path | None,
        Field(description="Motion file; if not set, another program sends the points."),
        Option(positional=True, metavar="[MOTION]", file="input"),
    ] = None
    model: ModelFile
    loop: LoopsFile
    socket: Annotated[
        Path | None,
        Field(
            description="Socket for the program that sends points, in a folder that you own; in"
            " the runtime directory if not set."
        ),
    ] = None
    options: StreamOptions = StreamOptions()
    despite_misfit: DespiteMisfit = False
    payload: CarriedPayload = None
    load_changes: LoadChangeFile = None
    temperature: Temperature = None
    simulation: Simulation = Simulation()
    cleared: Cleared = False
    axis_test: AxisTest = "required"
    practise: Practise = False
    label: Annotated[OfFile, Option(group=FILES)] = None
    runs: RunsFolder = DEFAULT_RUNS


@dataclass(frozen=True)
class StreamResult:
    """A path that was driven and recorded.

    Attributes:
        request: The request.
        run: The recorded motion.
        notes: Reasons to doubt the loops and the model, and effects that are not considered; they
            are shown before the motion.
    """

    request: StreamRequest
    run: RecordedRun
    notes: tuple[str, ...] = ()

    @property
    def exit_code(self) -> int:
        """Exit code of the run."""
        return self.run.exit_code

    def document(self) -> dict[str, object]:
        """Return the document of the run, with notes, load signals and the use of compensation."""
        more = {
            "compensated": self.request.options.compensated,
            "load_signals": self.load_signals,
            "notes": list(self.notes),
        }
        return self.run.document() | more

    @property
    def load_signals(self) -> list[dict[str, object]]:
        """The load changes that begin at a signal, each with the time of its signal."""
        from rid_daq.runs.changed_load import load_changes_of

        changes = load_changes_of(self.run.folder)
        return [
            {
                "change": number,
                "at_s": change.at_s,
                "came_s": change.came_s,
                "lateness_s": change.lateness_s,
                "in_window": change.in_window,
                "outcome": change.outcome,
            }
            for number, change in enumerate(() if changes is None else changes.changes, start=1)
            if change.signal is not None
        ]

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield timing, the motion's outcome, and the next command."""
        yield Text(text=self.run.timing_sentence)
        yield from self.run.blocks()
        if self.run.is_usable and self.request.motion is not None:
            yield Next(words=("tracking", str(self.run.folder.path)))


def run(request: StreamRequest, context: Context) -> StreamResult:
    """Stream a path."""
    from rid_daq.operations.path.streamed_path import stream_path

    return StreamResult(request, *stream_path(request, context))


OPERATION: Final = Operation(
    name="stream",
    label="Stream",
    request=StreamRequest,
    run=run,
    examples=(
        "stream ir361 path.yaml --model model.json --loop loops.json",
        "stream cell.yaml --model model.json --loop loops.json --socket points --wait 30",
    ),
    opens_cell=True,
    moves=True,
    module="rid_daq.operations.path.streamed_path",
)
