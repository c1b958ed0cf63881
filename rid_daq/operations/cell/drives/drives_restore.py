"""`drives restore`: restore the settings of a cell's drives from a backup."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

from pydantic import Field

from rid_daq.operations.cell.drives.restored_drives import RestoredDrives, RestoreRequest
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import Option


class DrivesRestoreRequest(RestoreRequest):
    """Restore the settings of a cell's drives from a backup.

    Settings that differ are written and read back. The command is refused while a session runs, if
    a drive is powered, or if a drive's identity (1018h) differs from that in the backup. The exit
    code is 3 if a drive does not contain the saved settings afterwards.
    """

    file: Annotated[
        Path,
        Field(description="Backup of these drives, from `drives backup`."),
        Option(positional=True, metavar="FILE", file="input"),
    ]


def run(request: DrivesRestoreRequest, _context: Context) -> RestoredDrives:
    """Restore the settings of a backup."""
    from drivers.settings.saved_drive import DriveBackup
    from rid_daq.operations.cell.drives.settings_files import restore_settings

    return restore_settings(DriveBackup.read(request.file).drives, request)


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
