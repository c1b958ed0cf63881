"""`require_torques`: refuse runs without measured torques."""

from __future__ import annotations

from collections.abc import Sequence

from acquisition.processing.dead_torque import dead_torques
from config.errors import DataQualityError
from rid_daq.runs.run_data import RunData


def require_torques(runs: Sequence[RunData]) -> None:
    """Refuse runs in which a joint moves while its torque is constant.

    Raises:
        DataQualityError: A run contains such a joint.
    """
    for data in runs:
        dead = dead_torques(data.average if data.is_periodic else data.recording)
        if dead:
            recorded = data.import_report is None
            where = "torque object of its drive" if recorded else "torque column in its map"
            found = ", ".join(f"{joint} (always {value:g})" for joint, value in dead.items())
            raise DataQualityError(
                f"{data.folder.path}: the torque of moving joints was not measured: {found}."
                f" Check the {where}",
                code="RID-RUN-NO-TORQUE",
            )
