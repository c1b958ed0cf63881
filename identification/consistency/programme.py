"""`ConsistencyProgramme`: the nearest robot that satisfies the constraints, by Clarabel."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from clarabel import DefaultSettings, DefaultSolver, NonnegativeConeT, PSDTriangleConeT  # pyright: ignore[reportAttributeAccessIssue]
from scipy import sparse

from config.arrays import FloatArray
from config.errors import EstimationError
from identification.consistency.pseudo_inertia import BASIS, SIZE

TOLERANCE: Final = 1e-9
ROUGH_TOLERANCE: Final = 1e-6
UNITS_SIGMAS: Final = (1.0, 100.0, 1e4)
TO_BODY: Final = np.linalg.pinv(BASIS.reshape(len(BASIS), -1).T)


def _stack(matrix: FloatArray) -> FloatArray:
    """Return a symmetric matrix as the vector that Clarabel expects.

    It is the upper triangle column by column, with off-diagonal elements times sqrt(2).
    """
    column, row = np.tril_indices(SIZE)
    return np.asarray(matrix[row, column] * np.where(row == column, 1.0, np.sqrt(2.0)))


_STACKED_BASIS: Final = np.array([_stack(element) for element in BASIS]).T


@dataclass(frozen=True, eq=False)
class ConsistencyProgramme:
    """Minimise |A theta - target|^2 + weight |(theta - centre) / scale|^2 over consistent robots.

    A robot is consistent if the pseudo-inertia of every body is at least its floor, and G theta >=
    0.

    Attributes:
        matrix: Shape (b, p). A, of full row rank: A theta are the base parameters in decorrelated
            standard deviations.
        weight: Weight of the distance from `centre`.
        centre, scale: Shape (p,). Nominal parameters, and their uncertainty.
        bodies: The ten parameters of each body.
        nominal: Shape (bodies, 4, 4). Pseudo-inertias of the bodies' size, positive definite.
        floors: Shape (bodies, 4, 4). Smallest pseudo-inertias; zero allows every physically
            consistent body.
        not_negative: Shape (k, p). G.
    """

    matrix: FloatArray
    weight: float
    centre: FloatArray
    scale: FloatArray
    bodies: tuple[slice, ...]
    nominal: FloatArray
    floors: FloatArray
    not_negative: FloatArray

    def cost(self, target: FloatArray, standard: FloatArray) -> float:
        """Return the minimised function's value for standard parameters of shape (p,)."""
        x = (standard - self.centre) / self.scale
        return float(np.sum((self.matrix @ standard - target) ** 2) + self.weight * np.sum(x**2))

    @cached_property
    def units(self) -> FloatArray:
        """The matrix S of theta = S y, (p, p).

        For each body, y contains the ten parameters of the pseudo-inertia L^-1 P L^-T, with L L^T
        the nominal one. For other parameters it contains values divided by `scale`. Thus all
        elements of y are of similar size.
        """
        units = np.diag(self.scale)
        for body, nominal in zip(self.bodies, self.nominal, strict=True):
            root = np.linalg.cholesky(nominal)
            units[body, body] = TO_BODY @ (root @ BASIS @ root.T).reshape(len(BASIS), -1).T
        return units

    @cached_property
    def effects(self) -> FloatArray:
        """The matrix A S, (b, p), from y to the whitened base parameters."""
        return np.asarray(self.matrix @ self.units)

    @cached_property
    def _directions(self) -> FloatArray:
        """The matrix D of y = start + D (r, z), (p, p).

        r are the residuals, and z are coordinates that change no residual. In these coordinates the
        programme's numbers are of similar size for any precision of the measurement.
        """
        b = len(self.matrix)
        left, size, right = np.linalg.svd(self.effects)
        return np.column_stack([right[:b].T @ (left / size).T, right[b:].T])

    @cached_property
    def _pull(self) -> FloatArray:
        return self.units / self.scale[:, np.newaxis]

    @cached_property
    def _quadratic(self) -> sparse.csc_matrix:
        pull = self._pull @ self._directions
        quadratic = self.weight * pull.T @ pull
        b = len(self.matrix)
        quadratic[:b, :b] += np.eye(b)
        return sparse.csc_matrix(np.triu(quadratic))

    @cached_property
    def _constraints(self) -> FloatArray:
        """The matrix R, (10 bodies + k, p): R y are the stacked pseudo-inertias and G theta."""
        rows = np.zeros((len(_STACKED_BASIS) * len(self.bodies), len(self.centre)))
        for number, body in enumerate(self.bodies):
            place = len(_STACKED_BASIS) * number
            rows[place : place + len(_STACKED_BASIS), body] = _STACKED_BASIS
        return np.vstack([rows, self.not_negative @ self.units])

    @cached_property
    def _slopes(self) -> sparse.csc_matrix:
        return sparse.csc_matrix(-self._constraints @ self._directions)

    def solve(self, target: FloatArray, *, exactly: bool = True) -> FloatArray:
        """Return the standard parameters theta, shape (p,).

        Args:
            target: Shape (b,). Base parameters in decorrelated standard deviations.
            exactly: If False, use a larger tolerance: the residuals change by about 1e-4 standard
                deviations, and the solution takes about half of the time.

        Raises:
            EstimationError: The solver found no solution.
        """
        b, k = len(self.matrix), len(self.not_negative)
        directions = self._directions
        nominal = np.linalg.solve(self.units, self.centre)
        start = nominal + directions[:, :b] @ (target - self.effects @ nominal)
        linear = self.weight * directions.T @ (self._pull.T @ (self._pull @ (start - nominal)))
        floor = np.zeros(len(start))
        for body, least in zip(self.bodies, self.floors, strict=True):
            floor[body] = TO_BODY @ least.ravel()
        room = self._constraints @ (start - np.linalg.solve(self.units, floor))
        statuses: list[str] = []
        # if the parameters are far from the cone, the solver needs a larger unit
        exact = [(unit, True) for unit in UNITS_SIGMAS]
        for unit, is_exact in exact if exactly else [(1.0, False), *exact]:
            solution = DefaultSolver(
                self._quadratic,
                linear / unit,
                self._slopes,
                room / unit,
                [*(PSDTriangleConeT(SIZE) for _ in self.bodies), NonnegativeConeT(k)],
                _settings(exact=is_exact),
            ).solve()
            statuses.append(str(solution.status))
            if statuses[-1] == "Solved" or (is_exact and statuses[-1] == "AlmostSolved"):
                x = unit * np.array(solution.x)
                return np.asarray(self.units @ (start + directions @ x))
        raise EstimationError(
            f"no physically consistent parameters were found (Clarabel: {', '.join(statuses)}):"
            " identify the model again, and check it for implausible values and standard"
            " deviations",
            code="RID-MODEL-UNSOUND",
        )


def _settings(*, exact: bool) -> DefaultSettings:
    settings = DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    tolerance = TOLERANCE if exact else ROUGH_TOLERANCE
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
    settings.iterative_refinement_enable = exact
    return settings
