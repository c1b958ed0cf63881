"""`model_doubts`: reasons to doubt the torques that a model predicts for a motion."""

from __future__ import annotations

from pathlib import Path

from config.arrays import FloatArray
from identification.accuracy.extrapolation import extrapolation_findings
from identification.estimation.estimate import Estimate
from identification.regression.fit_grade import Grade


def model_doubts(path: Path, estimate: Estimate, position: FloatArray | None) -> list[str]:
    """Return notes on a model whose torques decide how a robot moves.

    Args:
        path: File of the model, for the notes.
        estimate: The model.
        position: Shape (samples, n). The motion [rad or m]; None if it is not known in advance.
    """
    notes = []
    bad = [
        f"{fit.joint} ({fit.percent:.0f} %)"
        for fit in estimate.fit
        if fit.grade is Grade.BAD and fit.percent is not None
    ]
    if bad:
        notes.append(
            f"{path}: the model does not explain the torque of its own data; relative error of"
            f" {', '.join(bad)}. Its torques can be wrong: correct the files that `rid-daq"
            " identify` names, and identify again"
        )
    if position is not None:
        notes += extrapolation_findings(estimate, position)
    return notes
