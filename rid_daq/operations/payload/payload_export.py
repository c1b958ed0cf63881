"""`payload export`: write load data for a robot controller."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, TypedDict

from pydantic import Field

from identification.choices import LoadFormat
from rid_daq.blocks.block import AnyBlock, Next, Text, Verdict
from rid_daq.operations.operation import Context, Operation
from rid_daq.operations.payload.shared import PayloadFile
from rid_daq.requests.option import DEFAULT_RUNS, FILES, Option, Overwrite, RunsFolder
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from identification.payload.estimate import PayloadEstimate


class PayloadExportRequest(Request):
    """Write a payload in the format of a robot controller, with units and frame at the top.

    The frame is the flange, which is the tool frame of the robot file. The values are those of the
    closest physically consistent body. A payload that has not passed its verdict is refused. The
    text is parsed again and compared before it is written.
    """

    payload: PayloadFile
    to: Annotated[
        LoadFormat,
        Field(description="Format of the load data, named after the controller's manufacturer."),
    ]
    output: Annotated[
        Path,
        Field(description="File to write."),
        Option(
            short="o",
            metavar="FILE",
            group=FILES,
            file="output",
            endings=(
                *dict.fromkeys(each.ending for each in LoadFormat),
                *(".ls", ".dat", ".jbi", ".xml"),
            ),
        ),
    ]
    overwrite: Overwrite = False
    runs: RunsFolder = DEFAULT_RUNS


class LoadDataDocument(TypedDict):
    """Written load data."""

    file: str
    format: str
    robot: str
    mass_kg: float
    text: str
    notes: list[str]


@dataclass(frozen=True)
class PayloadExportResult:
    """Load data that were written.

    Attributes:
        request: The request.
        estimate: The payload.
        text: Content of the file.
        notes: Points that a person should check.
    """

    request: PayloadExportRequest
    estimate: PayloadEstimate
    text: str
    notes: tuple[str, ...]

    def document(self) -> LoadDataDocument:
        """Return the text of the file and the payload's mass."""
        estimate = self.estimate
        return {
            "file": str(self.request.output),
            "format": self.request.to.value,
            "robot": estimate.robot.name,
            "mass_kg": estimate.body.mass_kg,
            "text": self.text,
            "notes": list(self.notes),
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the text, notes, the file name and the next command."""
        request = self.request
        yield Text(text=self.text.rstrip("\n"))
        if self.notes:
            yield Text(text=f"note: {' '.join(self.notes)}")
        yield Verdict(
            passed=True, text=f"Wrote {request.output}; reading it back gives the same values"
        )
        yield Text(
            text="Enter the load data in the controller, save the controller's load data to a"
            " file, and compare:"
        )
        words = ("payload", "read-back", str(request.payload), "SAVED", "--from", request.to.value)
        yield Next(words=words)


def run(request: PayloadExportRequest, _context: Context) -> PayloadExportResult:
    """Write the load data."""
    from rid_daq.operations.payload.load_data import export_payload

    return export_payload(request)


OPERATION: Final = Operation(
    name="payload export",
    label="Write load data",
    request=PayloadExportRequest,
    run=run,
    examples=(
        "payload export payload.json --to kuka --output load.src",
        "payload export latest --to ur --output load.script --overwrite",
    ),
    module="rid_daq.operations.payload.load_data",
)
