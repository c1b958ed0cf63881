"""`find_plate_mistake`: search for a mistake in the description of a force plate.

The six components of a measured base wrench depend on the same parameters of the robot's links. If
the plate's size, position, orientation or sensitivities are described wrongly, no link parameters
fit all six components. One mistake is not visible in this way, a wrong factor common to all
channels: it is found by comparing the measured weight of the arm with its drawings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.processing.periods import PeriodAverage
from config.arrays import FloatArray
from config.cell.plate import PlatePlace
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel
from identification.calibration.plate_equations import PlateEquations
from identification.calibration.plate_hypotheses import (
    ORDER_KEY,
    SENSITIVITY_KEY,
    PlateHypothesis,
    plate_hypotheses,
    wrench_matrix,
)
from identification.calibration.plate_mistake import PlateKind, PlateMistake
from identification.equations.bins import BinEquations
from identification.model.base_parameters import BaseParameters
from identification.model.drawn_arm import drawn_parameters, plausible_weight

SUSPECT_SHARE: Final = 0.02
EXPLAINED_SHARE: Final = 0.3
LEAST_GAIN: Final = 1.0
FAR_BETTER_TIMES: Final = 2.0
WORSE: Final = 1.2
ONE_MORE_FREE: Final = 0.1


@dataclass(frozen=True)
class FileNames:
    """Names in the file that describes a plate.

    Attributes:
        file: The file, in words.
        sensitivity, order: Keys under `plate` of the sensitivities, and of the order of readings.
    """

    file: str
    sensitivity: str
    order: str


CELL_NAMES: Final = FileNames("cell file", SENSITIVITY_KEY, ORDER_KEY)
MAP_NAMES: Final = FileNames("import map", "scale", "channels")
WRENCH_MAP_NAMES: Final = FileNames("import map", "scale", "wrench")


def find_plate_mistake(
    averages: Sequence[PeriodAverage],
    equations: Sequence[BinEquations],
    delays_s: Sequence[float],
    plate: PlatePlace,
    robot: RobotDescription,
    model: RobotModel,
    base: BaseParameters,
    names: FileNames = CELL_NAMES,
) -> PlateMistake | None:
    """Return the mistake that explains the plate's wrench far better, or None.

    Args:
        averages: The runs' mean periods.
        equations: Equations of the mean periods, of the external or the combined model.
        delays_s: Delay of the plate's signals in each run [s].
        plate: The plate as described in its file.
        robot: The robot, for its drawings.
        base: The parameters of the equations.
        names: Names in the file that describes the plate.
    """
    found = PlateEquations.of(averages, equations, delays_s)
    if found is None:
        return None
    drawn = base.from_standard(drawn_parameters(model, robot))
    return best_mistake(found, plate, drawn, plausible_weight(robot), names)


def best_mistake(
    equations: PlateEquations,
    plate: PlatePlace,
    drawn: FloatArray,
    plausible: tuple[float, float],
    names: FileNames = CELL_NAMES,
) -> PlateMistake | None:
    """Return the mistake whose correction explains condensed equations far better, or None.

    Args:
        equations: Condensed equations of the wrench.
        plate: The plate as described in its file.
        drawn: Shape (b,). The parameters from `cad`, or from the arm's size.
        plausible: Smallest and largest ratio of a real arm's weight to the drawn one.
        names: Names in the file that describes the plate.
    """
    matrix = wrench_matrix(plate)
    before = equations.shares(matrix)
    suspect = before > SUSPECT_SHARE
    tried: list[tuple[float, float, PlateHypothesis]] = []
    for each in plate_hypotheses(equations, plate) if suspect.any() else ():
        after = equations.shares(each.matrix)
        times, gain = before / after, float(np.sum(np.log(before / after)))
        halved = bool(np.any(suspect & (times >= FAR_BETTER_TIMES)))
        worse = bool(np.any(after > np.maximum(WORSE * before, SUSPECT_SHARE)))
        if halved and gain >= LEAST_GAIN and not worse and equations.weight(each.matrix, drawn) > 0:
            tried.append((gain - ONE_MORE_FREE * each.free, float(times.max()), each))
    if tried:
        _, times_better, best = max(tried, key=lambda each: each[0])
        why = (
            "This correction reduces the residual of the wrench by a factor of up to"
            f" {times_better:.2g}"
        )
        return _mistake(best, times_better, why, names)
    if np.any(before > EXPLAINED_SHARE):
        return None
    return _of_all_channels(equations.weight(matrix, drawn), plausible, matrix, names)


def _of_all_channels(
    weight: float, plausible: tuple[float, float], matrix: FloatArray, names: FileNames
) -> PlateMistake | None:
    """Return the mistake of a sign or a factor that is common to all channels.

    A wrench with such a mistake fits another arm equally well; only the weight in the robot's
    drawings reveals the mistake.
    """
    low, high = plausible
    if low <= weight <= high:
        return None
    factor = -1.0 if -1.0 / low <= weight <= 0.0 else 1.0 / weight
    reversed_ = "the readings of all channels have the wrong sign"
    words = (
        reversed_
        if factor == -1.0
        else f"the readings of all channels must be multiplied by about {factor:.2g}"
    )
    why = (
        f"With the present description, the arm's weight would be {weight:.2g} times the weight"
        " expected from `cad` or from the arm's size"
    )
    count = matrix.shape[1]
    found = PlateHypothesis(
        PlateKind.SENSITIVITY,
        SENSITIVITY_KEY,
        (1.0,) * count,
        (factor,) * count,
        words,
        factor * matrix,
    )
    return _mistake(found, 1.0, why, names)


def _mistake(
    found: PlateHypothesis, times_better: float, why: str, names: FileNames
) -> PlateMistake:
    key = {SENSITIVITY_KEY: names.sensitivity, ORDER_KEY: names.order}.get(found.key, found.key)
    sentence = (
        f"The description of the force plate is probably wrong: {found.words}. {why}. Correct"
        f" `plate.{key}` in the {names.file}. Until then, torque constants are not compared with"
        " the plate."
    )
    return PlateMistake(
        kind=found.kind,
        key=key,
        stated=found.stated,
        right=found.right,
        times_better=times_better,
        sentence=sentence,
    )
