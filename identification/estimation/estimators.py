"""From averaged periods or smoothed recordings to an `Estimate`.

Maximum likelihood with Gaussian noise of known variance per channel is weighted least squares,
solved by QR (theory: section 9). The same functions do ordinary and robust least squares, take a
Bayesian prior, and fit nonlinear parameters on the same cost.
"""

from __future__ import annotations

from collections.abc import Sequence

from acquisition.processing.periods import PeriodAverage
from acquisition.processing.smoothing import SmoothedSignals
from config.robot.robot import RobotDescription
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_periods import fit_periodic
from identification.estimation.fitted_signals import fit_smoothed
from identification.estimation.options import EstimationOptions


def estimate_periodic(
    robot: RobotDescription,
    averages: Sequence[PeriodAverage],
    options: EstimationOptions | None = None,
    *,
    payload: Sequence[bool] | None = None,
    cell_name: str = "",
    run_ids: tuple[str, ...] = (),
) -> Estimate:
    """Estimate from averaged periods, on their DFT bins; see `fit_periodic`.

    Args:
        robot, averages, options, payload: As for `fit_periodic`.
        cell_name, run_ids: Provenance.

    Raises:
        EstimationError: The joints do not fit, or the motion does not show the parameters.
    """
    return fit_periodic(robot, averages, options, payload=payload).estimate(cell_name, run_ids)


def estimate_smoothed(
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    options: EstimationOptions | None = None,
    *,
    payload: Sequence[bool] | None = None,
    cell_name: str = "",
    run_ids: tuple[str, ...] = (),
) -> Estimate:
    """Estimate from recordings that are not periodic; see `fit_smoothed`.

    Args:
        robot, signals, options, payload: As for `fit_smoothed`.
        cell_name, run_ids: Provenance.

    Raises:
        EstimationError: The joints do not fit, or the motion does not show the parameters.
    """
    return fit_smoothed(robot, signals, options, payload=payload).estimate(cell_name, run_ids)
