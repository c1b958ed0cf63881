"""`drives backup`: save the settings of a cell's drives to a file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from rid_daq.blocks.block import AnyBlock, Next, Text
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import FILES, CellName, Option, Overwrite
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from drivers.settings.saved_drive import DriveBackup


class DrivesBackupRequest(Request):
    """Save the settings of a cell's drives to a file; nothing is written to the drives.

    If an axis names a data sheet (EDS), all writable objects of its drive are saved; otherwise the
    objects that CiA 301 and CiA 402 define.
    """

    cell: CellName
    output: Annotated[
        Path,
        Field(description="File to write (JSON)."),
        Option(short="o", metavar="FILE", group=FILES, file="output"),
    ]
    overwrite: Overwrite = False


@dataclass(frozen=True)
class DrivesBackup:
    """Result of a backup.

    Attributes:
        backup: The saved settings.
    """

    request: DrivesBackupRequest
    backup: DriveBackup

    @property
    def counts(self) -> dict[int, int]:
        """Number of settings by node id."""
        return {drive.node_id: len(drive.values) for drive in self.backup.drives}

    def document(self) -> dict[str, object]:
        """Return the file name and the number of settings of every node."""
        file = str(self.request.output)
        return {"cell": self.backup.cell, "file": file, "settings": self.counts}

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the file name, and the command that compares the file with the drives."""
        cell, output = self.request.cell, str(self.request.output)
        counts = (f"{count} settings of node {node}" for node, count in self.counts.items())
        yield Text(text=f"{output}: wrote {', '.join(counts)}.")
        yield Next(words=("drives", "restore", cell, output, "--dry-run"))


def run(request: DrivesBackupRequest, _context: Context) -> DrivesBackup:
    """Read the settings and write the file."""
    from rid_daq.operations.cell.drives.settings_files import backup_drives

    kept = backup_drives(request.cell, request.output, overwrite=request.overwrite)
    return DrivesBackup(request, kept)


OPERATION: Final = Operation(
    name="drives backup",
    label="Back up drives",
    request=DrivesBackupRequest,
    run=run,
    examples=(
        "drives backup ir361 --output drives.json",
        "drives backup cell.yaml -o drives.json --overwrite",
    ),
    opens_cell=True,
    module="rid_daq.operations.cell.drives.settings_files",
)
