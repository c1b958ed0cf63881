"""Least-squares solution of `PayloadEquations`: determined directions, values and covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import null_space

from config.arrays import FloatArray, IntArray
from config.errors import EstimationError
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK
from identification.choices import REPORTED
from identification.payload.body import reported, reported_slopes
from identification.payload.equations import Layout, PayloadEquations, independent_unknowns
from identification.payload.known import (
    KnownPayloadValue,
    known_rows,
    refuse_duplicates,
    start_values,
    with_fixed_values,
)
from identification.regression.intervals import Cluster, jackknife
from identification.regression.least_squares import triangular_factor

MOST_STEPS: Final = 30
SETTLED: Final = 1e-9
UNSEEN: Final = 1e-7
SEEN: Final = 1e-5


@dataclass(frozen=True, eq=False)
class PayloadSolution:
    """Solution of a payload's equations for its ten parameters.

    Attributes:
        unknowns: Shape (p,). All unknowns, the payload's first. Unknowns that depend linearly on
            others are zero.
        covariance_jackknife: Shape (10, 10). Covariance from leaving out clusters, plus that of
            prior knowledge.
        covariance_noise: Shape (10, 10). Covariance from the noise by which the rows were divided.
        gain_slopes: Shape (10, n). Derivative of the parameters with respect to a relative error of
            each joint's torque.
        unseen: Shape (10, 10 - rank). Unit vectors of the directions of the ten parameters that no
            equation determines.
        condition_number: Condition number of the payload's columns, each of length one, with all
            other columns projected out.
        contradictions: Shape (k,). Distance of each known quantity from the equations' result
            without it, in standard deviations of both; zero if the equations do not determine it.
    """

    unknowns: FloatArray
    covariance_jackknife: FloatArray
    covariance_noise: FloatArray
    gain_slopes: FloatArray
    unseen: FloatArray
    condition_number: float
    contradictions: FloatArray

    @property
    def values(self) -> FloatArray:
        """The payload's parameters, shape (10,)."""
        return self.unknowns[:PARAMETERS_PER_LINK]


def solve_payload(
    equations: PayloadEquations, known: Sequence[KnownPayloadValue] = (), *, intervals: bool = True
) -> PayloadSolution:
    """Solve the equations by weighted least squares.

    Rows are weighted by their noise. Because of model error, the real error of the rows is larger
    than this noise. Therefore a known quantity is weighted against the cluster-robust scatter of
    the rows' result, and not against the noise.

    Args:
        equations: Equations of the measurement.
        known: Quantities known from another source. Those about the centre of gravity are nonlinear
            in the parameters and are solved by Gauss-Newton.
        intervals: True to compute `covariance_jackknife`, which costs more than the rest; otherwise
            it equals the covariance of the noise.

    Raises:
        EstimationError: The equations do not determine a payload, or known quantities contradict
            each other.
    """
    refuse_duplicates(known)
    system = _System.of(equations)
    if len(equations.known) and intervals:
        first = _solve_measured(equations, system, True)
        white = np.sqrt(np.diagonal(first.noise))
        colour = float(np.median(np.sqrt(np.diagonal(first.clustered)) / white))
        equations = equations.with_larger_noise(max(colour, 1.0))
        system = _System.of(equations)
    found = _solve_measured(equations, system, intervals)
    subspace = found.subspace
    if not known:
        return PayloadSolution(
            unknowns=system.all_unknowns(found.values),
            covariance_jackknife=subspace.determined @ found.clustered @ subspace.determined.T,
            covariance_noise=subspace.determined @ found.noise @ subspace.determined.T,
            gain_slopes=subspace.determined @ found.slopes,
            unseen=subspace.undetermined,
            condition_number=subspace.condition,
            contradictions=np.zeros(0),
        )
    return _solve_with_known(system, found, known)


@dataclass(frozen=True, eq=False)
class _Measured:
    """Result without known quantities: values, and covariances in determined coordinates."""

    subspace: IdentifiableSubspace
    values: FloatArray
    coordinates: FloatArray
    clustered: FloatArray
    noise: FloatArray
    slopes: FloatArray

    @property
    def spread(self) -> FloatArray:
        """Cholesky factor of the covariance with cluster-robust sigmas and averaged correlations.

        The correlations are the mean of those of both covariances, because the cluster-robust
        covariance comes from few clusters and may not have full rank (Ledoit and Wolf 2004:
        shrinkage towards a target).
        """
        parts = []
        for covariance in (self.clustered, self.noise):
            size = np.sqrt(np.diagonal(covariance))
            parts.append(covariance / np.outer(size, size))
        sigma = np.sqrt(np.maximum(np.diagonal(self.clustered), np.diagonal(self.noise)))
        return sigma[:, np.newaxis] * np.linalg.cholesky(0.5 * parts[0] + 0.5 * parts[1])

    def contradiction(self, quantity: KnownPayloadValue) -> float:
        """Return the distance of a known quantity from the measured one [standard deviations]."""
        payload, index = self.values[:PARAMETERS_PER_LINK], REPORTED.index(quantity.name)
        slopes = reported_slopes(payload)[index]
        if np.linalg.norm(slopes @ self.subspace.undetermined) > SEEN * np.linalg.norm(slopes):
            return 0.0
        sigma = float(np.linalg.norm(slopes @ self.subspace.determined @ self.spread))
        off = abs(quantity.value - float(reported(payload)[index]))
        return off / float(np.hypot(sigma, quantity.sigma))


def _solve_measured(equations: PayloadEquations, system: _System, intervals: bool) -> _Measured:
    """Solve the equations without known quantities."""
    subspace = system.subspace()
    r = subspace.determined.shape[1]
    matrix = system.reduced_matrix(subspace)
    solved = system.solve(subspace)
    values = np.concatenate([subspace.determined @ solved[:r], solved[r:]])
    inverse = np.linalg.inv(triangular_factor(matrix))
    covariance = inverse @ inverse.T
    clustered = covariance
    if intervals and equations.procedure != "apart":
        clusters = (
            _cluster(system, subspace, factor, values, len(equations.joint_names))
            for factor in equations.factors
        )
        clustered = jackknife(matrix.T @ matrix, clusters).quoted
        # No cluster contains the prior knowledge of the robot: its covariance is added.
        brought = covariance @ matrix[system.measured :].T
        clustered = clustered + brought @ brought.T
    return _Measured(
        subspace=subspace,
        values=values,
        coordinates=solved[:r],
        clustered=clustered[:r, :r],
        noise=covariance[:r, :r],
        slopes=(covariance @ (matrix.T @ system.shares))[:r],
    )


def _solve_with_known(
    system: _System, found: _Measured, known: Sequence[KnownPayloadValue]
) -> PayloadSolution:
    """Return the estimate from the measurement and from known quantities.

    Fixed quantities are constraints: only payloads with exactly these values are considered.
    """
    ten = PARAMETERS_PER_LINK
    # theta = determined z + undetermined h. The recordings determine z; only known quantities can
    # determine h.
    subspace, r = found.subspace, found.subspace.determined.shape[1]
    axes = np.hstack([subspace.determined, subspace.undetermined])
    metric = np.linalg.inv(found.spread)
    measured = np.zeros((r, ten))
    measured[:, :r] = metric
    target = metric @ found.coordinates
    weighed = [quantity for quantity in known if not quantity.is_exact]
    held = [quantity for quantity in known if quantity.is_exact]
    values = start_values(found.values[:ten], known)
    for _ in range(MOST_STEPS):
        rows, bound = known_rows(weighed, values), known_rows(held, values)
        rows /= np.array([[quantity.sigma] for quantity in weighed]).reshape(-1, 1)
        matrix = np.vstack([measured, rows[:, :ten] @ axes])
        rhs = np.concatenate([target, rows[:, ten]])
        bounds = bound[:, :ten] @ axes
        size = np.linalg.norm(np.vstack([matrix, bounds]), axis=0)
        size = np.where(size > 0.0, size, 1.0)
        start = np.linalg.pinv(bounds / size) @ bound[:, ten]
        free = null_space(bounds / size)
        left, singular, right = np.linalg.svd(matrix / size @ free)
        rank = int(np.count_nonzero(singular > UNSEEN * singular.max(initial=0.0)))
        inverse = free @ (right[:rank].T / singular[:rank]) @ left[:, :rank].T
        better = axes @ ((start + inverse @ (rhs - matrix / size @ start)) / size)
        change = np.abs(better - values)
        values = better
        if np.all(change <= SETTLED * (1.0 + np.abs(values))):
            break
    else:
        raise EstimationError(
            "no payload was found that fits the recordings and the known quantities, which may"
            " contradict the recordings or each other; check their values and units",
            code="RID-PAYLOAD-CONTRADICTION",
        )
    values = with_fixed_values(known, values)
    inverse = inverse / size[:, np.newaxis]
    covariance = axes @ inverse @ inverse.T @ axes.T
    noise = axes @ inverse[:, :r] @ metric @ found.noise @ metric.T @ (axes @ inverse[:, :r]).T
    hidden = axes @ (free @ right[rank:].T / size[:, np.newaxis])
    return PayloadSolution(
        unknowns=system.solve_others(values),
        covariance_jackknife=covariance,
        covariance_noise=noise,
        gain_slopes=axes @ inverse[:, :r] @ metric @ found.slopes,
        unseen=np.linalg.qr(hidden)[0] if hidden.shape[1] else np.zeros((ten, 0)),
        condition_number=subspace.condition,
        contradictions=np.array([found.contradiction(quantity) for quantity in known]),
    )


def minimum_norm_solution(matrix: FloatArray, rhs: FloatArray) -> FloatArray:
    """Return the least-squares solution of minimum norm in scaled columns."""
    size = np.linalg.norm(matrix, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    return np.asarray(np.linalg.lstsq(matrix / size, rhs, rcond=1e-10)[0] / size)


def minimum_norm(equations: PayloadEquations) -> FloatArray:
    """Return the minimum-norm solution of all unknowns, shape (p,)."""
    p = len(equations.names)
    whole = equations.whole
    rhs = np.concatenate([whole[:, p:].sum(axis=1), equations.known[:, -1]])
    return minimum_norm_solution(np.vstack([whole[:, :p], equations.known[:, :-1]]), rhs)


def base_values(layout: Layout, unknowns: FloatArray, run: int) -> FloatArray:
    """Return the values of `PayloadModel.base` in one run, shape (b,)."""
    model, ten = layout.model, PARAMETERS_PER_LINK
    values = np.zeros(len(model.base))
    values[-ten:] = model.flange_to_link @ unknowns[:ten]
    start = ten
    if layout.with_robot:
        values[model.links] = unknowns[start : start + len(model.links)]
        start += len(model.links)
    f = len(model.friction)
    values[model.friction] = unknowns[start + run * f : start + (run + 1) * f]
    return values


@dataclass(frozen=True, eq=False)
class IdentifiableSubspace:
    """Directions of the ten parameters that the equations determine.

    `determined` (10, rank): the determined directions, in the units of the parameters.
    `undetermined` (10, 10 - rank): orthonormal directions that are not determined. `condition`:
    largest over smallest singular value of the scaled equations in the determined directions.
    """

    determined: FloatArray
    undetermined: FloatArray
    condition: float


@dataclass(frozen=True, eq=False)
class _System:
    """All equations A x = y: the measurement, followed by prior knowledge of the robot.

    `shares` (rows, n) are each joint's parts of y, zero for prior knowledge. `measured` is the
    number of measured rows. `kept` are the indices of the other unknowns that are linearly
    independent.
    """

    matrix: FloatArray
    side: FloatArray
    shares: FloatArray
    measured: int
    kept: IntArray

    @classmethod
    def of(cls, equations: PayloadEquations) -> _System:
        p, n = len(equations.names), len(equations.joint_names)
        whole, known = equations.whole, equations.known
        matrix = np.vstack([whole[:, :p], known[:, :p]])
        return cls(
            matrix=matrix,
            side=np.concatenate([whole[:, p:].sum(axis=1), known[:, p]]),
            shares=np.vstack([whole[:, p:], np.zeros((len(known), n))]),
            measured=len(whole),
            kept=independent_unknowns(matrix, p, PARAMETERS_PER_LINK),
        )

    def subspace(self) -> IdentifiableSubspace:
        """Return the directions of the payload's parameters that are determined."""
        ten = PARAMETERS_PER_LINK
        payload = self.matrix[:, :ten]
        size = np.linalg.norm(payload, axis=0)
        if not size.any():
            raise EstimationError(
                "no run carried the payload, so it cannot be estimated: name the runs that"
                " carried it (--loaded)",
                code="RID-PAYLOAD-RUNS",
            )
        size = np.where(size > 0.0, size, size.max())
        basis = np.linalg.qr(self.matrix[:, self.kept])[0]
        rest = payload - basis @ (basis.T @ payload)
        rest = (rest - basis @ (basis.T @ rest)) / size
        _, singular, right = np.linalg.svd(rest)
        singular = np.concatenate([singular, np.zeros(max(ten - len(singular), 0))])
        rank = int(np.count_nonzero(singular > UNSEEN * singular[0]))
        hidden = (right[rank:] / size).T
        return IdentifiableSubspace(
            determined=(right[:rank] / size).T,
            undetermined=np.linalg.qr(hidden)[0] if rank < ten else np.zeros((ten, 0)),
            condition=float(singular[0] / singular[rank - 1]),
        )

    def reduced_matrix(self, subspace: IdentifiableSubspace) -> FloatArray:
        """Return A for the determined combinations of the payload and the independent unknowns."""
        payload = self.matrix[:, :PARAMETERS_PER_LINK] @ subspace.determined
        return np.hstack([payload, self.matrix[:, self.kept]])

    def solve(self, subspace: IdentifiableSubspace) -> FloatArray:
        """Return the solution in the coordinates of `reduced_matrix`."""
        matrix = self.reduced_matrix(subspace)
        width = matrix.shape[1]
        upper = triangular_factor(np.hstack([matrix, self.side[:, np.newaxis]]))
        if len(upper) < width:
            raise EstimationError(
                f"the recordings give {len(upper)} equations for {width} unknowns: record longer",
                code="RID-RECORDING-SHORT",
            )
        return np.asarray(
            np.linalg.solve(upper[:width, :width], upper[:width, width]), dtype=np.float64
        )

    def solve_others(self, payload: FloatArray) -> FloatArray:
        """Return all unknowns, shape (p,), that fit best for fixed payload parameters."""
        rest = self.side - self.matrix[:, :PARAMETERS_PER_LINK] @ payload
        others: FloatArray = np.asarray(
            np.linalg.lstsq(self.matrix[:, self.kept], rest, rcond=None)[0], dtype=np.float64
        )
        return self.all_unknowns(np.concatenate([payload, others]))

    def all_unknowns(self, values: FloatArray) -> FloatArray:
        """Return all unknowns, shape (p,), from the payload's and the `kept` ones.

        The rest are zero.
        """
        unknowns = np.zeros(self.matrix.shape[1])
        unknowns[:PARAMETERS_PER_LINK] = values[:PARAMETERS_PER_LINK]
        unknowns[self.kept] = values[PARAMETERS_PER_LINK:]
        return unknowns


def _cluster(
    system: _System,
    subspace: IdentifiableSubspace,
    factor: FloatArray,
    values: FloatArray,
    joints: int,
) -> Cluster:
    """Return one cluster's equations in the coordinates of `_System.reduced_matrix`."""
    p = factor.shape[1] - joints
    residual = factor[:, p:].sum(axis=1) - factor[:, :p] @ system.all_unknowns(values)
    matrix = np.hstack(
        [factor[:, :PARAMETERS_PER_LINK] @ subspace.determined, factor[:, system.kept]]
    )
    return Cluster.of(matrix, residual)
