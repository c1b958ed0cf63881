"""`without_missing_velocities`: leaves out velocity columns that a source did not fill."""

from __future__ import annotations

from typing import Final

import numpy as np

from acquisition.imports.table import ImportTable
from acquisition.maps.import_map import ImportMap
from config.arrays import FloatArray
from config.column_file import each_column, has_few_values

_FEWEST_PLACES: Final = 10
"""Largest number of different positions of a joint at rest."""


def without_missing_velocities(
    import_map: ImportMap, table: ImportTable
) -> tuple[ImportMap, tuple[str, ...]]:
    """Return the map without velocity columns that are empty in too many rows, or 0 in all rows.

    A broadcaster without velocities writes NaN, an empty cell or 0. A velocity is optional, so that
    its column is left out if more rows lack it than `left_out_limit` permits. If fewer lack it,
    these rows count as damaged. A column of zeros is left out if its joint moves.

    Args:
        import_map: Map with which the table was read.
        table: The joints' positions, torques and velocities, and possibly temperatures.

    Returns:
        The map, and one finding for the columns that are left out.
    """
    n = len(import_map.joints)
    position, velocity = table.values[:, :n], table.values[:, 2 * n : 3 * n]
    share = np.zeros(n)
    if len(table.row):
        share = np.array([np.isnan(column).mean() for column in each_column(velocity)])
    lacks: dict[str, str] = {}
    for number, joint in enumerate(import_map.joints):
        if joint.velocity is None:
            continue
        if share[number] > import_map.left_out_limit:
            lacks[joint.joint] = f"{100.0 * share[number]:.3g} % of the rows"
        elif (velocity[:, number] == 0.0).all() and _moves(position[:, number]):
            lacks[joint.joint] = "0 in all rows, although the joint moves"
    if not lacks:
        return import_map, ()
    joints = tuple(
        joint.model_copy(update={"velocity": None}) if joint.joint in lacks else joint
        for joint in import_map.joints
    )
    named = ", ".join(f"{name} ({words})" for name, words in lacks.items())
    return import_map.model_copy(update={"joints": joints}), (
        f"Velocities are missing: {named}. They are not used; remove their columns from the map, or"
        " record them",
    )


def _moves(position: FloatArray) -> bool:
    return not has_few_values(position, _FEWEST_PLACES + 1)
