"""`Estimate`: identified base parameters with their uncertainty, and what they predict."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, Protocol

import numpy as np

from acquisition.processing.torque_channel import TorqueChannel
from config.arrays import FloatArray, freeze
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from dynamics.model.memory import with_memory
from dynamics.model.robot_model import RobotModel, base_wrench_regressor, load_torque, regressor
from dynamics.terms.conditions import Conditions
from identification.equations.plate_fit import PlateFit
from identification.equations.warming import Warming
from identification.estimation.options import Weighting
from identification.model.base_parameters import BaseParameters
from identification.model.options import ModelOptions
from identification.model.still_joints import StillJoint, refuse_still
from identification.regression.fit_grade import FitGrade, grade_fit

BLOCK_ROWS = 4096


@dataclass(frozen=True, eq=False)
class Estimate:
    """Base parameters of one robot, with everything needed to use them.

    Three covariances say how far to trust them: by the measured noise, by residuals taken for
    white, and one that holds for coloured residuals, that is for model error.

    Attributes:
        options: The terms of its model, with the estimated values of the nonlinear parameters.
        base: Names, units, words and combinations of the b parameters.
        values: Shape (b,). The estimate.
        covariance_noise: Shape (b, b). From the noise between periods; None where nothing repeated.
        covariance_residual: Shape (b, b). From the residuals of each joint, taken for white.
        covariance_jackknife: Shape (b, b). From the residuals, whatever their colour
            (`identification.regression.intervals`).
        nonlinear_covariance: Shape (s, s). The cluster-robust covariance of the nonlinear
            parameters.
        clusters: Stretches or bins that `covariance_jackknife` rests on; None if it is not counted.
        condition_number: Of the weighted regressor, columns scaled to length one (2.25, 2.26).
        equations: Equations used.
        residual_nm: Shape (n,). RMS of measured minus predicted torque inside the band [N m or N].
        noise_nm: Shape (n,). RMS that the measured noise alone would leave there.
        torque_nm: Shape (n,). RMS of the measured torque there; None of the external model.
        held_out_share: Shape (n,). The residual's share of the torque on parts of the recording
            that were left out of a plain fit, zero where it is hardly more than on what was fitted;
            None where nobody looked.
        left_out_fraction: Shape (n,). Share of samples under the standstill speed, left out or with
            free friction.
        method: On the bins of averaged periods, or in the time domain on low-passed signals.
        band_hz, standstill_rad_s: Highest frequency and lowest speed used.
        weighting: How rows were weighted.
        plate: How the force plate fits, where it was used.
        channel: By how much the recorded torque was late, and where it was low-passed; None where
            that was not looked for. It belongs to the recording, not to the robot: `validate`
            applies it.
        warming: How the joints' temperatures follow from their motion, where none was measured:
            coefficients by temperature are about these; None where temperatures were measured or do
            not count.
        periods: Averaged periods behind it; 0 for "smoothed".
        cell_name: Where it was measured.
        run_ids: The runs behind it.
        still: Joints that no run moved: it holds only at their positions.
        position_range: Shape (n, 2). Lowest and highest position of each joint in the runs [rad or
            m]; None of an estimate that comes from no runs.
    """

    robot: RobotDescription
    options: ModelOptions
    base: BaseParameters
    values: FloatArray
    covariance_noise: FloatArray | None
    covariance_residual: FloatArray
    covariance_jackknife: FloatArray
    condition_number: float
    equations: int
    residual_nm: FloatArray
    noise_nm: FloatArray | None
    left_out_fraction: FloatArray
    method: Literal["periodic", "smoothed"]
    band_hz: float
    standstill_rad_s: float
    weighting: Weighting = "ml"
    plate: PlateFit | None = None
    channel: TorqueChannel | None = None
    warming: Warming | None = None
    nonlinear_covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    torque_nm: FloatArray | None = None
    held_out_share: FloatArray | None = None
    clusters: int | None = None
    periods: int = 0
    cell_name: str = ""
    run_ids: tuple[str, ...] = ()
    still: tuple[StillJoint, ...] = ()
    position_range: FloatArray | None = None

    def __post_init__(self) -> None:
        b, n, s = len(self.base), len(self.robot.joints), len(self.options.nonlinear or ())
        covariances = ("covariance_residual", "covariance_jackknife", "covariance_noise")
        of_joints = ("residual_nm", "left_out_fraction", "noise_nm", "torque_nm", "held_out_share")
        freeze(self, EstimationError, (b,), "values", what="estimate ")
        freeze(self, EstimationError, (b, b), *covariances, what="estimate ")
        freeze(self, EstimationError, (s, s), "nonlinear_covariance", what="estimate ")
        freeze(self, EstimationError, (n,), *of_joints, what="estimate ")
        freeze(self, EstimationError, (n, 2), "position_range", what="estimate ")

    @cached_property
    def model(self) -> RobotModel:
        """The robot's model."""
        return self.options.build(self.robot)

    @property
    def standard_values(self) -> FloatArray:
        """Standard parameters with the same torques: each head has its base parameter's value.

        They are no link's true parameters; `identification.consistency.closest_robot` finds those
        that can be.
        """
        return self.base.to_standard(self.values)

    @property
    def sigma_noise(self) -> FloatArray | None:
        """Standard deviations by the measured noise, shape (b,)."""
        return None if self.covariance_noise is None else _sigma(self.covariance_noise)

    @property
    def sigma_residual(self) -> FloatArray:
        """Standard deviations by the residuals taken for white, shape (b,)."""
        return _sigma(self.covariance_residual)

    @property
    def sigma(self) -> FloatArray:
        """The standard deviations to quote, shape (b,): cluster-robust, at least the noise's."""
        clustered, noise = _sigma(self.covariance_jackknife), self.sigma_noise
        return clustered if noise is None else np.maximum(noise, clustered)

    @property
    def fit(self) -> tuple[FitGrade, ...]:
        """How well it explains the torque of each joint on the data that it was made of."""
        n = len(self.robot.joints)
        torque = np.full(n, np.nan) if self.torque_nm is None else self.torque_nm
        return grade_fit(
            self.robot.joint_names,
            self.residual_nm,
            torque,
            self.noise_nm,
            held_out_share=self.held_out_share,
        )

    @property
    def nonlinear_sigma(self) -> FloatArray:
        """Standard deviations of the nonlinear parameters, shape (s,)."""
        return _sigma(self.nonlinear_covariance)

    @property
    def nonlinear_unseen(self) -> tuple[str, ...]:
        """The nonlinear parameters that the data do not show.

        Each ended at a bound of its range, or its 95 % interval is as wide as the whole range, so
        that its value is little else than the start of the fit.
        """
        model = self.model
        low, high = model.nonlinear_bounds.T
        wide = 4.0 * self.nonlinear_sigma >= high - low
        return tuple(
            name
            for name, unseen in zip(model.nonlinear_names, wide, strict=True)
            if unseen or name in model.nonlinear_at_bound
        )


class TorqueModel(Protocol):
    """What a torque is predicted with: an `Estimate`, or a fit without its intervals."""

    @property
    @abstractmethod
    def model(self) -> RobotModel:
        """The robot's model."""

    @property
    @abstractmethod
    def base(self) -> BaseParameters:
        """What of it was identified."""

    @property
    @abstractmethod
    def values(self) -> FloatArray:
        """The base parameters, shape (b,)."""

    @property
    @abstractmethod
    def standard_values(self) -> FloatArray:
        """Standard parameters with the same torques, shape (p,)."""


def position_range(positions: Sequence[FloatArray]) -> FloatArray:
    """Return the lowest and highest position of each joint in some motions, (n, 2)."""
    whole = np.concatenate(positions)
    return np.stack([whole.min(axis=0), whole.max(axis=0)], axis=1)


def predict(
    estimate: Estimate | TorqueModel,
    q: FloatArray,
    v: FloatArray,
    a: FloatArray,
    conditions: Conditions | None = None,
) -> FloatArray:
    """Return the torques of an estimate, shape (samples, n) [N m or N], block by block.

    Friction with memory follows the samples in the order that they have.

    Args:
        estimate: The identified robot.
        q, v, a: Shape (samples, n). Motion [rad or m, per second, per second squared].
        conditions: Temperature and payload; the load is computed here, and the memory where it is
            not given.

    Raises:
        EstimationError: A joint that stood still when the robot was identified is not where it
            stood.
    """
    model, torque = estimate.model, np.empty(np.shape(q))
    if isinstance(estimate, Estimate):
        _refuse_other_positions(estimate, q)
    if conditions is None or conditions.memory is None:
        conditions = with_memory(model, q, conditions)
    for start in range(0, len(q), BLOCK_ROWS):
        rows = slice(start, start + BLOCK_ROWS)
        block = conditions.part(rows)
        if model.transmission.losses:
            load = load_torque(model, q[rows], v[rows], a[rows], estimate.standard_values, block)
            block = replace(block, load_nm=load)
        phi = regressor(model, q[rows], v[rows], a[rows], block)
        torque[rows] = estimate.base.columns(phi) @ estimate.values
    return torque


def predict_base_wrench(
    estimate: Estimate,
    q: FloatArray,
    v: FloatArray,
    a: FloatArray,
    conditions: Conditions | None = None,
) -> FloatArray:
    """Return the wrench that the base exerts on the robot, shape (samples, 6) [N, N m].

    Its constant part, the weight above all, is as uncertain as the plate's offset was.

    Args:
        estimate: Of the external or the combined model.
        q, v, a, conditions: As for `predict`.

    Raises:
        EstimationError: It is of the internal model: torques do not show what the base feels.
    """
    if estimate.options.kind == "internal":
        raise EstimationError(
            "the internal model does not know the reaction on the base: identify the combined"
            " model, from a run with a force plate",
            code="RID-MODEL-NOT-COMBINED",
        )
    _refuse_other_positions(estimate, q)
    wrench = np.empty((len(q), 6))
    for start in range(0, len(q), BLOCK_ROWS):
        rows = slice(start, start + BLOCK_ROWS)
        block = None if conditions is None else conditions.part(rows)
        phi = base_wrench_regressor(estimate.model, q[rows], v[rows], a[rows], block)
        wrench[rows] = estimate.base.columns(phi) @ estimate.values
    return wrench


def _refuse_other_positions(estimate: Estimate, q: FloatArray) -> None:
    """Refuse positions of joints that stood elsewhere when the estimate was made."""
    names = estimate.robot.joint_names
    refuse_still(
        [each for each in estimate.still if not each.stands_there(q[:, names.index(each.joint)])],
        "this motion cannot be predicted",
    )


def _sigma(covariance: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.diagonal(covariance)))
