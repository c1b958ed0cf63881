"""`require_torques`: runs from which torques are to be learnt, or to be predicted, have some."""

from __future__ import annotations

from collections.abc import Sequence

from acquisition.processing.dead_torque import dead_torques
from config.errors import DataQualityError
from rid_daq.runs.run_data import RunData


def require_torques(runs: Sequence[RunData]) -> None:
    """Refuse runs in which a joint moves while its torque is always the same.

    Raises:
        DataQualityError: There is one.
    """
    for data in runs:
        dead = dead_torques(data.average if data.is_periodic else data.recording)
        if dead:
            recorded = data.import_report is None
            where = "torque object of its drive" if recorded else "torque column in its map"
            found = ", ".join(f"{joint} (always {value:g})" for joint, value in dead.items())
            raise DataQualityError(
                f"{data.folder.path}: no torque was measured of joints that move: {found}. Look at"
                f" the {where}",
                code="RID-RUN-NO-TORQUE",
            )
