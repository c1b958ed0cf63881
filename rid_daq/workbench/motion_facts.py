"""`MotionFacts`: what a person should know of a motion before it is driven, and its picture."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from bokeh.models import GridPlot
from pydantic import BaseModel, ConfigDict

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.motion_file import AnyMotion
from config.load import LoadedCell
from identification.design.two_harmonic import condition_number
from identification.estimation.at_temperature import by_temperature
from identification.estimation.limit_torque import limit_torque
from rid_daq.figures.motion_figure import motion_figure
from rid_daq.operations.cell_files import estimate_for, motion_for

AT_REFERENCE: Final = "friction as at its reference temperature"
COLD_OR_WARM: Final = "friction as cold or as warm, whichever takes more"


class MotionFacts(BaseModel):
    """What a person should know of a motion.

    Attributes:
        kind, sentence: Its kind, and what it is in a sentence.
        duration_s: How long it takes [s].
        periods: Of a periodic motion.
        condition_number: Of an excitation.
    """

    model_config = ConfigDict(frozen=True)

    kind: str
    sentence: str
    duration_s: float
    periods: int | None
    condition_number: float | None


def motion_facts(cell: LoadedCell, path: Path) -> MotionFacts:
    """Return what a person should know of a motion file.

    Raises:
        ConfigError, LimitError: The file is none, or is of another robot, or the motion breaks a
            limit.
    """
    motion = motion_for(path, cell)
    samples = motion.plan(cell.robot, cell.config.cycle_time_s)
    excitation = excitation_of(motion)
    return MotionFacts(
        kind=motion.kind,
        sentence=motion.describe(),
        duration_s=samples.duration_s,
        periods=None if excitation is None else excitation.periods,
        condition_number=_condition(cell, motion),
    )


def motion_picture(cell: LoadedCell, path: Path, model: Path | None) -> GridPlot:
    """Return the picture of a motion file, with the torque that a model expects.

    It is the one that `record` holds the limits by (`limit_torque`).

    Raises:
        ConfigError, LimitError: As `motion_facts`; or the model is of another robot.
    """
    motion = motion_for(path, cell)
    samples = motion.plan(cell.robot, cell.config.cycle_time_s)
    torque, note = None, ""
    if model is not None:
        one = samples.whole(1)
        estimate = estimate_for(model, cell.robot)
        torque = limit_torque(estimate, one.position, one.velocity, one.acceleration)
        if by_temperature(estimate).any():
            note = AT_REFERENCE if estimate.warming is None else COLD_OR_WARM
    condition = _condition(cell, motion)
    return motion_figure(samples, cell.robot, cell.config.workspace, torque, condition, note)


def excitation_of(motion: AnyMotion) -> FourierMotion | None:
    """Return a motion that has a condition number, None of the other kinds."""
    return FourierMotion.of(motion)


def _condition(cell: LoadedCell, motion: AnyMotion) -> float | None:
    excitation = excitation_of(motion)
    return None if excitation is None else condition_number(cell.robot, excitation)
