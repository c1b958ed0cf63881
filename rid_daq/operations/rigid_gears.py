"""`rigid_gears_notes`: note that a command treats elastic gears as rigid."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from identification.elasticity.gear_torque import describe_gear_torque
from identification.estimation.estimate import Estimate

RIGID_GEARS: Final = "RID-MODEL-RIGID-GEARS"


def rigid_gears_notes(path: Path, estimate: Estimate, shortcoming: str) -> list[str]:
    """Return one note with the code `RIGID_GEARS` if a model has elastic gears; otherwise none.

    Args:
        path: File of the model.
        estimate: The model.
        shortcoming: Clause that completes "the gears are elastic, but …".
    """
    if estimate.gear_torque_nm is None:
        return []
    words = describe_gear_torque(estimate.robot, estimate.gear_torque_nm)
    return [
        f"{path}: the gears are elastic, but {shortcoming}. In the runs of the model, the"
        f" deflection changes the torques by {words} ({RIGID_GEARS})"
    ]
