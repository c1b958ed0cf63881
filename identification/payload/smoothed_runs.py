"""Equations of a payload from recordings that are not periodic, in the time domain."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from identification.equations.time_domain import joint_equations, time_runs
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_signals import fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.model.options import ModelOptions
from identification.payload.equations import (
    Layout,
    PayloadEquations,
    PayloadModel,
    Procedure,
    condense_cluster,
    robot_prior,
)
from identification.payload.measured_runs import MeasuredRuns
from identification.payload.same_motion import torque_difference
from identification.payload.solution import minimum_norm_solution
from identification.regression.least_squares import Triangle

REWEIGHTINGS: Final = 20
SETTLED: Final = 1e-4


@dataclass(frozen=True, eq=False)
class SmoothedRuns(MeasuredRuns):
    """Smoothed recordings, with and without the payload.

    Attributes:
        standstill_rad_s: Speed below which a joint's equation is left out [rad/s or m/s].
    """

    sources: tuple[SmoothedSignals, ...]
    standstill_rad_s: float

    def estimate(
        self, robot: RobotDescription, model: ModelOptions, payload: Sequence[bool]
    ) -> Estimate:
        """Estimate a whole robot; see `MeasuredRuns`."""
        options = EstimationOptions(model, standstill_rad_s=self.standstill_rad_s)
        return fit_smoothed(robot, self.sources, options, payload=payload).estimate()

    def equations(
        self,
        model: PayloadModel,
        procedure: Procedure,
        *,
        robot: Estimate | None = None,
        standard: FloatArray | None = None,
    ) -> PayloadEquations:
        """Set up the equations of smoothed recordings; see `MeasuredRuns`.

        Each joint's rows are divided by its RMS residual, found by iteration. A cluster is one
        interval of one run (`TimeRun.event`), a second or longer. `difference` needs one motion
        recorded with and without the payload.
        """
        if procedure == "difference":
            equations = self._difference()._equations(model, procedure, None, None)
            empty = self.part([self.loaded.index(False)])
            return replace(equations, explained_nm=empty.torque_nm)
        return self._equations(model, procedure, robot, standard)

    def _difference(self) -> SmoothedRuns:
        """Return the loaded run minus the unloaded run's torques, as a single run."""
        loaded, unloaded = self.pair()
        own = torque_difference(self.sources[loaded], self.sources[unloaded])
        return replace(self, sources=(own,), loaded=(True,))

    def _equations(
        self,
        model: PayloadModel,
        procedure: Procedure,
        robot: Estimate | None,
        standard: FloatArray | None,
    ) -> PayloadEquations:
        slopes = 0 if standard is None else len(model.model.nonlinear_names)
        with_robot = procedure != "difference"
        layout = Layout(model, len(self.sources), with_robot=with_robot, slopes=slopes)
        width, n = len(layout.names), model.model.chain.n
        known = robot_prior(layout, robot if procedure == "model" else None)
        triangles = [Triangle.empty(width) for _ in range(n)]
        divisors = np.zeros((2, n))
        for run, rows in _clusters(model, self, standard):
            for j, (matrix, rhs) in enumerate(rows):
                divisors[:, j] += len(rhs) * np.array([1.0, float(self.loaded[run])])
                triangles[j] = triangles[j].add(layout.expand_columns(run, matrix), rhs)
        scale = _scales(triangles, known)
        factors: list[FloatArray] = []
        owners: list[int] = []
        for run, rows in _clusters(model, self, standard):
            white = [
                layout.expand_columns(run, matrix) / s
                for (matrix, _), s in zip(rows, scale, strict=True)
            ]
            sides = [rhs / s for (_, rhs), s in zip(rows, scale, strict=True)]
            if any(len(side) for side in sides):
                factors.append(condense_cluster(white, sides, width))
                owners.append(run)
        return PayloadEquations(
            procedure=procedure,
            joint_names=model.model.joint_names,
            names=layout.names,
            factors=tuple(factors),
            joints=tuple(triangle.factor for triangle in triangles),
            rows=tuple(triangle.rows for triangle in triangles),
            divisors=divisors,
            known=known,
            runs=tuple(owners),
            explained_nm=np.zeros(n),
            noise_nm=None,
        )


def _clusters(
    model: PayloadModel, runs: SmoothedRuns, standard: FloatArray | None
) -> Iterator[tuple[int, list[tuple[FloatArray, FloatArray]]]]:
    """Yield, for each interval of each run, the index of the run and each joint's equations."""
    for run, timed in enumerate(time_runs(model.model, runs.sources, runs.loaded)):
        for rows in joint_equations(
            model.model, model.base, [timed], runs.standstill_rad_s, standard
        ):
            yield run, rows


def _scales(triangles: list[Triangle], known: FloatArray) -> FloatArray:
    """Return the RMS residual of each joint's rows, (n,), consistent with the weighted solution."""
    scale = np.ones(len(triangles))
    rows = np.array([max(triangle.rows, 1) for triangle in triangles], dtype=np.float64)
    for _ in range(REWEIGHTINGS):
        stacked = np.vstack([*(t.factor / s for t, s in zip(triangles, scale, strict=True)), known])
        values = minimum_norm_solution(stacked[:, :-1], stacked[:, -1])
        residual = np.sqrt([t.residual_sum(values) for t in triangles] / rows)
        better = np.maximum(residual, 1e-9 * residual.max() + 1e-300)
        settled = bool(np.all(np.abs(scale / better - 1.0) < SETTLED))
        scale = better
        if settled:
            break
    return scale
