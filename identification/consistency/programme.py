"""The semidefinite programme behind `closest_robot`, solved by Clarabel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from clarabel import DefaultSettings, DefaultSolver, NonnegativeConeT, PSDTriangleConeT  # pyright: ignore[reportAttributeAccessIssue]
from scipy import sparse

from config.arrays import FloatArray
from config.errors import EstimationError
from identification.consistency.pseudo_inertia import BASIS, SIZE, pseudo_inertia

TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class ConsistencyProgramme:
    """Least |r|^2 + weight |x|^2 over x with A x - b = r, bodies that exist, and G theta >= 0.

    The standard parameters are theta = centre + scale x.

    Attributes
    ----------
    matrix : ndarray, shape (b, p)
        A, of full row rank: r in standard deviations.
    rhs : ndarray, shape (b,)
        b.
    weight : float
        Of the distance from `centre`.
    centre, scale : ndarray, shape (p,)
        Nominal parameters, and how far each may be off.
    bodies : tuple of slice
        The ten parameters of each body.
    floors : ndarray, shape (bodies, 4, 4)
        What each body's pseudo-inertia must be at least, positive definite.
    not_negative : ndarray, shape (k, p)
        G.
    """

    matrix: FloatArray
    rhs: FloatArray
    weight: float
    centre: FloatArray
    scale: FloatArray
    bodies: tuple[slice, ...]
    floors: FloatArray
    not_negative: FloatArray

    def cost(self, standard: FloatArray) -> float:
        """Return what is made small, at standard parameters of shape (p,)."""
        x = (standard - self.centre) / self.scale
        return float(np.sum((self.matrix @ x - self.rhs) ** 2) + self.weight * np.sum(x**2))

    def solve(self) -> FloatArray:
        """Return the standard parameters theta, shape (p,).

        Raises
        ------
        EstimationError
            The solver found no solution.
        """
        # Coordinates y = (r, z): residuals, and directions that change none. In them the
        # programme's numbers are of one size, however precise the measurement is.
        b = len(self.matrix)
        left, size, right = np.linalg.svd(self.matrix)
        seen = right[:b].T @ (left / size).T
        start = seen @ self.rhs
        directions = np.column_stack([seen, right[b:].T])
        quadratic = self.weight * directions.T @ directions
        quadratic[:b, :b] += np.eye(b)
        linear = self.weight * directions.T @ start

        theta, slopes = self.centre + self.scale * start, self.scale[:, np.newaxis] * directions
        rows, rhs = [-self.not_negative @ slopes], [self.not_negative @ theta]
        cones: list[object] = [NonnegativeConeT(len(self.not_negative))]
        for body, floor in zip(self.bodies, self.floors, strict=True):
            # By congruence with the floor every body's matrix is of the floor's size: theirs >= 1.
            unit = np.linalg.inv(np.linalg.cholesky(floor))
            basis = np.array([_stacked(unit @ element @ unit.T) for element in BASIS])
            own = _stacked(unit @ pseudo_inertia(theta[body]) @ unit.T - np.eye(SIZE))
            rows.append(-basis.T @ slopes[body])
            rhs.append(own)
            cones.append(PSDTriangleConeT(SIZE))
        settings = DefaultSettings()
        settings.verbose = False
        settings.max_threads = 1
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = TOLERANCE
        solution = DefaultSolver(
            sparse.csc_matrix(np.triu(quadratic)),
            linear,
            sparse.csc_matrix(np.vstack(rows)),
            np.concatenate(rhs),
            cones,
            settings,
        ).solve()
        if str(solution.status) not in ("Solved", "AlmostSolved"):
            raise EstimationError(
                f"no physically consistent parameters were found (Clarabel: {solution.status});"
                " look for parameters with senseless values or standard deviations in the estimate"
            )
        return np.asarray(theta + slopes @ np.array(solution.x))


def _stacked(matrix: FloatArray) -> FloatArray:
    """Return the upper triangle column by column, off-diagonals times the root of 2."""
    column, row = np.tril_indices(SIZE)
    return np.asarray(matrix[row, column] * np.where(row == column, 1.0, np.sqrt(2.0)))
