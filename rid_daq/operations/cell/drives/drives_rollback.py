"""`drives rollback`: undo what a run wrote to the drives."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import Field

from rid_daq.operations.cell.drives.restored import RestoredDrives, RestoreRequest
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import Option


class DrivesRollbackRequest(RestoreRequest):
    """Undo what a run wrote to a cell's drives: they hold what they held before it.

    It also undoes a run whose program was killed. Refusals and exit codes are those of `restore`.
    """

    run: Annotated[
        str,
        Field(description="A run, or the write log of another command."),
        Option(positional=True, metavar="RUN"),
    ]


def run(request: DrivesRollbackRequest, _context: Context) -> RestoredDrives:
    """Put the settings before a run back."""
    from rid_daq.operations.cell.drives.settings_files import roll_back

    return roll_back(request.run, request)


OPERATION: Final = Operation(
    name="drives rollback",
    label="Undo writes to drives",
    request=DrivesRollbackRequest,
    run=run,
    examples=("drives rollback ir361 latest --dry-run", "drives rollback cell.yaml latest --store"),
    opens_cell=True,
    module="rid_daq.operations.cell.drives.settings_files",
)
