"""`ConsistencyTest`: test whether identified parameters can be those of a real robot.

There are two test statistics, whose distributions for a consistent robot are known. The smaller one
of their p-values is doubled (Bonferroni).

1. The largest violation by a single parameter that cannot be negative. This test is one-sided, and
   corrected for the number of such parameters (Holm 1979). It keeps its power with many parameters.
2. The distance d2 from the cone of consistent robots, in the estimate's own metric. For a
   consistent robot, d2 has a mixture of chi-squared distributions (Shapiro 1988), which is
   simulated: random estimates of such a robot are drawn and projected onto the cone, until enough
   of them have at least the distance d2 (Besag and Clifford 1991).

The distribution of d2 depends on the number of constraints that are active for the true robot,
which is unknown. Therefore the simulation starts from the nearest consistent robot; each of its
values within `BORDER_SIGMAS` of the border is moved to the border (Andrews and Soares 2010). A
robot closer to the cone's apex never has smaller distances. Let beta be a robot in the cone, and e
an error. Because the cone is convex, the distance of beta + k + e is at most that of beta + e for
every k in the cone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import chdtrc, fdtrc, ndtr, stdtr

from config.arrays import BoolArray, FloatArray
from identification.consistency.programme import TO_BODY, ConsistencyProgramme
from identification.consistency.pseudo_inertia import BASIS, SIZE
from identification.regression.intervals import widening
from identification.regression.multiple_tests import holm

SMALLEST_P: Final = 0.05
BORDER_SIGMAS: Final = 3.0
SHOWN_P: Final = 1e-6
MOST_NAMED: Final = 3
DRAWS: Final = 120
ENOUGH: Final = 10
SEED: Final = 20130013
NO_DISTANCE: Final = 1e-2  # the weight of the nominal robot causes distances up to this size
ROUNDING_SHARE: Final = 1e-7


@dataclass(frozen=True)
class Violation:
    """A parameter that cannot be negative, but was identified below zero.

    Attributes:
        name, expression: Its name, and its combination of standard parameters.
        sigmas: Its distance below zero [standard deviations].
        p_value: Probability of a value as low or lower if the true one is zero, corrected for the
            number of tested parameters.
    """

    name: str
    expression: str
    sigmas: float
    p_value: float


@dataclass(frozen=True)
class ConsistencyTest:
    """Result of the test.

    Attributes:
        p_value: P-value of the test, from both statistics.
        single_p_value: P-value of the largest single violation.
        distance_p_value, distance: P-value of the squared distance from the nearest consistent
            robot, and this squared distance in decorrelated standard deviations; None if the single
            violation is already significant.
        tested: Number of parameters that cannot be negative.
        violations: The tested parameters that were identified below zero, the largest violation
            first.
    """

    p_value: float
    single_p_value: float
    distance_p_value: float | None
    distance: float | None
    tested: int
    violations: tuple[Violation, ...]

    @property
    def is_consistent(self) -> bool:
        """False if every consistent robot is rejected at `SMALLEST_P`."""
        return self.p_value >= SMALLEST_P

    @property
    def largest(self) -> Violation | None:
        """The largest single violation; None if no tested parameter is below zero."""
        return self.violations[0] if self.violations else None

    @property
    def refuted(self) -> tuple[Violation, ...]:
        """The violations that are individually significant."""
        return tuple(each for each in self.violations if 2.0 * each.p_value < SMALLEST_P)

    @property
    def sentence(self) -> str:
        """Text with the result and the largest violations by single parameters."""
        p = f"p = {self.p_value:.2g}" if self.p_value >= SHOWN_P else f"p < {SHOWN_P:g}"
        if self.is_consistent:
            return f"The parameters do not contradict a possible robot ({p}): {self._largest}."
        if self.refuted:
            parts = [f"{v.expression} is {v.sigmas:.1f} σ below zero" for v in self.refuted]
            more = len(parts) - MOST_NAMED
            named = "; ".join(parts[:MOST_NAMED]) + (f"; and {more} more" if more > 0 else "")
            why = f"{named}. In a real robot these are not negative"
        else:
            far = 0.0 if self.distance is None else self.distance
            why = (
                f"together they are {np.sqrt(far):.1f} σ away from the nearest consistent robot;"
                f" {self._largest}"
            )
        return f"The parameters contradict every possible robot ({p}): {why}."

    @property
    def _largest(self) -> str:
        largest = self.largest
        if largest is None:
            return f"none of the {self.tested} parameters that cannot be negative is below zero"
        return (
            f"of the {self.tested} parameters that cannot be negative, {largest.expression} is"
            f" lowest, {largest.sigmas:.1f} σ below zero"
        )


@dataclass(frozen=True, eq=False)
class JudgedParameters:
    """Estimated parameters with their uncertainty.

    Attributes:
        names, expressions: Names, and the combinations of standard parameters.
        values, sigma: Shape (b,). Values and standard deviations.
        factor: Shape (b, b). Lower Cholesky factor of their correlations.
        clusters: Number of clusters from which the standard deviations were computed; None if the
            standard deviations are exact.
    """

    names: tuple[str, ...]
    expressions: tuple[str, ...]
    values: FloatArray
    sigma: FloatArray
    factor: FloatArray
    clusters: int | None = None


def judge_consistency(parameters: JudgedParameters, cone: ConsistencyProgramme) -> ConsistencyTest:
    """Test whether estimated parameters can be those of a real robot.

    Args:
        parameters: The estimate.
        cone: Programme that finds the nearest consistent robot, with floors of zero and a small
            weight of the nominal robot. Its targets are parameters in decorrelated standard
            deviations.

    Raises:
        EstimationError: The solver found no nearest robot.
    """
    violations, tested = _violations(parameters, cone)
    single = min((each.p_value for each in violations), default=1.0)
    if 2.0 * single < SMALLEST_P:
        return ConsistencyTest(2.0 * single, single, None, None, tested, violations)
    target = np.asarray(
        solve_triangular(parameters.factor, parameters.values / parameters.sigma, lower=True)
    )
    nearest = cone.solve(target)
    distance, far = _distance(cone, nearest, target), 1.0
    if distance >= NO_DISTANCE:
        y = np.asarray(np.linalg.solve(cone.units, nearest), dtype=float)
        border = cone.effects @ _towards_apex(cone, y)
        far = min(
            _upper_bound_of_tail(distance, len(target), parameters.clusters),
            _simulated_tail(cone, border, distance, parameters.clusters),
        )
    p_value = min(1.0, 2.0 * min(single, far))
    return ConsistencyTest(p_value, single, far, distance, tested, violations)


def _violations(
    parameters: JudgedParameters, cone: ConsistencyProgramme
) -> tuple[tuple[Violation, ...], int]:
    """Return the violations, the largest first, and the number of tested parameters."""
    tested = np.flatnonzero(cannot_be_negative(parameters, cone))
    z = (parameters.values / parameters.sigma)[tested]
    if parameters.clusters is None:
        alone = ndtr(z)
    else:
        alone = stdtr(parameters.clusters - 1, z * widening(parameters.clusters))
    adjusted = holm(np.asarray(alone))
    found = [
        Violation(parameters.names[i], parameters.expressions[i], -float(z[k]), float(adjusted[k]))
        for k, i in enumerate(tested)
        if z[k] < 0.0
    ]
    return tuple(sorted(found, key=lambda each: -each.sigmas)), len(tested)


def cannot_be_negative(parameters: JudgedParameters, cone: ConsistencyProgramme) -> BoolArray:
    """Return a mask of the parameters that are not negative in any consistent robot, shape (b,).

    A parameter is a sum of inner products <Y, P> of coefficient matrices Y with the bodies'
    pseudo-inertias P, and of scalar parameters times coefficients. It cannot be negative if and
    only if every Y is positive semidefinite, no coefficient of a scalar is negative, and the
    coefficient of every scalar that may be negative is zero.
    """
    rows = (parameters.sigma[:, np.newaxis] * parameters.factor) @ cone.effects
    alone, _ = _constrained(cone)
    found = np.zeros(len(rows), dtype=bool)
    for i, row in enumerate(rows):
        coefficients = np.array([row[body] for body in cone.bodies]) @ TO_BODY
        eigenvalues = np.linalg.eigvalsh(coefficients.reshape(-1, SIZE, SIZE)).ravel()
        scalars = np.where(alone, row, -np.abs(row))
        for body in cone.bodies:
            scalars[body] = 0.0
        parts = np.concatenate([eigenvalues, scalars])
        found[i] = -np.minimum(parts, 0.0).sum() <= ROUNDING_SHARE * np.maximum(parts, 0.0).sum()
    return found


def _constrained(cone: ConsistencyProgramme) -> tuple[BoolArray, BoolArray]:
    """Return two masks (p,): parameters constrained singly, and those constrained only jointly."""
    involved = cone.not_negative != 0.0
    single = np.count_nonzero(involved, axis=1) == 1
    alone = np.any(involved[single], axis=0)
    return alone, np.any(involved, axis=0) & ~alone


def _towards_apex(cone: ConsistencyProgramme, y: FloatArray) -> FloatArray:
    """Return a robot whose values within `BORDER_SIGMAS` of the border are moved to the border.

    Each eigenvalue of a body's pseudo-inertia, and each scalar, becomes zero if this changes the
    base parameters by less than this distance. Friction parameters that are constrained only
    together always become zero.
    """
    out = y.copy()
    for body in cone.bodies:
        values, vectors = np.linalg.eigh(np.tensordot(y[body], BASIS, axes=1))
        for value, vector in zip(values, vectors.T, strict=True):
            part = TO_BODY @ (value * np.outer(vector, vector)).ravel()
            if np.linalg.norm(cone.effects[:, body] @ part) < BORDER_SIGMAS:
                out[body] -= part
    alone, shared = _constrained(cone)
    for column in np.flatnonzero(alone):
        if np.linalg.norm(cone.effects[:, column] * y[column]) < BORDER_SIGMAS:
            out[column] = 0.0
    out[shared] = 0.0
    return out


def _simulated_tail(
    cone: ConsistencyProgramme, centre: FloatArray, distance: float, clusters: int | None
) -> float:
    """Return the simulated p-value: the probability that an estimate has at least `distance`."""
    random = np.random.default_rng(SEED)
    exceeded = 0
    for draw in range(1, DRAWS + 1):
        error = random.normal(size=len(centre))
        if clusters is not None:  # few clusters: Student's t
            freedom = clusters - 1
            error *= np.sqrt(freedom / random.chisquare(freedom)) / widening(clusters)
        target = centre + error
        nearest = cone.solve(target, exactly=False)
        exceeded += _distance(cone, nearest, target) >= distance
        if exceeded == ENOUGH:
            return ENOUGH / draw
    return (exceeded + 1) / (DRAWS + 1)


def _upper_bound_of_tail(distance: float, count: int, clusters: int | None) -> float:
    """Return an upper bound of the p-value: its value if the cone were a single point."""
    if clusters is None:
        return float(chdtrc(count, distance))
    return float(fdtrc(count, clusters - 1, distance * widening(clusters) ** 2 / count))


def _distance(cone: ConsistencyProgramme, theta: FloatArray, target: FloatArray) -> float:
    return float(np.sum((cone.matrix @ theta - target) ** 2))
