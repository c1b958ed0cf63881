"""`payload read-back`: compare the load data of a controller with a payload."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from config.ranges import TolerancePercent
from identification.choices import REPORTED, LoadFormat
from rid_daq.blocks.block import AnyBlock, Cells, table
from rid_daq.operations.operation import Context, Operation
from rid_daq.operations.payload.shared import PayloadFile
from rid_daq.requests.option import DEFAULT_RUNS, Option, RunsFolder
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from identification.payload.body import PayloadBody
    from rid_daq.report.sections.verdict import VerdictSection


class PayloadReadBackRequest(Request):
    """Read load data and compare them with a payload.

    Three quantities are compared: the mass, the centre of gravity (relative to its distance from
    the flange) and the inertia (relative to its largest moment).

    In a terminal: exit code 1 if they differ by more than --tolerance.
    """

    payload: PayloadFile
    file: Annotated[
        Path | None,
        Field(description="File with load data, exported by rid-daq or saved by the controller."),
        Option(positional=True, metavar="FILE", file="input"),
    ] = None
    form: Annotated[
        LoadFormat,
        Field(description="Format of the load data, named after the controller's manufacturer."),
        Option(flag="from"),
    ]
    text: Annotated[str, Field(description="Load data as text, instead of a file.")] = ""
    tolerance_percent: Annotated[
        TolerancePercent,
        Field(description="Largest allowed difference; controllers round their values."),
        Option(flag="tolerance", unit="%"),
    ] = 0.1
    runs: RunsFolder = DEFAULT_RUNS


@dataclass(frozen=True)
class PayloadReadBackResult:
    """Load data that were compared.

    Attributes:
        request: The request.
        source: Path of the file, or a description of the text.
        measured: The measured payload.
        found: Payload of the load data.
        verdict: Verdict on the difference.
    """

    request: PayloadReadBackRequest
    source: str
    measured: PayloadBody
    found: PayloadBody
    verdict: VerdictSection

    @property
    def exit_code(self) -> int:
        """Exit code 1 if the load data differ from the payload by more than the tolerance."""
        from rid_daq.terminal.exit_codes import ExitCode

        return ExitCode.DONE if self.verdict.passed else ExitCode.VERDICT_FAILED

    def document(self) -> dict[str, object]:
        """Return the values that were read, and the verdict."""
        read = self.found.reported.tolist()
        return {
            "file": self.source,
            "format": self.request.form.value,
            "verdict": self.verdict,
            "read": dict(zip(REPORTED, read, strict=True)),
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield measured and read values, and the verdict."""
        from identification.payload.body import REPORTED_UNITS
        from rid_daq.report.section_blocks.verdict import verdict_blocks

        measured, read = self.measured.reported.tolist(), self.found.reported.tolist()
        yield table(
            range(len(REPORTED)),
            Cells("parameter", lambda i: REPORTED[i]),
            Cells("measured", lambda i: measured[i], digits=6),
            Cells("read", lambda i: read[i], digits=6),
            Cells("unit", lambda i: REPORTED_UNITS[i]),
        )
        yield from verdict_blocks(self.verdict)


def run(request: PayloadReadBackRequest, _context: Context) -> PayloadReadBackResult:
    """Compare the load data."""
    from rid_daq.operations.payload.load_data import read_back_payload

    return read_back_payload(request)


OPERATION: Final = Operation(
    name="payload read-back",
    label="Compare load data",
    request=PayloadReadBackRequest,
    run=run,
    examples=(
        "payload read-back payload.json saved.src --from kuka",
        "payload read-back latest saved.script --from ur --tolerance 0.5 --json",
    ),
    module="rid_daq.operations.payload.load_data",
)
