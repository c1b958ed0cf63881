"""`ConsistentEstimate`: the physically consistent standard parameters closest to an estimate.

Torques determine base parameters, which are sums over several links. Because of noise there may be
no real robot with the estimated sums. A robot is physically consistent under three conditions:
- The pseudo-inertia of every link is positive definite (Wensing, Kim and Slotine 2018, "Linear
  matrix inequalities for physically consistent inertial parameter identification").
- No rotor has a negative inertia, and no spring a negative stiffness.
- Friction never drives a joint. If one of a joint's friction terms is cubic, cube root or Stribeck,
  the sum of its terms brakes at every tested speed. Otherwise no coefficient is negative. Constant
  offsets and temperature coefficients are free.

The result is the consistent robot whose base parameters are closest to the estimate. The distance
is measured in the estimate's own standard deviations.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from config.arrays import FloatArray, freeze
from config.errors import EstimationError
from config.robot.link_cad import LinkCad
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK
from identification.consistency.consistency_test import (
    ConsistencyTest,
    JudgedParameters,
    judge_consistency,
)
from identification.consistency.constraints import bodies, not_negative
from identification.consistency.metric import jackknife_metric, whiten_parameters
from identification.consistency.nominal_robot import nominal_parameters
from identification.consistency.programme import ConsistencyProgramme
from identification.consistency.pseudo_inertia import SMALLEST_BODY, pseudo_inertia
from identification.consistency.rigid_body import LinkBody
from identification.estimation.estimate import Estimate

NOMINAL_WEIGHT: Final = 1e-3
CONE_WEIGHT: Final = 1e-6
FLOOR_SHARE: Final = 1e-2
UNMOVED_SIGMAS: Final = 0.01  # smaller distances are errors of the solver


@dataclass(frozen=True, eq=False)
class ConsistentEstimate:
    """Standard parameters of a physically consistent robot.

    Attributes:
        estimate: The estimate from which they were computed.
        standard_values: Shape (p,). Values of `estimate.model.parameter_names`.
        base_values: Shape (b,). The corresponding base parameters.
    """

    estimate: Estimate
    standard_values: FloatArray
    base_values: FloatArray

    def __post_init__(self) -> None:
        base = self.estimate.base
        freeze(self, EstimationError, (len(base.standard_names),), "standard_values")
        freeze(self, EstimationError, (len(base),), "base_values")

    @cached_property
    def test(self) -> ConsistencyTest:
        """Consistency test of the estimate, which is computed when first used (about a second)."""
        return check_consistency(self.estimate)

    @property
    def moved_sigmas(self) -> FloatArray:
        """Distance of each base parameter from the estimate [sigma], shape (b,)."""
        return (self.base_values - self.estimate.values) / self.estimate.sigma

    @property
    def sentence(self) -> str:
        """Text: result of the test, and the parameter that the consistent robot changes most."""
        moved = self.moved_sigmas
        worst = int(np.argmax(np.abs(moved)))
        most = abs(float(moved[worst]))
        how_far = (
            f"The nearest consistent robot differs most in {self.estimate.base.names[worst]}, by"
            f" {most:.2g} σ."
            if most >= UNMOVED_SIGMAS
            else "The nearest consistent robot is the estimate itself."
        )
        return f"{self.test.sentence} {how_far}"

    @property
    def links(self) -> tuple[LinkBody, ...]:
        """Mass, centre and inertia of every link, base to flange."""
        model = self.estimate.model
        values = self.standard_values[model.parameter_groups["rigid_body"]]
        return tuple(LinkBody.of(body) for body in values.reshape(-1, PARAMETERS_PER_LINK))


@dataclass(frozen=True, eq=False)
class NominalLinks:
    """Links whose values are used for the directions that the measurement does not determine.

    Attributes:
        cad: Mass, centre and inertia of each link; they replace those of the robot file.
        unchanged: Shape (n, 10). Parameters of the parts of each link that keep their values: the
            rest of each link must be physically consistent without them.
    """

    cad: tuple[LinkCad, ...]
    unchanged: FloatArray


def find_closest(estimate: Estimate, nominal: NominalLinks | None = None) -> ConsistentEstimate:
    """Find the physically consistent robot that is closest to an estimate.

    The squared distance is computed with `jackknife_metric`, so that it is comparable to a
    chi-squared value. Some directions are not determined by the measurement. To determine them, a
    small cost is added: a thousandth of the squared distance from the drawings' values, in units of
    their sigmas. Without drawings, the values of a plausible robot are used (`nominal_parameters`).

    The constraints are:
    - Each pseudo-inertia is at least a hundredth of that of the nominal body.
    - The friction of a joint with a cubic, cube-root or Stribeck term brakes at every tested speed,
      from 2 % to 100 % of the joint's limit.
    - The friction of any other joint has no negative coefficients.
    - Inertias of rotors, and stiffness and preload of a spring, are not negative.

    Args:
        estimate: The estimate.
        nominal: Links to use instead of those of the robot file.

    Raises:
        EstimationError: The solver found no solution, a term's constraints are not known, or the
            covariances are not positive definite.
    """
    standard = programme(estimate, nominal).solve(whiten_parameters(estimate, estimate.values))
    return ConsistentEstimate(estimate, standard, estimate.base.from_standard(standard))


def check_consistency(estimate: Estimate) -> ConsistencyTest:
    """Test whether an estimate can be that of a physically consistent robot.

    Raises:
        EstimationError: The solver found no consistent robot, a term's constraints are not known,
            or the covariances are not positive definite.
    """
    sigma, factor = jackknife_metric(estimate)
    base = estimate.base
    parameters = JudgedParameters(
        base.names, base.expressions, estimate.values, sigma, factor, estimate.clusters
    )
    return judge_consistency(parameters, cone(estimate))


def programme(estimate: Estimate, nominal: NominalLinks | None = None) -> ConsistencyProgramme:
    """Return the semidefinite programme that `find_closest` solves."""
    return _programme(estimate, NOMINAL_WEIGHT, FLOOR_SHARE, nominal)


def cone(estimate: Estimate) -> ConsistencyProgramme:
    """Return the programme that projects parameters onto the cone of consistent robots."""
    return _programme(estimate, CONE_WEIGHT, 0.0)


def _programme(
    estimate: Estimate, weight: float, floor_share: float, links: NominalLinks | None = None
) -> ConsistencyProgramme:
    model, robot = estimate.model, estimate.robot
    if links is not None:
        robot = robot.model_copy(update={"cad": links.cad})
    centre, scale = nominal_parameters(model, robot)
    places = bodies(model)
    smallest = pseudo_inertia(np.array(SMALLEST_BODY))
    nominal = pseudo_inertia(np.array([centre[body] for body in places])) + smallest
    floors = floor_share * nominal
    for number, part in enumerate(pseudo_inertia(links.unchanged) if links is not None else ()):
        floors[number] = part + floor_share * (_positive_part(nominal[number] - part) + smallest)
    return ConsistencyProgramme(
        matrix=whiten_parameters(estimate, estimate.base.combination),
        weight=weight,
        centre=centre,
        scale=scale,
        bodies=places,
        nominal=nominal,
        floors=floors,
        not_negative=not_negative(model, robot),
    )


def _positive_part(matrix: FloatArray) -> FloatArray:
    """Return the nearest positive semidefinite matrix."""
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray(vectors @ np.diag(np.maximum(values, 0.0)) @ vectors.T)
