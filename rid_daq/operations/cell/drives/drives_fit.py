"""`drives fit`: print the cell file keys that a drive needs, from its data sheet (EDS)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from rid_daq.blocks.block import AnyBlock, Text, Verdict
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import Option
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from rid_daq.operations.cell.drives.eds_file_fit import EdsFileFit


class DrivesFitRequest(Request):
    """Print the keys of the cell file that adapt rid-daq to the drive of a data sheet.

    Numbers that no data sheet contains are printed as '?'; a cell file is refused until they are
    replaced. The exit code is 1 if the drive cannot be used; the printed reason states whether it
    concerns safety.
    """

    eds: Annotated[
        Path,
        Field(description="The drive's data sheet (EDS or DCF)."),
        Option(positional=True, metavar="SHEET", file="input"),
    ]
    cell: Annotated[
        str,
        Field(description="The cell whose first axis the drive will move."),
        Option(metavar="CELL"),
    ] = "ir361"


@dataclass(frozen=True)
class DrivesFitResult:
    """Profile that fits a data sheet.

    Attributes:
        eds: Path of the data sheet.
        found: The profile and its keys.
    """

    eds: Path
    found: EdsFileFit

    @property
    def exit_code(self) -> int:
        """Exit code 1 if the drive cannot be used."""
        from rid_daq.terminal.exit_codes import ExitCode

        return ExitCode.DONE if self.found.fit.accepted else ExitCode.VERDICT_FAILED

    def document(self) -> dict[str, object]:
        """Return the keys, and the objects that the drive lacks."""
        done = self.found.fit
        return {
            "file": str(self.eds),
            "accepted": done.accepted,
            "profile": done.base,
            "identity": self.found.identity,
            "servo": done.keys,
            "reason": done.reason,
            "concerns_safety": done.concerns_safety,
            "lacks": [
                {"object": each.object_name, "name": each.name, "safety": done.protects(each)}
                for each in done.findings
            ],
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the keys, the objects that the drive lacks, and the verdict."""
        done = self.found.fit
        for line in done.lines:
            yield Text(text=line)
        for each in done.findings:
            safety = "needed for safety" if done.protects(each) else "not needed for safety"
            yield Text(text=f"the drive lacks {each.object_name} {each.name} ({safety})")
        if not done.accepted:
            text = f"{self.eds}: this drive cannot be used: {done.reason}."
            yield Verdict(passed=False, text=text)
            return
        profile = f"with the bundled profile {done.base}" if done.base else "by CiA 402"
        keys = f" and the {len(done.lines)} lines above" if done.lines else ""
        yield Verdict(passed=True, text=f"{self.eds}: this drive can be used {profile}{keys}.")


def run(request: DrivesFitRequest, _context: Context) -> DrivesFitResult:
    """Compare the data sheet with the bundled profiles."""
    from rid_daq.operations.cell.drives.eds_file_fit import fit_eds_file

    return DrivesFitResult(request.eds, fit_eds_file(request.eds, request.cell))


OPERATION: Final = Operation(
    name="drives fit",
    label="Fit a drive",
    request=DrivesFitRequest,
    run=run,
    examples=("drives fit drive.eds --json", "drives fit drive.dcf --cell cell.yaml"),
    module="rid_daq.operations.cell.drives.eds_file_fit",
)
