"""`compensate`: compute the velocity feedforward that reduces a motion's path error."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, TypedDict

from pydantic import Field

from rid_daq.blocks.block import AnyBlock, Cells, Interval, Next, Text, note_blocks, table
from rid_daq.operations.operation import Context, Operation
from rid_daq.operations.path.shared import FeedforwardOutput, LoopsFile, ModelFile, Temperature
from rid_daq.requests.option import (
    DEFAULT_RUNS,
    FILES,
    CarriedPayload,
    CellName,
    DespiteMisfit,
    LoadChangeFile,
    Option,
    Overwrite,
    RunsFolder,
    Unfinished,
)
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from compensation.feedforward.file import TuningEntry
    from rid_daq.operations.path.feedforward import CompensatedMotion


class CompensateRequest(Request):
    """Compute the velocity feedforward with which the drives produce the torques of a motion.

    If a reference run is given, scale and delay of the feedforward are tuned to it for each joint.
    It is a run of a periodic motion, this one or another, with or without compensation; its periods
    are averaged. Nothing moves. Perform the motion with the result by `rid-daq record CELL MOTION
    --feedforward FEEDFORWARD`.
    """

    cell: CellName
    motion: Annotated[
        Path,
        Field(description="Motion file."),
        Option(positional=True, metavar="MOTION", file="input"),
    ]
    model: ModelFile
    loop: LoopsFile
    output: FeedforwardOutput
    reference: Annotated[
        str | None,
        Field(
            description="Run of a periodic motion. Scale and delay of the feedforward are tuned to"
            " this run, joint by joint."
        ),
        Option(metavar="RUN"),
    ] = None
    despite_misfit: DespiteMisfit = False
    payload: CarriedPayload = None
    load_changes: LoadChangeFile = None
    temperature: Temperature = None
    deflection: Annotated[
        bool,
        Field(
            description="Correct the deflection of the gears whose stiffness_nm_rad is in the robot"
            " file: the motors then follow positions at which the links are on the path."
        ),
        Option(negatable=True),
    ] = True
    overwrite: Overwrite = False
    unfinished: Annotated[Unfinished, Option(group=FILES, needs="reference")] = False
    runs: RunsFolder = DEFAULT_RUNS


class CompensateDocument(TypedDict):
    """Feedforward file and its corrections."""

    feedforward: str
    rows: int
    largest_correction: object
    largest_deflection: object
    tuning: dict[str, object] | None
    notes: Sequence[str]


@dataclass(frozen=True)
class CompensateResult:
    """A feedforward that was written.

    Attributes:
        request: The request.
        made: Size of the feedforward, and its tuning to the reference run.
    """

    request: CompensateRequest
    made: CompensatedMotion

    def document(self) -> CompensateDocument:
        """Return the path of the feedforward, its number of rows, corrections, tuning and notes."""
        tuning = self.made.tuning
        return {
            "feedforward": str(self.request.output),
            "rows": self.made.rows,
            "largest_correction": self.made.largest,
            "largest_deflection": self.made.bent,
            "tuning": None if tuning is None else tuning.model_dump(mode="json"),
            "notes": self.made.notes,
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield notes, the tuning, the largest corrections, and the next command."""
        yield from note_blocks(self.made.notes)
        if self.made.tuning is not None:
            yield from _tuning_blocks(self.made.tuning, tuple(self.made.largest))
        changes = ", ".join(f"{name} {value:.3g}" for name, value in self.made.largest.items())
        yield Text(text=f"Largest correction of the speed [rad/s or m/s]: {changes}.")
        if self.made.bent:
            bent = ", ".join(f"{name} {1e3 * value:.3g}" for name, value in self.made.bent.items())
            yield Text(
                text=f"Largest deflection of the gears, which the position reference contains"
                f" [mrad or mm]: {bent}."
            )
        request = self.request
        words = ("record", request.cell, str(request.motion), "--feedforward", str(request.output))
        yield Next(words=words)


def _tuning_blocks(tuning: TuningEntry, names: tuple[str, ...]) -> Iterator[AnyBlock]:
    yield Text(
        text="Scale and delay of the feedforward, tuned to the reference run. For a joint whose"
        " values the run does not determine, scale 1 and delay 0 are applied."
    )
    yield table(
        range(len(names)),
        Cells("joint", lambda j: names[j]),
        Cells("scale ± 2σ", lambda j: Interval.of(tuning.scale[j], tuning.scale_std[j])),
        Cells("applied scale", lambda j: tuning.applied_scale[j]),
        Cells(
            "delay ± 2σ", lambda j: Interval.of(tuning.delay_s[j], tuning.delay_std_s[j], 1e3), "ms"
        ),
        Cells("applied delay", lambda j: 1e3 * tuning.applied_delay_s[j], "ms"),
    )


def run(request: CompensateRequest, _context: Context) -> CompensateResult:
    """Compute the feedforward and write it."""
    from rid_daq.operations.path.feedforward import compensate_motion

    return CompensateResult(request, compensate_motion(request))


OPERATION: Final = Operation(
    name="compensate",
    label="Compute a feedforward",
    request=CompensateRequest,
    run=run,
    examples=(
        "compensate ir361 circle.yaml --model model.json --loop loops.json --output ff.json",
        "compensate ir361 circle.yaml --model model.json --loop loops.json --output ff.json"
        " --reference latest --overwrite",
        "compensate ir361 circle.yaml --model model.json --loop loops.json --output ff.json"
        " --payload payload.json",
    ),
    module="rid_daq.operations.path.feedforward",
)
