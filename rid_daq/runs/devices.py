"""`drives_with_serials`: drives of runs, with the serial numbers that the runs have recorded."""

from __future__ import annotations

from collections.abc import Sequence

from acquisition.runs.folder import RunFolder
from config.cell.cell import CellConfig
from config.load import load_bundled_or_path
from drivers.settings.write_log import DRIVE_WRITES, read_write_log
from rid_daq.runs.run_data import CELL


def drives_with_serials(
    cells: Sequence[CellConfig], folders: Sequence[RunFolder]
) -> tuple[tuple[str, str | None], ...]:
    """Return each drive of some cells with its serial numbers; None if no number is recorded.

    Raises:
        ConfigError, RecordingError: A manifest or a log of writes to drives cannot be read.
    """
    serials: dict[int, list[str]] = {}
    for folder in folders:
        if DRIVE_WRITES not in folder.manifest().files:
            continue
        for drive in read_write_log(folder.file(DRIVE_WRITES)):
            serial = drive.identity.serial
            known = serials.setdefault(drive.node_id, [])
            if serial is not None and str(serial) not in known:
                known.append(str(serial))
    axes = {axis.node_id: axis.joint for cell in cells for axis in cell.axes}
    return tuple(
        (f"drive of {joint} (node {node})", ", ".join(serials.get(node, ())) or None)
        for node, joint in axes.items()
    )


def cell_of_run(folder: RunFolder) -> CellConfig | None:
    """Return the cell as it was in a run; None for an imported recording.

    Raises:
        ConfigError: The cell file is damaged.
    """
    path = folder.file(CELL)
    return load_bundled_or_path(str(path), "cells", CellConfig) if path.exists() else None
