"""`PeriodicProblem`: least squares on the DFT bins of averaged periods."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from acquisition.processing.periods import PeriodAverage
from config.arrays import FloatArray
from config.errors import EstimationError
from dynamics.model.robot_model import RobotModel
from identification.equations.bins import BinEquations, bin_equations
from identification.equations.whitened import (
    WhitenedEquations,
    bin_clusters,
    whiten,
    whiten_base_wrench,
)
from identification.estimation.nonlinear_parameters import step_prior
from identification.estimation.options import Weighting
from identification.estimation.prior import PriorRows
from identification.model.base_parameters import BaseParameters, ModelKind
from identification.regression.intervals import Scatter, jackknife
from identification.regression.least_squares import Solution, Triangle, huber_weights, solve

REWEIGHTINGS = 20


@dataclass(frozen=True, eq=False)
class PeriodicFit:
    """The solution for one set of columns, with its whitened equations.

    Attributes:
        base, nonlinear, delays: Numbers of values in the solution, in this order: base parameters,
            steps of the nonlinear parameters, steps of the plates' delays.
        solution: The solution with all these values.
        white: Tuple, one per run, of tuples of WhitenedEquations. The outputs that were used:
            joints first, then the plate's.
        joints: Tuple, one per run, of tuples of WhitenedEquations. The joints' outputs, used or
            not.
    """

    base: int
    nonlinear: int
    delays: int
    solution: Solution
    white: tuple[tuple[WhitenedEquations, ...], ...]
    joints: tuple[tuple[WhitenedEquations, ...], ...]

    @property
    def of_base(self) -> slice:
        """Indices of the base parameters in the solution."""
        return slice(0, self.base)

    @property
    def of_nonlinear(self) -> slice:
        """Indices of the steps of the nonlinear parameters in the solution."""
        return slice(self.base, self.base + self.nonlinear)

    @property
    def of_model(self) -> slice:
        """Indices of base parameters and steps of nonlinear parameters in the solution."""
        return slice(0, self.base + self.nonlinear)

    @property
    def of_delays(self) -> slice:
        """Indices of the steps of the plates' delays in the solution."""
        return slice(self.base + self.nonlinear, None)

    @property
    def residual_nm(self) -> FloatArray:
        """RMS residual of each joint, shape (n,) [N m or N]."""
        return self._rms(self.solution.values)

    @property
    def torque_nm(self) -> FloatArray:
        """RMS of each joint's torque, without its free part, shape (n,) [N m or N]."""
        return self._rms(np.zeros_like(self.solution.values))

    @property
    def noise_nm(self) -> FloatArray:
        """RMS of the residual that noise alone would cause, shape (n,) [N m or N]."""
        power = [[part.noise_power for part in parts] for parts in self.joints]
        return np.asarray(np.sqrt(np.mean(power, axis=0)))

    def _rms(self, values: FloatArray) -> FloatArray:
        """Return the RMS of each joint's torque minus its prediction by `values`, (n,)."""
        power = [
            [np.sum((part.residual(values) * part.sigma) ** 2) for part in parts]
            for parts in self.joints
        ]
        return np.asarray(np.sqrt(np.mean(power, axis=0)))


@dataclass(frozen=True, eq=False)
class PeriodicProblem:
    """Averaged periods, and the weighting of their rows.

    Attributes:
        inertia: Shape (averages, n, n). Magnitude of the joint-space inertia, through which the
            noise of the positions becomes torque noise; zero before it is known.
        kind: Kind of the model, which selects the outputs.
        base_inertia: Shape (averages, n, 6, 6). The same as `inertia` for the base wrench
            (`base_inertia_squares`).
        delays_s: Shape (averages,). Delay of the plate's signals in each run.
        known: Shape (averages, b). Contribution of known bodies to the base parameters of each run.
    """

    base: BaseParameters
    averages: tuple[PeriodAverage, ...]
    payload: tuple[bool, ...]
    band_hz: float
    standstill_rad_s: float
    weighting: Weighting
    prior: PriorRows
    inertia: FloatArray
    kind: ModelKind = "internal"
    base_inertia: FloatArray = field(default_factory=lambda: np.zeros(0))
    delays_s: FloatArray = field(default_factory=lambda: np.zeros(0))
    known: FloatArray | None = None

    def __post_init__(self) -> None:
        if self.kind != "internal":
            self._check_plates()
        if len(self.payload) != len(self.averages):
            raise EstimationError(
                f"payload has {len(self.payload)} values, but there are {len(self.averages)}"
                " runs: give one value for each run",
                code="RID-API-ARGUMENT",
            )

    def equations(self, model: RobotModel, standard: FloatArray | None) -> tuple[BinEquations, ...]:
        """Return the equations of every average; `standard` as in `torque_columns`."""
        found = tuple(
            bin_equations(
                model,
                self.base,
                average,
                band_hz=self.band_hz,
                standstill_rad_s=self.standstill_rad_s,
                payload=loaded,
                standard=standard,
                plate=self.kind != "internal",
            )
            for average, loaded in zip(self.averages, self.payload, strict=True)
        )
        if self.known is None:
            return found
        pairs = zip(found, self.known, strict=True)
        return tuple(each.without_loads(known) for each, known in pairs)

    def _check_plates(self) -> None:
        runs = len(self.averages)
        for number, average in enumerate(self.averages, start=1):
            if average.reaction is None:
                raise EstimationError(
                    f"the {self.kind} model needs a force plate, but run {number} of {runs} has"
                    " no force plate with valid channels: identify the internal model",
                    code="RID-PLATE-MISSING",
                )
        shapes = ((runs, len(self.averages[0].joint_names), 6, 6), (runs,))
        if (self.base_inertia.shape, self.delays_s.shape) != shapes:
            raise EstimationError(
                f"base_inertia and delays_s have the shapes {self.base_inertia.shape} and"
                f" {self.delays_s.shape}, which do not fit {runs} runs",
                code="RID-API-ARGUMENT",
            )

    def fit(
        self,
        model: RobotModel,
        standard: FloatArray | None,
        equations: tuple[BinEquations, ...],
        near: FloatArray | None = None,
    ) -> PeriodicFit:
        """Solve the equations.

        If values `near` the solution are given, the delay of each run's plate is estimated too: the
        last values are steps from `delays_s`.

        Raises:
            EstimationError: The motion does not determine the parameters.
        """
        delays = [] if near is None else [f"the delay of plate {i}" for i in range(len(equations))]
        joints = tuple(
            tuple(
                part.add_columns(np.zeros((len(part.rhs), len(delays))))
                for part in whiten(each, inertia, uniform=self.weighting == "ls")
            )
            for each, inertia in zip(equations, self.inertia, strict=True)
        )
        white = joints if self.kind != "external" else tuple(() for _ in equations)
        if self.kind != "internal":
            plates = (self._plate(run, each, near) for run, each in enumerate(equations))
            white = tuple((*own, *plate) for own, plate in zip(white, plates, strict=True))
        nonlinear = model.nonlinear_names if standard is not None else ()
        names = (*self.base.names, *nonlinear, *delays)
        parts = (len(self.base), len(nonlinear), len(delays))
        known = [self.prior.triangle(len(names))]
        if standard is not None:
            known.append(step_prior(model, len(self.base), len(names)))
        fit = PeriodicFit(*parts, _solve(white, known, names), white, joints)
        if self.weighting != "huber":
            return fit
        for _ in range(REWEIGHTINGS):
            values = fit.solution.values
            held_down = tuple(
                tuple(part.reweight(huber_weights(part.residual(values))) for part in parts)
                for parts in white
            )
            better = PeriodicFit(*parts, _solve(held_down, known, names), held_down, joints)
            change = np.abs(better.solution.values - values)
            fit = better
            if np.all(change <= 1e-3 * np.sqrt(np.diagonal(fit.solution.covariance))):
                break
        return fit

    def _plate(
        self, run: int, equations: BinEquations, near: FloatArray | None
    ) -> tuple[WhitenedEquations, ...]:
        """Return the whitened outputs of one run's plate."""
        assert equations.reaction is not None
        reaction = equations.reaction.compensate_delay(float(self.delays_s[run]))
        if near is not None:
            columns = np.zeros((*reaction.rhs.shape, len(self.averages)))
            columns[:, :, run] = reaction.delay_column(reaction.matrix @ near)
            matrix = np.concatenate([reaction.matrix, columns], axis=2)
            reaction = replace(reaction, matrix=matrix)
        reaction = reaction.with_motion_noise(equations.position_sigma, self.base_inertia[run])
        return whiten_base_wrench(reaction, uniform=self.weighting == "ls")

    def scatter(self, fit: PeriodicFit) -> Scatter:
        """Return the covariance of the solution, from leaving out each frequency bin in turn."""
        return jackknife(fit.solution.information, bin_clusters(fit.white, fit.solution.values))


def _solve(
    white: tuple[tuple[WhitenedEquations, ...], ...],
    known: list[Triangle],
    names: tuple[str, ...],
) -> Solution:
    triangles = [
        Triangle.empty(len(names)).add(part.matrix, part.rhs, part.rows)
        for parts in white
        for part in parts
    ]
    return solve([*triangles, *known], [1.0] * (len(triangles) + len(known)), names)
