"""`rigid_gears_notes`: note on a command that computes with rigid gears, but whose gears bend."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from identification.elasticity.gear_torque import describe_gear_torque
from identification.estimation.estimate import Estimate

RIGID_GEARS: Final = "RID-MODEL-RIGID-GEARS"


def rigid_gears_notes(path: Path, estimate: Estimate, shortcoming: str) -> list[str]:
    """Return a note with the code `RIGID_GEARS` if a model is that of links behind elastic gears.

    Args:
        path: File of the model.
        estimate: The model.
        shortcoming: What the command does as if the gears were rigid, as a clause.
    """
    if estimate.gear_torque_nm is None:
        return []
    words = describe_gear_torque(estimate.robot, estimate.gear_torque_nm)
    return [
        f"{path}: the gears are elastic, but {shortcoming}. In the runs of the model, the"
        f" deflection changes the torques by {words} ({RIGID_GEARS})"
    ]
