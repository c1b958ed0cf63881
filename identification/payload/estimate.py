"""`PayloadEstimate`: mass, centre of gravity, inertia of what a robot carries, with intervals."""

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
from identification.payload.known import Known, with_held
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
        robot: The robot that carried it.
        procedure: How it was told from the robot.
        values: Shape (10,). `PARAMETERS` about the flange's origin. Those that were not seen hold
            no meaning.
        covariance: Shape (10, 10). Honest: what coloured residuals, noise, known quantities and
            torque constants leave open.
        covariance_noise: Shape (10, 10). By the noise that rows were divided by alone.
        gain_slopes: Shape (10, n). How `values` change with a relative error of each joint's torque
            (its torque constant).
        unseen: Shape (10, any). Orthonormal directions of the parameters that the motion does not
            show.
        condition_number: Of the payload's columns with all else projected out.
        known: What was known otherwise.
        residual_nm, payload_nm: Shape (n,). RMS of what the fit leaves of each joint's torque, and
            of what the payload makes [N m or N].
        equations: How many there were.
        cell_name, run_ids: Where it was measured.
        torque_nm: Shape (n,). RMS of each joint's torque [N m or N].
        noise_nm: Shape (n,). RMS that the measured noise alone leaves of each joint's torque [N m
            or N]; None if it is not measured.
        contradictions: Shape (k,). How far each of `known` lies from what the recordings say
            without it [standard deviations].
        torque_constant_sigma: Relative standard deviation of every joint's torque constant, which
            `covariance` has in it.
    """

    robot: RobotDescription
    procedure: Procedure
    values: FloatArray
    covariance: FloatArray
    covariance_noise: FloatArray
    gain_slopes: FloatArray
    unseen: FloatArray
    condition_number: float
    known: tuple[Known, ...]
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
    def seen_parameters(self) -> tuple[bool, ...]:
        """Which of `PARAMETERS` the motion shows."""
        return self._shown(np.eye(PARAMETERS_PER_LINK))

    @property
    def seen(self) -> tuple[bool, ...]:
        """Which of `REPORTED` the motion shows."""
        return self._shown(self._slopes)

    def _shown(self, slopes: FloatArray) -> tuple[bool, ...]:
        if not self.unseen.shape[1]:
            return (True,) * len(slopes)
        size = np.linalg.norm(slopes, axis=1)
        return tuple((np.linalg.norm(slopes @ self.unseen, axis=1) <= SEEN * size).tolist())

    @property
    def rank(self) -> int:
        """How many independent combinations of the ten parameters the motion shows."""
        return PARAMETERS_PER_LINK - int(self.unseen.shape[1])

    @cached_property
    def _slopes(self) -> FloatArray:
        return reported_slopes(self.values)

    @property
    def reported(self) -> FloatArray:
        """Estimates of `REPORTED`, shape (10,); not a number where not `seen`."""
        return np.where(self.seen, reported(self.values), np.nan)

    @property
    def sigma(self) -> FloatArray:
        """Standard deviations of `reported`, shape (10,), propagated from `covariance`.

        Zero where a value is held.
        """
        held = [quantity.name for quantity in self.known if quantity.held]
        sigma = np.where(np.isin(REPORTED, held), 0.0, _sigma(self._slopes, self.covariance))
        return np.where(self.seen, sigma, np.inf)

    @property
    def sigma_noise(self) -> FloatArray:
        """The same by the noise alone."""
        return np.where(self.seen, _sigma(self._slopes, self.covariance_noise), np.inf)

    @property
    def sigma_parameters(self) -> FloatArray:
        """Standard deviations of `values`, shape (10,)."""
        sigma = np.sqrt(np.maximum(np.diagonal(self.covariance), 0.0))
        return np.where(self.seen_parameters, sigma, np.inf)

    @property
    def residual_share(self) -> FloatArray:
        """What the fit leaves of each joint's torque, as a share of it, shape (n,).

        A joint that hardly works has little to explain: its torque counts as at least
        `IDLE_SHARE` of its limit.
        """
        return np.asarray(self.residual_nm / self._work_nm)

    @property
    def fit(self) -> tuple[FitGrade, ...]:
        """How well the payload and the robot explain each joint's torque, as `residual_share`."""
        names = self.robot.joint_names
        return grade_fit(names, self.residual_nm, self._work_nm, self.noise_nm)

    @property
    def _work_nm(self) -> FloatArray:
        limits = np.array([joint.limits.torque for joint in self.robot.joints])
        return np.asarray(np.maximum(self.torque_nm, IDLE_SHARE * limits))

    @property
    def gain_effects(self) -> FloatArray:
        """How `reported` changes with a relative error of each joint's torque, shape (10, n)."""
        return np.asarray(self._slopes @ self.gain_slopes)

    @cached_property
    def consistent(self) -> tuple[FloatArray, float]:
        """The parameters of the closest body that can exist, and how likely the data find it.

        Closest in the cluster-robust covariance; the probability is that of a chi-square as large
        as its distance, 1 where the estimate itself can exist.

        Raises:
            EstimationError: Not all parameters are seen, or there is no such body.
        """
        return closest_body(self)

    @property
    def body(self) -> PayloadBody:
        """The payload as the closest body that can exist: what exports write."""
        return PayloadBody.of_parameters(self.consistent[0])

    @property
    def can_exist(self) -> bool:
        """Whether a body with the estimate's parameters can exist, as far as the data say."""
        return self.consistent[1] >= SMALLEST_P


def closest_body(estimate: PayloadEstimate) -> tuple[FloatArray, float]:
    """Return the closest body that can exist and its probability; see `PayloadEstimate`."""
    if estimate.rank < PARAMETERS_PER_LINK:
        names = [
            n for n, seen in zip(PARAMETERS, estimate.seen_parameters, strict=True) if not seen
        ]
        raise EstimationError(
            f"the motion does not show {', '.join(names)}: whether such a body can exist is not"
            " known; move more axes",
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
    return with_held(estimate.known, standard), float(chdtrc(PARAMETERS_PER_LINK, distance))


def _ball(values: FloatArray) -> FloatArray:
    """Return the pseudo-inertia of a ball about the origin of a payload's size."""
    smallest = np.diagonal(pseudo_inertia(np.array(SMALLEST_BODY)))
    size = np.abs(np.diagonal(pseudo_inertia(values)))
    return np.diag([*np.full(3, max(size[:3].max(), smallest[0])), max(size[3], smallest[3])])


def _sigma(slopes: FloatArray, covariance: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", slopes, covariance, slopes), 0)))
