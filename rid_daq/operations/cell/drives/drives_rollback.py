"""`drives rollback`: undo the writes of a run to the drives."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import Field

from rid_daq.operations.cell.drives.restored_drives import RestoredDrives, RestoreRequest
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import Option


class DrivesRollbackRequest(RestoreRequest):
    """Undo the writes of a run to a cell's drives: restore the values before the run.

    The command also works for a run whose program was killed. Refusals and exit codes are those of
    `restore`.
    """

    run: Annotated[
        str,
        Field(description="Run, or the write log of another command."),
        Option(positional=True, metavar="RUN"),
    ]


def run(request: DrivesRollbackRequest, _context: Context) -> RestoredDrives:
    """Restore the settings as they were before a run."""
    from rid_daq.operations.cell.drives.settings_files import restore_settings
    from rid_daq.session.drive_writes import settings_before_writes

    return restore_settings(settings_before_writes(request.runs, request.run), request)


OPERATION: Final = Operation(
    name="drives rollback",
    label="Undo writes to drives",
    request=DrivesRollbackRequest,
    run=run,
    examples=("drives rollback ir361 latest --dry-run", "drives rollback cell.yaml latest --store"),
    opens_cell=True,
    module="rid_daq.operations.cell.drives.settings_files",
)
