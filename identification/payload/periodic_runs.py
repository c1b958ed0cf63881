"""Equations of a payload from averaged periods, on their DFT bins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from acquisition.processing.periods import PeriodAverage
from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from identification.equations.base_wrench import repeat_for_real_and_imaginary
from identification.equations.bins import BinEquations, bin_equations
from identification.equations.whitened import WhitenedEquations, whiten
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_periods import fit_periodic
from identification.estimation.options import EstimationOptions
from identification.model.inertia import inertia_size
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
from identification.payload.solution import base_values, minimum_norm
from identification.regression.least_squares import Triangle

SAME_MOTION_SHARE: Final = 0.02


@dataclass(frozen=True, eq=False)
class PeriodicRuns(MeasuredRuns):
    """Averaged periods, with and without the payload.

    Attributes:
        band_hz, standstill_rad_s: As in `EstimationOptions`.
    """

    sources: tuple[PeriodAverage, ...]
    band_hz: float
    standstill_rad_s: float

    def estimate(
        self, robot: RobotDescription, model: ModelOptions, payload: Sequence[bool]
    ) -> Estimate:
        """Estimate a whole robot; see `MeasuredRuns`."""
        options = EstimationOptions(
            model, band_hz=self.band_hz, standstill_rad_s=self.standstill_rad_s
        )
        return fit_periodic(robot, self.sources, options, payload=payload).estimate()

    def equations(
        self,
        model: PayloadModel,
        procedure: Procedure,
        *,
        robot: Estimate | None = None,
        standard: FloatArray | None = None,
    ) -> PayloadEquations:
        """Set up the equations of averaged periods; see `MeasuredRuns`.

        Each row is divided by its noise: that of the torque between periods, and that of the
        position multiplied by the inertia. A cluster is one bin of one run.
        """
        binned = self._bins(model, standard)
        slopes = 0 if standard is None else len(model.model.nonlinear_names)
        if procedure == "difference":
            binned = [_difference(self, binned)]
            layout = Layout(model, 1, with_robot=False, slopes=0)
            averages = [self.sources[self.loaded.index(True)]]
        else:
            layout = Layout(model, len(binned), slopes=slopes)
            averages = list(self.sources)
        known = robot_prior(layout, robot if procedure == "model" else None)
        n = model.model.chain.n
        loaded = 1 if procedure == "difference" else sum(self.loaded)
        divisors = np.outer((len(binned), loaded), np.ones(n))
        none = [np.zeros((n, n))] * len(binned)
        first = _condense(model, layout, procedure, binned, none, divisors, known)
        values = minimum_norm(first)
        sizes = []
        for run, average in enumerate(averages):
            own = base_values(layout, values, run)
            sizes.append(inertia_size(model.model, model.base, average.position, own))
        equations = _condense(model, layout, procedure, binned, sizes, divisors, known)
        if procedure == "difference":
            empty = self.part([self.loaded.index(False)])
            equations = replace(equations, explained_nm=empty.torque_nm)
        return equations

    def _bins(self, model: PayloadModel, standard: FloatArray | None) -> list[BinEquations]:
        """Return the equations of every run; `standard` as in `torque_columns`."""
        return [
            bin_equations(
                model.model,
                model.base,
                average,
                band_hz=self.band_hz,
                standstill_rad_s=self.standstill_rad_s,
                payload=loaded,
                standard=standard,
            )
            for average, loaded in zip(self.sources, self.loaded, strict=True)
        ]


def _condense(
    model: PayloadModel,
    layout: Layout,
    procedure: Procedure,
    binned: Sequence[BinEquations],
    inertia: Sequence[FloatArray],
    divisors: FloatArray,
    known: FloatArray,
) -> PayloadEquations:
    names = layout.names
    n, width = model.model.chain.n, len(names)
    factors: list[FloatArray] = []
    owners: list[int] = []
    triangles = [Triangle.empty(width) for _ in range(n)]
    noise = np.zeros((len(binned), n))
    for run, (each, size) in enumerate(zip(binned, inertia, strict=True)):
        white = [_spread(layout, run, part) for part in whiten(each, size)]
        for j, part in enumerate(white):
            sigma = part.sigma
            triangles[j] = triangles[j].add(
                part.matrix * sigma[:, np.newaxis], part.rhs * sigma, part.rows
            )
            noise[run, j] = part.noise_power
        bins = repeat_for_real_and_imaginary(np.arange(each.harmonics + 1, dtype=np.float64))
        for number in range(each.harmonics + 1):
            rows = bins == number
            factors.append(
                condense_cluster(
                    [p.matrix[rows] for p in white], [p.rhs[rows] for p in white], width
                )
            )
            owners.append(run)
    return PayloadEquations(
        procedure=procedure,
        joint_names=model.model.joint_names,
        names=names,
        factors=tuple(factors),
        joints=tuple(triangle.factor for triangle in triangles),
        rows=tuple(triangle.rows for triangle in triangles),
        divisors=divisors,
        known=known,
        runs=tuple(owners),
        explained_nm=np.zeros(n),
        noise_nm=np.sqrt(np.mean(noise, axis=0)),
    )


def _spread(layout: Layout, run: int, part: WhitenedEquations) -> WhitenedEquations:
    return replace(part, matrix=layout.expand_columns(run, part.matrix))


def _difference(runs: PeriodicRuns, binned: Sequence[BinEquations]) -> BinEquations:
    """Return the loaded run's equations minus the unloaded run's torques."""
    loaded, unloaded = runs.pair()
    a, b = runs.sources[loaded], runs.sources[unloaded]
    if a.position.shape != b.position.shape or abs(a.period_s - b.period_s) > 1e-9 * a.period_s:
        raise EstimationError(
            f"the runs have periods of {a.period_s:g} s and {b.period_s:g} s, but torques are"
            " subtracted only between runs of the same motion: use the procedure `together`",
            code="RID-PAYLOAD-PROCEDURE",
        )
    difference = np.sqrt(np.mean((a.position - b.position) ** 2, axis=0))
    moved = np.maximum(a.position.std(axis=0), 1e-12)
    worst = int(np.argmax(difference / np.maximum(moved, difference.max() + 1e-12)))
    if difference[worst] > SAME_MOTION_SHARE * a.position.std(axis=0).max():
        raise EstimationError(
            f"{a.joint_names[worst]} moved differently with the payload than without it, by"
            f" {difference[worst]:.3g} rad or m (RMS), so the torques cannot be subtracted: use the"
            " procedure `together`",
            code="RID-PAYLOAD-PROCEDURE",
        )
    with_load, without = binned[loaded], binned[unloaded]
    return replace(
        with_load,
        rhs=with_load.rhs - without.rhs,
        free=tuple(np.hstack([x, y]) for x, y in zip(with_load.free, without.free, strict=True)),
        torque_sigma=np.hypot(with_load.torque_sigma, without.torque_sigma),
        position_sigma=np.hypot(with_load.position_sigma, without.position_sigma),
    )
