"""`refine`: correct a feedforward by the error that remained with it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final, NamedTuple

from rid_daq.blocks.block import AnyBlock, Cells, Next, Text, note_blocks, table
from rid_daq.operations.operation import Context, Operation
from rid_daq.operations.path.shared import FeedforwardOutput, LoopsFile, ModelFile, Temperature
from rid_daq.requests.option import DEFAULT_RUNS, Overwrite, RunNames, RunsFolder, Unfinished
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from rid_daq.operations.path.feedforward import Refined


class RefineRequest(Request):
    """Correct a feedforward by the error that remained with it.

    Give one run of a periodic motion, or at least two runs of another motion, all with the same
    feedforward. Record the motion with the new file, and refine again. Once the remaining error is
    noise, or no longer shrinks, the command says so and writes the feedforward unchanged. An error
    that grows is refused.
    """

    run: RunNames
    model: ModelFile
    loop: LoopsFile
    output: FeedforwardOutput
    temperature: Temperature = None
    overwrite: Overwrite = False
    unfinished: Unfinished = False
    runs: RunsFolder = DEFAULT_RUNS


class _Axis(NamedTuple):
    """The remaining error of an axis."""

    joint: str
    rms: float
    over_noise: float
    bound: float


@dataclass(frozen=True)
class RefineResult:
    """A feedforward that was refined, or needs no more of it.

    Attributes:
        request: What was asked for.
        refined: The remaining error and its correction.
    """

    request: RefineRequest
    refined: Refined
    exit_code: int = 0

    @property
    def has_stalled(self) -> bool:
        """True if the error is not noise and no longer shrinks."""
        return self.refined.stalled and not self.refined.found.finished

    def document(self) -> dict[str, object]:
        """Return the numbers."""
        measured, found = self.refined.measured, self.refined.found
        return {
            "feedforward": str(self.request.output),
            "finished": self.refined.finished,
            "stalled": self.has_stalled,
            "repetitions": measured.repetitions,
            "noise_limit": found.noise_limit,
            "band_hz": found.bound.band_hz,
            "axes": [axis._asdict() for axis in self._axes()],
            "notes": self.refined.notes,
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield notes, the remaining error, and what comes next."""
        yield from note_blocks(self.refined.notes)
        yield table(
            self._axes(),
            Cells("joint", lambda axis: axis.joint),
            Cells("RMS error", lambda axis: 1e3 * axis.rms, "mrad or mm"),
            Cells("power / noise", lambda axis: axis.over_noise, digits=3),
            Cells("remains at most", lambda axis: 100.0 * axis.bound, "%", 3),
        )
        if self.has_stalled:
            yield Text(text="The error no longer shrinks: the rest does not repeat. Done.")
        elif self.refined.finished:
            yield Text(text="The remaining error is noise. Done.")
        else:
            band_hz = self.refined.found.bound.band_hz
            yield Text(
                text=f"Up to {band_hz:.3g} Hz at most this share of an error"
                " remains after each refinement, for loops within their intervals. Friction may"
                " leave more next to reversals."
            )
            cell, motion = self.refined.cell, str(self.refined.motion)
            yield Next(words=("record", cell, motion, "--feedforward", str(self.request.output)))
            yield Text(text="Then refine again with that run.")

    def _axes(self) -> list[_Axis]:
        measured, found = self.refined.measured, self.refined.found
        columns = zip(
            measured.joint_names,
            measured.rms.tolist(),
            found.over_noise.tolist(),
            found.bound.largest.tolist(),
            strict=True,
        )
        return [_Axis(*row) for row in columns]


def run(request: RefineRequest, _context: Context) -> RefineResult:
    """Correct the feedforward and write the next one."""
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
