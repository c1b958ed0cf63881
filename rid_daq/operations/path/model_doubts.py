"""`model_doubts`: reasons to doubt the torques that a model predicts for a motion."""

from __future__ import annotations

from pathlib import Path

from config.arrays import FloatArray
from config.cell.cell import CellConfig
from identification.accuracy.extrapolation import extrapolation_findings
from identification.estimation.estimate import Estimate
from rid_daq.operations.cell_files import rejection_notes


def model_doubts(
    path: Path, estimate: Estimate, position: FloatArray | None, cell: CellConfig
) -> list[str]:
    """Return notes on a model whose torques decide how a robot moves.

    Args:
        path: File of the model, for the notes.
        estimate: The model.
        position: Shape (samples, n). The motion [rad or m]; None if it is not known in advance.
        cell: The cell that performs the motion.
    """
    notes = rejection_notes(path, estimate)
    if estimate.cell_name and estimate.cell_name != cell.name:
        notes.append(
            f"{path} was identified in cell {estimate.cell_name}, but cell {cell.name} is used"
            " here: if its robot is another one, even of the same type, identify that robot"
        )
    if position is not None:
        notes += extrapolation_findings(estimate, position)
    return notes
