"""`drives restore`: make the drives hold what a backup says."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from pydantic import Field

from rid_daq.operations.cell.drives.restored import RestoredDrives, RestoreRequest
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import Option


class DrivesRestoreRequest(RestoreRequest):
    """Make a cell's drives hold what a backup says; differing settings are written and read back.

    Refused while a session runs, if a drive is powered, or if one is another drive than the
    backup's (1018h). The exit code is 3 if a drive does not hold the saved settings afterwards.
    """

    file: Annotated[
        Path,
        Field(description="A backup of these drives."),
        Option(positional=True, metavar="FILE", file="input"),
    ]


def run(request: DrivesRestoreRequest, _context: Context) -> RestoredDrives:
    """Put the settings of a backup back."""
    from rid_daq.operations.cell.drives.settings_files import restore_backup

    return restore_backup(request.file, request)


OPERATION: Final = Operation(
    name="drives restore",
    label="Restore drives",
    request=DrivesRestoreRequest,
    run=run,
    examples=(
        "drives restore cell.yaml drives.json --dry-run",
        "drives restore cell.yaml drives.json --store",
    ),
    opens_cell=True,
    module="rid_daq.operations.cell.drives.settings_files",
)
