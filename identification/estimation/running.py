"""`RunningEstimate`: estimate during a measurement, updated with every new part.

Recursive least squares in the square-root information form (Bierman 1977): only triangular factors
of past rows are kept. Therefore the cost of a new part does not depend on the length of the
measurement, and the result equals that of all rows together. The weights of the joints are computed
anew for every result.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from config.arrays import FloatArray, IntArray
from config.errors import EstimationError
from dynamics.model.robot_model import RobotModel
from identification.equations.time_domain import EVENT_S, TimeRun, time_blocks
from identification.estimation.smoothed_fit import solve_weighted_by_residuals
from identification.model.base_parameters import BaseParameters, base_parameters
from identification.model.torque_columns import torque_structure
from identification.regression.intervals import Cluster, jackknife
from identification.regression.least_squares import Triangle


@dataclass(frozen=True, eq=False)
class RunningValues:
    """Base parameters at one time of a measurement.

    Attributes:
        values, sigma: Shape (b,). Base parameters and their cluster-robust standard deviations.
        residual_nm: Shape (n,). RMS residual of each joint [N m or N].
        relative_percent: Shape (n,). RMS residual over RMS torque of each joint [%].
    """

    values: FloatArray
    sigma: FloatArray
    residual_nm: FloatArray
    relative_percent: FloatArray


@dataclass(frozen=True, eq=False)
class RunningEstimate:
    """Information of all rows measured so far on the base parameters.

    Nonlinear parameters are those of the model; they are not estimated.

    Attributes:
        model, base: The model and its base parameters.
        standstill_rad_s: Rows of a joint below this speed are left out [rad/s or m/s].
        stretches: For each second, counted from the start of the run or of its period: one triangle
            of the rows of each joint. The same second of all periods is one cluster, because errors
            that repeat in every period are not independent.
    """

    model: RobotModel
    base: BaseParameters
    standstill_rad_s: float
    stretches: Mapping[int, tuple[Triangle, ...]]

    @classmethod
    def empty(cls, model: RobotModel, standstill_rad_s: float) -> RunningEstimate:
        """Return an estimate without rows.

        Raises:
            EstimationError: The gears have losses: such a model is not linear in its parameters.
        """
        if model.transmission.losses:
            raise EstimationError(
                "a running estimate needs a model that is linear in its parameters, but the"
                " gears of this model have losses: leave --until and --until-mass out, and identify"
                " after the measurement",
                code="RID-MODEL-LOAD-FRICTION",
            )
        return cls(model, base_parameters(model), standstill_rad_s, {})

    def add(self, run: TimeRun) -> RunningEstimate:
        """Return the estimate with one more part of the measurement.

        Args:
            run: A period, with time counted from its start, or any other part of a run that is not
                yet included, with time counted from the run's start.
        """
        structure = torque_structure(self.model, self.base, slopes=False)
        stretches = dict(self.stretches)
        for block in time_blocks(self.model, self.base, [run], self.standstill_rad_s):
            second = np.floor(block.time_s / EVENT_S).astype(int)
            for key in np.unique(second):
                rows = np.flatnonzero(second == key)
                known = stretches.get(int(key)) or _empty_triangles(len(self.base), structure)
                triangles = []
                for j, (triangle, columns) in enumerate(zip(known, structure, strict=True)):
                    triangles.append(triangle.add(*block.of_joint(j, rows, columns)))
                stretches[int(key)] = tuple(triangles)
        return replace(self, stretches=stretches)

    def current_values(self) -> RunningValues:
        """Solve for the parameters from all parts so far, with their uncertainty and residuals.

        Raises:
            EstimationError: The motion so far does not determine the parameters.
        """
        structure = torque_structure(self.model, self.base, slopes=False)
        triangles = list(_empty_triangles(len(self.base), structure))
        for parts in self.stretches.values():
            triangles = [
                whole.add(part.factor[:, :-1], part.factor[:, -1], part.rows)
                for whole, part in zip(triangles, parts, strict=True)
            ]
        solution, scale = solve_weighted_by_residuals(triangles, [], self.base.names)
        clusters = (_cluster(parts, solution.values, scale) for parts in self.stretches.values())
        covariance = jackknife(solution.information, clusters).quoted
        power = [
            [triangle.residual_sum(values) / max(triangle.rows, 1) for triangle in triangles]
            for values in (solution.values, np.zeros(len(self.base)))
        ]
        residual, torque = np.sqrt(power)
        return RunningValues(
            values=solution.values,
            sigma=np.sqrt(np.diagonal(covariance)),
            residual_nm=residual,
            relative_percent=100.0 * residual / np.maximum(torque, 1e-300),
        )


def _empty_triangles(parameters: int, structure: tuple[IntArray, ...]) -> tuple[Triangle, ...]:
    return tuple(Triangle.empty(parameters, columns) for columns in structure)


def _cluster(parts: tuple[Triangle, ...], values: FloatArray, scale: FloatArray) -> Cluster:
    """Return one time interval as a cluster, each joint weighted by one over its residual."""
    factors = [part.full() / sigma for part, sigma in zip(parts, scale, strict=True)]
    matrix = np.vstack([factor[:, :-1] for factor in factors])
    rhs = np.concatenate([factor[:, -1] for factor in factors])
    return Cluster.of(matrix, rhs - matrix @ values)
