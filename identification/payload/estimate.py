"""`PayloadEstimate`: mass, centre of gravity and inertia of a robot's payload, with intervals."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from scipy.special import chdtrc

from config.arrays import FloatArray, freeze
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK
from identification.choices import REPORTED
from identification.consistency.consistency_test import SMALLEST_P
from identification.consistency.programme import ConsistencyProgramme
from identification.consistency.pseudo_inertia import SMALLEST_BODY, pseudo_inertia
from identification.payload.body import PARAMETERS, PayloadBody, reported, reported_slopes
from identification.payload.equations import Procedure
from identification.payload.known import KnownPayloadValue, with_fixed_values
from identification.payload.solution import SEEN
from identification.regression.fit_grade import FitGrade, grade_fit

PULL: Final = 1e-9
FLOOR_SHARE: Final = 0.02
IDLE_SHARE: Final = 0.01
HELD_SHARE: Final = 1e-6


@dataclass(frozen=True, eq=False)
class PayloadEstimate:
    """Ten inertial parameters of a payload, in the frame of the flange (5.6).

    Attributes:
        robot: The robot that carried the payload.
        procedure: Procedure that separated the payload from the robot.
        values: Shape (10,). `PARAMETERS` about the flange's origin. Values that are not identified
            are meaningless.
        covariance: Shape (10, 10). Covariance from coloured residuals, noise, known quantities and
            torque constants.
        covariance_noise: Shape (10, 10). Covariance only from the noise of the rows.
        gain_slopes: Shape (10, n). Derivative of `values` with respect to a relative error of each
            joint's torque (its torque constant).
        unseen: Shape (10, any). Orthonormal directions of the parameters that the motion does not
            determine.
        condition_number: Condition number of the payload's columns with all other columns projected
            out.
        known: Quantities that are known from another source.
        residual_nm, payload_nm: Shape (n,). RMS of the fit's residual, and of the payload's
            contribution, in each joint's torque [N m or N].
        equations: Number of equations.
        cell_name, run_ids: The cell and the runs of the measurement.
        torque_nm: Shape (n,). RMS of each joint's torque [N m or N].
        noise_nm: Shape (n,). RMS of each joint's torque residual due to measured noise alone [N m
            or N]; None if it is not measured.
        contradictions: Shape (k,). Distance of each of `known` from the recordings' result without
            it [standard deviations].
        torque_constant_sigma: Relative standard deviation of every joint's torque constant;
            `covariance` includes it.
    """

    robot: RobotDescription
    procedure: Procedure
    values: FloatArray
    covariance: FloatArray
    covariance_noise: FloatArray
    gain_slopes: FloatArray
    unseen: FloatArray
    condition_number: float
    known: tuple[KnownPayloadValue, ...]
    residual_nm: FloatArray
    payload_nm: FloatArray
    equations: int
    torque_nm: FloatArray
    contradictions: FloatArray
    cell_name: str = ""
    run_ids: tuple[str, ...] = ()
    torque_constant_sigma: float = 0.0
    noise_nm: FloatArray | None = None

    def __post_init__(self) -> None:
        ten, n = PARAMETERS_PER_LINK, len(self.robot.joints)
        covariances = ("covariance", "covariance_noise")
        freeze(self, EstimationError, (ten,), "values", what="payload ")
        freeze(self, EstimationError, (ten, ten), *covariances, what="payload ")
        freeze(self, EstimationError, (ten, n), "gain_slopes", what="payload ")
        freeze(self, EstimationError, (ten, None), "unseen", what="payload ")
        freeze(self, EstimationError, (len(self.known),), "contradictions", what="payload ")
        of_joints = ("torque_nm", "residual_nm", "payload_nm", "noise_nm")
        freeze(self, EstimationError, (n,), *of_joints, what="payload ")

    @property
    def is_parameter_determined(self) -> tuple[bool, ...]:
        """For each of `PARAMETERS`: True if the motion determines it."""
        return self._shown(np.eye(PARAMETERS_PER_LINK))

    @property
    def is_determined(self) -> tuple[bool, ...]:
        """For each of `REPORTED`: True if the motion determines it."""
        return self._shown(self._slopes)

    def _shown(self, slopes: FloatArray) -> tuple[bool, ...]:
        if not self.unseen.shape[1]:
            return (True,) * len(slopes)
        size = np.linalg.norm(slopes, axis=1)
        return tuple((np.linalg.norm(slopes @ self.unseen, axis=1) <= SEEN * size).tolist())

    @property
    def rank(self) -> int:
        """Number of independent combinations of the ten parameters that the motion determines."""
        return PARAMETERS_PER_LINK - int(self.unseen.shape[1])

    @cached_property
    def _slopes(self) -> FloatArray:
        return reported_slopes(self.values)

    @property
    def reported(self) -> FloatArray:
        """Estimates of `REPORTED`, shape (10,); NaN if the motion does not determine them."""
        return np.where(self.is_determined, reported(self.values), np.nan)

    @property
    def sigma(self) -> FloatArray:
        """Standard deviations of `reported`, shape (10,), propagated from `covariance`.

        They are zero for values that are fixed by `known`, and infinite for values that the motion
        does not determine.
        """
        held = [quantity.name for quantity in self.known if quantity.is_exact]
        sigma = np.where(np.isin(REPORTED, held), 0.0, _sigma(self._slopes, self.covariance))
        return np.where(self.is_determined, sigma, np.inf)

    @property
    def sigma_noise(self) -> FloatArray:
        """Standard deviations of `reported` from noise alone, shape (10,)."""
        return np.where(self.is_determined, _sigma(self._slopes, self.covariance_noise), np.inf)

    @property
    def sigma_parameters(self) -> FloatArray:
        """Standard deviations of `values`, shape (10,)."""
        sigma = np.sqrt(np.maximum(np.diagonal(self.covariance), 0.0))
        return np.where(self.is_parameter_determined, sigma, np.inf)

    @property
    def residual_share(self) -> FloatArray:
        """RMS residual of each joint's torque relative to the torque, shape (n,).

        For a joint with little torque, the torque is replaced by `IDLE_SHARE` of the joint's limit.
        """
        return np.asarray(self.residual_nm / self._work_nm)

    @property
    def fit(self) -> tuple[FitGrade, ...]:
        """Quality of the fit of each joint's torque, from `residual_share`."""
        names = self.robot.joint_names
        return grade_fit(names, self.residual_nm, self._work_nm, self.noise_nm)

    @property
    def _work_nm(self) -> FloatArray:
        limits = np.array([joint.limits.torque for joint in self.robot.joints])
        return np.asarray(np.maximum(self.torque_nm, IDLE_SHARE * limits))

    @property
    def gain_effects(self) -> FloatArray:
        """Derivative of `reported` by a relative error of each joint's torque, shape (10, n)."""
        return np.asarray(self._slopes @ self.gain_slopes)

    @cached_property
    def consistent(self) -> tuple[FloatArray, float]:
        """Parameters of the closest physically consistent body, and the p-value of its distance.

        The distance is measured in the cluster-robust covariance. The p-value is the probability
        that a chi-squared variable is at least as large; it is 1 if the estimate itself is
        physically consistent.

        Raises:
            EstimationError: Not all parameters are determined, or there is no such body.
        """
        return closest_body(self)

    @property
    def body(self) -> PayloadBody:
        """The payload as the closest physically consistent body, which exports use."""
        return PayloadBody.of_parameters(self.consistent[0])

    @property
    def is_consistent(self) -> bool:
        """True unless the data reject every physically consistent body."""
        return self.consistent[1] >= SMALLEST_P


def closest_body(estimate: PayloadEstimate) -> tuple[FloatArray, float]:
    """Return the closest physically consistent body and its p-value; see `PayloadEstimate`."""
    if estimate.rank < PARAMETERS_PER_LINK:
        names = [
            n
            for n, seen in zip(PARAMETERS, estimate.is_parameter_determined, strict=True)
            if not seen
        ]
        raise EstimationError(
            f"the motion does not determine {', '.join(names)}, so the payload cannot be tested"
            " for physical consistency: use a motion that moves more axes",
            code="RID-MOTION-UNINFORMATIVE",
        )
    values = np.array(estimate.values)
    mass = float(values[0])
    floor = FLOOR_SHARE * pseudo_inertia(np.array(SMALLEST_BODY))
    if mass > 0.0 and np.linalg.eigvalsh(pseudo_inertia(values) - floor)[0] >= 0.0:
        return values, 1.0
    least = HELD_SHARE * np.maximum(np.abs(values), 1e-3)
    sigma = np.sqrt(np.maximum(np.diagonal(estimate.covariance), least**2))
    correlation = estimate.covariance / np.outer(sigma, sigma)
    np.fill_diagonal(correlation, 1.0)
    factor = np.linalg.cholesky(correlation + 1e-9 * np.eye(PARAMETERS_PER_LINK))
    programme = ConsistencyProgramme(
        matrix=np.asarray(np.linalg.solve(factor, np.diag(1.0 / sigma)), dtype=np.float64),
        weight=PULL,
        centre=values,
        scale=sigma,
        bodies=(slice(0, PARAMETERS_PER_LINK),),
        nominal=_ball(values)[np.newaxis],
        floors=floor[np.newaxis],
        not_negative=np.zeros((0, PARAMETERS_PER_LINK)),
    )
    standard = programme.solve(programme.matrix @ values)
    distance = float(np.sum((programme.matrix @ (standard - values)) ** 2))
    return with_fixed_values(estimate.known, standard), float(chdtrc(PARAMETERS_PER_LINK, distance))


def _ball(values: FloatArray) -> FloatArray:
    """Return the pseudo-inertia of a ball about the origin, of a payload's size."""
    smallest = np.diagonal(pseudo_inertia(np.array(SMALLEST_BODY)))
    size = np.abs(np.diagonal(pseudo_inertia(values)))
    return np.diag([*np.full(3, max(size[:3].max(), smallest[0])), max(size[3], smallest[3])])


def _sigma(slopes: FloatArray, covariance: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", slopes, covariance, slopes), 0)))
