"""`check_data`: checks before an identification whether runs can be used."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import BaseModel, ConfigDict

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.motion_file import load_motion
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from config.errors import RidDaqError
from config.load import LoadedCell, load_robot
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel
from identification.design.two_harmonic import condition_number
from identification.model.base_parameters import base_parameters
from rid_daq.report.result_file import RESULT, read_result
from rid_daq.runs.run_data import MOTION, ROBOT, require_own

LARGEST_CONDITION = 200.0
"""Limit of the condition number; above it, small errors of the model cause large errors of
parameters.
"""


class Finding(BaseModel):
    """A finding of the check.

    `passed` is False if the finding forbids the identification, and None for information.
    """

    model_config = ConfigDict(frozen=True)

    passed: bool | None
    text: str


class DataCheck(BaseModel):
    """Result of the check.

    Attributes:
        data: Findings about the runs.
        model: Findings about the motions of the runs.
        parameters: Number of base parameters of the cell's robot.
        friction: Friction terms in the robot file, by the name of the joint.
    """

    model_config = ConfigDict(frozen=True)

    data: tuple[Finding, ...]
    model: tuple[Finding, ...]
    parameters: int
    friction: dict[str, tuple[str, ...]]


def check_data(cell: LoadedCell, runs: Sequence[RunFolder]) -> DataCheck:
    """Check if runs can be used for an identification; nothing is estimated.

    Args:
        cell: The cell whose robot is identified.
    """
    data: list[Finding] = []
    model: list[Finding] = []
    for folder in runs:
        data += _of_run(folder, cell.robot)
        model += _of_motion(folder, cell.robot)
    count = len(base_parameters(RobotModel.from_description(cell.robot)))
    return DataCheck(
        data=tuple(data),
        model=tuple(model),
        parameters=count,
        friction={joint.name: tuple(joint.friction) for joint in cell.robot.joints},
    )


def _of_run(folder: RunFolder, robot: RobotDescription) -> list[Finding]:
    name = f"Run {folder.manifest().label or folder.run_id}"
    try:
        manifest = folder.manifest()
        require_own(folder)
        if manifest.status not in (RunStatus.COMPLETE, RunStatus.RECOVERED):
            text = f"{name} is {manifest.status}: choose a complete run, or record it again."
            return [Finding(passed=False, text=text)]
        found = [_robot(name, load_robot(str(folder.file(ROBOT))), robot)]
        if folder.file(RESULT).exists():
            result = read_result(folder)
            found += [Finding(passed=None, text=f"{name}: {note}") for note in result.notes or ()]
            if result.average is not None:
                lost = bool(result.average.rejected)
                text = f"{name}: {result.average.sentence}"
                found.append(Finding(passed=None if lost else True, text=text))
    except RidDaqError as error:
        return [Finding(passed=False, text=f"{name}: {error}")]
    return found


def _robot(name: str, of_run: RobotDescription, of_cell: RobotDescription) -> Finding:
    if of_run.name != of_cell.name:
        text = (
            f"{name} is of robot {of_run.name}, but the cell has {of_cell.name}: choose"
            " another run."
        )
        return Finding(passed=False, text=text)
    if of_run != of_cell:
        text = (
            f"{name}: its robot file differs from the present one of the cell. The model will use"
            " the robot file of the run."
        )
        return Finding(passed=None, text=text)
    return Finding(passed=True, text=f"{name} has this cell's robot file.")


def _of_motion(folder: RunFolder, robot: RobotDescription) -> list[Finding]:
    if not folder.file(MOTION).exists():
        return []
    name = f"Run {folder.manifest().label or folder.run_id}"
    try:
        excitation = FourierMotion.of(load_motion(folder.file(MOTION)))
        if excitation is None:
            text = (
                f"{name}: the motion is not an excitation trajectory, so it has no condition"
                " number."
            )
            return [Finding(passed=None, text=text)]
        condition = condition_number(robot, excitation)
    except RidDaqError as error:
        return [Finding(passed=False, text=f"{name}: {error}")]
    if condition > LARGEST_CONDITION:
        text = (
            f"{name}: condition number {condition:.3g}, above {LARGEST_CONDITION:g}: the motion"
            " makes some parameters poorly identifiable. Design a better excitation trajectory,"
            " or add a run."
        )
        return [Finding(passed=None, text=text)]
    text = (
        f"{name}: condition number {condition:.3g}: the motion makes every base parameter"
        " identifiable."
    )
    return [Finding(passed=True, text=text)]
