"""`Estimate`: identified base parameters with their uncertainty, and how they are computed.

Maximum likelihood with Gaussian noise of known variance per channel is weighted least squares,
solved by QR (physics: section 9). Two covariances are reported, because model error is usually
larger than noise: one from the noise measured between periods, one from the residuals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from acquisition.arrays import FloatArray, read_only
from acquisition.periods import PeriodAverage
from acquisition.smoothing import SmoothedSignals
from config.errors import EstimationError
from config.robot import RobotDescription
from dynamics.robot_model import RobotModel, regressor
from identification.base_parameters import BaseParameters, base_parameters
from identification.bin_equations import BinEquations, bin_equations
from identification.least_squares import Solution, Triangle, sandwich, solve
from identification.model_options import ModelOptions
from identification.time_equations import time_blocks
from identification.white_equations import WhiteEquations, residual_covariance, whiten

BAND_HZ = 10.0
STANDSTILL_RAD_S = 0.02
REWEIGHTINGS = 10
BLOCK_ROWS = 4096


@dataclass(frozen=True, eq=False)
class Estimate:
    """Base parameters of one robot, with everything needed to use them.

    Attributes
    ----------
    robot : RobotDescription
        The robot.
    options : ModelOptions
        The terms of its model.
    base : BaseParameters
        Names, units, words and combinations of the b parameters.
    values : ndarray, shape (b,)
        The estimate.
    covariance_noise : ndarray, shape (b, b), or None
        From the noise between periods; None where nothing repeated.
    covariance_residual : ndarray, shape (b, b)
        From the residuals.
    condition_number : float
        Of the weighted regressor, columns scaled to length one (2.25, 2.26).
    equations : int
        Equations used.
    residual_nm : ndarray, shape (n,)
        RMS of measured minus predicted torque inside the band [N m or N].
    noise_nm : ndarray, shape (n,), or None
        RMS that the measured noise alone would leave there.
    left_out_fraction : ndarray, shape (n,)
        Share of samples under the standstill speed, left out or with free friction.
    method : "periodic" or "smoothed"
        On the bins of averaged periods, or in the time domain on low-passed signals.
    band_hz, standstill_rad_s : float
        Highest frequency and lowest speed used.
    periods : int
        Averaged periods behind it; 0 for "smoothed".
    cell_name : str
        Where it was measured.
    run_ids : tuple of str
        The runs behind it.
    """

    robot: RobotDescription
    options: ModelOptions
    base: BaseParameters
    values: FloatArray
    covariance_noise: FloatArray | None
    covariance_residual: FloatArray
    condition_number: float
    equations: int
    residual_nm: FloatArray
    noise_nm: FloatArray | None
    left_out_fraction: FloatArray
    method: Literal["periodic", "smoothed"]
    band_hz: float
    standstill_rad_s: float
    periods: int = 0
    cell_name: str = ""
    run_ids: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        b, n = len(self.base), len(self.robot.joints)
        shapes: dict[str, tuple[int, ...]] = {
            "values": (b,),
            "covariance_residual": (b, b),
            "residual_nm": (n,),
            "left_out_fraction": (n,),
        }
        if self.covariance_noise is not None:
            shapes["covariance_noise"] = (b, b)
        if self.noise_nm is not None:
            shapes["noise_nm"] = (n,)
        for name, shape in shapes.items():
            array = read_only(
                f"estimate {name}", getattr(self, name), float, shape, EstimationError
            )
            object.__setattr__(self, name, array)

    @cached_property
    def model(self) -> RobotModel:
        """The robot's model."""
        return self.options.build(self.robot)

    @property
    def sigma_noise(self) -> FloatArray | None:
        """Standard deviations by the measured noise, shape (b,)."""
        return None if self.covariance_noise is None else _sigma(self.covariance_noise)

    @property
    def sigma_residual(self) -> FloatArray:
        """Standard deviations by the residuals, shape (b,)."""
        return _sigma(self.covariance_residual)

    @property
    def sigma(self) -> FloatArray:
        """The larger of the two standard deviations: the one to quote, shape (b,)."""
        noise = self.sigma_noise
        return self.sigma_residual if noise is None else np.maximum(noise, self.sigma_residual)


def predict(estimate: Estimate, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
    """Return the torques of an estimate, shape (samples, n) [N m or N], block by block.

    Parameters
    ----------
    estimate : Estimate
        The identified robot.
    q, v, a : ndarray, shape (samples, n)
        Motion [rad or m, per second, per second squared].
    """
    torque = np.empty(np.shape(q))
    for start in range(0, len(q), BLOCK_ROWS):
        rows = slice(start, start + BLOCK_ROWS)
        phi = regressor(estimate.model, q[rows], v[rows], a[rows])
        torque[rows] = estimate.base.columns(phi) @ estimate.values
    return torque


def estimate_periodic(
    robot: RobotDescription,
    averages: Sequence[PeriodAverage],
    *,
    options: ModelOptions | None = None,
    band_hz: float = BAND_HZ,
    standstill_rad_s: float = STANDSTILL_RAD_S,
    cell_name: str = "",
    run_ids: tuple[str, ...] = (),
) -> Estimate:
    """Estimate from averaged periods, on their DFT bins.

    Each row's noise is the torque's, from the scatter between periods with the anti-alias filter
    divided out, and the position's, through the inertia that the estimate itself shows.

    Parameters
    ----------
    robot : RobotDescription
        The robot.
    averages : sequence of PeriodAverage
        One a run.
    options : ModelOptions, optional
        Terms of the model; all by default.
    band_hz : float
        Highest frequency used [Hz].
    standstill_rad_s : float
        Below this speed a joint's friction is left free; 0 trusts sign(v) everywhere.
    cell_name, run_ids : str, tuple of str
        Provenance.

    Raises
    ------
    EstimationError
        The joints do not fit, or the motion does not show the parameters.
    """
    options = options or ModelOptions()
    model = options.build(robot)
    base = base_parameters(model)
    sets = [
        bin_equations(model, base, average, band_hz=band_hz, standstill_rad_s=standstill_rad_s)
        for average in averages
    ]
    n = len(robot.joints)
    white, solution = _solve_on_bins(sets, [np.zeros((n, n)) for _ in sets], base)
    # The torque that the positions' noise makes is known only once the inertia is.
    inertias = [_inertia(model, base, a.position, solution.values) for a in averages]
    white, solution = _solve_on_bins(sets, inertias, base)
    residual = [
        [np.sum((part.residual(solution.values) * part.sigma) ** 2) for part in parts]
        for parts in white
    ]
    noise = [
        [np.sum(part.sigma**2) * part.rows / len(part.rhs) for part in parts] for parts in white
    ]
    return Estimate(
        robot=robot,
        options=options,
        base=base,
        values=solution.values,
        covariance_noise=solution.covariance,
        covariance_residual=residual_covariance(white, solution.values, solution.covariance),
        condition_number=solution.condition_number,
        equations=solution.rows,
        residual_nm=np.sqrt(np.mean(residual, axis=0)),
        noise_nm=np.sqrt(np.mean(noise, axis=0)),
        left_out_fraction=np.mean([equations.left_out_fraction for equations in sets], axis=0),
        method="periodic",
        band_hz=min(equations.harmonics / equations.period_s for equations in sets),
        standstill_rad_s=standstill_rad_s,
        periods=sum(average.periods_kept for average in averages),
        cell_name=cell_name,
        run_ids=run_ids,
    )


def estimate_smoothed(
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    *,
    options: ModelOptions | None = None,
    standstill_rad_s: float = STANDSTILL_RAD_S,
    cell_name: str = "",
    run_ids: tuple[str, ...] = (),
) -> Estimate:
    """Estimate from recordings that are not periodic, in the time domain.

    A joint's equation is left out while the joint is slower than `standstill_rad_s`. The weight
    of each joint is one over its residuals' standard deviation, found by iteration. Neighbouring
    rows are not independent; the covariance takes the residuals of one second as one event.

    Parameters
    ----------
    robot : RobotDescription
        The robot.
    signals : sequence of SmoothedSignals
        One a run.
    options, standstill_rad_s, cell_name, run_ids
        As for `estimate_periodic`.

    Raises
    ------
    EstimationError
        The joints do not fit, or the motion does not show the parameters.
    """
    options = options or ModelOptions()
    model = options.build(robot)
    base = base_parameters(model)
    n = len(robot.joints)
    triangles = [Triangle.empty(len(base)) for _ in range(n)]
    rows_used = np.zeros(n)
    rows = events = 0
    for block in time_blocks(model, base, signals, standstill_rad_s):
        rows, events = rows + len(block.rhs), int(block.event[-1]) + 1
        rows_used += block.use.sum(axis=0)
        for j, use in enumerate(block.use.T):
            triangles[j] = triangles[j].add(block.matrix[use, j], block.rhs[use, j])
    residual = scale = np.ones(n)
    solution = solve(triangles, scale, base.names)
    for _ in range(REWEIGHTINGS):
        error = np.array([triangle.residual_sum(solution.values) for triangle in triangles])
        residual = np.sqrt(error / np.maximum(rows_used, 1.0))
        scale = np.maximum(residual, 1e-9 * residual.max() + 1e-300)
        solution = solve(triangles, 1.0 / scale, base.names)
    scores = np.zeros((events, len(base)))
    for block in time_blocks(model, base, signals, standstill_rad_s):
        misfit = np.where(block.use, block.rhs - block.matrix @ solution.values, 0.0) / scale**2
        np.add.at(scores, block.event, np.einsum("snb,sn->sb", block.matrix, misfit))
    return Estimate(
        robot=robot,
        options=options,
        base=base,
        values=solution.values,
        covariance_noise=None,
        covariance_residual=sandwich(solution.covariance, scores, solution.rows),
        condition_number=solution.condition_number,
        equations=solution.rows,
        residual_nm=residual,
        noise_nm=None,
        left_out_fraction=1.0 - rows_used / rows,
        method="smoothed",
        band_hz=min(smoothed.cutoff_hz for smoothed in signals),
        standstill_rad_s=standstill_rad_s,
        cell_name=cell_name,
        run_ids=run_ids,
    )


def _solve_on_bins(
    sets: Sequence[BinEquations], inertias: Sequence[FloatArray], base: BaseParameters
) -> tuple[list[tuple[WhiteEquations, ...]], Solution]:
    """Whiten and solve the equations of all period averages together."""
    white = [whiten(e, inertia) for e, inertia in zip(sets, inertias, strict=True)]
    triangles = [
        Triangle.empty(len(base)).add(part.matrix, part.rhs, part.rows)
        for parts in white
        for part in parts
    ]
    return white, solve(triangles, [1.0] * len(triangles), base.names)


def _inertia(
    model: RobotModel, base: BaseParameters, position: FloatArray, values: FloatArray
) -> FloatArray:
    """Return the RMS over a period of each element of the joint-space inertia, shape (n, n)."""
    q = position[:: max(1, len(position) // 100)]
    rest = np.zeros_like(q)
    still = base.columns(regressor(model, q, rest, rest))
    columns = []
    for j in range(q.shape[1]):
        unit = rest.copy()
        unit[:, j] = 1.0
        columns.append((base.columns(regressor(model, q, rest, unit)) - still) @ values)
    return np.asarray(np.sqrt(np.mean(np.square(columns), axis=1)).T)


def _sigma(covariance: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.diagonal(covariance)))
