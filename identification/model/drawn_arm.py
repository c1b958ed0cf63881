"""`drawn_parameters`: an arm's parameters from `cad` or its size; the range of its weight."""

from __future__ import annotations

from typing import Final

from config.arrays import FloatArray
from config.robot.nominal_links import nominal_links
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain
from dynamics.model.cad import cad_parameters
from dynamics.model.robot_model import RobotModel

NOMINAL_RANGE: Final = (0.02, 50.0)
LIGHTEST_DRAWN: Final = 0.3
HEAVIEST_DRAWN: Final = 3.0
UNCERTAINTIES: Final = 2.0


def drawn_parameters(model: RobotModel, robot: RobotDescription) -> FloatArray:
    """Return a model's standard parameters from `cad`, or from cylinders of the arm's size."""
    if not robot.is_drawn:
        chain = Chain.from_description(robot)
        robot = robot.model_copy(update={"cad": nominal_links(chain.rows, chain.tool_m)})
    return cad_parameters(model, robot)[0]


def plausible_weight(robot: RobotDescription) -> tuple[float, float]:
    """Return the smallest and the largest weight of a real arm, relative to the drawn one."""
    if not robot.is_drawn or robot.cad is None:
        return NOMINAL_RANGE
    unsure = UNCERTAINTIES * max(link.uncertainty or 0.0 for link in robot.cad)
    return min(LIGHTEST_DRAWN, 1.0 / (1.0 + unsure)), max(HEAVIEST_DRAWN, 1.0 + unsure)
