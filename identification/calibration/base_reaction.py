"""`BaseLoad`: what a motion would do to the floor, against what the floor may see."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acquisition.recording.plate_geometry import WRENCH_NAMES, WRENCH_UNITS
from config.arrays import FloatArray, IntArray, freeze
from config.cell.plate import PlateLimits
from config.errors import EstimationError
from dynamics.model.cad import cad_parameters
from dynamics.model.robot_model import base_wrench_regressor
from identification.estimation.estimate import Estimate

SIGMAS = 2.0


BLOCK_ROWS = 4096


@dataclass(frozen=True, eq=False)
class BaseLoad:
    """The largest reaction of a motion, component by component.

    Attributes:
        peak: Shape (6,). Largest magnitude of the wrench that the base exerts on the robot [N, N
            m].
        sigma: Shape (6,). Standard deviation of the prediction there.
        at_s: Shape (6,). When it is reached [s].
        limit: Shape (6,). What the floor may see.
        weight_known: Whether the robot's standing weight is in it; a plate cannot tell it from its
            offset.
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
        """Whether each component stays within its limit, two standard deviations included."""
        return tuple((self.peak + SIGMAS * self.sigma <= self.limit).tolist())

    @property
    def sentence(self) -> str:
        """The result in words."""
        broken = [
            f"{WRENCH_NAMES[k]} reaches {self.peak[k]:.4g} ± {SIGMAS * self.sigma[k]:.2g}"
            f" {WRENCH_UNITS[k]} at {self.at_s[k]:.3g} s, its limit is {self.limit[k]:.4g}"
            for k, held in enumerate(self.held)
            if not held
        ]
        share = 100.0 * float(np.max((self.peak + SIGMAS * self.sigma) / self.limit))
        words = "; ".join(broken) or f"every limit on the base is held, {share:.0f} % used"
        weight = (
            "" if self.weight_known else ". The robot's standing weight is not known, nor in it"
        )
        return f"{words}{weight}."


def base_limits(limits: PlateLimits) -> FloatArray:
    """Return the limits on the six components, (6,)."""
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
    """Predict the largest reaction of a motion, and hold it against limits.

    Args:
        estimate: Of the external or the combined model.
        time_s: Shape (samples,). Times [s].
        q, v, a: Shape (samples, n). The motion [rad or m, per s, per s^2].
        limits: What the floor may see.
        mass_kg: Mass of everything that the base carries; by the robot's drawings where it is not
            given.

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
    """Return an estimate's values and covariance with the weight from elsewhere.

    What adds a constant wrench whatever the motion, a plate cannot tell from its offset: the mass
    of everything. It is `mass_kg`, else by the robot's drawings, else zero.

    Returns:
        `values`, shape (b,). Base parameters.
        `covariance`, shape (b, b). The cluster-robust covariance of the others.
        `known`. Whether the mass is known from either.

    Raises:
        EstimationError: The estimate is of the internal model.
    """
    if estimate.options.kind == "internal":
        raise EstimationError(
            "the internal model does not know the reaction on the base: identify the combined"
            " model, from a run with a force plate",
            code="RID-MODEL-NOT-COMBINED",
        )
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
    """Return which base parameters add a constant wrench whatever the motion, shape (any,)."""
    model, base = estimate.model, estimate.base
    random = np.random.default_rng(0)
    phi = base.columns(base_wrench_regressor(model, *random.normal(size=(3, 20, model.chain.n))))
    size = np.abs(phi).max(axis=(0, 1))
    same = np.ptp(phi, axis=0).max(axis=0) <= 1e-9 * size
    return np.flatnonzero(same & (size > 0.0))


def weight_words(estimate: Estimate) -> tuple[str, ...]:
    """Return the parameters that only the standing weight shows, in words.

    Args:
        estimate: Of any model; without a force plate there are none.
    """
    if estimate.options.kind == "internal":
        return ()
    return tuple(estimate.base.expressions[i] for i in weight_parameters(estimate))
