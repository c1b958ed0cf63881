"""`BaseLoad`: predicted base wrench of a motion, compared with the limits of the base."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acquisition.recording.plate_geometry import WRENCH_NAMES, WRENCH_UNITS
from config.arrays import FloatArray, IntArray, freeze
from config.cell.plate import PlateLimits
from config.errors import EstimationError
from dynamics.model.cad import cad_parameters
from dynamics.model.robot_model import base_wrench_regressor
from identification.estimation.estimate import Estimate, refuse_internal_model

SIGMAS = 2.0


BLOCK_ROWS = 4096


@dataclass(frozen=True, eq=False)
class BaseLoad:
    """Largest base wrench of a motion, component by component.

    Attributes:
        at_s: Shape (6,). Time at which the magnitude of the wrench that the base exerts on the
            robot, plus two standard deviations, is largest [s].
        peak: Shape (6,). Magnitude of the wrench at this time [N, N m].
        sigma: Shape (6,). Standard deviation of the prediction at this time [N, N m].
        limit: Shape (6,). Limits of the base [N, N m].
        weight_known: True if the prediction contains the robot's static weight; a plate cannot
            distinguish this weight from its offset.
    """

    peak: FloatArray
    sigma: FloatArray
    at_s: FloatArray
    limit: FloatArray
    weight_known: bool

    def __post_init__(self) -> None:
        of_components = ("peak", "sigma", "at_s", "limit")
        freeze(self, EstimationError, (6,), *of_components, what="base load ")

    @property
    def held(self) -> tuple[bool, ...]:
        """For each component: True if the peak plus two standard deviations is within its limit."""
        return tuple((self.peak + SIGMAS * self.sigma <= self.limit).tolist())

    @property
    def sentence(self) -> str:
        """Text that names the exceeded limits of the base."""
        broken = [
            f"{WRENCH_NAMES[k]} reaches {self.peak[k]:.4g} ± {SIGMAS * self.sigma[k]:.2g}"
            f" {WRENCH_UNITS[k]} at {self.at_s[k]:.3g} s, but its limit is {self.limit[k]:.4g}"
            f" {WRENCH_UNITS[k]}"
            for k, held in enumerate(self.held)
            if not held
        ]
        share = 100.0 * float(np.max((self.peak + SIGMAS * self.sigma) / self.limit))
        words = (
            "; ".join(broken)
            or f"all base limits are satisfied; at most {share:.0f} % of a limit is used"
        )
        weight = (
            "" if self.weight_known else ". The robot's static weight is unknown and not included"
        )
        return f"{words}{weight}."


def base_limits(limits: PlateLimits) -> FloatArray:
    """Return the limits of the base wrench's six components, (6,) [N, N m]."""
    return np.array([*limits.force_n, *limits.moment_nm])


def base_load(
    estimate: Estimate,
    time_s: FloatArray,
    q: FloatArray,
    v: FloatArray,
    a: FloatArray,
    limits: PlateLimits,
    *,
    mass_kg: float | None = None,
) -> BaseLoad:
    """Predict the largest base wrench of a motion, and compare it with limits.

    Args:
        estimate: Estimate of the external or the combined model.
        time_s: Shape (samples,). Times [s].
        q, v, a: Shape (samples, n). The motion [rad or m, per s, per s^2].
        limits: Limits of the base.
        mass_kg: Total mass on the base; if it is not given, that of the robot's drawings, or else
            zero.

    Raises:
        EstimationError: The estimate is of the internal model.
    """
    values, covariance, known = with_known_mass(estimate, mass_kg)
    wrench, sigma = np.empty((len(q), 6)), np.empty((len(q), 6))
    for start in range(0, len(q), BLOCK_ROWS):
        rows = slice(start, start + BLOCK_ROWS)
        phi = base_wrench_regressor(estimate.model, q[rows], v[rows], a[rows])
        columns = estimate.base.columns(phi)
        wrench[rows] = columns @ values
        sigma[rows] = np.sqrt(np.einsum("skb,bc,skc->sk", columns, covariance, columns))
    load = np.abs(wrench) + SIGMAS * sigma
    worst, each = load.argmax(axis=0), np.arange(6)
    return BaseLoad(
        peak=np.abs(wrench[worst, each]),
        sigma=sigma[worst, each],
        at_s=np.asarray(time_s)[worst],
        limit=base_limits(limits),
        weight_known=known,
    )


def with_known_mass(
    estimate: Estimate, mass_kg: float | None = None
) -> tuple[FloatArray, FloatArray, bool]:
    """Return an estimate's values and covariance, with the robot's weight from another source.

    In every motion the total mass adds the same constant wrench, which a plate cannot distinguish
    from its offset. Therefore the estimated mass is replaced by `mass_kg`, or else by the mass in
    the robot's drawings, or else by zero.

    Returns:
        `values`, shape (b,). Base parameters.
        `covariance`, shape (b, b). The cluster-robust covariance of the other parameters.
        `known`. True if the mass is known from either source.

    Raises:
        EstimationError: The estimate is of the internal model.
    """
    refuse_internal_model(estimate)
    model, base = estimate.model, estimate.base
    constant = weight_parameters(estimate)
    values, covariance = estimate.values.copy(), estimate.covariance_jackknife.copy()
    covariance[constant] = 0.0
    covariance[:, constant] = 0.0
    robot = estimate.robot
    known = mass_kg is not None or robot.is_drawn
    drawn = np.zeros(len(base))
    if mass_kg is None and robot.is_drawn:
        drawn = base.from_standard(cad_parameters(model, robot)[0])
    values[constant] = drawn[constant] if mass_kg is None else mass_kg
    return values, covariance, known


def weight_parameters(estimate: Estimate) -> IntArray:
    """Return the indices of base parameters whose part of the base wrench is constant, (any,)."""
    model, base = estimate.model, estimate.base
    random = np.random.default_rng(0)
    phi = base.columns(base_wrench_regressor(model, *random.normal(size=(3, 20, model.chain.n))))
    size = np.abs(phi).max(axis=(0, 1))
    same = np.ptp(phi, axis=0).max(axis=0) <= 1e-9 * size
    return np.flatnonzero(same & (size > 0.0))


def weight_words(estimate: Estimate) -> tuple[str, ...]:
    """Return the expressions of the parameters that affect only the constant base wrench.

    Args:
        estimate: Estimate of any model; for the internal model the result is empty.
    """
    if estimate.options.kind == "internal":
        return ()
    return tuple(estimate.base.expressions[i] for i in weight_parameters(estimate))
