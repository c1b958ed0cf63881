"""`refine`: correct a feedforward by the path error that was measured with it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, NamedTuple, TypedDict

from rid_daq.blocks.block import AnyBlock, Cells, Next, Text, note_blocks, table
from rid_daq.operations.operation import Context, Operation
from rid_daq.operations.path.shared import FeedforwardOutput, LoopsFile, ModelFile, Temperature
from rid_daq.requests.option import (
    DEFAULT_RUNS,
    CarriedPayload,
    DespiteMisfit,
    Overwrite,
    RunNames,
    RunsFolder,
    Unfinished,
)
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from rid_daq.operations.path.feedforward import RefinedFeedforward


class RefineRequest(Request):
    """Correct a feedforward by the path error that was measured with it.

    Give one run of a periodic motion, or at least two runs of another motion, all with the same
    feedforward. Record the motion with the new file, and refine again. If the remaining error is
    noise, or no longer shrinks, the command says so and writes the feedforward unchanged. If the
    error has grown by more than 20 %, the command ends with an error and writes nothing.
    """

    run: RunNames
    model: ModelFile
    loop: LoopsFile
    output: FeedforwardOutput
    despite_misfit: DespiteMisfit = False
    payload: CarriedPayload = None
    temperature: Temperature = None
    overwrite: Overwrite = False
    unfinished: Unfinished = False
    runs: RunsFolder = DEFAULT_RUNS


class _AxisError(NamedTuple):
    """Remaining path error of an axis."""

    joint: str
    rms: float
    over_noise: float
    bound: float


class RefineDocument(TypedDict):
    """Remaining path errors and their bounds."""

    feedforward: str
    finished: bool
    stalled: bool
    repetitions: int
    noise_limit: float
    band_hz: float
    axes: list[dict[str, object]]
    notes: Sequence[str]


@dataclass(frozen=True)
class RefineResult:
    """Result of one refinement of a feedforward.

    Attributes:
        request: The request.
        refined: The remaining error and its correction.
    """

    request: RefineRequest
    refined: RefinedFeedforward

    @property
    def has_stalled(self) -> bool:
        """True if the path error is larger than noise but no longer shrinks."""
        return self.refined.stalled and not self.refined.found.finished

    def document(self) -> RefineDocument:
        """Return the remaining path errors and their bounds as numbers."""
        measured, found = self.refined.measured, self.refined.found
        return {
            "feedforward": str(self.request.output),
            "finished": self.refined.finished,
            "stalled": self.has_stalled,
            "repetitions": measured.repetitions,
            "noise_limit": found.noise_limit,
            "band_hz": found.bound.band_hz,
            "axes": [axis._asdict() for axis in self._axis_errors()],
            "notes": self.refined.notes,
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield notes, the remaining error, and the next commands."""
        yield from note_blocks(self.refined.notes)
        yield table(
            self._axis_errors(),
            Cells("joint", lambda axis: axis.joint),
            Cells("RMS error", lambda axis: 1e3 * axis.rms, "mrad or mm"),
            Cells("power / noise", lambda axis: axis.over_noise, digits=3),
            Cells("largest remaining fraction", lambda axis: 100.0 * axis.bound, "%", 3),
        )
        if self.has_stalled:
            yield Text(
                text="The error is larger than the noise, but no longer shrinks. The refinement is"
                " complete."
            )
        elif self.refined.finished:
            yield Text(text="The remaining error is noise. The refinement is complete.")
        else:
            band_hz = self.refined.found.bound.band_hz
            yield Text(
                text="If the loops are within their intervals, each refinement reduces an error"
                f" up to {band_hz:.3g} Hz at least to its largest remaining fraction. Near"
                " reversals, friction can leave a larger error."
            )
            cell, motion = self.refined.cell, str(self.refined.motion)
            yield Next(words=("record", cell, motion, "--feedforward", str(self.request.output)))
            yield Text(text="Then refine again with the new run.")

    def _axis_errors(self) -> list[_AxisError]:
        measured, found = self.refined.measured, self.refined.found
        columns = zip(
            measured.joint_names,
            measured.rms.tolist(),
            found.over_noise.tolist(),
            found.bound.largest.tolist(),
            strict=True,
        )
        return [_AxisError(*row) for row in columns]


def run(request: RefineRequest, _context: Context) -> RefineResult:
    """Correct the feedforward and write the new one."""
    from rid_daq.operations.path.feedforward import refine_feedforward

    return RefineResult(request, refine_feedforward(request))


OPERATION: Final = Operation(
    name="refine",
    label="Refine a feedforward",
    request=RefineRequest,
    run=run,
    examples=(
        "refine latest --model model.json --loop loops.json --output ff2.json",
        "refine first second --model model.json --loop loops.json --output ff2.json"
        " --temperature warm",
    ),
    module="rid_daq.operations.path.feedforward",
)
