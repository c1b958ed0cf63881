"""`ConsistentEstimate`: standard parameters that a robot can have, closest to what was measured.

Base parameters say what the torques say, not what each link is like, and noise can make them such
that no robot has them. Here every link's pseudo-inertia is positive definite (Wensing, Kim and
Slotine 2018, "Linear matrix inequalities for physically consistent inertial parameter
identification"), no rotor's inertia and no friction that brakes is negative, and of all such robots
the one is taken whose base parameters are closest to the estimate, in its own sigmas.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import chdtrc

from config.arrays import FloatArray, freeze
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel
from dynamics.terms.conditions import Conditions
from dynamics.terms.friction import Friction, FrictionFunction
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK
from dynamics.terms.spring import Spring
from identification.consistency.nominal_robot import nominal_parameters
from identification.consistency.programme import ConsistencyProgramme
from identification.consistency.pseudo_inertia import pseudo_inertia
from identification.consistency.rigid_body import LinkBody
from identification.estimation.estimate import Estimate

NOMINAL_WEIGHT = 1e-3
FLOOR_SHARE = 1e-2
SMALLEST_BODY = (0.01, 0.0, 0.0, 0.0, 4e-7, 0.0, 0.0, 4e-7, 0.0, 4e-7)  # 10 g, a ball of 1 cm
SLOWEST_SHARE = 0.02
SPEEDS = 40
SMALLEST_P = 0.05
UNMOVED_SIGMAS = 0.01  # so little is the solver's own

_STRAIGHT: frozenset[FrictionFunction] = frozenset({"coulomb", "viscous", "forward", "backward"})
_LEFT_FREE: frozenset[FrictionFunction] = frozenset(
    {"offset", "coulomb_by_temperature", "viscous_by_temperature"}
)


@dataclass(frozen=True, eq=False)
class ConsistentEstimate:
    """Standard parameters of a robot that can exist.

    Attributes
    ----------
    estimate : Estimate
        The estimate that they come from.
    standard_values : ndarray, shape (p,)
        Values of `estimate.model.parameter_names`.
    base_values : ndarray, shape (b,)
        Their base parameters.
    distance : float
        Chi-square distance of `base_values` from the estimate.
    p_value : float
        The robot lies on the border of the estimate's confidence region of level 1 - `p_value`:
        under 0.05, no robot that can exist lies within the 95 % region, and the model is wrong or
        the intervals are. (The distance includes what the weak pull to the nominal robot costs.)
    """

    estimate: Estimate
    standard_values: FloatArray
    base_values: FloatArray
    distance: float
    p_value: float

    def __post_init__(self) -> None:
        base = self.estimate.base
        freeze(self, EstimationError, (len(base.standard_names),), "standard_values")
        freeze(self, EstimationError, (len(base),), "base_values")

    @property
    def can_exist(self) -> bool:
        """Whether a robot with the estimate's parameters can exist, as far as the data say."""
        return self.p_value >= SMALLEST_P

    @property
    def moved_sigmas(self) -> FloatArray:
        """How far each base parameter was moved from the estimate, in its sigmas, shape (b,)."""
        return (self.base_values - self.estimate.values) / self.estimate.sigma

    @property
    def sentence(self) -> str:
        """How far the robot that can exist is from what was identified, in words."""
        moved = self.moved_sigmas
        worst = int(np.argmax(np.abs(moved)))
        explains = "explains" if self.can_exist else "DOES NOT explain"
        most = abs(float(moved[worst]))
        how_far = (
            f"the parameter moved most is {self.estimate.base.names[worst]}, by {most:.2g} standard"
            " deviations"
            if most >= UNMOVED_SIGMAS
            else "it is what was identified"
        )
        return (
            f"The nearest robot that can exist {explains} the data (p = {self.p_value:.2g});"
            f" {how_far}."
        )

    @property
    def links(self) -> tuple[LinkBody, ...]:
        """Mass, centre and inertia of every link, base to flange."""
        model = self.estimate.model
        bodies = self.standard_values[model.parameter_groups["rigid_body"]]
        return tuple(LinkBody.of(body) for body in bodies.reshape(-1, PARAMETERS_PER_LINK))


def consistent(estimate: Estimate) -> ConsistentEstimate:
    """Find the robot that can exist and is closest to an estimate.

    The distance is chi-square in the metric of `jackknife_metric`. What the measurement cannot see
    is picked by a weak pull, a thousandth of a chi-square each, towards the drawings' values in
    their sigmas, or where there are none those of a plausible robot (`nominal_parameters`).
    Positive definite means: at least a hundredth of the nominal body. A friction of Coulomb and
    viscous terms has no negative coefficient; any other brakes at every speed from 2 % to 100 % of
    the joint's limit. Stiffness and preload of a spring are not negative.

    Raises
    ------
    EstimationError
        The solver found none.
    """
    base = estimate.base
    sigma, factor = jackknife_metric(estimate)
    standard = programme(estimate).solve()
    values = base.from_standard(standard)
    distance = float(np.sum(_whitened(factor, (values - estimate.values) / sigma) ** 2))
    return ConsistentEstimate(
        estimate=estimate,
        standard_values=standard,
        base_values=values,
        distance=distance,
        p_value=float(chdtrc(len(base), distance)),
    )


def programme(estimate: Estimate) -> ConsistencyProgramme:
    """Return the semidefinite programme of `consistent`."""
    model, base = estimate.model, estimate.base
    centre, scale = nominal_parameters(model, estimate.robot)
    bodies = _bodies(model)
    sigma, factor = jackknife_metric(estimate)
    residual = (estimate.values - base.from_standard(centre)) / sigma
    smallest = pseudo_inertia(np.array(SMALLEST_BODY))
    return ConsistencyProgramme(
        matrix=_whitened(factor, base.combination * scale / sigma[:, np.newaxis]),
        rhs=_whitened(factor, residual),
        weight=NOMINAL_WEIGHT,
        centre=centre,
        scale=scale,
        bodies=bodies,
        floors=FLOOR_SHARE * (pseudo_inertia(np.array([centre[b] for b in bodies])) + smallest),
        not_negative=not_negative(model, estimate.robot),
    )


def jackknife_metric(estimate: Estimate) -> tuple[FloatArray, FloatArray]:
    """Return the estimate's sigmas and the Cholesky factor of its correlations.

    The cluster-robust covariance of a short recording is singular: it has a direction for each
    second of it. Its sigmas are taken, and correlations half its own, half those of white
    residuals, which have full rank (shrinkage towards a target, Ledoit and Wolf 2004).

    Returns
    -------
    sigma : ndarray, shape (b,)
        Standard deviations.
    factor : ndarray, shape (b, b)
        Lower triangular.

    Raises
    ------
    EstimationError
        The covariances are not positive.
    """
    try:
        correlation = sum(
            0.5 * covariance / np.sqrt(np.outer(np.diagonal(covariance), np.diagonal(covariance)))
            for covariance in (estimate.covariance_jackknife, estimate.covariance_residual)
        )
        return estimate.sigma, np.array(np.linalg.cholesky(correlation), dtype=float)
    except (np.linalg.LinAlgError, FloatingPointError):
        raise EstimationError(
            "the estimate's covariances are not positive definite, so that no distance from it can"
            " be told: estimate again from the recordings"
        ) from None


def full_rank_covariance(estimate: Estimate) -> FloatArray:
    """Return the covariance of `jackknife_metric`, shape (b, b)."""
    sigma, factor = jackknife_metric(estimate)
    spread = sigma[:, np.newaxis] * factor
    return np.asarray(spread @ spread.T)


def not_negative(model: RobotModel, robot: RobotDescription) -> FloatArray:
    """Return rows G, shape (k, p), of G theta >= 0: rotors, springs, and friction that brakes."""
    names, identity = model.parameter_names, np.eye(len(model.parameter_names))
    rows: list[FloatArray] = []
    for term, columns in zip(model.terms, model.parameter_groups.values(), strict=True):
        stiff = isinstance(term, Spring) and term.distances_m is not None
        if stiff or term.name in ("rotors", "armature"):
            rows.extend(identity[columns])
        elif isinstance(term, Friction):
            for j in range(model.chain.n):
                own = {c.function for c in term.columns if c.joint == j}
                if own <= _STRAIGHT | _LEFT_FREE:
                    rows.extend(
                        identity[names.index(c.parameter_name)]
                        for c in term.columns
                        if c.joint == j and c.function in _STRAIGHT
                    )
                else:
                    rows.extend(_braking(model, term, columns, j, robot.joints[j].limits.velocity))
    return np.array(rows).reshape(-1, len(names))


def _braking(
    model: RobotModel, friction: Friction, columns: slice, joint: int, fastest: float
) -> FloatArray:
    """Return rows whose product with theta is how strongly a joint's friction brakes."""
    speed = np.linspace(SLOWEST_SHARE * fastest, fastest, SPEEDS)
    actuator = np.zeros((2 * SPEEDS, model.chain.n))
    actuator[:, joint] = np.concatenate([speed, -speed])
    v = actuator if model.coupling is None else actuator @ model.coupling.joints_by_motors.T
    reference = Conditions(temperature_k=np.full(model.chain.n, 293.15))  # columns left free
    motion = model.motion(np.zeros_like(v), v, np.zeros_like(v), reference)
    torque = np.zeros((*v.shape, len(friction.columns)))
    friction.fill_torque(motion, torque)
    torque[:, :, [c.function in _LEFT_FREE for c in friction.columns]] = 0.0
    rows = np.zeros((len(v), len(model.parameter_names)))
    rows[:, columns] = torque[:, joint] * np.sign(actuator[:, [joint]])
    return rows


def _bodies(model: RobotModel) -> tuple[slice, ...]:
    """Return where the ten parameters of each link, and of a payload, are."""
    size = PARAMETERS_PER_LINK
    links = [slice(size * i, size * (i + 1)) for i in range(model.chain.n)]
    payload = model.parameter_groups.get("payload")
    return (*links, *([] if payload is None else [payload]))


def _whitened(factor: FloatArray, values: FloatArray) -> FloatArray:
    return np.asarray(solve_triangular(factor, values, lower=True))
