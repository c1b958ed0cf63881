"""`Improvement`: information that a force plate adds, parameter by parameter (table 4.1).

Three models are compared. They have the same weights, but use different equations:
- The combined model uses the joint torques and the base wrench.
- The internal model uses only the joint torques.
- The external model uses only the base wrench.

Leaving out equations can only reduce the information. Therefore the combined model is never less
certain than the other two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

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
    """A combination of standard parameters, and its uncertainty in each model.

    Attributes:
        expression, unit: The combination.
        value: Its estimate in the combined model.
        sigma_internal, sigma_external: Standard deviation from the measured noise, in the internal
            and in the external model; None if the model does not determine the combination.
        sigma_combined: Standard deviation from the measured noise, in the combined model.
    """

    expression: str
    unit: str
    value: float
    sigma_internal: float | None
    sigma_external: float | None
    sigma_combined: float

    @property
    def gain(self) -> float | None:
        """Ratio of standard deviations without and with the plate; None if infinite."""
        return None if self.sigma_internal is None else self.sigma_internal / self.sigma_combined


@dataclass(frozen=True)
class Improvement:
    """Improvement of an estimate's standard deviations by a force plate.

    Attributes:
        parameters: The internal model's base parameters, then those of the external model that are
            not among them.
        shared: Expressions of the parameters that torques alone and plate alone both determine.
        determinant_ratio: Determinant of the covariance of the shared parameters, internal over
            combined model.
    """

    parameters: tuple[ParameterGain, ...]
    shared: tuple[str, ...]
    determinant_ratio: float

    @property
    def sentence(self) -> str:
        """The plate's effect on the standard deviations, in words."""
        gains = sorted(p.gain for p in self.parameters if p.gain is not None)
        return (
            f"The force plate divides the standard deviations of the {len(gains)} parameters that"
            f" the torques determine by {gains[len(gains) // 2]:.2g} (median; {gains[0]:.2g} to"
            f" {gains[-1]:.2g}). It divides the determinant of the covariance of the"
            f" {len(self.shared)} parameters that torques and plate each determine by"
            f" {self.determinant_ratio:.2g}. The plate determines"
            f" {len(self.parameters) - len(gains)} more parameters."
        )


def improvement(fitted: FittedPeriods) -> Improvement:
    """Compare the uncertainty with the plate, without it, and with the plate alone.

    Args:
        fitted: A fit of the combined model.

    Raises:
        EstimationError: The fit is of another model, or the motion does not determine the
            parameters of the internal and the external model.
    """
    if fitted.options.kind != "combined":
        raise EstimationError(
            "the improvement by the force plate can be computed only for the combined model:"
            " identify with --model combined",
            code="RID-MODEL-NOT-COMBINED",
        )
    n = len(fitted.robot.joints)
    white = fitted.fit.white
    both = [part for parts in white for part in parts]
    joints = [part for parts in white for part in parts[:n]]
    plates = [part for parts in white for part in parts[n:]]
    internal = replace(fitted.options, kind="internal").base_parameters(fitted.robot)
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
    # Each model has only the unknowns that affect it: the base wrench does not depend on nonlinear
    # parameters of gears and friction, and the joint torques do not depend on the plate's delays.
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
    """Return base parameter i of a model as a combination of those of the combined one, (b,)."""
    return np.asarray(base.combination[i, list(combined.kept)])


def _unknowns(base: BaseParameters, fitted: FittedPeriods, steps: Sequence[int]) -> FloatArray:
    """Return a basis (p, any) of the unknowns on which one model depends.

    The unknowns are base parameters, followed by steps of nonlinear parameters and of delays;
    `steps` are the indices of those steps that affect the model.
    """
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
    """Return the covariance of linear functions of the unknowns, estimated from some outputs.

    The coefficients of the functions are `functionals` (any, p). The outputs depend only on the
    unknowns in the span of `basis` (p, any). A function that the outputs do not determine has an
    infinite variance; its covariances are meaningless.

    Raises:
        EstimationError: The motion does not determine an unknown.
    """
    factor = np.zeros((0, basis.shape[1]))
    for part in outputs:
        factor = triangular_factor(np.vstack([factor, part.matrix @ basis]))
    size = np.linalg.norm(factor, axis=0)
    if (size == 0.0).any() or np.linalg.cond(factor / size) > 1.0 / RANK:
        raise EstimationError(
            "the motion does not determine all parameters of the internal and the external"
            " model, so the improvement by the plate cannot be computed: use a motion that moves"
            " every joint more",
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
