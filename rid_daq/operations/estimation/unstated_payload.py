"""`find_unstated_payload`: the run whose torques show a body that the other runs lack."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from identification.estimation.fitted_signals import FittedSignals, fit_smoothed
from identification.estimation.options import EstimationOptions

MASS: Final = "mL"
CERTAIN: Final = 10.0
"""Smallest mass in standard deviations from white residuals; true ones are a few times larger."""
LARGEST_SHARE: Final = 0.5
"""Largest squared residual with a payload, relative to that without one. A payload of 10 % of the
last link gives 0.1 on a simulated arm; two sound runs give 1."""


@dataclass(frozen=True)
class UnstatedPayload:
    """A body that the robot carried in one run only.

    Attributes:
        run: Number of the run.
        mass_kg, sigma_kg: Mass in this run minus that in the other runs, and its standard
            deviation.
    """

    run: int
    mass_kg: float
    sigma_kg: float

    def sentence(self, run_id: str) -> str:
        """Contradiction, with the remedy."""
        more = "more" if self.mass_kg > 0.0 else "less"
        return (
            f"In run {run_id}, the robot carried {abs(self.mass_kg):.3g} ± {2 * self.sigma_kg:.2g}"
            f" kg {more} than in the other runs: state the payload (--loaded, or --loads if it is"
            " known), or leave this run out."
        )


def find_unstated_payload(
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    numbers: Sequence[int],
    options: EstimationOptions,
    plain: FittedSignals,
) -> UnstatedPayload | None:
    """Return the run that is best explained by another payload; None if there is none.

    It is also None if the signals do not determine the parameters together with a payload.

    Args:
        robot: The robot.
        signals: Signals of at least two runs.
        numbers: Number of the run of each signal.
        options: Options of the estimate, without payload.
        plain: Fit to the signals with these options.
    """
    loaded = replace(options, model=replace(options.model, payload=True))
    found: list[tuple[float, UnstatedPayload]] = []
    different = sorted(set(numbers))
    for number in different:
        flags = [each == number for each in numbers]
        try:
            fitted = fit_smoothed(robot, signals, loaded, payload=flags)
        except EstimationError:
            return None
        if MASS in fitted.base.names:
            place = fitted.base.names.index(MASS)
            mass, sigma = float(fitted.values[place]), float(fitted.sigma[place])
            share = _squared_residual(fitted) / _squared_residual(plain)
            if abs(mass) > CERTAIN * sigma and share < LARGEST_SHARE:
                found.append((share, UnstatedPayload(number, mass, sigma)))
    if len(different) == 2:  # more in one run and less in the other are the same
        found = [each for each in found if each[1].mass_kg > 0.0]
    return min(found, key=lambda each: each[0], default=(0.0, None))[1]


def _squared_residual(fitted: FittedSignals) -> float:
    """Return the squared residual relative to the torque, summed over the joints."""
    return float(np.nansum(np.square(fitted.fit.residual_nm / fitted.fit.torque_nm)))
