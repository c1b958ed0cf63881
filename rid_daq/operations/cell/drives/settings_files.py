"""Save the settings of a cell's drives, and restore them."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path

from config.errors import ConfigError
from config.load import LoadedCell, load_cell
from drivers.cell import open_cell
from drivers.servo.drive_settings import (
    read_drive,
    refuse_other_drive,
    restore_drive,
    store_settings,
)
from drivers.servo.service import DriveService
from drivers.settings.saved_drive import DriveBackup, SavedDrive
from drivers.settings.write_log import WriteLog
from rid_daq.operations.cell.drives.restored_drives import RestoredDrives, RestoreRequest
from rid_daq.runs import made_file
from rid_daq.runs.output_file import refuse_output
from rid_daq.session.cells import hold_reachable_cell
from rid_daq.session.drive_writes import new_write_log

STORE_TIMEOUT_S = 10.0


def backup_drives(cell: str, path: Path, *, overwrite: bool) -> DriveBackup:
    """Save the settings of a cell's drives to a file; nothing is written to the drives.

    Raises:
        ConfigError, RecordingError: The file exists already, or cannot be written.
        RidDaqError: Another session holds the cell, or a drive does not answer.
    """
    refuse_output(path, overwrite, made_file.BACKUP)
    loaded = load_cell(cell)
    eds_files = loaded.eds_files or (None,) * len(loaded.config.axes)
    eds_of = {axis.node_id: eds for axis, eds in zip(loaded.config.axes, eds_files, strict=True)}
    with _open_drive_service(loaded) as service:
        drives = tuple(read_drive(port, eds_of[port.node_id]) for port in service.ports())
    backup = DriveBackup(
        format=1,
        cell=loaded.config.name,
        created_utc=datetime.now(UTC).isoformat(timespec="seconds"),
        drives=drives,
    )
    backup.write(path)
    return backup


def restore_settings(saved: Sequence[SavedDrive], request: RestoreRequest) -> RestoredDrives:
    """Restore settings of a cell's drives.

    Args:
        saved: Settings from a backup, or from before a run.
        request: Options of the command.

    Raises:
        ConfigError: The drives are not those of the cell.
        PreflightError: A drive was replaced by another one, or is powered; nothing was written. Or
            a drive does not store its settings.
        RidDaqError: Another session holds the cell, or a drive does not answer.
    """
    loaded = load_cell(request.cell)
    joints = {axis.node_id: axis.joint for axis in loaded.config.axes}
    strange = [str(drive.node_id) for drive in saved if drive.node_id not in joints]
    if strange:
        raise ConfigError(
            f"cell {loaded.config.name} has no drive with node id {', '.join(strange)}: give the"
            " cell from which the settings were saved",
            code="RID-CELL-JOINTS",
        )
    write_log = None if request.dry_run else new_write_log(request.runs)
    with _open_drive_service(loaded, write_log) as service:
        ports = {port.node_id: port for port in service.ports()}
        for drive in saved:
            refuse_other_drive(ports[drive.node_id], drive)
        if not request.dry_run:
            service.leave_operational()
        settings = [
            setting
            for drive in saved
            for setting in restore_drive(ports[drive.node_id], drive, dry_run=request.dry_run)
        ]
        if request.store and not request.dry_run:
            for port in service.ports(STORE_TIMEOUT_S):
                store_settings(port)
    written = write_log is not None and write_log.path.exists()
    return RestoredDrives(
        request,
        loaded.config.name,
        joints,
        tuple(settings),
        write_log.path if write_log is not None and written else None,
    )


@contextlib.contextmanager
def _open_drive_service(
    loaded: LoadedCell, write_log: WriteLog | None = None
) -> Iterator[DriveService]:
    """Yield the drive service of a cell; the cell is locked until the `with` block ends."""
    with (
        hold_reachable_cell(loaded, any_eds=True) as (cell, _),
        open_cell(cell, loaded.robot, write_log) as opened,
    ):
        opened.axes.service.claim_bus()
        yield opened.axes.service
