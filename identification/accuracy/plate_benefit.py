"""`Improvement`: what a force plate adds to the torques, parameter by parameter (table 4.1).

All three models are judged by the same equations and weights: the internal model is the combined
one without the plate's outputs, the external one without the joints'. Leaving out equations can
only lose information, so that the combined model is never less certain.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from config.arrays import FloatArray
from config.errors import EstimationError
from identification.equations.whitened import WhitenedEquations
from identification.estimation.fitted_periods import FittedPeriods
from identification.model.base_parameters import BaseParameters, base_parameters
from identification.regression.least_squares import triangular_factor

SEEN: float = 1e-6
RANK: float = 1e-10


@dataclass(frozen=True)
class ParameterGain:
    """One combination of parameters, and how well each model knows it.

    Attributes:
        expression, unit: The combination.
        value: Its estimate by the combined model.
        sigma_internal, sigma_external: Standard deviation by the measured noise, with the joints'
            or the plate's outputs alone; None where they do not show it.
        sigma_combined: The same with both.
    """

    expression: str
    unit: str
    value: float
    sigma_internal: float | None
    sigma_external: float | None
    sigma_combined: float

    @property
    def gain(self) -> float | None:
        """By what the plate divides the internal model's standard deviation."""
        return None if self.sigma_internal is None else self.sigma_internal / self.sigma_combined


@dataclass(frozen=True)
class Improvement:
    """How much a force plate improved an estimate.

    Attributes:
        parameters: The internal model's base parameters, then those that only the plate shows.
        shared: The parameters that both show.
        determinant_ratio: Determinant of the covariance of the shared ones, internal over combined
            model.
    """

    parameters: tuple[ParameterGain, ...]
    shared: tuple[str, ...]
    determinant_ratio: float

    @property
    def sentence(self) -> str:
        """The finding in words."""
        gains = sorted(p.gain for p in self.parameters if p.gain is not None)
        return (
            f"The force plate divides the standard deviations of the {len(gains)} parameters that"
            f" the torques show by {gains[len(gains) // 2]:.2g} (median; {gains[0]:.2g} to"
            f" {gains[-1]:.2g}), the determinant of the {len(self.shared)} shared ones by"
            f" {self.determinant_ratio:.2g}, and shows {len(self.parameters) - len(gains)} more."
        )


def improvement(fitted: FittedPeriods) -> Improvement:
    """Compare what is known with the plate, without it, and by the plate alone.

    Args:
        fitted: A fit of the combined model.

    Raises:
        EstimationError: It is of another model, or the motion does not show the internal model's
            parameters.
    """
    if fitted.options.kind != "combined":
        raise EstimationError(
            "only the combined model tells what the plate improved", code="RID-MODEL-NOT-COMBINED"
        )
    n = len(fitted.robot.joints)
    white = fitted.fit.white
    both = [part for parts in white for part in parts]
    joints = [part for parts in white for part in parts[:n]]
    plates = [part for parts in white for part in parts[n:]]
    internal = base_parameters(fitted.model, kind="internal")
    external = base_parameters(fitted.model, kind="external")
    rows = [(internal, i) for i in range(len(internal))]
    rows += [
        (external, i) for i, w in enumerate(external.expressions) if w not in internal.expressions
    ]
    functionals = np.array([_functional(base, i, fitted.base) for base, i in rows])
    steps = len(fitted.fit.solution.values) - len(fitted.base)
    wide = np.hstack([functionals, np.zeros((len(rows), steps))])
    of_both = _covariance(both, np.eye(wide.shape[1]), wide)
    s = fitted.fit.nonlinear
    # What a model alone has no say in is left out of its unknowns: shapes of the gears and friction
    # belong to the joints, delays to the plates.
    of_joints = _covariance(joints, _unknowns(internal, fitted, range(s)), wide)
    of_plates = _covariance(plates, _unknowns(external, fitted, range(s, steps)), wide)
    shared = np.flatnonzero(np.isfinite(np.diagonal(of_joints) + np.diagonal(of_plates)))
    parameters = tuple(
        ParameterGain(
            expression=base.expressions[i],
            unit=base.units[i],
            value=float(functionals[k] @ fitted.fit.solution.values[: len(fitted.base)]),
            sigma_internal=_sigma(of_joints[k, k]),
            sigma_external=_sigma(of_plates[k, k]),
            sigma_combined=math.sqrt(of_both[k, k]),
        )
        for k, (base, i) in enumerate(rows)
    )
    return Improvement(
        parameters,
        tuple(parameters[k].expression for k in shared),
        _determinant_ratio(of_joints, of_both, shared),
    )


def _functional(base: BaseParameters, i: int, combined: BaseParameters) -> FloatArray:
    """Return base parameter i of another base set in terms of the combined ones, (b,)."""
    return np.asarray(base.combination[i, list(combined.kept)])


def _unknowns(base: BaseParameters, fitted: FittedPeriods, steps: Sequence[int]) -> FloatArray:
    """Return a basis of the unknowns (p, any) that another base set and some steps depend on."""
    b, p = len(fitted.base), len(fitted.fit.solution.values)
    to_own = base.combination[:, list(fitted.base.kept)]
    size = np.linalg.norm(to_own, axis=1, keepdims=True)
    basis = np.zeros((p, len(base) + len(steps)))
    basis[:b, : len(base)] = np.linalg.pinv(to_own / size)
    for column, step in enumerate(steps, start=len(base)):
        basis[b + step, column] = 1.0
    return basis


def _covariance(
    outputs: Sequence[WhitenedEquations], basis: FloatArray, functionals: FloatArray
) -> FloatArray:
    """Return the covariance of functionals (any, p) of unknowns spanned by a basis (p, any).

    A functional that the outputs do not show has infinite variance (and no covariances).

    Raises:
        EstimationError: The motion does not show an unknown at all.
    """
    factor = np.zeros((0, basis.shape[1]))
    for part in outputs:
        factor = triangular_factor(np.vstack([factor, part.matrix @ basis]))
    size = np.linalg.norm(factor, axis=0)
    if (size == 0.0).any() or np.linalg.cond(factor / size) > 1.0 / RANK:
        raise EstimationError(
            "the motion does not show all parameters of the internal and of the external model:"
            " what the plate improves cannot be told",
            code="RID-MOTION-UNINFORMATIVE",
        )
    seen = functionals @ basis
    reached = np.linalg.lstsq(basis.T, seen.T, rcond=None)[0].T
    lost = np.linalg.norm(functionals - reached, axis=1) > SEEN * np.linalg.norm(
        functionals, axis=1
    )
    root = solve_triangular(factor, seen.T, trans="T")
    covariance = np.asarray(root.T @ root)
    covariance[lost, lost] = np.inf
    return covariance


def _sigma(variance: float) -> float | None:
    return float(np.sqrt(variance)) if np.isfinite(variance) else None


def _determinant_ratio(
    before: FloatArray, after: FloatArray, rows: np.ndarray[tuple[int], np.dtype[np.intp]]
) -> float:
    if len(rows) == 0:
        return 1.0
    pick = (rows[:, np.newaxis], rows)
    scale = np.sqrt(np.outer(np.diagonal(after)[rows], np.diagonal(after)[rows]))
    logs = [np.linalg.slogdet(c[pick] / scale)[1] for c in (before, after)]
    return float(np.exp(logs[0] - logs[1]))
