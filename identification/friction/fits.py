"""`FrictionFit`: a friction model fitted to a measured curve, and the choice of the best model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import minimize_scalar

from config.arrays import FloatArray
from config.robot.friction_terms import FrictionTerm
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel
from dynamics.terms.friction import FASTEST_STRIBECK, SLOWEST_STRIBECK, Friction
from identification.friction.curve import FrictionCurve, friction_columns
from identification.model.options import ModelOptions

MODELS: Final[dict[str, tuple[FrictionTerm, ...]]] = {
    "classical": ("coulomb", "viscous"),
    "asymmetric": ("asymmetric", "viscous"),
    "cubic": ("coulomb", "viscous", "cubic"),
    "cube root": ("viscous", "cube_root"),
    "Stribeck": ("coulomb", "viscous", "stribeck"),
}
"""The models of theory: section 4, by name (2.8-2.14)."""


CLEARLY_BETTER: Final = 2.0
AT_BOUND_SHARE: Final = 1e-3


@dataclass(frozen=True, eq=False)
class FrictionFit:
    """Fit of one model to one joint's friction.

    Attributes:
        name: Name of the model.
        terms: The friction terms, as in the robot file.
        model: The robot with these terms, and with the fitted Stribeck speed.
        joint: The joint's index, from 0.
        parameter_names, parameter_units: The joint's coefficients; the Stribeck speed is last, if
            there is one.
        values, sigmas: Values and standard deviations of the coefficients.
        rms_nm: RMS of the curve's odd part minus the model [N m or N].
        misfit: Mean square of the residuals in standard deviations of the curve; about 1 if the
            model explains the curve.
        criterion: Akaike's criterion, corrected for few values: the smallest is best (Burnham and
            Anderson 2002).
        at_bound: True if the Stribeck speed is at a bound: the measured speeds do not determine it.
    """

    name: str
    terms: tuple[FrictionTerm, ...]
    model: RobotModel
    joint: int
    parameter_names: tuple[str, ...]
    parameter_units: tuple[str, ...]
    values: FloatArray
    sigmas: FloatArray
    rms_nm: float
    misfit: float
    criterion: float
    at_bound: bool

    def torque(self, speed: FloatArray) -> FloatArray:
        """Return the friction at signed speeds, in the shape of `speed` [N m or N]."""
        columns, _ = _of_joint(self.model, self.joint, speed)
        return np.asarray(columns @ self.values[: columns.shape[1]])


def fit_friction(curve: FrictionCurve, robot: RobotDescription) -> tuple[FrictionFit, ...]:
    """Fit every model for which the curve has enough values, and return the best first.

    Of all models whose criterion is less than 2 above the smallest, the simplest is the best. A
    model with a parameter at a bound comes last. The odd part is fitted, and, if it was measured,
    the even part with its covariance. For a symmetric model, a difference between the directions
    adds to the misfit.

    Args:
        curve: The measured friction.
    """
    joint = robot.joint_names.index(curve.joint)
    fits = []
    for name, terms in MODELS.items():
        if "asymmetric" in terms and curve.even is None:
            continue
        model = ModelOptions(rotors=False, spring=False, friction_terms=terms).build(robot)
        parameters = len(terms) + ("asymmetric" in terms) + ("stribeck" in terms)
        if len(curve.speed) * (1 if curve.even is None else 2) > parameters + 2:
            fits.append(_fit(curve, name, terms, model, joint))
    fits.sort(key=lambda fit: (fit.at_bound, fit.criterion))
    undecided = [fit for fit in fits if not fit.at_bound and _close(fit, fits[0])]
    return tuple(sorted(undecided, key=lambda fit: len(fit.values)) + fits[len(undecided) :])


def _close(fit: FrictionFit, best: FrictionFit) -> bool:
    return fit.criterion - best.criterion < CLEARLY_BETTER


def _fit(
    curve: FrictionCurve,
    name: str,
    terms: tuple[FrictionTerm, ...],
    model: RobotModel,
    joint: int,
) -> FrictionFit:
    vs = f"vs_{curve.joint}"
    if vs in model.nonlinear_names:
        model = _with_best_speed(curve, model, joint, vs)
    values, residual, jacobian = _solve(curve, model, joint)
    if vs in model.nonlinear_names:
        best = _speed(model, vs)
        step = 1e-4 * best
        ends = [
            _parts(_at_speed(model, vs, best + side), joint, curve.speed) @ values
            for side in (step, -step)
        ]
        slope = _white(curve, (ends[0] - ends[1]) / (2.0 * step))
        jacobian = np.column_stack([jacobian, slope])
    count, parameters = len(residual), jacobian.shape[1]
    left = float(residual @ residual)
    misfit = left / max(count - parameters, 1)
    covariance = np.linalg.pinv(jacobian.T @ jacobian) * max(1.0, misfit)
    _, columns = _of_joint(model, joint, curve.speed)
    units = dict(
        zip(
            (*model.parameter_names, *model.nonlinear_names),
            (*model.parameter_units, *model.nonlinear_units),
            strict=True,
        )
    )
    rms_nm = _rms(curve, model, joint, values)
    if vs in model.nonlinear_names:
        columns, values = (*columns, vs), np.append(values, _speed(model, vs))
    k = parameters + 1  # the scatter is estimated as one more parameter
    return FrictionFit(
        name=name,
        terms=terms,
        model=model,
        joint=joint,
        parameter_names=columns,
        parameter_units=tuple(units[name] for name in columns),
        values=values,
        sigmas=np.sqrt(np.diagonal(covariance)),
        rms_nm=rms_nm,
        misfit=misfit,
        criterion=count * np.log(max(left / count, 1e-300))
        + 2.0 * k
        + 2.0 * k * (k + 1) / max(count - k - 1, 0.5),
        at_bound=vs in model.nonlinear_names and _is_at_bound(curve, _speed(model, vs)),
    )


def _solve(
    curve: FrictionCurve, model: RobotModel, joint: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return values, whitened residuals and the whitened matrix of weighted least squares."""
    parts = _parts(model, joint, curve.speed)
    matrix = np.column_stack([_white(curve, parts[:, :, c]) for c in range(parts.shape[2])])
    even = np.zeros_like(curve.odd) if curve.even is None else curve.even
    rhs = _white(curve, np.array([curve.odd, even]))
    values = np.asarray(np.linalg.lstsq(matrix, rhs, rcond=None)[0], np.float64)
    return values, rhs - matrix @ values, matrix


def _parts(model: RobotModel, joint: int, speed: FloatArray) -> FloatArray:
    """Return the odd and the even part of every coefficient's function, (2, k, coefficients)."""
    forward, _ = _of_joint(model, joint, speed)
    backward, _ = _of_joint(model, joint, -speed)
    return np.array([0.5 * (forward - backward), 0.5 * (forward + backward)])


def _white(curve: FrictionCurve, parts: FloatArray) -> FloatArray:
    """Divide the odd and even parts by their standard deviations; `even` may be missing."""
    # The scatter of a few values can be small by chance: use at least half the median.
    sigma = np.maximum(curve.odd_sigma, 0.5 * np.median(curve.odd_sigma) + 1e-12)
    odd = parts[0] / sigma
    if curve.even_covariance is None:
        return np.asarray(odd)
    lower = np.linalg.cholesky(curve.even_covariance)
    return np.concatenate([odd, solve_triangular(lower, parts[1], lower=True)])


def _of_joint(
    model: RobotModel, joint: int, speed: FloatArray
) -> tuple[FloatArray, tuple[str, ...]]:
    """Return the friction torque per unit of the joint's own coefficients, and their names."""
    term = next(term for term in model.terms if isinstance(term, Friction))
    own = [c for c, column in enumerate(term.columns) if column.joint == joint]
    names = tuple(term.columns[c].parameter_name for c in own)
    return friction_columns(model, joint, speed)[:, own], names


def _with_best_speed(curve: FrictionCurve, model: RobotModel, joint: int, name: str) -> RobotModel:
    """Return the model with the Stribeck speed that gives the smallest residual."""

    def left(log_speed: float) -> float:
        _, residual, _ = _solve(curve, _at_speed(model, name, float(np.exp(log_speed))), joint)
        return float(residual @ residual)

    low, high = _log_range(curve)
    grid = np.linspace(low, high, 30)
    start = int(np.argmin([left(x) for x in grid]))
    bounds = (grid[max(start - 1, 0)], grid[min(start + 1, len(grid) - 1)])
    best = minimize_scalar(left, bounds=bounds, method="bounded")
    return _at_speed(model, name, float(np.exp(best.x)))


def _log_range(curve: FrictionCurve) -> tuple[float, float]:
    """Return the logarithms of the lowest and highest Stribeck speed that a curve determines."""
    # A Stribeck term that decays below half the lowest speed looks like Coulomb friction.
    low = max(SLOWEST_STRIBECK, 0.5 * float(curve.speed.min()))
    high = min(FASTEST_STRIBECK, float(curve.speed.max()))
    return float(np.log(low)), float(np.log(high))


def _is_at_bound(curve: FrictionCurve, speed: float) -> bool:
    low, high = _log_range(curve)
    margin = AT_BOUND_SHARE * (high - low)
    return not low + margin < np.log(speed) < high - margin


def _speed(model: RobotModel, name: str) -> float:
    return float(model.nonlinear_values[model.nonlinear_names.index(name)])


def _at_speed(model: RobotModel, name: str, speed: float) -> RobotModel:
    """Return the model with its Stribeck speed, the parameter `name`, set to `speed`."""
    values = model.nonlinear_values
    values[model.nonlinear_names.index(name)] = speed
    return model.with_nonlinear(values)


def _rms(curve: FrictionCurve, model: RobotModel, joint: int, values: FloatArray) -> float:
    """Return the RMS residual of the odd part; the even part also depends on gravity."""
    odd = _parts(model, joint, curve.speed)[0] @ values
    return float(np.sqrt(np.mean((curve.odd - odd) ** 2)))
