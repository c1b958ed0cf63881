"""`without_missing_velocities`: leaves out velocity columns that a source did not fill."""

from __future__ import annotations

import numpy as np

from acquisition.imports.table import ImportTable
from acquisition.maps.import_map import ImportMap


def without_missing_velocities(
    import_map: ImportMap, table: ImportTable
) -> tuple[ImportMap, tuple[str, ...]]:
    """Return the map without velocity columns that are empty in too many rows.

    A broadcaster without velocities writes NaN or an empty cell. A velocity is optional, so that
    its column is left out if more rows lack it than `left_out_limit` permits. If fewer lack it,
    these rows count as damaged.

    Args:
        import_map: Map with which the table was read.
        table: The joints' positions, torques and velocities, and possibly temperatures.

    Returns:
        The map, and one finding for the columns that are left out.
    """
    n = len(import_map.joints)
    share = np.isnan(table.values[:, 2 * n : 3 * n]).mean(axis=0) if len(table.row) else np.zeros(n)
    lacks = {
        joint.joint: 100.0 * part
        for joint, part in zip(import_map.joints, share.tolist(), strict=True)
        if joint.velocity is not None and part > import_map.left_out_limit
    }
    if not lacks:
        return import_map, ()
    joints = tuple(
        joint.model_copy(update={"velocity": None}) if joint.joint in lacks else joint
        for joint in import_map.joints
    )
    named = ", ".join(f"{name} ({percent:.3g} % of the rows)" for name, percent in lacks.items())
    return import_map.model_copy(update={"joints": joints}), (
        f"Velocities are missing: {named}. They are not used; remove their columns from the map, or"
        " record them",
    )
